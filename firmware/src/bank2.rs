//! Flash bank 2, whose last two sectors contain the stored arm (J-54). Erasing and programming never block the program,
//! and a read of a damaged word does not cause a fault.
//!
//! A read of bank 2 during erasing or programming would halt the processor until the flash operation ends. A flash
//! operation takes up to two seconds, but the watchdog allows only 4.5 ms. Therefore the memory protection unit blocks
//! every access to bank 2, including speculative reads and cache line fills ([`memory::bank2`]). Only this module
//! permits accesses to the bank. During these accesses, the bank is memory that is neither cached nor prefetched. Code
//! and constants are in bank 1, which remains readable.
use core::arch::asm;

use cortex_m::peripheral::SCB;
use embassy_stm32::pac;
use embassy_stm32::pac::flash::{Bank, regs};
use jtc_core::slots::{SLOTS, WORD, Word};

use crate::memory;

/// Flash sectors of the slots for the stored arm. The Cortex-M4 starts in the first sector of the bank, which is
/// never modified.
const SECTORS: [u8; SLOTS] = [6, 7];
const SECTOR_BYTES: u32 = 128 * 1024;
const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];
/// Code for programming of 32 bits at once, which is permitted at every supply voltage of the boards.
const PSIZE: u8 = 0b10;
/// Bit BFHFNMIGN of the register CCR. If it is set, the core ignores bus faults of loads and stores while faults are
/// masked.
const IGNORE_BUS_FAULTS: u32 = 1 << 8;

/// Bits of FLASH_SR2 that report errors: write protection, sequence, strobe, inconsistency, operation, read
/// protection, read security, and two wrong bits in a word.
const ERRORS: u32 = 1 << 17 | 1 << 18 | 1 << 19 | 1 << 21 | 1 << 22 | READ_ERRORS;
const READ_ERRORS: u32 = 1 << 23 | 1 << 24 | 1 << 26;
/// Flags that are cleared together with the errors: end of operation, and corrected one-bit error.
const REMARKS: u32 = 1 << 16 | 1 << 25;

/// Returns the registers of flash bank 2.
fn bank() -> Bank {
    pac::FLASH.bank(1)
}

/// Unlocks the flash registers. Returns `false` if the registers remain locked until the next reset.
pub fn unlock() -> bool {
    if bank().cr().read().lock() {
        KEYS.into_iter().for_each(|key| bank().keyr().write_value(key));
    }
    !bank().cr().read().lock()
}

/// Ends a flash operation and locks the flash registers. After this call, no operation can begin until [`unlock`] is
/// called.
pub fn lock() {
    end();
    bank().cr().modify(|w| w.set_lock(true));
}

/// Returns `true` while a flash operation is in progress.
pub fn busy() -> bool {
    let sr = bank().sr().read();
    sr.bsy() || sr.qw()
}

/// Ends programming or erasing, so that later writes do not belong to that operation.
pub fn end() {
    bank().cr().write(|w| w.set_psize(PSIZE));
}

/// Returns the errors that have occurred since the flash operation began, as bits of FLASH_SR2.
pub fn errors() -> u32 {
    bank().sr().read().0 & ERRORS
}

fn clear() {
    bank().ccr().write_value(regs::Ccr(ERRORS | REMARKS));
}

fn address(slot: usize, word: usize) -> u32 {
    memory::BANK2 + u32::from(SECTORS[slot]) * SECTOR_BYTES + (word * WORD) as u32
}

/// Begins to erase a slot; erasing takes seconds.
pub fn erase(slot: usize) {
    clear();
    let sector = SECTORS[slot];
    bank().cr().write(|w| {
        w.set_psize(PSIZE);
        w.set_ser(true);
        w.set_snb(sector);
    });
    bank().cr().modify(|w| w.set_start(true));
}

/// Begins to program a word; programming takes a fraction of a millisecond.
pub fn program(slot: usize, word: usize, bytes: &Word) {
    clear();
    bank().cr().write(|w| {
        w.set_psize(PSIZE);
        w.set_pg(true);
    });
    let (words, _) = bytes.as_chunks::<4>();
    let at = address(slot, word) as *mut u32;
    let write = |n: usize| {
        // SAFETY: the address is within a sector that only this module uses; stores to this sector go to the write
        // buffer of the flash.
        unsafe { at.add(n).write_volatile(u32::from_le_bytes(words[n])) }
    };
    let last = words.len() - 1;
    memory::bank2(true);
    (0..last).for_each(write);
    // The write of the last 32 bits starts programming. Interrupts are masked until accesses to the bank are blocked
    // again.
    critical_section::with(|_| {
        write(last);
        memory::bank2(false);
    });
}

/// Reads a word. Returns `None` if the word cannot be read. This function must not be called while flash bank 2 is
/// busy.
///
/// If programming or erasing a word was interrupted, the word may have more wrong bits than the flash can correct. A
/// read of such a word causes a bus fault. The core ignores this bus fault here, and this function checks the error
/// flag of the flash instead.
pub fn read(slot: usize, word: usize) -> Option<Word> {
    clear();
    // SAFETY: this code only changes a register of the core. No other code changes this bit, and the bit has an effect
    // only while faults are masked.
    let ignore = |on: bool| unsafe {
        (*SCB::PTR).ccr.modify(|ccr| if on { ccr | IGNORE_BUS_FAULTS } else { ccr & !IGNORE_BUS_FAULTS });
    };
    ignore(true);
    memory::bank2(true);
    let mut bytes = [0; WORD];
    let (words, _) = bytes.as_chunks_mut::<4>();
    for (n, to) in words.iter_mut().enumerate() {
        *to = load(address(slot, word) + 4 * n as u32).to_le_bytes();
    }
    memory::bank2(false);
    ignore(false);
    (bank().sr().read().0 & READ_ERRORS == 0).then_some(bytes)
}

/// Loads one word with faults masked. Each load masks faults separately, so that the tick waits for one load at most.
fn load(address: u32) -> u32 {
    let value: u32;
    // SAFETY: this code is an aligned load from flash. With FAULTMASK and BFHFNMIGN set, the core ignores a bus fault
    // of this load, and the barrier waits until the load is complete. The protection unit stays active while faults are
    // masked (HFNMIENA, `memory`), so the load is neither cached nor prefetched.
    unsafe {
        asm!(
            "cpsid f",
            "dsb",
            "ldr {value}, [{address}]",
            "dsb",
            "cpsie f",
            address = in(reg) address,
            value = out(reg) value,
            options(nostack, preserves_flags),
        );
    }
    value
}
