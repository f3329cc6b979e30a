//! Decodes the Thumb-2 instructions that affect the next address (ARMv7-M Architecture Reference Manual, A7.7).

/// Effect of an instruction on control flow and on the computation of addresses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Flow {
    /// Branch to an address with B, `B<cc>`, CBZ, CBNZ or BL.
    Direct(u32),
    /// Branch to a computed address with BX, BLX, or with MOV or LDR to the program counter. The target address is
    /// known only at run time.
    Indirect(u8),
    /// MOVW, which sets the lower half of a register and clears the upper half.
    Low(u8, u16),
    /// MOVT, which sets the upper half of a register.
    High(u8, u16),
    /// UDF instruction, which aborts the program.
    Trap,
    /// Any other instruction, including a return.
    Other,
}

/// Returns the number of bytes of the instruction that begins with this halfword.
pub(super) fn len(first: u16) -> u32 {
    if first >> 11 >= 0b11101 { 4 } else { 2 }
}

/// Decodes the instruction at `address`. `second` is used only for instructions of four bytes.
pub(super) fn flow(address: u32, first: u16, second: u16) -> Flow {
    if len(first) == 4 { wide(address, first.into(), second.into()) } else { narrow(address, first.into()) }
}

/// Extends a signed number of `bits` bits to 32 bits.
fn signed(value: u32, bits: u32) -> u32 {
    ((value << (32 - bits)) as i32 >> (32 - bits)) as u32
}

fn narrow(address: u32, code: u32) -> Flow {
    let to = |offset: u32| Flow::Direct(address.wrapping_add(4).wrapping_add(offset));
    let register = (code >> 3 & 0xF) as u8;
    match code {
        // BX and BLX instructions. A BX with the link register is a return.
        0x4700..=0x47FF if register == 14 && code & 0x80 == 0 => Flow::Other,
        0x4700..=0x47FF => Flow::Indirect(register),
        // MOV instruction that writes the program counter. A MOV from the link register is a return.
        0x4687..=0x46FF if code & 0x87 == 0x87 && register != 14 => Flow::Indirect(register),
        // ADD instruction that writes the program counter.
        0x4487..=0x44FF if code & 0x87 == 0x87 => Flow::Indirect(15),
        0xB100..=0xBBFF if code & 0x0500 == 0x0100 => to((code >> 9 & 1) << 6 | (code >> 3 & 0x1F) << 1),
        0xDE00..=0xDEFF => Flow::Trap,
        0xD000..=0xDDFF => to(signed(code & 0xFF, 8) << 1),
        0xE000..=0xE7FF => to(signed(code & 0x7FF, 11) << 1),
        _ => Flow::Other,
    }
}

fn wide(address: u32, first: u32, second: u32) -> Flow {
    let to = |offset: u32| Flow::Direct(address.wrapping_add(4).wrapping_add(offset));
    let (sign, j1, j2) = (first >> 10 & 1, second >> 13 & 1, second >> 11 & 1);
    let immediate = (first & 0xF) << 12 | (first >> 10 & 1) << 11 | (second >> 12 & 7) << 8 | second & 0xFF;
    let register = (second >> 8 & 0xF) as u8;
    match (first & 0xF800, second & 0xD000) {
        // BL, and B without a condition.
        (0xF000, 0xD000 | 0x9000) => {
            let (i1, i2) = (1 ^ j1 ^ sign, 1 ^ j2 ^ sign);
            let offset = sign << 24 | i1 << 23 | i2 << 22 | (first & 0x3FF) << 12 | (second & 0x7FF) << 1;
            to(signed(offset, 25))
        }
        // UDF, and B with a condition. The condition values 14 and 15 encode barriers and similar instructions.
        (0xF000, 0x8000) if first & 0xFFF0 == 0xF7F0 && second & 0xF000 == 0xA000 => Flow::Trap,
        (0xF000, 0x8000) if first >> 7 & 7 != 7 => {
            let offset = sign << 20 | j2 << 19 | j1 << 18 | (first & 0x3F) << 12 | (second & 0x7FF) << 1;
            to(signed(offset, 21))
        }
        (0xF000, _) if second & 0x8000 == 0 => match first & 0xFBF0 {
            0xF240 => Flow::Low(register, immediate as u16),
            0xF2C0 => Flow::High(register, immediate as u16),
            _ => Flow::Other,
        },
        // LDR that loads the program counter from any memory except the stack. An LDR from the stack is a return.
        _ if first & 0xFF70 == 0xF850 && second >> 12 == 15 && first & 0xF != 13 => Flow::Indirect(15),
        _ => Flow::Other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AT: u32 = 0x0800_1000;

    /// Instruction codes, and their meaning according to the assembler and disassembler of LLVM. The first halfword of a long
    /// instruction comes first. Offsets are relative to the address of the instruction + 4.
    const BRANCHES: [(u32, i32); 11] = [
        (0xF001_F918, 4_656),      // bl
        (0xF7FE_FEE4, -4_664),     // bl
        (0xF123_BA29, 1_193_042),  // b.w
        (0xF6DC_BDD3, -1_193_050), // b.w
        (0xF002_8232, 9_316),      // beq.w
        (0xF6FD_ADCA, -9_324),     // blt.w
        (0xE0FE, 508),             // b
        (0xD1EE, -36),             // bne
        (0xE67E, -772),            // b
        (0xB1FB, 62),              // cbz r3
        (0xBBED, 122),             // cbnz r5
    ];
    const OTHERS: [(u32, Flow); 32] = [
        (0x4718, Flow::Indirect(3)),           // bx r3
        (0x47B8, Flow::Indirect(7)),           // blx r7
        (0x47F0, Flow::Indirect(14)),          // blx lr
        (0x4697, Flow::Indirect(2)),           // mov pc, r2
        (0x4497, Flow::Indirect(15)),          // add pc, r2
        (0xF8DF_F000, Flow::Indirect(15)),     // ldr.w pc, [pc]
        (0xF853_F022, Flow::Indirect(15)),     // ldr.w pc, [r3, r2, lsl #2]
        (0xF245_6C78, Flow::Low(12, 0x5678)),  // movw r12, #0x5678
        (0xF2C1_2C34, Flow::High(12, 0x1234)), // movt r12, #0x1234
        (0xF64F_70FF, Flow::Low(0, 0xFFFF)),   // movw r0, #0xffff
        (0xF640_0700, Flow::Low(7, 0x0800)),   // movw r7, #0x800
        (0xDEFE, Flow::Trap),                  // udf #254
        (0xF7F0_A001, Flow::Trap),             // udf.w #1
        (0x4770, Flow::Other),                 // bx lr
        (0x46F7, Flow::Other),                 // mov pc, lr
        (0xF85D_FB08, Flow::Other),            // ldr pc, [sp], #8
        (0xBD10, Flow::Other),                 // pop {r4, pc}
        (0x467A, Flow::Other),                 // mov r2, pc
        (0xDF03, Flow::Other),                 // svc #3
        (0xE8DF_F000, Flow::Other),            // tbb [pc, r0]
        (0xF3BF_8F4F, Flow::Other),            // dsb sy
        (0xF3EF_8010, Flow::Other),            // mrs r0, primask
        (0xF381_8811, Flow::Other),            // msr basepri, r1
        (0xF853_4002, Flow::Other),            // ldr.w r4, [r3, r2]
        (0xEE31_0B02, Flow::Other),            // vadd.f64 d0, d1, d2
        (0xF5B1_5080, Flow::Other),            // subs.w r0, r1, #0x1000
        (0xF601_70FF, Flow::Other),            // addw r0, r1, #0xfff
        (0xF361_00C6, Flow::Other),            // bfi r0, r1, #3, #4
        (0xBF08, Flow::Other),                 // it eq
        (0xB510, Flow::Other),                 // push {r4, lr}
        (0xBA08, Flow::Other),                 // rev r0, r1
        (0xBE01, Flow::Other),                 // bkpt #1
    ];

    fn decode(code: u32) -> Flow {
        let (first, second) =
            if code > 0xFFFF { ((code >> 16) as u16, code as u16) } else { (code as u16, 0xFFFF) };
        assert_eq!(len(first), if code > 0xFFFF { 4 } else { 2 }, "{code:#X}");
        flow(AT, first, second)
    }

    #[test]
    fn branches_go_where_the_disassembler_says() {
        for (code, offset) in BRANCHES {
            assert_eq!(decode(code), Flow::Direct((AT + 4).wrapping_add_signed(offset)), "{code:#X}");
        }
    }

    #[test]
    fn other_instructions() {
        for (code, expected) in OTHERS {
            assert_eq!(decode(code), expected, "{code:#X}");
        }
    }
}
