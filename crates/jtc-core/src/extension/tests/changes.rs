//! Tests of the effects of accepted settings, and of silent hosts (J-53, J-59, J-60).
use super::*;
use crate::Payload;
use crate::execution::phase::Phase;

fn held() -> Bench {
    let mut bench = Bench::new();
    bench.force(ControllerState::HoldPos);
    bench
}

fn set_all(bench: &mut Bench, values: &[SettingValue]) -> DataStatus {
    let frame = settings_frame(values).expect("it fits");
    let values = Values::parse(&frame[4..frame.len() - 2]).expect("values");
    bench.at_once(Command::SetSettings(values))
}

fn value(setting: u8, joint: u8, value: f64) -> SettingValue {
    SettingValue { setting, joint, value }
}

fn load(mass: f64, com: [f64; 3]) -> Vec<SettingValue> {
    settings::payload_values(&Payload { mass, com, inertia: [0.0; 6] }).collect()
}

/// Executes the slices of a command. Returns the number of slices and the data status.
fn slices(bench: &mut Bench, values: &[SettingValue]) -> (usize, DataStatus) {
    let frame = settings_frame(values).expect("it fits");
    bench.controller.slice_progress = SliceProgress::Begin;
    for slice in 1..100 {
        let values = Values::parse(&frame[4..frame.len() - 2]).expect("values");
        match bench.controller.carry_out_extension(0, Command::SetSettings(values)) {
            SliceOutcome::Done => return (slice, DataStatus::NoError),
            SliceOutcome::Refused(status) => return (slice, status),
            SliceOutcome::Unfinished(next) => bench.controller.slice_progress = next,
        }
    }
    panic!("the frame needs too many slices")
}

#[test]
fn j53_a_standing_arm_accepts_16_values_in_a_frame() {
    for (count, expected) in
        [(4, DataStatus::NoError), (16, DataStatus::NoError), (17, DataStatus::NotAllowed)]
    {
        let values = vec![value(settings::SPEED, 0, 0.5); count];
        assert_eq!(set_all(&mut held(), &values), expected, "{count}");
    }
}

/// The speed override can change in every state, and it does not change the hash of the arm.
#[test]
fn j52_j57_the_speed_does_not_change_the_hash_of_the_arm() {
    for state in [ControllerState::Operate, ControllerState::Init] {
        let mut bench = Bench::new();
        bench.controller.state = state;
        bench.controller.extensions.hash = Some(7);
        assert_eq!(set_all(&mut bench, &[value(settings::SPEED, 0, 0.5)]), DataStatus::NoError);
        assert_eq!((bench.controller.extensions.hash, bench.controller.config.speed), (Some(7), 0.5));
    }
}

/// If the host changes the payload in Init, the controller checks it at once against the torque limits. Other
/// settings, such as gravity, are checked when Init ends.
#[test]
fn j60_only_a_payload_is_checked_against_the_torque_limits() {
    let mut bench = Bench::new();
    assert_eq!(bench.send(1, &fixed::ARM_MODEL_USE_DEFAULT), DataStatus::NoError);
    bench.force(ControllerState::Init);
    bench.controller.config.gravity = [0.0; 3];
    bench.controller.config.joints.iter_mut().for_each(|joint| joint.torque_max = 0.01);
    let config = bench.controller.config.clone();
    bench.controller.parameters.set_gravity(&config);
    let sideways = value(32, 0, 9.81);
    let mut next = config.clone();
    next.gravity[0] = 9.81;
    assert!(!bench.controller.parameters.carries(Some(&[0.0; JOINTS]), &next), "the arm is too heavy");
    assert_eq!(set_all(&mut bench, &[sideways]), DataStatus::NoError);
    // Gravity acts sideways, so the torque limits cannot hold the additional payload at a distance of 1 m. The frame
    // is refused.
    bench.controller.use_settings(config);
    let mut values = load(5.0, [0.0, 0.0, 1.0]);
    values.push(sideways);
    assert_eq!(set_all(&mut bench, &values), DataStatus::IncorrectValue);
}

#[test]
fn j60_settings_with_an_unchanged_payload_do_not_begin_a_blend() {
    let mut bench = held();
    bench.controller.config.payload = Payload { mass: 1.5, com: [0.0; 3], inertia: [0.0; 6] };
    let values = vec![value(settings::SPEED, 0, 0.5); 5];
    assert_eq!(set_all(&mut bench, &values), DataStatus::NoError);
    assert_eq!(bench.controller.parameters.blend_left_ms(), 0);
    // The position of a payload without a mass has no effect.
    let mut bench = held();
    assert_eq!(set_all(&mut bench, &load(0.0, [0.0, 0.1, 0.0])), DataStatus::NoError);
    assert_eq!(bench.controller.parameters.blend_left_ms(), 0);
    assert_eq!(bench.controller.config.payload.com, [0.0, 0.1, 0.0]);
}

/// The blend takes 500 ms, so the first tick adds 1/500 of the difference of the masses.
#[test]
fn j60_the_blend_adds_the_difference_of_the_masses() {
    for (before, after) in [(0.0, 1.5), (1.0, 1.5), (1.5, 0.5), (1.5, 0.0)] {
        let mut bench = held();
        bench.controller.config.payload.mass = before;
        assert_eq!(set_all(&mut bench, &load(after, [0.0; 3])), DataStatus::NoError);
        assert_eq!(bench.controller.parameters.blend_left_ms(), 500);
        assert_eq!(bench.controller.parameters.next_mass(), (after - before) / 500.0, "{before} {after}");
    }
}

/// The controller checks the six friction tables in six slices. If the position range of a joint changes, the sixth
/// slice also computes the inertia in the first of 17 poses. The remaining 16 poses take 16 slices, and the last
/// slice applies the settings.
#[test]
fn j07_j53_tables_are_checked_one_in_each_slice() {
    let mut bench = Bench::new();
    bench.use_defaults();
    assert_eq!(slices(&mut bench, &[value(34, 0, 9.81)]), (1, DataStatus::NoError));
    assert_eq!(bench.send(0, &fixed::FRICTION_TABLE_USE_DEFAULT), DataStatus::NoError);
    assert_eq!(slices(&mut bench, &[value(34, 0, -9.81)]), (6, DataStatus::NoError));
    assert_eq!(slices(&mut bench, &[value(1, 1, -2.5)]), (6 + 16 + 1, DataStatus::NoError));
    assert_eq!(bench.controller.config.joints[0].position_min, -2.5);
}

#[test]
fn j23_the_pump_stops_when_nodes_are_configured_again() {
    for (bits, pump) in [(0x17, true), (0x16, false)] {
        let mut bench = Bench::new();
        bench.controller.pump = true;
        let gravity = [0.0, 0.0, 9.81];
        bench.controller.use_settings(Config { joint_config_bits: bits, gravity, ..Config::avena() });
        assert_eq!(bench.controller.pump, pump, "{bits:#x}");
    }
}

/// A Stop or a Pause on any line shows at once that a host is alive. The frames that arrived before it need not have
/// been processed.
#[test]
fn j59_an_urgent_command_of_any_line_ends_the_silence() {
    for line in [None, Some(0), Some(1)] {
        let mut bench = Bench::new();
        bench.controller.extensions.hosts_silent_ms = 77;
        let mut urgent = [jtc_wire::UrgentCommands::NONE; 2];
        if let Some(line) = line {
            urgent[line].push(UrgentCommand::Stop);
        }
        bench.controller.watch_hosts(&Inputs { urgent, ..Inputs::QUIET }, 0);
        let silent_ms = if line.is_some() { 0 } else { 78 };
        assert_eq!(bench.controller.extensions.hosts_silent_ms, silent_ms, "{line:?}");
    }
}

/// J-33: if the hosts are silent, a path that is executed is paused. A path that is already stopping keeps its Stop,
/// and a path that is not executed does not change.
#[test]
fn j59_silent_hosts_pause_only_a_path_that_is_executed_and_not_stopped() {
    let (pause, stop) = (Some(TrajectoryState::Pause), Some(TrajectoryState::Stop));
    for (trajectory, before, after) in [
        (TrajectoryState::Execute, None, pause),
        (TrajectoryState::Execute, stop, stop),
        (TrajectoryState::Finish, None, None),
        (TrajectoryState::Pause, stop, stop),
    ] {
        let mut bench = Bench::new();
        bench.controller.config.host_timeout_ms = 500;
        bench.controller.extensions.hosts_silent_ms = 499;
        (bench.controller.trajectory, bench.controller.phase) =
            (trajectory, Phase::Running { leave: before });
        bench.controller.watch_hosts(&Inputs::QUIET, 0);
        assert_eq!(bench.controller.phase, Phase::Running { leave: after }, "{trajectory:?} {before:?}");
    }
}
