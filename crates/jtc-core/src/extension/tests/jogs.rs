//! Tests of the acceptance of a Jog, and of the end of a jog (J-53, J-58).
use std::format;

use super::*;
use crate::motion::JOG_LASTS_MS;

/// Returns a controller that holds the arm at rest, with every joint at 0 rad.
fn held() -> Bench {
    let mut bench = Bench::new();
    bench.force(ControllerState::HoldPos);
    bench.controller.motion.set.hold_for_test();
    bench
}

fn jog(bench: &mut Bench, velocity: [f32; JOINTS]) -> DataStatus {
    let bytes: Vec<u8> = velocity.into_iter().flat_map(f32::to_be_bytes).collect();
    bench.at_once(Command::Jog(Floats::new(&bytes)))
}

/// Returns a Jog of the joint with index `joint` alone.
fn alone(joint: usize, velocity: f32) -> [f32; JOINTS] {
    core::array::from_fn(|j| if j == joint { velocity } else { 0.0 })
}

/// Makes joint 1 yield.
fn push(bench: &mut Bench) {
    let config = Config::avena();
    bench.controller.motion.begin_yields(&core::array::from_fn(|j| j == 0), &[false; JOINTS], &config);
}

/// Brings the arm to rest after a hand has moved joint 2 with 0.1 rad/s.
fn lead(bench: &mut Bench) {
    let nodes = Nodes::enabled_at([0.0; JOINTS], [0.0, 0.1, 0.0, 0.0, 0.0, 0.0]);
    bench.controller.motion.set.hold_measured(&nodes, 200.0, &Config::avena());
    assert!(bench.controller.motion.set.is_led());
}

/// Name and function of a change to the controller. The test makes the change before it sends a Jog.
type Change = (&'static str, fn(&mut Bench));

#[test]
fn j58_each_condition_alone_refuses_a_jog() {
    let changes: [Change; 9] = [
        ("the state is Operate", |bench| bench.controller.state = ControllerState::Operate),
        ("the state is Teaching", |bench| bench.controller.state = ControllerState::Teaching),
        ("Teaching was requested", |bench| bench.controller.teaching = true),
        ("a path is paused", |bench| bench.controller.trajectory = TrajectoryState::Pause),
        ("a path is executed", |bench| bench.controller.trajectory = TrajectoryState::Execute),
        ("a payload is blended in", |bench| {
            bench.controller.parameters.change_payload(&Config::avena(), 1.0);
        }),
        ("a stop is held", |bench| bench.controller.errors.hold_joints(&[1, 0, 0, 0, 0, 0], true)),
        ("a joint yields", push),
        ("the safety input stops the arm", |bench| bench.controller.safety_stop_ms = Some(0)),
    ];
    for (name, change) in changes {
        let mut bench = held();
        change(&mut bench);
        assert_eq!(jog(&mut bench, [0.1; JOINTS]), DataStatus::NotAllowed, "{name}");
        assert!(!bench.controller.motion.set.jogging(), "{name}");
    }
    let mut bench = Bench::new();
    bench.force(ControllerState::HoldPos);
    assert_eq!(jog(&mut bench, [0.1; JOINTS]), DataStatus::NotAllowed, "no joint is held");
    for trajectory in [TrajectoryState::Null, TrajectoryState::Stop, TrajectoryState::Finish] {
        let mut bench = held();
        bench.controller.trajectory = trajectory;
        assert_eq!(jog(&mut bench, [0.1; JOINTS]), DataStatus::NoError, "{trajectory:?}");
        assert!(bench.controller.motion.set.jogging(), "{trajectory:?}");
    }
}

/// In a held stop, a Jog with a velocity is refused. The following Jogs are then also refused for 200 ms. This time
/// does not start if a Jog has no velocity, or if it is refused for another reason.
#[test]
fn j58_a_pressed_key_in_a_held_stop_is_refused_for_200_ms_more() {
    for (stop, velocity, refused_ms) in [
        (true, [0.0; JOINTS], 0),
        (true, alone(5, -0.1), 200),
        (true, [0.1; JOINTS], 200),
        (false, [0.1; JOINTS], 0),
    ] {
        let mut bench = held();
        if stop {
            bench.controller.errors.hold_joints(&[1, 0, 0, 0, 0, 0], true);
        } else {
            bench.controller.teaching = true;
        }
        assert_eq!(jog(&mut bench, velocity), DataStatus::NotAllowed, "{stop} {velocity:?}");
        assert_eq!(bench.controller.extensions.jogs_refused_ms, refused_ms, "{stop} {velocity:?}");
    }
    assert_eq!(JOG_LASTS_MS, 200);
}

#[test]
fn j58_a_stop_without_a_jog_does_not_refuse_later_jogs() {
    for (jogs, refused_ms) in [(false, 0), (true, 200)] {
        let mut bench = held();
        if jogs {
            assert_eq!(jog(&mut bench, [0.1; JOINTS]), DataStatus::NoError);
        }
        assert_eq!(bench.controller.stop_jog(), jogs);
        assert_eq!(bench.controller.extensions.jogs_refused_ms, refused_ms, "{jogs}");
    }
}

/// The velocity limit 1.5 rad/s is an f32 number. The limit 0.3 rad/s is not: the nearest f32 number is above 0.3.
#[test]
fn j58_a_jog_may_have_the_velocity_limit() {
    assert!(f64::from(0.3f32) > 0.3);
    for (limit, velocity, expected) in [
        (1.5, 1.5, DataStatus::NoError),
        (1.5, -1.5, DataStatus::NoError),
        (1.5, 1.5f32.next_up(), DataStatus::IncorrectValue),
        (0.3, 0.3f32, DataStatus::NoError),
        (0.3, 0.3f32.next_up(), DataStatus::IncorrectValue),
        (1.5, f32::NAN, DataStatus::IncorrectValue),
    ] {
        let mut bench = held();
        bench.controller.config.joints[0].velocity_max = limit;
        assert_eq!(jog(&mut bench, alone(0, velocity)), expected, "{limit} {velocity}");
    }
}

#[test]
fn j53_a_jog_of_an_absent_joint_is_refused() {
    for (joint, expected) in [(0, DataStatus::NoError), (2, DataStatus::NotAllowed), (5, DataStatus::NoError)]
    {
        let mut bench = held();
        bench.controller.config.absent[2] = true;
        assert_eq!(jog(&mut bench, alone(joint, 0.05)), expected, "{joint}");
    }
}

/// The remaining time in which Jogs are refused is 7 ms. A Jog with a velocity is refused and sets this time to 200
/// ms. A Jog without a velocity is accepted, because it starts no motion.
#[test]
fn j58_a_jog_without_a_velocity_is_accepted_while_jogs_are_refused() {
    for (velocity, expected, refused_ms) in
        [(0.0, DataStatus::NoError, 7), (0.1, DataStatus::NotAllowed, 200)]
    {
        let mut bench = held();
        bench.controller.extensions.jogs_refused_ms = 7;
        assert_eq!(jog(&mut bench, [velocity; JOINTS]), expected, "{velocity}");
        assert_eq!(bench.controller.extensions.jogs_refused_ms, refused_ms, "{velocity}");
        assert!(!bench.controller.motion.set.jogging());
    }
}

/// A Jog without a velocity ends the jog. The acceleration limits of the jog and the inertia of the arm do not
/// change.
#[test]
fn j58_a_jog_without_a_velocity_ends_the_jog() {
    let mut bench = held();
    bench.controller.motion.set.jog(&[0.1; JOINTS], &[1.0; JOINTS], &Config::avena());
    let mut ended = bench.controller.motion.clone();
    assert!(!bench.controller.motion.set.clone().jog_ends());
    assert_eq!(jog(&mut bench, [0.0; JOINTS]), DataStatus::NoError);
    ended.set.end_jog();
    assert_eq!(format!("{:?}", bench.controller.motion), format!("{ended:?}"));
    assert!(bench.controller.motion.set.jog_ends());
}

/// The torque limit of each joint is 0.01 N·m, so no torque remains for a motion. A new jog is refused, and an active
/// jog ends.
#[test]
fn j58_a_jog_for_which_no_torque_remains_is_refused_or_ends() {
    for (jogs, expected) in [(false, DataStatus::NotAllowed), (true, DataStatus::NoError)] {
        let mut bench = held();
        if jogs {
            bench.controller.motion.set.jog(&[0.1; JOINTS], &[1.0; JOINTS], &Config::avena());
        }
        bench.controller.config.joints.iter_mut().for_each(|joint| joint.torque_max = 0.01);
        assert_eq!(jog(&mut bench, [0.1; JOINTS]), expected, "{jogs}");
        assert_eq!(bench.controller.motion.set.jog_ends(), jogs);
    }
}

/// The last torque contains 8 N·m of friction. The start of a jog changes the control mode, so these 8 N·m are
/// blended out. If a jog is already active, a further Jog does not change the mode and blends nothing.
#[test]
fn j44_a_jog_begins_without_a_torque_step() {
    for (jogs, blended) in [(false, 8.0), (true, 0.0)] {
        let mut bench = held();
        // This tick completes the mode change that the start of the controller has prepared.
        bench.controller.control(ControlMode::Hold);
        if jogs {
            bench.controller.motion.set.jog(&[0.1; JOINTS], &[1.0; JOINTS], &Config::avena());
        }
        bench.controller.motion.law.torque[0].friction = 8.0;
        assert_eq!(jog(&mut bench, [0.1; JOINTS]), DataStatus::NoError);
        // In this tick, the set velocity is still zero, so the friction of the new mode is zero.
        bench.controller.control(ControlMode::Approach);
        assert_eq!(bench.controller.motion.law.torque[0].blend, blended, "{jogs}");
    }
}

/// J-04: a Jog that arrived before a Stop or a Pause does not move the arm.
#[test]
fn j04_j58_an_overtaken_jog_does_not_move_the_arm() {
    let mut frame = [0; 30];
    jtc_wire::floats(&mut frame, jtc_wire::FrameType::Jog, [0.1; JOINTS]).expect("it fits");
    for overtaken in [false, true] {
        let mut bench = held();
        let event = LinkEvent::Frame(FrameRef::new_checked(&frame).expect("a good frame"));
        let host = [HostEvent { line: 0, overtaken, plain: false, event }];
        bench.controller.serve_host(&Inputs { host: &host, ..Inputs::QUIET });
        assert_eq!(bench.controller.motion.set.jogging(), !overtaken);
    }
}

/// J-53: live settings that affect the torque are refused while the arm moves or yields.
#[test]
fn j53_an_arm_that_moves_or_yields_does_not_stand() {
    let changes: [Change; 6] = [
        ("a path is executed", |bench| bench.controller.trajectory = TrajectoryState::Execute),
        ("a jog moves the arm", |bench| {
            bench.controller.motion.set.jog(&[0.1; JOINTS], &[1.0; JOINTS], &Config::avena());
        }),
        ("a hand has moved the arm", lead),
        ("a joint yields", push),
        ("the state is Operate", |bench| bench.controller.state = ControllerState::Operate),
        ("the state is Init", |bench| bench.controller.state = ControllerState::Init),
    ];
    for (name, change) in changes {
        let mut bench = held();
        change(&mut bench);
        assert!(!bench.controller.stands(), "{name}");
    }
    let mut bench = held();
    assert!(bench.controller.stands());
    bench.controller.state = ControllerState::Teaching;
    assert!(bench.controller.stands());
}
