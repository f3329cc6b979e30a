//! Small programs, assembled by hand. The text above each program is the assembly source of its half-words.

/// ```text
/// b .
/// ```
pub const SPIN: &[u16] = &[0xE7FE];

/// ```text
/// 1: wfi
/// b 1b
/// ```
pub const SLEEP: &[u16] = &[0xBF30, 0xE7FD];

/// ```text
/// ldr r0, =0xE000ED88
/// mov r1, #0xF00000
/// str r1, [r0]
/// dsb
/// isb
/// ldr r0, =0x20000000
/// ldr r1, [r0], #8
/// 1: vldr d0, [r0]
/// vldr d1, [r0, #8]
/// vmul.f64 d2, d0, d1
/// vadd.f64 d3, d0, d1
/// vsub.f64 d4, d0, d1
/// vdiv.f64 d5, d0, d1
/// vsqrt.f64 d6, d0
/// vcvt.f32.f64 s14, d0
/// vstmia r0!, {d2-d6}
/// vstr s14, [r0]
/// add r0, #8
/// subs r1, #1
/// bne 1b
/// b .
/// .pool
/// ```
pub const FLOATS: &[u16] = &[
    0x4812, 0xF44F, 0x0170, 0x6001, 0xF3BF, 0x8F4F, 0xF3BF, 0x8F6F, 0xF04F, 0x5000, 0xF850, 0x1B08, 0xED90,
    0x0B00, 0xED90, 0x1B02, 0xEE20, 0x2B01, 0xEE30, 0x3B01, 0xEE30, 0x4B41, 0xEE80, 0x5B01, 0xEEB1, 0x6BC0,
    0xEEB7, 0x7BC0, 0xECA0, 0x2B0A, 0xED80, 0x7A00, 0xF100, 0x0008, 0x3901, 0xD1E7, 0xE7FE, 0x0000, 0xED88,
    0xE000,
];

/// ```text
/// ldr r8, =0xE000E100
/// mov r9, #1
/// str r9, [r8]
/// movs r0, #10
/// movs r1, #11
/// movs r2, #12
/// movs r3, #13
/// mov r12, #22
/// mov lr, #33
/// vmov s0, r1
/// cmp r0, r0
/// str r9, [r8, #0x100]
/// ite eq
/// moveq r10, #1
/// movne r10, #2
/// vmov r11, s0
/// ldr r7, =0x20000100
/// stmia r7, {r0-r3, r10-r12, lr}
/// mov r6, sp
/// str r6, [r7, #32]
/// b .
/// .pool
/// ```
pub const PRESERVE: &[u16] = &[
    0xF8DF, 0x803C, 0xF04F, 0x0901, 0xF8C8, 0x9000, 0x200A, 0x210B, 0x220C, 0x230D, 0xF04F, 0x0C16, 0xF04F,
    0x0E21, 0xEE00, 0x1A10, 0x4280, 0xF8C8, 0x9100, 0xBF0C, 0xF04F, 0x0A01, 0xF04F, 0x0A02, 0xEE10, 0xBA10,
    0x4F03, 0xE887, 0x5C0F, 0x466E, 0x623E, 0xE7FE, 0xE100, 0xE000, 0x0100, 0x2000,
];

/// ```text
/// ldr r0, =0x20000000
/// ldr r1, [r0]
/// add r1, #1
/// str r1, [r0]
/// movs r2, #99
/// movs r3, #99
/// mov r12, #99
/// vmov s0, r2
/// vmov s1, r2
/// cmp r2, #5
/// bx lr
/// .pool
/// ```
pub const CLOBBER: &[u16] = &[
    0xF04F, 0x5000, 0x6801, 0xF101, 0x0101, 0x6001, 0x2263, 0x2363, 0xF04F, 0x0C63, 0xEE00, 0x2A10, 0xEE00,
    0x2A90, 0x2A05, 0x4770,
];

/// ```text
/// ldr r8, =0xE000E100
/// movs r0, #7
/// str r0, [r8]
/// ldr r9, =0xE000E400
/// ldr r0, =0x00102030
/// str r0, [r9]
/// movs r0, #1
/// str r0, [r8, #0x100]
/// nop
/// ldr r5, =0x20000000
/// ldr r6, [r5]
/// add r6, r5
/// movs r0, #0xAA
/// strb r0, [r6, #4]
/// b .
/// .pool
/// ```
pub const PEND_0_THEN_MARK: &[u16] = &[
    0xF8DF, 0x8028, 0x2007, 0xF8C8, 0x0000, 0xF8DF, 0x9024, 0x4809, 0xF8C9, 0x0000, 0x2001, 0xF8C8, 0x0100,
    0xBF00, 0xF04F, 0x5500, 0x682E, 0x442E, 0x20AA, 0x7130, 0xE7FE, 0x0000, 0xE100, 0xE000, 0xE400, 0xE000,
    0x2030, 0x0010,
];

/// ```text
/// mrs r0, ipsr
/// sub r0, #16
/// ldr r1, =0x20000000
/// ldr r2, [r1]
/// add r3, r1, r2
/// strb r0, [r3, #4]
/// add r2, #1
/// str r2, [r1]
/// movs r3, #2
/// lsl r3, r0
/// ldr r12, =0xE000E200
/// cmp r0, #2
/// beq 1f
/// str r3, [r12]
/// nop
/// 1: ldr r2, [r1]
/// add r3, r1, r2
/// add r0, #0x10
/// strb r0, [r3, #4]
/// add r2, #1
/// str r2, [r1]
/// bx lr
/// .pool
/// ```
pub const LOG_AND_PEND: &[u16] = &[
    0xF3EF, 0x8005, 0xF1A0, 0x0010, 0xF04F, 0x5100, 0x680A, 0xEB01, 0x0302, 0x7118, 0xF102, 0x0201, 0x600A,
    0x2302, 0xFA03, 0xF300, 0xF8DF, 0xC020, 0x2802, 0xD002, 0xF8CC, 0x3000, 0xBF00, 0x680A, 0xEB01, 0x0302,
    0xF100, 0x0010, 0x7118, 0xF102, 0x0201, 0x600A, 0x4770, 0x0000, 0xE200, 0xE000,
];

/// ```text
/// ldr r8, =0xE000E100
/// movs r0, #1
/// str r0, [r8]
/// ldr r1, =0x20000000
/// cpsid i
/// str r0, [r8, #0x100]
/// nop
/// nop
/// nop
/// nop
/// ldr r2, [r1]
/// str r2, [r1, #4]
/// cpsie i
/// ldr r2, [r1]
/// str r2, [r1, #8]
/// b .
/// .pool
/// ```
pub const MASKED: &[u16] = &[
    0xF8DF, 0x8024, 0x2001, 0xF8C8, 0x0000, 0xF04F, 0x5100, 0xB672, 0xF8C8, 0x0100, 0xBF00, 0xBF00, 0xBF00,
    0xBF00, 0x680A, 0x604A, 0xB662, 0x680A, 0x608A, 0xE7FE, 0xE100, 0xE000,
];

/// ```text
/// ldr r1, =0x20000000
/// movs r0, #1
/// sev
/// wfe
/// str r0, [r1]
/// wfe
/// str r0, [r1, #4]
/// b .
/// .pool
/// ```
pub const SEV_WFE: &[u16] = &[0xF04F, 0x5100, 0x2001, 0xBF40, 0xBF20, 0x6008, 0xBF20, 0x6048, 0xE7FE];

/// ```text
/// ldr r0, =0x60000000
/// ldr r1, [r0]
/// b .
/// .pool
/// ```
pub const BAD_LOAD: &[u16] = &[0xF04F, 0x40C0, 0x6801, 0xE7FE];

/// ```text
/// ldr r0, =0xE0001000
/// movs r1, #1
/// str r1, [r0]
/// ldr r2, [r0, #4]
/// nop
/// nop
/// nop
/// nop
/// nop
/// ldr r3, [r0, #4]
/// subs r3, r2
/// ldr r1, =0x20000000
/// str r3, [r1]
/// b .
/// .pool
/// ```
pub const CYCLES: &[u16] = &[
    0x4807, 0x2101, 0x6001, 0x6842, 0xBF00, 0xBF00, 0xBF00, 0xBF00, 0xBF00, 0x6843, 0x1A9B, 0xF04F, 0x5100,
    0x600B, 0xE7FE, 0x0000, 0x1000, 0xE000,
];

/// ```text
/// ldr r0, =0x20000000
/// ldr r1, [r0]
/// add r1, #1
/// str r1, [r0]
/// ldr r2, =0xE000ED0C
/// ldr r3, =0x05FA0004
/// cmp r1, #3
/// bge 1f
/// str r3, [r2]
/// 1: b 1b
/// .pool
/// ```
pub const RESET_REQUEST: &[u16] = &[
    0xF04F, 0x5000, 0x6801, 0xF101, 0x0101, 0x6001, 0x4A02, 0x4B03, 0x2903, 0xDA00, 0x6013, 0xE7FE, 0xED0C,
    0xE000, 0x0004, 0x05FA,
];

/// ```text
/// ldr r4, =0x20000000
/// 1: push {r4, lr}
/// bl 2f
/// pop {r4, lr}
/// b 1b
/// 2: push {r4-r6, lr}
/// nop
/// ldr r6, [r4]
/// ands r6, #1
/// beq 3f
/// nop
/// nop
/// nop
/// 3: pop {r4-r6, pc}
/// .pool
/// ```
pub const CALL: &[u16] = &[
    0xF04F, 0x5400, 0xB510, 0xF000, 0xF803, 0xE8BD, 0x4010, 0xE7F9, 0xB570, 0xBF00, 0x6826, 0xF016, 0x0601,
    0xD002, 0xBF00, 0xBF00, 0xBF00, 0xBD70,
];

/// ```text
/// mov r4, #0x20000000
/// 1: push {r4, lr}
/// bl 2f
/// pop {r4, lr}
/// b 1b
/// 2: push {r4-r6, lr}
/// nop
/// ldr r6, [r4]
/// ands r6, #1
/// itte ne
/// nopne
/// movne.w r5, #1
/// nopeq
/// pop {r4-r6, pc}
/// ```
pub const CALL_IT_BLOCK: &[u16] = &[
    0xF04F, 0x5400, 0xB510, 0xF000, 0xF803, 0xE8BD, 0x4010, 0xE7F9, 0xB570, 0xBF00, 0x6826, 0xF016, 0x0601,
    0xBF1A, 0xBF00, 0xF04F, 0x0501, 0xBF00, 0xBD70,
];

/// ```text
/// ldr r0, =0x52002104
/// ldr r1, =0x45670123
/// str r1, [r0]
/// ldr r1, =0xCDEF89AB
/// str r1, [r0]
/// movw r1, #0x624
/// str r1, [r0, #8]
/// movw r1, #0x6A4
/// str r1, [r0, #8]
/// ldr r2, =0x081C0000
/// ldr r3, [r2]
/// mov r4, #0x20000000
/// str r3, [r4]
/// movs r5, #1
/// str r5, [r4, #4]
/// b .
/// .pool
/// ```
pub const ERASE_AND_READ: &[u16] = &[
    0x4809, 0x490A, 0x6001, 0x490A, 0x6001, 0xF240, 0x6124, 0x6081, 0xF240, 0x61A4, 0x6081, 0x4A07, 0x6813,
    0xF04F, 0x5400, 0x6023, 0x2501, 0x6065, 0xE7FE, 0x0000, 0x2104, 0x5200, 0x0123, 0x4567, 0x89AB, 0xCDEF,
    0x0000, 0x081C,
];

/// ```text
/// ldr r2, =0x081C0000
/// ldr r3, [r2]
/// b .
/// nop
/// .pool
/// ```
pub const READ_BANK2: &[u16] = &[0x4A01, 0x6813, 0xE7FE, 0xBF00, 0x0000, 0x081C];
