//! Tests of the core: arithmetic, exceptions, sleep, faults, resets and instruction counts.
use openjtc_emulator::clock::{self, MICROSECOND, MILLISECOND, SECOND};
use openjtc_emulator::observe::FaultKind;
use openjtc_emulator::{Elf, FIRST_LINE, RegisterARM, ResetCause, Symbol};

use crate::programs::*;
use crate::{MAIN, RESULT, image, machine, result};

/// Duration of an instruction at 64 MHz, the clock after reset.
const CYCLE: u64 = SECOND / 64_000_000;

#[test]
fn f64_results_have_the_bits_of_the_pc() {
    const ROUNDS: usize = 500;
    let mut rng = fastrand::Rng::with_seed(7);
    // Random numbers of all kinds except NaN. The kinds include subnormal numbers, infinities and zeros of both signs.
    let mut number = || match rng.u8(..) {
        0 => 0.0,
        1 => -0.0,
        2 => f64::INFINITY,
        3 => f64::from_bits(rng.u64(1..1 << 52)),
        4..120 => rng.f64() * 10.0 - 5.0,
        _ => f64::from_bits(rng.u64(..)),
    };
    let pairs: Vec<[f64; 2]> = std::iter::repeat_with(|| [number(), number()])
        .filter(|pair| pair.iter().all(|x| !x.is_nan()))
        .take(ROUNDS)
        .collect();
    let mut machine = machine(FLOATS, &[]);
    // The machine runs the program once for each pair of numbers, because the results of the program would overwrite
    // the next pair.
    for [a, b] in pairs {
        let mut one = 1u64.to_le_bytes().to_vec();
        one.extend(a.to_le_bytes());
        one.extend(b.to_le_bytes());
        machine.reset(ResetCause::Pin);
        assert!(machine.poke(RESULT, &one));
        let end = machine.now() + 40 * CYCLE;
        machine.run_until(end);
        let out = machine.memory(RESULT + 8, 48).unwrap();
        let double = |i: usize| u64::from_le_bytes(out[8 * i..8 * i + 8].try_into().unwrap());
        for (i, expected) in [a * b, a + b, a - b, a / b, a.sqrt()].into_iter().enumerate() {
            let same =
                double(i) == expected.to_bits() || f64::from_bits(double(i)).is_nan() && expected.is_nan();
            assert!(same, "operation {i} on {a:e} and {b:e}: {:x}, not {:x}", double(i), expected.to_bits());
        }
        assert_eq!(double(5) as u32, (a as f32).to_bits(), "{a:e} as f32");
    }
}

#[test]
fn an_exception_preserves_what_the_program_has() {
    let mut machine = machine(PRESERVE, &[(FIRST_LINE, CLOBBER)]);
    // Checks the flags and registers that the main program stores after the interrupt. The program uses the
    // floating-point unit without enabling it, which the emulator permits.
    machine.run_until(5 * MICROSECOND);
    assert_eq!(result(&machine, 0), 1, "the handler ran once");
    let after: Vec<u32> = (0..9).map(|i| machine.word(RESULT + 0x100 + 4 * i).unwrap()).collect();
    assert_eq!(after, [10, 11, 12, 13, 1, 11, 22, 33, 0x2001_0000]);
    let chip = machine.chip();
    assert!(chip.observers.faults.is_empty());
    assert_eq!(chip.observers.handlers[FIRST_LINE].calls, 1);
    assert_eq!(chip.observers.handlers[FIRST_LINE].last, 11);
    assert_eq!(chip.observers.lowest_sp[FIRST_LINE], 0x2001_0000 - 104);
}

fn log_of_three(program: &[u16]) -> Vec<u8> {
    let lines = [FIRST_LINE, FIRST_LINE + 1, FIRST_LINE + 2];
    let mut machine = machine(program, &lines.map(|e| (e, LOG_AND_PEND)));
    machine.run_until(20 * MICROSECOND);
    machine.memory(RESULT + 4, 7).unwrap()
}

#[test]
fn more_urgent_exceptions_preempt_and_equal_ones_follow() {
    assert_eq!(log_of_three(PEND_0_THEN_MARK), [0, 1, 2, 0x12, 0x11, 0x10, 0xAA]);
    let mut equal = PEND_0_THEN_MARK.to_vec();
    let at = equal.windows(2).position(|w| w == [0x2030, 0x0010]).unwrap();
    equal[at..at + 2].copy_from_slice(&[0x2020, 0x0020]);
    assert_eq!(log_of_three(&equal), [0, 0x10, 1, 0x11, 2, 0x12, 0xAA]);
}

#[test]
fn primask_holds_an_interrupt_until_the_very_instruction_that_clears_it() {
    let mut machine = machine(MASKED, &[(FIRST_LINE, CLOBBER)]);
    machine.run_until(5 * MICROSECOND);
    assert_eq!((result(&machine, 1), result(&machine, 2)), (0, 1));
    let latency = machine.chip().observers.latencies[FIRST_LINE];
    // The interrupt becomes pending at the end of the store instruction. Before the handler, the core executes seven
    // instructions: four nop, a load, a store and cpsie.
    assert_eq!((latency.entries, latency.worst), (1, 7 * CYCLE));
}

#[test]
fn wfi_sleeps_until_a_timer_and_costs_no_instructions() {
    let mut machine = machine(SLEEP, &[(FIRST_LINE + 55, CLOBBER)]);
    machine.write_register(0x5802_44E8, 1 << 5); // APB1LENR: TIM7
    for (offset, value) in [(0x28, 63), (0x2C, 999), (0x14, 1), (0x10, 0), (0x0C, 1), (0x00, 1)] {
        machine.write_register(0x4000_1400 + offset, value);
    }
    machine.write_register(0xE000_E100 + 4, 1 << (55 - 32));
    let start = machine.now();
    machine.run_until(start + 999 * MICROSECOND);
    assert!(machine.instructions() <= 2);
    assert_eq!(result(&machine, 0), 0);
    // The handler does not clear the flag, so the interrupt line remains high and the interrupt occurs repeatedly.
    machine.run_until(start + 1000 * MICROSECOND + 40 * CYCLE);
    assert!(result(&machine, 0) >= 3);
    assert_eq!(machine.chip().observers.latencies[FIRST_LINE + 55].worst, 0);
}

#[test]
fn wfe_passes_once_after_sev_and_then_sleeps() {
    let mut machine = machine(SEV_WFE, &[]);
    machine.run_until(MILLISECOND);
    assert_eq!((result(&machine, 0), result(&machine, 1)), (1, 0));
    assert_eq!(machine.instructions(), 6);
}

#[test]
fn a_bad_access_is_a_hard_fault_and_a_second_one_locks_up() {
    let mut machine = machine(BAD_LOAD, &[(3, CLOBBER)]);
    machine.run_until(MICROSECOND);
    let faults = machine.chip().observers.faults.clone();
    assert_eq!(
        (faults[0].kind, faults[0].pc, faults[0].address),
        (FaultKind::BadAccess, MAIN + 4, 0x6000_0000)
    );
    assert!(result(&machine, 0) > 0);
    let mut machine = crate::machine(BAD_LOAD, &[(3, BAD_LOAD)]);
    machine.run_until(MICROSECOND);
    assert!(machine.locked_up());
    assert!(machine.chip().observers.faults[1].lockup);
}

#[test]
fn cyccnt_counts_instructions() {
    let mut machine = machine(CYCLES, &[]);
    machine.run_until(MICROSECOND);
    assert_eq!(result(&machine, 0), 6);
}

#[test]
fn a_requested_reset_keeps_ram_and_adds_its_flag() {
    let mut machine = machine(RESET_REQUEST, &[]);
    machine.run_until(10 * MICROSECOND);
    assert_eq!(result(&machine, 0), 3);
    let chip = machine.chip();
    let causes: Vec<ResetCause> = chip.observers.resets.iter().map(|r| r.cause).collect();
    assert_eq!(causes, [ResetCause::PowerOn, ResetCause::Software, ResetCause::Software]);
    // The chip sets SFTRSTF in addition to PORRSTF.
    assert_eq!(chip.rcc.reset_flags() & (1 << 24 | 1 << 23), 1 << 24 | 1 << 23);
    machine.write_register(0x5802_44D0, 1 << 16);
    assert_eq!(machine.read_register(0x5802_44D0), 0);
}

#[test]
fn the_watchdog_resets_after_its_time_unless_it_is_fed() {
    let mut machine = machine(SPIN, &[]);
    let write = |machine: &mut openjtc_emulator::Machine, offset: u32, value: u32| {
        machine.write_register(0x5800_4800 + offset, value);
    };
    write(&mut machine, 0, 0x5555);
    write(&mut machine, 4, 1); // LSI / 8
    write(&mut machine, 8, 39); // 40 counts: 10 ms
    write(&mut machine, 0, 0xCCCC);
    machine.run_until(9 * MILLISECOND);
    write(&mut machine, 0, 0xAAAA);
    let fed = machine.now();
    machine.run_until(25 * MILLISECOND);
    let resets = machine.chip().observers.resets.clone();
    assert_eq!(resets.len(), 2);
    assert_eq!(resets[1].cause, ResetCause::Watchdog);
    assert!(resets[1].time.abs_diff(fed + 10 * MILLISECOND) <= 2 * CYCLE);
    assert_ne!(machine.chip().rcc.reset_flags() & 1 << 26, 0);
    assert!(!machine.chip().iwdg.running());
}

#[test]
fn instructions_of_a_function_are_counted_by_its_symbol() {
    let function = Symbol { address: MAIN + 16, size: 18, code: true };
    let elf = image(CALL, &[]).with_symbol("some::module::work", function);
    let mut machine = openjtc_emulator::Machine::new(elf, 1);
    assert!(machine.count("no_such").is_err());
    let counter = machine.count("module::work").unwrap();
    machine.poke(RESULT, &[0; 4]);
    machine.run_until(10 * MICROSECOND);
    let count = machine.counted(counter);
    assert!(count.calls > 10);
    assert_eq!((count.min, count.max, count.last), (6, 6, 6));
    machine.poke(RESULT, &[1, 0, 0, 0]);
    machine.run_until(20 * MICROSECOND);
    let count = machine.counted(counter);
    assert_eq!((count.min, count.max, count.last), (6, 9, 9));
}

#[test]
fn an_it_block_counts_with_all_its_members_whether_they_are_skipped_or_not() {
    let function = Symbol { address: MAIN + 16, size: 22, code: true };
    let elf = image(CALL_IT_BLOCK, &[]).with_symbol("work", function);
    let mut machine = openjtc_emulator::Machine::new(elf, 1);
    let counter = machine.count("work").unwrap();
    for condition in [0, 1] {
        machine.poke(RESULT, &[condition, 0, 0, 0]);
        machine.run_until(machine.now() + 10 * MICROSECOND);
        let count = machine.counted(counter);
        assert_eq!((count.min, count.max, count.last), (9, 9, 9), "{condition}");
    }
}

#[test]
fn the_same_run_with_it_blocks_comes_out_however_it_is_cut() {
    let run = |step: u64| {
        let mut machine = machine(CALL_IT_BLOCK, &[]);
        machine.poke(RESULT, &[1, 0, 0, 0]);
        while machine.now() < 5 * MICROSECOND {
            machine.run_until((machine.now() + step).min(5 * MICROSECOND));
        }
        (machine.instructions(), machine.pc(), machine.register(RegisterARM::SP))
    };
    let whole = run(5 * MICROSECOND);
    for step in [CYCLE, 3 * CYCLE, 7 * CYCLE + 1] {
        assert_eq!(run(step), whole, "steps of {step}");
    }
}

#[test]
fn the_same_run_comes_out_however_it_is_cut() {
    let run = |step: u64| {
        let lines = [FIRST_LINE, FIRST_LINE + 1, FIRST_LINE + 2];
        let mut machine = machine(PEND_0_THEN_MARK, &lines.map(|e| (e, LOG_AND_PEND)));
        let mut now = 0;
        while now < 5 * MICROSECOND {
            now += step;
            machine.run_until(now.min(5 * MICROSECOND));
        }
        let chip = machine.chip();
        let handlers = chip.observers.handlers.clone();
        (machine.instructions(), machine.pc(), machine.memory(RESULT, 64), handlers)
    };
    let whole = run(5 * MICROSECOND);
    assert_eq!(whole.0, clock::to_ns(5 * MICROSECOND) * 64 / 1000);
    for step in [CYCLE, 3 * CYCLE, 7 * CYCLE + 1] {
        assert_eq!(run(step), whole, "steps of {step}");
    }
}

#[test]
fn an_elf_file_that_is_none_is_refused() {
    assert!(Elf::parse(b"not an ELF file").is_err());
    assert!(Elf::parse(&[]).is_err());
    let mut machine = machine(SPIN, &[]);
    machine.run_until(MICROSECOND);
    assert_eq!(machine.register(RegisterARM::SP), 0x2001_0000);
}
