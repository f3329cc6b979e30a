//! Tests of safety functions: the safety input, a tick that hangs, and faults and panics of the program.
mod rig;

use jtc_bus::Request;
use jtc_core::{ControllerState, TrajectoryState, error};
use jtc_sim::{SimConfig, host as frames};
use openjtc_emulator::clock::{MICROSECOND, Time, to_us};
use openjtc_emulator::fdcan::Outcome;
use openjtc_emulator::observe::ResetCause;
use openjtc_emulator::{BoardConfig, Port};
use rig::{BOARDS, Flight, Rig};

const HOST: Port = Port::Usart3;

/// Returns a board that holds the arm in a pose in which gravity requires torque.
fn holding() -> Rig {
    let sim = SimConfig { start: [0.0, 0.5, -0.4, 0.3, 0.0, 0.0], ..SimConfig::default() };
    let mut rig = Rig::with(BOARDS[0], BoardConfig { sim, ..Default::default() });
    rig.bring_up(HOST);
    rig.run(100);
    assert!(rig.flight.torque[1].abs() > 10.0, "{:?}", rig.flight.torque);
    rig
}

/// Like `holding`, but the board moves the arm along a trajectory.
fn moving() -> Rig {
    let mut rig = holding();
    rig.set_off(HOST, 1.0, 500);
    rig
}

fn torque_of(frame: &can_link::CanFrame) -> Option<[f64; 6]> {
    let frame = jtc_bus::Frame::new(frame.id().value() as u16, frame.data())?;
    match Request::parse(&frame) {
        Ok(Request::Move { torque, .. }) => Some(torque),
        _ => None,
    }
}

/// J-22, J-12, J-21: the state Error begins in the first tick that reads a safety input of 0. The frame of this tick
/// contains zero torque. A broken wire has the same effect. The error remains until the wire is repaired and the host
/// has cleared the error.
#[test]
fn j22_the_safety_input_acts_in_one_tick() {
    for level in [Some(false), None] {
        for mut rig in [holding(), moving()] {
            rig.board.set_safety_input(level);
            rig.step();
            assert_eq!(rig.state(), ControllerState::Error, "{level:?}: in the first tick");
            assert!(!rig.flight.safety_input && rig.telemetry().errors & error::EMERGENCY_INPUT != 0);
            let sent: Vec<_> = rig.bus.iter().filter(|e| e.from_controller).map(|e| &e.frame).collect();
            assert_eq!(sent.into_iter().map(torque_of).collect::<Vec<_>>(), [Some([0.0; 6])], "on the bus");
            // A request to clear the error has no effect while the cause of the error is present.
            rig.ask(HOST, &frames::clear_all());
            rig.run(50);
            assert_eq!(rig.state(), ControllerState::Error);
            rig.board.set_safety_input(Some(true));
            rig.run(300);
            assert_eq!(rig.state(), ControllerState::Error, "J-21: the host has not cleared it");
            rig.ask(HOST, &frames::clear_all());
            rig.wait_for_hold(15_000);
            rig.run(500);
            assert_eq!(
                (rig.state(), rig.telemetry().trajectory),
                (ControllerState::HoldPos, TrajectoryState::Null),
                "J-24"
            );
        }
    }
}

/// Sets the safety input low for `us` µs. The pulse begins `phase` µs after the start of a millisecond. Returns `true`
/// if one of the next two ticks has detected the low level.
fn pulse(rig: &mut Rig, phase: u64, us: u64) -> bool {
    let start = rig.board.now_ms() * 1000 + phase;
    rig.board.machine.run_until(start * MICROSECOND);
    rig.board.set_safety_input(Some(false));
    rig.board.machine.run_until((start + us) * MICROSECOND);
    rig.board.set_safety_input(Some(true));
    (0..2).fold(false, |seen, _| {
        rig.step();
        seen | !rig.flight.safety_input
    })
}

/// J-22: the board latches a pulse of the safety input between two ticks at any phase, and the pulse takes effect in
/// the next tick.
#[test]
fn j22_pulses_shorter_than_a_tick_are_seen() {
    let mut rig = holding();
    assert!(pulse(&mut rig, 700, 50));
    assert_eq!(rig.state(), ControllerState::Error);
    assert!(rig.telemetry().errors & error::EMERGENCY_INPUT != 0);
    for us in [50, 100, 200, 300] {
        for phase in (5..995 - us).step_by(23) {
            assert!(pulse(&mut rig, phase, us), "{us} µs, {phase} µs after the start of a millisecond");
            // The board detects the pulse only once.
            rig.step();
            assert!(rig.flight.safety_input, "{us} µs, {phase} µs after the start of a millisecond");
        }
    }
    rig.ask(HOST, &frames::clear_all());
    rig.wait_for_hold(15_000);
    for _ in 0..100 {
        rig.step();
        assert!(rig.flight.safety_input && rig.telemetry().errors == 0);
    }
}

/// Data about a program run that ended with a reset.
struct End {
    /// Time of the fault or of the last tick.
    begin: Time,
    /// Time of the reset.
    reset: Time,
    cause: ResetCause,
    /// Record that the program wrote about the cause of the reset.
    last_words: Vec<u8>,
    /// Torques in the frames that the board sent between `begin` and `reset`.
    torques: Vec<[f64; 6]>,
    /// Level of the safety output before the reset.
    safety: Option<bool>,
}

/// Runs until the board has been reset and started again. The rig calls `undo` before the first tick of the new program
/// run.
fn until_reset(rig: &mut Rig, undo: impl FnOnce(&mut Rig)) -> End {
    rig.may_hang = true;
    let begin = rig.board.machine.now();
    let resets = |rig: &mut Rig| rig.board.machine.chip().observers.resets.len();
    let before = resets(rig);
    let log = rig.board.machine.elf().symbol("LAST_WORDS").expect("last words");
    let mut torques = Vec::new();
    let mut seen = 0;
    for _ in 0..20 {
        // The rig runs in steps of 10 µs up to the next millisecond, so that it can stop the machine between reset
        // and start.
        for _ in 0..99 {
            let safety = rig.board.safety_output();
            let next = rig.board.machine.now() + 10 * MICROSECOND;
            rig.board.machine.run_until(next);
            let log_of_bus = rig.board.machine.chip().fdcan.wire.log();
            let new =
                log_of_bus.iter().skip(seen).filter(|e| e.from_controller && e.outcome == Outcome::Good);
            torques.extend(new.filter(|e| e.start >= begin).filter_map(|e| torque_of(&e.frame)));
            seen = rig.board.machine.chip().fdcan.wire.log().len();
            if resets(rig) > before {
                let reset = rig.board.machine.chip().observers.resets[before];
                let last_words = rig.board.machine.memory(log.address, 60).expect("memory");
                undo(rig);
                rig.step();
                rig.may_hang = false;
                return End { begin, reset: reset.time, cause: reset.cause, last_words, torques, safety };
            }
        }
        rig.step();
        let passed = rig.bus.iter().skip(seen).filter(|e| e.from_controller && e.outcome == Outcome::Good);
        torques.extend(passed.filter_map(|e| torque_of(&e.frame)));
        seen = 0;
    }
    panic!("no reset");
}

/// Checks the state after the program has failed and restarted. From the first status on, the controller reports the
/// error, with zero torque and the safety output at 0, until the host clears the error. Afterwards, the arm does not
/// move without a command.
fn latched_until_cleared(mut rig: Rig, cause: u32) {
    rig.wait("the first tick", 10, |rig| rig.ticks > 0);
    assert_eq!(rig.flight.cause, cause);
    let received = rig.hosts[1].times.len();
    rig.wait("the first status", 100, |rig| rig.hosts[1].times.len() > received);
    let status = rig.status(HOST);
    let bits = error::INTERNAL | error::EMERGENCY_OUTPUT;
    assert_eq!((status.errors & bits, status.occurred & bits), (bits, bits), "J-12: in the first status");
    assert_eq!(
        (status.jtc_init, status.trajectory),
        (7, TrajectoryState::Null.into()),
        "nothing that the host gave is left"
    );
    for _ in 0..500 {
        rig.step();
        assert_eq!(rig.state(), ControllerState::Error);
        assert_eq!(rig.board.safety_output(), Some(false), "J-22");
        let mut own = rig.bus.iter().filter(|e| e.from_controller);
        assert!(own.all(|e| torque_of(&e.frame).is_none_or(|torque| torque == [0.0; 6])));
    }
    let rest = rig.board.plant().truth().q;
    rig.ask(HOST, &frames::clear_all());
    rig.wait("Init", 1_000, |rig| rig.state() == ControllerState::Init);
    rig.run(500);
    assert_eq!(
        (rig.state(), rig.telemetry().trajectory),
        (ControllerState::Init, TrajectoryState::Null),
        "J-24"
    );
    for (now, then) in rig.board.plant().truth().q.into_iter().zip(rest) {
        assert!((now - then).abs() < 1e-3, "the arm moved by itself");
    }
    rig.bring_up(HOST);
    assert_eq!(rig.board.safety_output(), Some(true));
}

/// Returns the largest distance of a joint from its position in `since`, rad.
fn moved(rig: &Rig, since: &[f64; 6]) -> f64 {
    rig.board.plant().truth().q.iter().zip(since).fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()))
}

const CONTROL_STEP: &str = "control_step";

/// Overwrites the first instructions of the control step. Returns the address of these instructions and the old
/// instructions.
fn patch(rig: &mut Rig, code: &[u8]) -> (u32, Vec<u8>) {
    let at = rig.board.machine.elf().symbol(CONTROL_STEP).expect("the control step").address;
    let old = rig.board.machine.memory(at, code.len()).expect("flash");
    assert!(rig.board.machine.poke(at, code));
    (at, old)
}

/// J-12: if a tick does not end, or does not begin, the watchdog resets the board within 6 ms.
#[test]
fn j12_a_tick_that_hangs_resets_the_board() {
    // If `hang` is `true`, the endless loop `b .` replaces the control step. If `hang` is `false`, the test masks the
    // interrupt of TIM7 in the NVIC.
    for hang in [true, false] {
        let mut rig = holding();
        let pose = rig.board.plant().truth().q;
        let end = if hang {
            let (at, old) = patch(&mut rig, &[0xFE, 0xE7]);
            until_reset(&mut rig, |rig| assert!(rig.board.machine.poke(at, &old)))
        } else {
            rig.board.machine.write_register(0xE000_E184, 1 << (55 - 32));
            until_reset(&mut rig, |_| ())
        };
        assert_eq!(end.cause, ResetCause::Watchdog);
        let us = to_us(end.reset - end.begin);
        println!("hang {hang}: reset after {us} µs");
        assert!((3_000..6_000).contains(&us), "{us} µs");
        rig.run(20);
        let way = moved(&rig, &pose);
        println!("the arm moved by {way:.6} rad");
        assert!(way < 0.01, "{way} rad");
        latched_until_cleared(rig, 4);
    }
}

/// J-24: after a reset during a motion, the trajectory does not continue.
#[test]
fn j24_after_a_hang_no_trajectory_goes_on() {
    let mut rig = moving();
    let (at, old) = patch(&mut rig, &[0xFE, 0xE7]);
    until_reset(&mut rig, |rig| assert!(rig.board.machine.poke(at, &old)));
    latched_until_cleared(rig, 4);
}

/// Checks the reaction to a fault or a panic. The safety output becomes 0, the board sends one frame with zero torque,
/// and the board is reset. The program has recorded the cause.
fn said_goodbye(end: &End) {
    assert_eq!(end.cause, ResetCause::Software);
    assert_eq!(
        end.torques.last(),
        Some(&[0.0; 6]),
        "zero torque is the last word on the bus: {:?}",
        end.torques
    );
    assert_eq!(end.safety, Some(false), "J-22: before the reset");
    let us = to_us(end.reset - end.begin);
    println!("reset after {us} µs");
    assert!(us < 2_500, "{us} µs");
}

fn words(end: &End, n: usize) -> u32 {
    u32::from_le_bytes(end.last_words[4 * n..][..4].try_into().expect("four"))
}

#[test]
fn j12_a_hard_fault_takes_the_torque_away() {
    for mut rig in [holding(), moving()] {
        // The half-word 0xDE00 is an undefined instruction.
        let (at, old) = patch(&mut rig, &[0x00, 0xDE]);
        let end = until_reset(&mut rig, |rig| assert!(rig.board.machine.poke(at, &old)));
        said_goodbye(&end);
        assert_eq!(&end.last_words[..4], b"HFLT");
        assert_eq!(words(&end, 2), at, "where it was");
        assert_ne!(words(&end, 4) & 1 << 16, 0, "CFSR: undefined instruction");
        latched_until_cleared(rig, 5);
    }
}

/// J-12: the tick loads from an unmapped address, which causes a hard fault.
#[test]
fn j12_a_null_pointer_is_a_hard_fault() {
    let mut rig = holding();
    // `movw r0, 0; movt r0, 0x6000; ldr r0, [r0]` loads from external memory, which does not exist on the board.
    let (at, old) = patch(&mut rig, &[0x40, 0xF2, 0x00, 0x00, 0xC6, 0xF2, 0x00, 0x00, 0x00, 0x68]);
    let end = until_reset(&mut rig, |rig| assert!(rig.board.machine.poke(at, &old)));
    said_goodbye(&end);
    assert_eq!((&end.last_words[..4], words(&end, 6)), (&b"HFLT"[..], 0x6000_0000), "and its address");
    latched_until_cleared(rig, 5);
}

/// Encodes `b.w` from one address to another.
fn branch(from: u32, to: u32) -> [u8; 4] {
    let offset = to.wrapping_sub(from + 4);
    let bit = |n: u32| offset >> n & 1;
    let (s, i1, i2) = (bit(24), bit(23), bit(22));
    let (j1, j2) = (1 ^ i1 ^ s, 1 ^ i2 ^ s);
    let first = 0xF000 | s << 10 | offset >> 12 & 0x3FF;
    let second = 0x9000 | j1 << 13 | j2 << 11 | offset >> 1 & 0x7FF;
    let ([a, b], [c, d]) = ((first as u16).to_le_bytes(), (second as u16).to_le_bytes());
    [a, b, c, d]
}

#[test]
fn j12_a_panic_takes_the_torque_away() {
    let mut rig = holding();
    // Functions that panic. If such a function takes a source location as an argument, the location is one of the
    // first four arguments.
    const PANICS: [&str; 4] = [
        "core::option::unwrap_failed",
        "core::panicking::panic_bounds_check",
        "core::result::unwrap_failed",
        "core::panicking::panic",
    ];
    let elf = rig.board.machine.elf();
    let panic = PANICS.iter().find_map(|name| elf.symbol(name).ok()).expect("a function that panics").address;
    // The test writes code to free flash. The code sets the four arguments and branches to the function that panics.
    // A `Location` and a name follow the code.
    const STUB: u32 = 0x080F_0000;
    let mut stub = vec![0x03, 0x48, 0x01, 0x46, 0x02, 0x46, 0x03, 0x46];
    stub.extend(branch(STUB + 8, panic));
    stub.extend([0x00, 0xBF, 0x00, 0xBF]);
    for word in [STUB + 20, STUB + 36, 7, 77, 1] {
        stub.extend(word.to_le_bytes());
    }
    stub.extend(b"hung.rs\0");
    assert!(rig.board.machine.poke(STUB, &stub));
    let at = rig.board.machine.elf().symbol(CONTROL_STEP).expect("the control step").address;
    let (at, old) = patch(&mut rig, &branch(at, STUB));
    let end = until_reset(&mut rig, |rig| assert!(rig.board.machine.poke(at, &old)));
    said_goodbye(&end);
    assert_eq!(&end.last_words[..4], b"PANC");
    let name = String::from_utf8_lossy(&end.last_words[28..60]);
    let name = name.trim_end_matches('\0');
    println!("panic in {name} line {}", words(&end, 1));
    assert!(name.ends_with(".rs") && words(&end, 1) > 0, "{name}");
    latched_until_cleared(rig, 6);
}

/// A reset by the button or the power supply is not a failure. The board starts in Init without an error, and does not
/// move the arm.
#[test]
fn j24_reset_and_power_on_begin_in_init() {
    for (cause, number) in [(ResetCause::Pin, 2), (ResetCause::PowerOn, 1)] {
        let mut rig = moving();
        rig.board.machine.reset(cause);
        rig.run(200);
        assert_eq!(rig.flight.cause, number);
        assert_eq!((rig.state(), rig.telemetry().errors), (ControllerState::Init, 0));
        assert_eq!((rig.status(HOST).jtc_init, rig.telemetry().trajectory), (7, TrajectoryState::Null));
        assert_eq!(rig.flight.phase, Flight::PHASE_COMPLETE);
    }
}
