//! Compares the emulated machine with the architecture and the reference manual, using programs of a few instructions.
mod bus;
mod core;
mod flash;
mod programs;
mod serial;

use openjtc_emulator::{Elf, Machine};

/// Address of the main program of [`image`].
const MAIN: u32 = 0x0800_0400;
/// Address of the first result word of each program.
const RESULT: u32 = 0x2000_0000;

/// Returns a flash image that contains the vector table, the main program, and handlers by exception number.
fn image(main: &[u16], handlers: &[(usize, &[u16])]) -> Elf {
    let mut bytes = vec![0; 0x2000];
    let mut put = |at: usize, words: &[u16]| {
        for (i, word) in words.iter().enumerate() {
            bytes[at + 2 * i..at + 2 * i + 2].copy_from_slice(&word.to_le_bytes());
        }
    };
    let pair = |word: u32| [word as u16, (word >> 16) as u16];
    put(0, &pair(0x2001_0000));
    put(4, &pair(MAIN | 1));
    put(0x400, main);
    for (i, (exception, code)) in handlers.iter().enumerate() {
        let at = 0x800 + 0x100 * i;
        put(at, code);
        put(4 * exception, &pair((0x0800_0000 + at as u32) | 1));
    }
    Elf::from_image(0x0800_0000, bytes)
}

/// Returns a machine that contains the flash image of [`image`]; its first result words are zero.
fn machine(main: &[u16], handlers: &[(usize, &[u16])]) -> Machine {
    let mut machine = Machine::new(image(main, handlers), 1);
    assert!(machine.poke(RESULT, &[0; 64]));
    machine
}

/// Returns a result word.
fn result(machine: &Machine, index: u32) -> u32 {
    machine.word(RESULT + 4 * index).unwrap()
}
