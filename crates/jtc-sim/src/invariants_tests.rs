//! The checker finds what it is there to find.
use super::*;

/// A controller that behaves, one tick after the other; each test lets it misbehave in one way.
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

    fn tick(&mut self, state: State, tes: Tes) -> Option<Broken> {
        self.telemetry.tick += 1;
        (self.telemetry.state, self.telemetry.tes) = (state, tes);
        let frame = self.request.emit();
        let worked = std::mem::take(&mut self.worked);
        let moment = Moment {
            time_us: 1000 * self.telemetry.tick,
            ticked: true,
            telemetry: &self.telemetry,
            truth: &self.truth,
            sent: Some(&frame),
            worked: &worked,
            safety_output: self.safety_output && state != State::Start,
            torque_max: [80.0; JOINTS],
        };
        self.checker.check_moment(&moment).err().map(|violation| violation.broken)
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
        (State::Init, false),
        (State::HoldPos, true),
        (State::Operate, true),
        (State::Teaching, true),
        (State::Error, false),
    ] {
        let mut script = Script::new();
        script.command(FrameType::TrajSetExecStatus);
        let tes = if state == State::Operate { Tes::Execute } else { Tes::Null };
        if state == State::Teaching {
            script.command(FrameType::TeachingModeEnable);
        }
        script.request = torque(1.0);
        let found = script.tick(state, tes);
        assert_eq!(matches!(found, Some(Broken::Torque { joint: 0, .. })), !powered, "{state:?}: {found:?}");
    }
}

#[test]
fn j43_torque_over_the_limit_is_found() {
    let mut script = Script::new();
    script.request = torque(-80.5);
    assert!(matches!(script.tick(State::HoldPos, Tes::Null), Some(Broken::TorqueLimit { joint: 0, .. })));
}

#[test]
fn j24_leaving_error_or_moving_without_a_command_is_found() {
    let mut script = Script::new();
    assert_eq!(script.tick(State::Error, Tes::Null), None);
    assert_eq!(script.tick(State::Init, Tes::Null), Some(Broken::LeftErrorAlone { to: State::Init }));

    let mut script = Script::new();
    assert_eq!(script.tick(State::Error, Tes::Null), None);
    script.command(FrameType::ClearCurrentErrors);
    assert_eq!(script.tick(State::HoldPos, Tes::Null), None);
    assert_eq!(script.tick(State::HoldPos, Tes::Stop), None);
    assert_eq!(script.tick(State::Operate, Tes::Execute), Some(Broken::ExecutionAlone { to: Tes::Execute }));

    // A command from before the error permits nothing after it.
    let mut script = Script::new();
    script.command(FrameType::TrajSetExecStatus);
    assert_eq!(script.tick(State::HoldPos, Tes::Stop), None);
    assert_eq!(script.tick(State::Error, Tes::Null), None);
    script.command(FrameType::ClearCurrentErrors);
    assert_eq!(script.tick(State::HoldPos, Tes::Stop), None);
    assert!(script.tick(State::Operate, Tes::Execute).is_some());
    assert_eq!(Script::new().tick(State::Teaching, Tes::Null), Some(Broken::TaughtAlone));
}

#[test]
fn j31_an_index_that_goes_back_is_found() {
    let mut script = Script::new();
    script.command(FrameType::TrajSetExecStatus);
    for point in [1, 2, 3] {
        script.telemetry.point = point;
        assert_eq!(script.tick(State::Operate, Tes::Execute), None);
    }
    script.telemetry.point = 2;
    assert_eq!(script.tick(State::Operate, Tes::Execute), Some(Broken::IndexFell { from: 3, to: 2 }));
}

#[test]
fn j12_too_few_moves_and_a_late_zero_are_found() {
    let other = Request::ChangeFsm { target: [Target::Ready; 7] };
    let mut script = Script::new();
    script.request = other;
    assert_eq!(script.tick(State::Init, Tes::Null), None);
    script.request = torque(0.0);
    for _ in 0..2 {
        assert_eq!(script.tick(State::Init, Tes::Null), None);
    }
    script.request = other;
    assert_eq!(script.tick(State::Init, Tes::Null), Some(Broken::NoMove { ticks: 2 }));

    let mut script = Script::new();
    script.tick(State::HoldPos, Tes::Null);
    script.request = other;
    assert_eq!(script.tick(State::Error, Tes::Null), Some(Broken::ErrorWithoutZero));

    let mut script = Script::new();
    script.request = Request::ChangeFsm { target: [Target::Enable; 7] };
    assert!(matches!(script.tick(State::Init, Tes::Null), Some(Broken::Enabled { node: 0, .. })));
}

#[test]
fn nothing_nan_goes_unseen() {
    let mut script = Script::new();
    script.telemetry.joints[4].torque_d = f64::NAN;
    assert_eq!(
        script.tick(State::Init, Tes::Null),
        Some(Broken::NotFinite { what: "part of the torque", joint: 4 })
    );
    let mut script = Script::new();
    script.truth.q[1] = f64::INFINITY;
    assert!(matches!(script.tick(State::Init, Tes::Null), Some(Broken::NotFinite { joint: 1, .. })));
}

#[test]
fn j22_a_wrong_safety_output_is_found() {
    let mut script = Script::new();
    script.telemetry.errors = jtc_core::error::INTERNAL;
    assert!(matches!(script.tick(State::Error, Tes::Null), Some(Broken::SafetyOutput { level: true, .. })));
    let mut script = Script::new();
    script.safety_output = false;
    assert!(matches!(script.tick(State::HoldPos, Tes::Null), Some(Broken::SafetyOutput { .. })));
}
