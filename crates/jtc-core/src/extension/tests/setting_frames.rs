//! Tests of reading and changing settings, and of the states in which settings may change (J-53).
use super::*;

#[test]
fn j53_settings_are_read_page_by_page() {
    let mut bench = Bench::new();
    let mut values = Vec::new();
    while values.len() < settings::count(false) {
        bench.send(1, &fixed::get_settings(values.len() as u16));
        let (line, bytes) = bench.answers.pop().expect("an answer");
        let frame = FrameRef::new_checked(&bytes).expect("a good frame");
        let Some(Answer::Settings { first, total, values: page }) = Answer::parse(frame) else {
            panic!("no Settings")
        };
        assert_eq!((line, usize::from(first), usize::from(total)), (1, values.len(), settings::count(false)));
        values.extend(page.iter());
    }
    assert_eq!(values, settings::values(&Config::avena(), 0, false).collect::<Vec<_>>());
}

#[test]
fn j53_settings_change_whole_and_without_torque_only() {
    let mut bench = Bench::new();
    bench.info(0);
    let good = SettingValue { setting: 34, joint: 0, value: 9.81 };
    let bad = SettingValue { setting: 3, joint: 2, value: -1.0 };
    let both = settings_frame(&[good, bad]).expect("it fits");
    assert_eq!(bench.send(0, &both), DataStatus::IncorrectValue);
    assert_eq!(bench.controller.config(), &Config::avena(), "nothing is half changed");
    for (state, taken) in [
        (ControllerState::Init, true),
        (ControllerState::Error, true),
        (ControllerState::HoldPos, false),
        (ControllerState::Teaching, false),
        (ControllerState::Operate, false),
    ] {
        let expected = if taken { DataStatus::NoError } else { DataStatus::NotAllowed };
        bench.controller.state = state;
        let frame = settings_frame(&[good]).expect("it fits");
        let values = Values::parse(&frame[4..frame.len() - 2]).expect("values");
        assert_eq!(bench.at_once(Command::SetSettings(values)), expected, "{state:?}");
        assert_eq!(bench.controller.config.gravity[2], if taken { 9.81 } else { -9.81 });
        // The speed override can change in every state.
        let frame = settings_frame(&[SettingValue { setting: 128, joint: 0, value: 0.5 }]).expect("it fits");
        let values = Values::parse(&frame[4..frame.len() - 2]).expect("values");
        assert_eq!(bench.at_once(Command::SetSettings(values)), DataStatus::NoError, "{state:?}");
        let name = Command::SetName(Name::default());
        assert_eq!(bench.at_once(name), expected, "{state:?}");
        bench.controller.use_settings(Config::avena());
    }
}

/// After the change, the model torque uses the new gravity.
#[test]
fn j53_gravity_that_is_set_is_computed_with() {
    let mut bench = Bench::new();
    bench.use_defaults();
    let at = [0.0, 0.7, 0.3, 0.0, 0.2, 0.0];
    let before = bench.controller.parameters.dynamics.gravity_torque(&at);
    assert_eq!(bench.set(34, 0, 9.81), DataStatus::NoError);
    let after = bench.controller.parameters.dynamics.gravity_torque(&at);
    assert!(before.iter().zip(after).all(|(b, a)| (b + a).abs() < 1e-9) && before[1].abs() > 10.0);
}

/// The controller refuses settings if the parameters that it received before are not valid with these settings.
#[test]
fn j53_settings_that_the_parameters_contradict_are_refused() {
    for (setting, value) in [(96, 7_000.0), (101, 0.5), (103, 0.001)] {
        let mut bench = Bench::new();
        assert_eq!(bench.set(setting, 0, value), DataStatus::NoError, "nothing was received yet");
        let mut bench = Bench::new();
        bench.use_defaults();
        assert_eq!(bench.set(setting, 0, value), DataStatus::IncorrectValue, "{setting}");
    }
    // The controller also refuses parameters that are not valid with the settings that it received before.
    let mut bench = Bench::new();
    bench.set(96, 0, 7_000.0);
    assert_eq!(bench.send(0, &fixed::PID_PARAM_USE_DEFAULT), DataStatus::IncorrectValue);
}

/// New settings are checked against the received parameters, even if Disable has withdrawn these parameters.
#[test]
fn j53_settings_fit_to_what_disable_has_withdrawn() {
    let mut bench = Bench::new();
    bench.use_defaults();
    bench.controller.parameters.withdraw_all();
    assert_eq!(bench.set(96, 0, 7_000.0), DataStatus::IncorrectValue);
    // Friction tables are also checked against new settings, one table per tick.
    let mut bench = Bench::new();
    bench.use_defaults();
    bench.send(0, &fixed::FRICTION_TABLE_USE_DEFAULT);
    assert_eq!(bench.set(103, 0, 0.001), DataStatus::IncorrectValue);
    let before = bench.controller.telemetry().tick;
    assert_eq!(bench.set(34, 0, 9.81), DataStatus::NoError);
    assert!(bench.controller.telemetry().tick - before >= 6);
}

/// During a motion, the controller accepts only a few values per frame.
#[test]
fn j07_j53_settings_in_motion_are_few() {
    let value = SettingValue { setting: settings::SPEED, joint: 0, value: 0.5 };
    for (count, taken) in [(1, true), (LIVE_MAX, true), (LIVE_MAX + 1, false), (200, false)] {
        let mut bench = Bench::new();
        bench.controller.state = ControllerState::Operate;
        let frame = settings_frame(&vec![value; count]).expect("it fits");
        let values = Values::parse(&frame[4..frame.len() - 2]).expect("values");
        let outcome = bench.at_once(Command::SetSettings(values));
        assert_eq!(outcome, if taken { DataStatus::NoError } else { DataStatus::NotAllowed }, "{count}");
    }
}

/// A payload is accepted in every state in which the arm is at rest. A frame that also contains a setting of the arm
/// is accepted only in a state in which this setting may change. The speed override may change together with the
/// payload.
#[test]
fn j53_j60_a_payload_is_set_wherever_the_arm_stands() {
    for (state, stands, bare) in [
        (ControllerState::Init, true, true),
        (ControllerState::Error, true, true),
        (ControllerState::HoldPos, true, false),
        (ControllerState::Teaching, true, false),
        (ControllerState::Operate, false, false),
    ] {
        let mut bench = Bench::new();
        bench.controller.state = state;
        let taken = |yes| if yes { DataStatus::NoError } else { DataStatus::NotAllowed };
        let mut set = |more: &[(u8, f64)]| {
            let payload =
                crate::Payload { mass: 1.5, com: [0.0, 0.1, 0.2], inertia: [0.1, 0.0, 0.0, 0.1, 0.0, 0.1] };
            let more = more.iter().map(|&(setting, value)| SettingValue { setting, joint: 0, value });
            let list: Vec<_> = settings::payload_values(&payload).chain(more).collect();
            let frame = settings_frame(&list).expect("it fits");
            let values = Values::parse(&frame[4..frame.len() - 2]).expect("values");
            let status = bench.at_once(Command::SetSettings(values));
            let config = bench.controller.config();
            assert_eq!(config.payload == payload, status == DataStatus::NoError, "{state:?}");
            (status, config.speed, config.gravity[2])
        };
        assert_eq!(set(&[(34, 9.0)]), (taken(bare), 1.0, if bare { 9.0 } else { -9.81 }), "{state:?}");
        let gravity = if bare { 9.0 } else { -9.81 };
        if stands {
            assert_eq!(set(&[(settings::SPEED, 0.5)]), (taken(true), 0.5, gravity), "{state:?}");
        } else {
            assert_eq!(set(&[]), (taken(false), 1.0, gravity), "{state:?}");
        }
    }
}

#[test]
fn j33_settings_under_which_stops_fail_are_refused() {
    let mut bench = Bench::new();
    bench.info(0);
    for (setting, value, taken) in [(53, 501.0, false), (54, 999.0, false), (54, 1000.0, true)] {
        let expected = if taken { DataStatus::NoError } else { DataStatus::IncorrectValue };
        assert_eq!(bench.set(setting, 0, value), expected, "{setting} = {value}");
        bench.controller.use_settings(Config::avena());
    }
}
