//! Tests of flash bank 2: locks, times, errors, stalls of the core, and contents after a loss of power.
use openjtc_emulator::clock::{MICROSECOND, MILLISECOND, SECOND};
use openjtc_emulator::flash::{BANK2, BANK2_SIZE, Bank2, Flash, OperationKind, WORD, sr};
use openjtc_emulator::{Machine, ResetCause};

use crate::programs::{ERASE_AND_READ, READ_BANK2};
use crate::{image, machine, result};

const KEYR: u32 = 0x104;
const CR: u32 = 0x10C;
const SR: u32 = 0x110;
const CCR: u32 = 0x114;
/// Values of CR for programming, for erasing sector 6, and for erasing sector 6 with START.
const PG: u32 = 0x22;
const SER: u32 = 0x624;
const START: u32 = 0x6A4;
/// First word of sector 6.
const AT: u32 = BANK2 + 6 * 0x2_0000;

fn unlocked() -> Flash {
    let mut flash = Flash::default();
    for key in [0x4567_0123, 0xCDEF_89AB] {
        assert!(flash.write_register(KEYR, key, 0, true));
    }
    flash
}

fn sr(flash: &mut Flash, now: u64) -> u32 {
    flash.read_register(SR, now).expect("a register")
}

/// Programs a word with one value.
fn program(flash: &mut Flash, address: u32, value: u32, now: u64) {
    flash.write_register(CR, PG, now, true);
    for n in 0..8 {
        flash.store(address + 4 * n, 4, value, now, true);
    }
}

#[test]
fn bank_2_is_locked_until_both_keys_are_written() {
    let mut flash = Flash::default();
    flash.write_register(CR, START, 0, true);
    program(&mut flash, AT, 0, 0);
    assert_eq!((sr(&mut flash, 0), flash.operations.len()), (sr::PGSERR, 0));
    flash.write_register(KEYR, 0x4567_0123, 0, true);
    flash.write_register(KEYR, 0x4567_0123, 0, true);
    flash.write_register(KEYR, 0xCDEF_89AB, 0, true);
    assert_eq!(flash.read_register(CR, 0).map(|cr| cr & 1), Some(1), "a wrong sequence locks until a reset");
    flash.reset(1);
    for key in [0x4567_0123, 0xCDEF_89AB] {
        flash.write_register(KEYR, key, 1, true);
    }
    assert_eq!(flash.read_register(CR, 1).map(|cr| cr & 1), Some(0));
    assert!(!flash.bank1_unlocked);
}

#[test]
fn a_sector_takes_its_time_and_holds_ones_then() {
    let mut flash = unlocked();
    flash.bank.put(AT - 1, &[0; 0x2_0002]);
    flash.write_register(CR, SER, 0, true);
    assert_eq!(sr(&mut flash, 0), 0, "not without START");
    flash.write_register(CR, START, 0, true);
    assert_eq!(sr(&mut flash, 2 * SECOND - 1), sr::BSY | sr::QW);
    assert_eq!(sr(&mut flash, 2 * SECOND), 0);
    assert!(flash.bank.bytes(AT, 0x2_0000).iter().all(|byte| *byte == 0xFF));
    assert_eq!(flash.bank.bytes(AT - 1, 1), [0], "the neighbouring sectors are as before");
    assert_eq!(flash.bank.bytes(AT + 0x2_0000, 1), [0]);
}

#[test]
fn a_word_is_programmed_once_and_only_as_a_whole() {
    let mut flash = unlocked();
    program(&mut flash, AT, 0x1234_5678, 0);
    assert_eq!(sr(&mut flash, 0), sr::BSY | sr::QW);
    let end = 130 * MICROSECOND;
    assert_eq!((sr(&mut flash, end), flash.overwrites), (0, 0));
    assert_eq!(flash.load(AT + 28, 4), (0x1234_5678, false));
    // If a word is programmed again without being erased, the word becomes unreadable.
    program(&mut flash, AT, 0x1234_5678, end);
    assert_eq!((sr(&mut flash, 2 * end), flash.overwrites), (0, 1));
    assert!(flash.load(AT, 4).1);
    assert_eq!(sr(&mut flash, 2 * end), sr::DBECCERR);
    flash.write_register(CCR, sr::DBECCERR, 2 * end, true);
    // Half of a flash word is in the write buffer. In this state it is an error to write to another word, or to write
    // the same bytes again.
    flash.store(AT + 32, 4, 0, 2 * end, true);
    assert_eq!(sr(&mut flash, 2 * end), sr::WBNE);
    flash.store(AT + 64, 4, 0, 2 * end, true);
    flash.store(AT + 32, 4, 0, 2 * end, true);
    assert_eq!(sr(&mut flash, 2 * end), sr::WBNE | sr::INCERR | sr::STRBERR);
}

#[test]
fn the_power_goes_in_the_middle() {
    let mut flash = unlocked();
    program(&mut flash, AT, 7, 0);
    let end = 130 * MICROSECOND;
    sr(&mut flash, end);
    let whole = flash.bank.clone();
    program(&mut flash, AT + 32, 0, end);
    assert_eq!(flash.cut(end, 1), whole, "before it has begun");
    let torn: Vec<Bank2> = (0..40).map(|seed| flash.cut(end + MICROSECOND, seed)).collect();
    assert!(torn.contains(&whole), "sometimes nothing happened");
    assert!(torn.iter().all(|bank| bank.bytes(AT, 32) == whole.bytes(AT, 32)), "other words are as before");
    assert!(torn.iter().any(|bank| bank.bytes(AT + 32, 32) == [0; 32]), "sometimes all of it");
    assert!(
        torn.iter().any(|bank| !matches!(bank.bytes(AT + 32, 1)[0], 0 | 0xFF)),
        "sometimes something else"
    );
    assert_eq!(flash.cut(end + MICROSECOND, 3), torn[3], "the same seed, the same chance");
}

#[test]
fn a_failed_operation_says_so() {
    let mut flash = unlocked();
    flash.fail_next = sr::OPERR;
    program(&mut flash, AT, 7, 0);
    assert_eq!(sr(&mut flash, MILLISECOND), sr::OPERR);
}

/// The core waits in the load instruction until the erase operation of the flash ends.
#[test]
fn a_read_of_the_busy_bank_halts_the_core() {
    let mut machine = machine(ERASE_AND_READ, &[]);
    assert!(machine.poke(AT, &[0; 4]));
    machine.run_until(SECOND);
    assert_eq!(result(&machine, 1), 0, "it waits");
    machine.run_until(2 * SECOND + MILLISECOND);
    assert_eq!((result(&machine, 0), result(&machine, 1)), (u32::MAX, 1), "what it read, when it could");
    let flash = &machine.chip().flash;
    assert_eq!(flash.operations[0].kind, OperationKind::Erase { sector: 6 });
    assert_eq!(flash.stalls.len(), 1);
    let (at, length) = flash.stalls[0];
    assert!(at < MICROSECOND && at + length == flash.operations[0].end);
    assert_eq!(flash.longest_open, 2 * SECOND, "nothing kept it from that");
    assert!(flash.ahead > 0, "nor from reading ahead");
}

#[test]
fn the_watchdog_ends_such_a_wait() {
    let mut machine = machine(ERASE_AND_READ, &[]);
    for (offset, value) in [(0, 0xCCCC), (0, 0x5555), (8, 35), (0, 0xAAAA)] {
        machine.write_register(0x5800_4800 + offset, value);
    }
    machine.run_until(4 * MILLISECOND);
    assert_eq!(machine.chip().observers.resets.len(), 1, "not yet");
    machine.run_until(5 * MILLISECOND);
    assert_eq!(machine.chip().observers.resets[1].cause, ResetCause::Watchdog);
}

#[test]
fn the_protection_unit_keeps_the_core_out() {
    let mut machine = machine(READ_BANK2, &[]);
    for (address, value) in
        [(0xE000_ED98, 3), (0xE000_ED9C, BANK2), (0xE000_EDA0, 1 << 28 | 19 << 1 | 1), (0xE000_ED94, 5)]
    {
        machine.write_register(address, value);
    }
    machine.run_until(MICROSECOND);
    let faults = &machine.chip().observers.faults;
    assert_eq!(faults.first().map(|fault| fault.address), Some(AT), "{faults:?}");
}

#[test]
fn an_unreadable_word_is_a_fault_and_outlasts_the_power() {
    let mut bank = Bank2::default();
    bank.damage(AT);
    let mut machine = Machine::with_bank2(image(READ_BANK2, &[]), 1, bank);
    machine.run_until(MICROSECOND);
    let faults = &machine.chip().observers.faults;
    assert_eq!(faults.first().map(|fault| fault.address), Some(AT), "{faults:?}");
    let bank = machine.cut_power(0);
    assert_eq!(format!("{bank:?}"), "0 words programmed, 1 unreadable");
}

/// The bytes of a flash bank can be saved to a file and restored.
#[test]
fn a_bank_of_the_bytes_that_another_had_is_that_bank() {
    let mut bank = Bank2::default();
    bank.put(BANK2 + 6 * 0x2_0000, &[0x5A; 3 * WORD]);
    bank.put(BANK2 + BANK2_SIZE - WORD as u32, &[0; WORD]);
    let bytes = bank.bytes(BANK2, BANK2_SIZE as usize);
    assert!(Bank2::from_bytes(&bytes) == bank);
    let longer = [&bytes[..], &[1; 100]].concat();
    assert!(Bank2::from_bytes(&longer) == bank, "what exceeds the bank is left out");
    assert!(Bank2::from_bytes(&[]) == Bank2::default());
}
