//! The flight recorder in whole sessions: what it holds, and that a replay gives the same again (J-56).
use std::collections::HashMap;

use jtc_core::Telemetry;
use jtc_core::recorder::{Block, Log, Outcome, Replay, Unsure};
use jtc_sim::World;
use jtc_sim::soak::Soak;
use jtc_wire::LogState;

/// What became of the ticks of a log.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Counts {
    ticks: u64,
    same: u64,
    input: u64,
    others: u64,
}

fn blocks(world: &World) -> Vec<Block> {
    world.recorder().blocks().copied().collect()
}

/// Replays the log and compares each tick with what was computed then.
fn replay(world: &World, seen: &HashMap<u64, Telemetry>) -> Counts {
    let blocks = blocks(world);
    let controller = world.controller().clone();
    let hash = Some(controller.points_hash());
    let mut counts = Counts::default();
    for step in Replay::new(Log::new(&blocks), controller, hash) {
        counts.ticks += 1;
        let tick = step.telemetry.tick;
        match step.outcome {
            Outcome::Same => {
                counts.same += 1;
                let Some(seen) = seen.get(&tick) else { continue };
                // Records belong to the link.
                let then = Telemetry { records_lost: 0, ..*seen };
                assert_eq!(Telemetry { records_lost: 0, ..step.telemetry }, then, "tick {tick}");
            }
            Outcome::Differs => {
                panic!("tick {tick} differs: {:?}\nthen: {:?}", step.telemetry, seen.get(&tick))
            }
            Outcome::Unsure(Unsure::Input) => counts.input += 1,
            Outcome::Unsure(_) => counts.others += 1,
        }
    }
    counts
}

#[test]
fn j56_random_sessions_with_faults_replay_bit_for_bit() {
    let mut all = Counts::default();
    for seed in 1..=6 {
        let mut soak = Soak::new(seed);
        let mut seen = HashMap::new();
        for ms in 1..=60_000 {
            assert!(soak.run(1));
            let telemetry = *soak.world().telemetry();
            seen.insert(telemetry.tick, telemetry);
            let stopped = soak.world().recorder().state() != LogState::Recording;
            if stopped || ms % 4_700 == 0 {
                let counts = replay(soak.world(), &seen);
                println!("seed {seed}, {ms} ms: {:?} {counts:?}", soak.world().recorder().state());
                all = Counts {
                    ticks: all.ticks + counts.ticks,
                    same: all.same + counts.same,
                    input: all.input + counts.input,
                    others: all.others + counts.others,
                };
                soak.clear_log();
                seen.clear();
            }
        }
    }
    println!("{all:?}");
    assert!(all.same > 100_000, "{all:?}");
}
