//! Tests that the checker finds violations of each kind.
use jtc_core::{Config, Telemetry};

use super::*;
use jtc_sim::Truth;

/// Controller that behaves correctly, one tick per call; each test adds one violation.
struct Script {
    checker: Invariants,
    telemetry: Telemetry,
    truth: Truth,
    request: Request,
    worked: Vec<Worked>,
    safety_output: bool,
}

impl Script {
    fn new() -> Self {
        Self {
            checker: Invariants::default(),
            telemetry: Telemetry::default(),
            truth: Truth::default(),
            request: Request::zero_torque(false),
            worked: Vec::new(),
            safety_output: true,
        }
    }

    fn tick(&mut self, state: ControllerState, trajectory: TrajectoryState) -> Option<Broken> {
        self.telemetry.tick += 1;
        (self.telemetry.state, self.telemetry.trajectory) = (state, trajectory);
        let config = Config::avena();
        let frame = self.request.emit();
        let worked = std::mem::take(&mut self.worked);
        let moment = Moment {
            time_us: 1000 * self.telemetry.tick,
            ticked: true,
            telemetry: &self.telemetry,
            truth: &self.truth,
            sent: Some(&frame),
            worked: &worked,
            safety_output: self.safety_output && state != ControllerState::Start,
            config: &config,
        };
        self.checker.check_moment(&moment).err().map(|violation| violation.broken)
    }

    fn exec(&mut self, command: ExecCommand) {
        self.worked.push(Worked::Exec(command as u8));
    }

    fn command(&mut self, frame_type: FrameType) {
        self.worked.push(Worked::Frame(frame_type as u8));
    }
}

fn torque(first: f64) -> Request {
    Request::Move { torque: [first, 0.0, 0.0, 0.0, 0.0, 0.0], pump: false }
}

#[test]
fn j21_torque_outside_the_powered_states_is_found() {
    for (state, powered) in [
        (ControllerState::Init, false),
        (ControllerState::HoldPos, true),
        (ControllerState::Operate, true),
        (ControllerState::Teaching, true),
        (ControllerState::Error, false),
    ] {
        let mut script = Script::new();
        script.exec(ExecCommand::Execute);
        let trajectory =
            if state == ControllerState::Operate { TrajectoryState::Execute } else { TrajectoryState::Null };
        if state == ControllerState::Teaching {
            script.command(FrameType::TeachingModeEnable);
        }
        script.request = torque(1.0);
        let found = script.tick(state, trajectory);
        assert_eq!(
            matches!(found, Some(Broken::Torque { joint, .. }) if joint == Joint::ALL[0]),
            !powered,
            "{state:?}: {found:?}"
        );
    }
}

#[test]
fn j43_torque_over_the_limit_is_found() {
    let mut script = Script::new();
    script.request = torque(-80.5);
    assert!(matches!(
        script.tick(ControllerState::HoldPos, TrajectoryState::Null),
        Some(Broken::TorqueLimit { joint, .. }) if joint == Joint::ALL[0]
    ));
}

#[test]
fn j24_leaving_error_or_moving_without_a_command_is_found() {
    let mut script = Script::new();
    assert_eq!(script.tick(ControllerState::Error, TrajectoryState::Null), None);
    assert_eq!(
        script.tick(ControllerState::Init, TrajectoryState::Null),
        Some(Broken::LeftErrorAlone { to: ControllerState::Init })
    );

    let mut script = Script::new();
    assert_eq!(script.tick(ControllerState::Error, TrajectoryState::Null), None);
    script.command(FrameType::ClearCurrentErrors);
    assert_eq!(script.tick(ControllerState::HoldPos, TrajectoryState::Null), None);
    assert_eq!(script.tick(ControllerState::HoldPos, TrajectoryState::Stop), None);
    assert_eq!(
        script.tick(ControllerState::Operate, TrajectoryState::Execute),
        Some(Broken::ExecutionAlone { to: TrajectoryState::Execute })
    );

    // An Execute that was sent before the error must not start a motion after the error.
    let mut script = Script::new();
    script.exec(ExecCommand::Execute);
    assert_eq!(script.tick(ControllerState::HoldPos, TrajectoryState::Stop), None);
    assert_eq!(script.tick(ControllerState::Error, TrajectoryState::Null), None);
    script.command(FrameType::ClearCurrentErrors);
    assert_eq!(script.tick(ControllerState::HoldPos, TrajectoryState::Stop), None);
    assert!(script.tick(ControllerState::Operate, TrajectoryState::Execute).is_some());
    assert_eq!(
        Script::new().tick(ControllerState::Teaching, TrajectoryState::Null),
        Some(Broken::TaughtAlone)
    );
}

#[test]
fn j31_an_index_that_goes_back_is_found() {
    let mut script = Script::new();
    script.exec(ExecCommand::Execute);
    for point in [1, 2, 3] {
        script.telemetry.point = point;
        assert_eq!(script.tick(ControllerState::Operate, TrajectoryState::Execute), None);
    }
    script.telemetry.point = 2;
    assert_eq!(
        script.tick(ControllerState::Operate, TrajectoryState::Execute),
        Some(Broken::IndexFell { from: 3, to: 2 })
    );
}

#[test]
fn j12_too_few_moves_and_a_late_zero_are_found() {
    let other = Request::ChangeFsm { target: [Target::Ready; 7] };
    let mut script = Script::new();
    script.request = other;
    assert_eq!(script.tick(ControllerState::Init, TrajectoryState::Null), None);
    script.request = torque(0.0);
    for _ in 0..2 {
        assert_eq!(script.tick(ControllerState::Init, TrajectoryState::Null), None);
    }
    script.request = other;
    assert_eq!(script.tick(ControllerState::Init, TrajectoryState::Null), Some(Broken::NoMove { ticks: 2 }));

    let mut script = Script::new();
    script.tick(ControllerState::HoldPos, TrajectoryState::Null);
    script.request = other;
    assert_eq!(script.tick(ControllerState::Error, TrajectoryState::Null), Some(Broken::ErrorWithoutZero));

    let mut script = Script::new();
    script.request = Request::ChangeFsm { target: [Target::Enable; 7] };
    assert!(matches!(
        script.tick(ControllerState::Init, TrajectoryState::Null),
        Some(Broken::Enabled { node: 0, .. })
    ));
}

#[test]
fn nothing_nan_goes_unseen() {
    let mut script = Script::new();
    script.telemetry.joints[4].torque_d = f64::NAN;
    assert_eq!(
        script.tick(ControllerState::Init, TrajectoryState::Null),
        Some(Broken::NotFinite { what: "part of the torque", joint: Joint::ALL[4] })
    );
    let mut script = Script::new();
    script.truth.q[1] = f64::INFINITY;
    assert!(matches!(
        script.tick(ControllerState::Init, TrajectoryState::Null),
        Some(Broken::NotFinite { joint, .. }) if joint == Joint::ALL[1]
    ));
}

#[test]
fn j22_a_wrong_safety_output_is_found() {
    let mut script = Script::new();
    script.telemetry.errors = jtc_core::error::INTERNAL;
    assert!(matches!(
        script.tick(ControllerState::Error, TrajectoryState::Null),
        Some(Broken::SafetyOutput { level: true, .. })
    ));
    let mut script = Script::new();
    script.safety_output = false;
    assert!(matches!(
        script.tick(ControllerState::HoldPos, TrajectoryState::Null),
        Some(Broken::SafetyOutput { .. })
    ));
}

/// Returns a joint that moves on the path at this speed. The Stop is executed in the next tick.
fn stopped_at(speed: f64) -> Script {
    let mut script = Script::new();
    script.exec(ExecCommand::Execute);
    script.truth.qd[2] = speed;
    assert_eq!(script.tick(ControllerState::Operate, TrajectoryState::Execute), None);
    script.exec(ExecCommand::Stop);
    script
}

#[test]
fn j33_a_stop_that_takes_too_long_is_found() {
    // In the first case, the set values do not come to rest. In the second case, the set values have stopped, but the
    // arm does not. The checker must find both.
    for (state, trajectory) in [
        (ControllerState::Operate, TrajectoryState::Execute),
        (ControllerState::HoldPos, TrajectoryState::Stop),
    ] {
        let mut script = stopped_at(0.3);
        let found = (0..600).find_map(|ms| script.tick(state, trajectory).map(|broken| (ms, broken)));
        assert_eq!(found, Some((521, Broken::NoStop { ticks: 521 })), "{trajectory:?}");
    }
    // A stop acts before the controller executes its frame (J-04), so the checker has not seen the command yet. The
    // time of the stop then begins when the controller brakes.
    let mut script = stopped_at(0.3);
    script.worked.clear();
    script.telemetry.braking = true;
    assert!((0..600).any(|_| script.tick(ControllerState::Operate, TrajectoryState::Execute).is_some()));
}

#[test]
fn j33_a_stop_against_a_push_has_the_time_that_braking_may_take() {
    let found = |push: f64, torque: f64, (state, trajectory): (ControllerState, TrajectoryState)| {
        let mut script = stopped_at(0.3);
        script.truth.outside[2] = push;
        script.telemetry.joints[2].torque = torque;
        script.telemetry.braking = true;
        (0..1_100).find(|_| script.tick(state, trajectory).is_some())
    };
    let limit = Config::avena().joints[2].torque_max;
    let (path, held) = (
        (ControllerState::Operate, TrajectoryState::Execute),
        (ControllerState::HoldPos, TrajectoryState::Stop),
    );
    for place in [path, held] {
        assert_eq!(found(0.0, limit, place), Some(521), "no push");
        assert_eq!(found(50.0, limit - 1.0, place), Some(521), "a push that leaves torque to brake with");
    }
    assert_eq!(found(50.0, -limit, path), Some(1_021));
    assert_eq!(found(50.0, -limit, held), None, "what moves then is held by the other limits");
}

#[test]
fn j33_a_stop_that_ends_is_none_and_an_error_ends_it() {
    let mut script = stopped_at(0.3);
    assert!((0..500).all(|_| script.tick(ControllerState::Operate, TrajectoryState::Execute).is_none()));
    script.truth.qd[2] = 0.0;
    assert_eq!(script.tick(ControllerState::HoldPos, TrajectoryState::Stop), None);
    script.truth.qd[2] = 0.3;
    assert!(
        (0..600).all(|_| script.tick(ControllerState::HoldPos, TrajectoryState::Stop).is_none()),
        "pushed, later"
    );

    let mut script = stopped_at(0.3);
    assert!((0..600).all(|_| script.tick(ControllerState::Error, TrajectoryState::Null).is_none()));
    // If no stop was commanded, the arm may move without a time limit.
    let mut script = stopped_at(0.3);
    script.worked.clear();
    assert!((0..600).all(|_| script.tick(ControllerState::Operate, TrajectoryState::Execute).is_none()));
}

#[test]
fn j35_a_joint_that_races_is_found() {
    let limit = 1.2 * Config::avena().joints[3].velocity_max;
    let fast = || {
        let mut script = Script::new();
        let joint = &mut script.telemetry.joints[3];
        (joint.state, joint.fresh, joint.velocity) = (jtc_bus::NodeState::ENABLED, true, -1.01 * limit);
        script
    };
    let mut script = fast();
    let found = (1..=10).find_map(|ms| {
        script.tick(ControllerState::HoldPos, TrajectoryState::Null).map(|broken| (ms, broken))
    });
    assert_eq!(found, Some((6, Broken::Speed { joint: Joint::ALL[3], velocity: -1.01 * limit, ticks: 6 })));
    // A predicted velocity must neither increase nor reset the counted ticks.
    let mut script = fast();
    assert!((0..5).all(|_| script.tick(ControllerState::HoldPos, TrajectoryState::Null).is_none()));
    script.telemetry.joints[3].fresh = false;
    assert!((0..4).all(|_| script.tick(ControllerState::HoldPos, TrajectoryState::Null).is_none()));
    script.telemetry.joints[3].fresh = true;
    assert!(script.tick(ControllerState::HoldPos, TrajectoryState::Null).is_some());
    // A fast motion is not a violation if the joint has no torque, or if its speed is below the limit.
    let mut script = fast();
    assert!((0..10).all(|_| script.tick(ControllerState::Error, TrajectoryState::Null).is_none()));
    let mut script = fast();
    script.telemetry.joints[3].velocity = 0.99 * limit;
    assert!((0..10).all(|_| script.tick(ControllerState::HoldPos, TrajectoryState::Null).is_none()));
}

#[test]
fn j43_torque_that_stays_at_its_limit_is_found() {
    let limit = Config::avena().joints[0].torque_max;
    // If the torque is at its limit in every ninth tick, this is a violation. Every tenth tick is permitted.
    for (period, allowed) in [(9, false), (10, true)] {
        let mut script = Script::new();
        let mut good = true;
        for ms in 0..400 {
            script.telemetry.joints[0].torque = if ms % period == 0 { -limit } else { 0.0 };
            good &= script.tick(ControllerState::HoldPos, TrajectoryState::Null).is_none();
        }
        assert_eq!(good, allowed, "one tick of {period}");
    }
    let mut script = Script::new();
    script.telemetry.joints[0].torque = limit;
    script.telemetry.braking = true;
    assert!(
        (0..400).all(|_| script.tick(ControllerState::HoldPos, TrajectoryState::Null).is_none()),
        "braking"
    );
    script.telemetry.braking = false;
    let found = (1..=20).find_map(|ms| {
        script.tick(ControllerState::HoldPos, TrajectoryState::Null).map(|broken| (ms, broken))
    });
    assert_eq!(found, Some((11, Broken::Saturated { joint: Joint::ALL[0], ticks: 11 })));
    // A joint that was just enabled may have its torque at the limit for one second, to catch its load. In Teaching
    // it has no such time.
    for (state, last) in [(ControllerState::HoldPos, 1_000), (ControllerState::Teaching, 0)] {
        let mut script = Script::new();
        script.telemetry.joints[0].torque = limit;
        script.telemetry.joints[0].state = jtc_bus::NodeState::ENABLED;
        script.command(FrameType::TeachingModeEnable);
        let found = (1..=2_000).find(|_| script.tick(state, TrajectoryState::Null).is_some());
        assert_eq!(found, Some(last + 11), "{state:?}");
    }
}

#[test]
fn what_is_found_names_joints_from_1() {
    for (broken, words) in [
        (
            Broken::Speed { joint: Joint::ALL[3], velocity: -1.9, ticks: 6 },
            "joint 4 has been too fast for 6 ms",
        ),
        (Broken::Enabled { state: ControllerState::Init, node: 0 }, "joint 1 is to be enabled in Init"),
        (Broken::Enabled { state: ControllerState::Init, node: 6 }, "the gripper is to be enabled in Init"),
    ] {
        let shown = Violation { time_us: 1_500_000, broken }.to_string();
        assert!(shown.starts_with("at 1.500 s: ") && shown.contains(words), "{shown}");
    }
}
