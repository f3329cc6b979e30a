//! Tests in which answers of one joint are lost repeatedly, but too few consecutive answers for an error (J-14, J-63). The position loop
//! stays closed, and the arm behaves as if no answer were lost.
use crate::{plant, rig};

use jtc_core::{Config, ControllerState, Parameters, TrajectoryState, error};
use jtc_wire::{FrameType, RawPoint};
use plant::{LuGre, Plant, loaded};
use rig::{Rig, pieces};

const JOINT: usize = 1;

/// Pattern of the lost answers of the joint.
#[derive(Clone, Copy, Debug)]
enum Loss {
    /// A good answer, followed by this number of lost answers. The pattern of good and lost answers repeats for ever.
    Periodic(u32),
    /// On average, every second answer is lost at random, with at most four consecutive losses. The contained number is the seed of the
    /// random numbers.
    Random(u32),
}

const LOSSES: [Loss; 7] = [
    Loss::Periodic(1),
    Loss::Periodic(2),
    Loss::Periodic(3),
    Loss::Periodic(4),
    Loss::Random(12345),
    Loss::Random(1),
    Loss::Random(77),
];

impl Loss {
    /// Returns the pattern of the next `ticks` answers. `true` means that the answer is lost.
    fn pattern(self, ticks: u32) -> Vec<bool> {
        match self {
            Self::Periodic(lost) => (0..ticks).map(|k| k % (1 + lost) < lost).collect(),
            Self::Random(mut x) => {
                let mut running = 0;
                (0..ticks)
                    .map(|_| {
                        x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                        let lost = (x >> 8) % 100 < 50 && running < 4;
                        running = if lost { running + 1 } else { 0 };
                        lost
                    })
                    .collect()
            }
        }
    }
}

fn arm(mass: f64, q: [f64; 6]) -> Plant {
    Plant::new(&loaded(Parameters::avena().model, mass), LuGre::of_avena_times(1.0), q)
}

/// Returns a path that accelerates to 0.25 rad/s in 0.2 s, keeps this speed for 2 s, and stops in 0.2 s. The points of this path contain no
/// accelerations, so the position loop must correct an error.
fn path() -> Vec<RawPoint> {
    let points = pieces(JOINT, &[(1.25, 20), (0.0, 200), (-1.25, 20)]);
    points.into_iter().map(|point| RawPoint { acceleration: [0; 6], ..point }).collect()
}

/// Returns the largest error of the true position on the path, rad.
fn on_the_path(lost: &[bool]) -> f64 {
    let mut arm = arm(0.0, [0.0; 6]);
    let mut rig = arm.holding(Config::avena());
    arm.run(&mut rig, 500);
    rig.upload(&path(), 10);
    rig.send(FrameType::TrajSetExecStatus, &[3]);
    let mut worst: f64 = 0.0;
    for (k, &lost) in lost.iter().enumerate() {
        rig.nodes[JOINT].silent = lost;
        arm.tick(&mut rig);
        assert_ne!(rig.state(), ControllerState::Error, "after {k} ms: {:?}", rig.controller.telemetry());
        worst = worst.max((rig.controller.telemetry().joints[JOINT].set_position - arm.q[JOINT]).abs());
    }
    assert_eq!(
        (rig.state(), rig.trajectory()),
        (ControllerState::HoldPos, TrajectoryState::Finish),
        "{:?}",
        rig.controller.telemetry()
    );
    worst
}

/// Holds an arm with an unmodelled load of 1 kg, and pushes the arm with 20 N·m for 100 ms. Returns the distance that the arm moves, rad.
fn pushed(lost: &[bool]) -> f64 {
    let mut arm = arm(1.0, [0.3, 0.8, -0.9, 0.4, 0.7, 0.2]);
    let mut rig = arm.holding(Config::avena());
    arm.run(&mut rig, 2000);
    let from = arm.q[JOINT];
    let mut worst: f64 = 0.0;
    for (k, &lost) in lost.iter().enumerate() {
        arm.push[JOINT] = if (1000..1100).contains(&k) { 20.0 } else { 0.0 };
        rig.nodes[JOINT].silent = lost;
        arm.tick(&mut rig);
        assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0), "after {k} ms");
        worst = worst.max((arm.q[JOINT] - from).abs());
    }
    worst
}

#[test]
fn j63_a_path_is_followed_while_answers_are_lost_for_ever() {
    const TICKS: u32 = 3200;
    let clean = on_the_path(&vec![false; TICKS as usize]);
    for loss in LOSSES {
        let worst = on_the_path(&loss.pattern(TICKS));
        assert!(worst < 1.5 * clean, "{loss:?}: {worst} rad, without loss {clean} rad");
    }
}

#[test]
fn j63_a_push_is_answered_while_answers_are_lost_for_ever() {
    const TICKS: u32 = 6000;
    let clean = pushed(&vec![false; TICKS as usize]);
    for loss in LOSSES {
        let worst = pushed(&loss.pattern(TICKS));
        assert!(worst < 1.5 * clean, "{loss:?}: {worst} rad, without loss {clean} rad");
    }
}

/// Returns the time until the controller detects a joint that is blocked on the path, ms. Also returns the error of the position that the
/// control law used before the detection, rad.
fn blocked(velocity: f64, lost: &[bool]) -> (usize, f64) {
    const FROM: usize = 200;
    let mut rig = Rig::holding();
    rig.move_along(&path(), 600);
    let mut off: f64 = 0.0;
    for (k, &lost) in lost.iter().enumerate() {
        rig.apart[JOINT] = k >= FROM;
        rig.nodes[JOINT].report.velocity = if k >= FROM { 0.0 } else { velocity };
        rig.nodes[JOINT].silent = lost;
        rig.tick();
        if rig.trajectory() != TrajectoryState::Execute {
            return (k - FROM, off);
        }
        let used = rig.controller.telemetry().joints[JOINT].position;
        off = off.max((used - rig.nodes[JOINT].report.position).abs());
    }
    panic!("the block is not seen: {:?}", rig.controller.telemetry());
}

#[test]
fn j66_a_blocked_joint_is_seen_as_early_while_answers_are_lost_for_ever() {
    const TICKS: u32 = 1700;
    let (clean, _) = blocked(0.25, &vec![false; TICKS as usize]);
    for loss in LOSSES {
        let (ms, off) = blocked(0.25, &loss.pattern(TICKS));
        assert!(ms <= clean + 5, "{loss:?}: {ms} ms, without loss {clean} ms");
        assert!(off < 2e-3, "{loss:?}: {off} rad");
    }
}

/// A joint is stuck and does not follow its command, so the controller switches the torque off. If the next answers
/// of the joint are missing, the predicted position must stay at the true position of the joint.
#[test]
fn j63_a_stuck_joint_is_not_predicted_to_move_when_torque_goes() {
    for velocity in [0.25, -0.25] {
        let mut rig = Rig::holding_with(Config { torque_release: true, ..Config::avena() });
        let path: Vec<_> = pieces(JOINT, &[(5.0 * velocity, 20), (0.0, 200), (-5.0 * velocity, 20)]);
        rig.move_along(&path, 600);
        rig.apart[JOINT] = true;
        rig.nodes[JOINT].report.velocity = 0.0;
        rig.until(1_500, |rig| rig.trajectory() != TrajectoryState::Execute);
        assert_eq!(rig.state(), ControllerState::Error);
        let stuck = rig.nodes[JOINT].report.position;
        for k in 1..=4 {
            // In each tick, the test also drops the answer that is still on its way.
            rig.drop_answers(JOINT);
            rig.tick();
            let t = rig.controller.telemetry().joints[JOINT];
            assert!((t.position - stuck).abs() < 1e-4, "{velocity}, {k}: {} rad", t.position - stuck);
            assert!(t.velocity.abs() < 0.02, "{velocity}, {k}: {} rad/s", t.velocity);
        }
    }
}

/// If four of five Moves are not acknowledged, no transmit timeout occurs. If a joint fails during this time, the
/// controller must not predict its motion for longer than usual.
#[test]
fn j63_a_dead_joint_is_not_predicted_longer_while_acknowledges_are_missing() {
    for start in 0..5 {
        for dead in [false, true] {
            let mut rig = Rig::holding();
            rig.run(3);
            let mut seen = None;
            for tick in 0..100 {
                rig.acknowledged = (tick + start) % 5 == 4;
                rig.nodes[JOINT].silent = dead;
                rig.tick();
                if rig.errors() != 0 {
                    seen = Some(tick);
                    break;
                }
            }
            if dead {
                // In the first tick after the failure, the answer to the previous Move still arrives. The next five
                // Moves get no answer, and the error occurs after the fifth of them.
                assert_eq!(seen, Some(5), "{start}");
                assert_eq!(rig.errors(), error::EXTERNAL | error::EXTERNAL_JOINTS);
                assert_eq!(rig.torque, [0.0; 6]);
            } else {
                assert_eq!(seen, None, "{start}");
            }
        }
    }
}
