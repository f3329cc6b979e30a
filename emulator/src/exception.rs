//! Entry to and return from exceptions (ARMv7-M B1.5.6 to B1.5.8). The hardware has two kinds of stack frames. This
//! model always uses the larger stack frame, which includes the floating-point registers.
use unicorn_engine::RegisterARM::{self, *};

use crate::machine::Machine;
use crate::observe::FaultKind;

const BASIC: [RegisterARM; 6] = [R0, R1, R2, R3, R12, LR];
const FLOATS: [RegisterARM; 8] = [D0, D1, D2, D3, D4, D5, D6, D7];
/// Number of words in the stack frame.
const WORDS: usize = 26;
/// Position of FPSCR in the stack frame.
const FPSCR_AT: usize = 24;

/// Exception return values: for a return to a handler, and for a return to a thread with an extended stack frame on the
/// main stack.
const TO_HANDLER: u32 = 0xFFFF_FFE1;
const TO_THREAD: u32 = 0xFFFF_FFE9;

/// Bit of the stacked xPSR that indicates a padding word in the stack frame.
const ALIGNED: u32 = 1 << 9;

/// Enters the handler of an exception.
pub fn enter(machine: &mut Machine, exception: usize) {
    let sp = machine.register(SP);
    let padding = sp & 4;
    let frame_at = (sp & !7).wrapping_sub(4 * WORDS as u32);
    let mut frame = [0u32; WORDS];
    for (word, register) in frame.iter_mut().zip(BASIC) {
        *word = machine.register(register);
    }
    frame[6] = machine.pc() & !1;
    frame[7] = machine.register(XPSR) & !ALIGNED | if padding != 0 { ALIGNED } else { 0 };
    for (i, register) in FLOATS.into_iter().enumerate() {
        let value = machine.uc.reg_read(register).unwrap_or(0);
        frame[8 + 2 * i] = value as u32;
        frame[9 + 2 * i] = (value >> 32) as u32;
    }
    frame[FPSCR_AT] = machine.register(FPSCR);
    let bytes: Vec<u8> = frame.iter().flat_map(|w| w.to_le_bytes()).collect();
    let stacked = machine.poke(frame_at, &bytes);
    let chip = machine.chip();
    chip.observers.note_sp(frame_at);
    let (now, instructions) = (chip.now(), chip.core.instructions);
    let since = chip.nvic.pending_since(exception);
    chip.nvic.enter(exception);
    chip.observers.enter(exception, since, now, instructions);
    let back = if chip.core.contexts.is_empty() { TO_THREAD } else { TO_HANDLER };
    chip.core.contexts.push(exception);
    let vector = chip.scs.vtor + 4 * exception as u32;
    let handler = machine.word(vector).unwrap_or(0);
    machine.set(SP, frame_at);
    machine.set(LR, back);
    machine.set(XPSR_NZCVQG, 1 << 24 | exception as u32);
    machine.set(PC, handler | 1);
    machine.chip().observers.note_sp(frame_at);
    if !stacked {
        // The stack frame could not be written, because the stack has overflowed its RAM.
        machine.chip().core.fault_address = frame_at;
        machine.fault(FaultKind::BadAccess, handler);
    }
}

/// Handles the return from an exception, which occurs when a handler jumps to an exception return value.
pub fn leave(machine: &mut Machine, to: u32) {
    let chip = machine.chip();
    let (now, instructions) = (chip.now(), chip.core.instructions);
    let Some(exception) = chip.core.contexts.pop() else {
        return machine.fault(FaultKind::BadReturn, to & !1);
    };
    let expected = if chip.core.contexts.is_empty() { TO_THREAD } else { TO_HANDLER };
    chip.observers.leave(instructions);
    chip.nvic.leave(exception, now);
    chip.core.event = true;
    let sp = machine.register(SP);
    let bytes = machine.memory(sp, 4 * WORDS);
    let Some(bytes) = bytes.filter(|_| to & !1 == expected & !1) else {
        return machine.fault(FaultKind::BadReturn, to & !1);
    };
    let word =
        |i: usize| u32::from_le_bytes([bytes[4 * i], bytes[4 * i + 1], bytes[4 * i + 2], bytes[4 * i + 3]]);
    for (i, register) in BASIC.into_iter().enumerate() {
        machine.set(register, word(i));
    }
    for (i, register) in FLOATS.into_iter().enumerate() {
        let value = u64::from(word(8 + 2 * i)) | u64::from(word(9 + 2 * i)) << 32;
        let _ = machine.uc.reg_write(register, value);
    }
    machine.set(FPSCR, word(FPSCR_AT));
    let xpsr = word(7);
    machine.set(XPSR_NZCVQG, xpsr & !ALIGNED);
    let padding = if xpsr & ALIGNED != 0 { 4 } else { 0 };
    machine.set(SP, sp + 4 * WORDS as u32 + padding);
    // The return from any exception except NMI clears FAULTMASK.
    machine.set(FAULTMASK, 0);
    machine.set(PC, word(6) | 1);
}
