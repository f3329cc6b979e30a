//! Tests of the flight recorder in whole sessions: its contents, and a replay with identical results (J-56).
use std::collections::HashMap;

use jtc_core::recorder::{Block, Log, Outcome, Record, Replay, SNAPSHOT_MS, Unsure};
use jtc_core::{Controller, POINTS_MAX, Telemetry, TrajectoryState};
use jtc_sim::{Operator, SimConfig, World, host};
use jtc_wire::{ExecCommand, LogState, RawPoint, fixed};
use sim_checks::soak::Soak;

const FROM: [f64; 6] = [0.1, -0.4, 0.9, 0.2, -0.3, 0.5];
const TO: [f64; 6] = [1.1, 0.4, -0.3, 1.2, 0.8, -0.9];

/// Number of ticks in a log, for each result of the replay.
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

/// Replays the log, and compares each tick with the values that the controller computed in the session.
fn replay(world: &World, seen: &HashMap<u64, Telemetry>) -> Counts {
    let blocks = blocks(world);
    // The replay uses only the settings and the trajectory points of the session's controller. All other data are in
    // the snapshots of the log.
    let then = world.controller();
    let mut controller = Controller::new(then.config().clone(), vec![RawPoint::default(); POINTS_MAX]);
    controller.put_points(0, then.points());
    let hash = Some(then.points_hash());
    let mut counts = Counts::default();
    for step in Replay::new(Log::new(&blocks), controller, hash) {
        counts.ticks += 1;
        let tick = step.telemetry.tick;
        match step.outcome {
            Outcome::Same => {
                counts.same += 1;
                let Some(seen) = seen.get(&tick) else { continue };
                // `records_lost` is not compared, because the host link sets this value.
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

/// Returns a controller that holds the arm, with a trajectory in memory.
fn loaded() -> Operator {
    let config = SimConfig { start: FROM, baud: None, ..SimConfig::default() };
    let mut operator = Operator::new(config);
    operator.bring_up().unwrap();
    operator.upload(&host::there_and_back(&FROM, &TO, 3.0, 1, 10), 10).unwrap();
    operator
}

/// Executes the trajectory and returns the telemetry of each tick. `sends` returns the bytes that a host sends in a
/// tick.
fn run(sends: impl Fn(u32) -> Vec<u8>) -> (Operator, Vec<Telemetry>) {
    let mut operator = loaded();
    operator.ask(&host::exec(ExecCommand::Execute)).unwrap();
    let mut all = Vec::new();
    for ms in 0..8_000 {
        operator.world.host_write(&sends(ms));
        operator.step();
        all.push(Telemetry { records_lost: 0, ..*operator.world.telemetry() });
    }
    assert_eq!(operator.world.telemetry().trajectory, TrajectoryState::Finish);
    (operator, all)
}

#[test]
fn j56_a_host_that_reads_the_log_changes_nothing_of_a_motion() {
    let (_, undisturbed) = run(|_| Vec::new());
    // The host requests page after page, as fast as the answers arrive.
    let (_, read) =
        run(
            |ms| {
                if ms % 3 == 0 { fixed::get_log(0, (232 * (ms / 3 % 5)) as u16).to_vec() } else { Vec::new() }
            },
        );
    assert!(undisturbed == read, "a torque differs");
}

/// Even with more traffic than the controller can execute, the recorder must keep at least two seconds before an
/// error, and the time after it.
///
/// The ticks before the first complete snapshot in the log are lost. Their number varies, so the test reads the log
/// every 10 ms during one snapshot interval.
#[test]
fn j56_two_seconds_are_kept_under_the_busiest_traffic() {
    let mut operator = loaded();
    operator.ask(&host::exec(ExecCommand::Execute)).unwrap();
    let mut least = usize::MAX;
    for ms in 0..3_500 + u32::from(SNAPSHOT_MS) {
        // In each tick, the host sends many short frames, which are executed quickly. The host also sends a parameter
        // frame, which makes the recorder store a new snapshot.
        for n in 0..12 {
            operator.world.host_write(&fixed::gripper_control((ms + n) % 2 == 0));
        }
        operator.world.host_write(&fixed::GET_INFO);
        operator.world.host_write(&fixed::PID_PARAM_USE_DEFAULT);
        operator.step();
        if ms >= 3_500 && ms % 10 == 0 {
            least = least.min(ticks(&blocks(&operator.world)));
        }
    }
    println!("{least} ticks");
    assert!(least >= 2_300, "{least} ticks");
}

/// Returns the number of ticks in these blocks.
fn ticks(blocks: &[Block]) -> usize {
    Log::new(blocks).filter(|record| matches!(record, Record::Tick { .. })).count()
}

/// With a changed point of the trajectory, the replay must be equal up to that point and differ after it.
#[test]
fn j56_the_first_tick_that_differs_is_named() {
    const POINT: usize = 120;
    let mut operator = loaded();
    operator.world.clear_log();
    operator.ask(&host::exec(ExecCommand::Execute)).unwrap();
    operator.run(2_500);
    let mut seen = HashMap::new();
    let blocks = blocks(&operator.world);
    let mut controller = operator.world.controller().clone();
    let hash = Some(controller.points_hash());
    for step in Replay::new(Log::new(&blocks), controller.clone(), hash) {
        assert_eq!(step.outcome, Outcome::Same, "tick {}", step.telemetry.tick);
        seen.insert(step.telemetry.point, step.telemetry.tick);
    }
    let mut points = host::there_and_back(&FROM, &TO, 3.0, 1, 10);
    points[POINT].velocity[1] += 40;
    controller.put_points(POINT, &points[POINT..=POINT]);
    let differs = Replay::new(Log::new(&blocks), controller, hash)
        .find(|step| step.outcome == Outcome::Differs)
        .expect("a tick differs");
    // A changed point already affects the motion from the previous point on. The torque on the bus must differ at
    // most 8 ticks later.
    let acts = seen[&(10 * (POINT as u32 - 1))];
    let tick = differs.telemetry.tick;
    assert!((acts..=acts + 8).contains(&tick), "{tick}, where it acts from {acts} on");
}
