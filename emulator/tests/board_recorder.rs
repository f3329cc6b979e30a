//! J-56: tests of the flight recorder on the board. The memory of the flight recorder survives a reset.
mod rig;

use jtc_core::recorder::{BLOCK_BYTES, Block, Log, Outcome, Replay};
use jtc_core::{ControllerState, Telemetry};
use jtc_sim::{FaultKind, SimConfig};
use jtc_wire::{LogState, fixed};
use openjtc_emulator::observe::ResetCause;
use openjtc_emulator::{BoardConfig, Port};
use rig::{BOARDS, Rig};

const HOST: Port = Port::Usart3;

/// Returns a board that moves the arm along a trajectory of many seconds.
fn moving() -> Rig {
    let sim = SimConfig { start: [0.0, 0.5, -0.4, 0.3, 0.0, 0.0], ..SimConfig::default() };
    let mut rig = Rig::with(BOARDS[0], BoardConfig { sim, ..Default::default() });
    rig.bring_up(HOST);
    rig.run(100);
    rig.set_off(HOST, 2.0, 2_200);
    rig
}

/// Returns the memory of the flight recorder on the board.
fn memory(rig: &Rig) -> Vec<Block> {
    let piece = |(name, blocks): (&str, usize)| {
        let at = rig.board.machine.elf().symbol(name).expect("its memory");
        let bytes = rig.board.machine.memory(at.address, blocks * BLOCK_BYTES).expect("memory");
        let words: Vec<u32> = bytes.as_chunks::<4>().0.iter().map(|word| u32::from_le_bytes(*word)).collect();
        words.as_chunks::<{ BLOCK_BYTES / 4 }>().0.to_vec()
    };
    let names = ["RECORDER_SRAM1", "RECORDER_SRAM3", "RECORDER_SRAM4"];
    names.into_iter().zip(jtc_sim::RECORDER_BLOCKS).flat_map(piece).collect()
}

/// Replays the log of the shadow controller and returns the telemetry of each tick. The replayed values must equal the
/// recorded values in every tick.
fn replayed(rig: &Rig) -> Vec<Telemetry> {
    let shadow = rig.shadow.as_ref().expect("a controller");
    let blocks: Vec<Block> = shadow.recorder().blocks().copied().collect();
    let controller = shadow.controller().clone();
    let points = Some(controller.points_hash());
    Replay::new(Log::new(&blocks), controller, points)
        .inspect(|step| assert_ne!(step.outcome, Outcome::Differs, "tick {}", step.telemetry.tick))
        .filter(|step| step.outcome == Outcome::Same)
        .map(|step| step.telemetry)
        .collect()
}

/// J-56: the log of the board equals the log of the recorder on the PC in every word. A replay on the PC computes the
/// same values as the board. The replay covers at least two seconds before the error and 0.3 s after it.
#[test]
fn j56_a_replay_on_a_pc_is_what_the_board_did() {
    let mut rig = moving();
    let mut seen = Vec::new();
    rig.inject(FaultKind::NodeSilent { node: 2 });
    for _ in 0..500 {
        rig.step();
        seen.push(rig.telemetry());
    }
    let error = seen.iter().find(|t| t.state == ControllerState::Error).expect("an error").tick;
    let shadow = rig.shadow.as_ref().expect("a controller");
    assert_eq!(shadow.recorder().state(), LogState::Error);
    assert!(memory(&rig) == shadow.recorder().memory().concat(), "memory of the board and of this machine");
    let replayed = replayed(&rig);
    let (first, last) = (replayed[0].tick, replayed.last().expect("ticks").tick);
    assert!(error - first >= 2_000 && last == error + 300, "{first} {error} {last}");
    for then in seen.iter().filter(|then| then.tick <= last) {
        let now = replayed.iter().find(|now| now.tick == then.tick).expect("each tick");
        // The comparison excludes `records_lost`, because the serial link sets this value, and not the controller.
        assert_eq!(Telemetry { records_lost: 0, ..*now }, Telemetry { records_lost: 0, ..*then });
    }
}

/// A watchdog reset does not damage the log, and the log remains available after the next start. A host can read the
/// pages of the log, and the pages equal the pages of the shadow controller. The log can be replayed up to the last
/// tick before the reset.
#[test]
fn j56_a_log_outlasts_the_reset_of_a_board_that_hangs() {
    let mut rig = moving();
    let last = rig.telemetry().tick;
    // The test masks the interrupt of TIM7, so no further tick occurs.
    rig.may_hang = true;
    rig.board.machine.write_register(0xE000_E184, 1 << (55 - 32));
    rig.run(30);
    let resets: Vec<_> = rig.board.machine.chip().observers.resets.iter().map(|r| r.cause).collect();
    assert_eq!(resets, [ResetCause::PowerOn, ResetCause::Watchdog]);
    rig.may_hang = false;
    rig.run(100);
    rig.ask(HOST, &fixed::GET_INFO);
    rig.run(60);
    assert_eq!(rig.hosts[1].info.expect("an Info").log, LogState::Reset);
    let shadow = rig.shadow.as_ref().expect("a controller");
    let before = shadow.recorder().memory().concat();
    assert!(memory(&rig) == before, "memory of the board and of this machine");
    let ticks: Vec<u64> = Log::new(&shadow.recorder().blocks().copied().collect::<Vec<_>>())
        .filter_map(|record| match record {
            jtc_core::recorder::Record::Snapshot(snapshot) => Some(snapshot.tick()),
            jtc_core::recorder::Record::Tick { .. } => None,
        })
        .collect();
    assert!(ticks.last().is_some_and(|tick| last - tick <= 500), "{ticks:?} {last}");

    // The host reads a complete block of the log. The test compares each byte with the answers of the shadow
    // controller.
    for offset in (0..BLOCK_BYTES).step_by(232) {
        rig.ask(HOST, &fixed::get_log(0, offset as u16));
        rig.run(60);
    }
    assert!(memory(&rig) == before, "reading changes nothing");
    rig.ask(HOST, &fixed::CLEAR_LOG);
    rig.ask(HOST, &fixed::GET_INFO);
    rig.run(60);
    assert_eq!(rig.hosts[1].info.expect("an Info").log, LogState::Recording);
}
