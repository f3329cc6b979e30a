//! Tests of joints that move above their velocity limit, with or without a command (J-35). Also tests limits that the drives do not support
//! (J-35, J-43).
use crate::rig;

use jtc_core::{Config, ConfigError, ControllerState, joint_error};
use jtc_wire::FrameType;
use rig::{Rig, rest};

/// Returns three rigs, one in each state with torque.
fn powered() -> [Rig; 3] {
    let holding = Rig::holding();
    let mut operating = Rig::holding();
    operating.execute(&[rest(0); 200]);
    operating.run(300);
    assert_eq!(operating.state(), ControllerState::Operate);
    let mut teaching = Rig::holding();
    teaching.ask(FrameType::TeachingModeEnable, &[]);
    teaching.run(150);
    assert_eq!(teaching.state(), ControllerState::Teaching);
    [holding, operating, teaching]
}

#[test]
fn j35_a_joint_above_its_speed_for_5_ms_is_an_error_in_every_state_with_torque() {
    for speed in [-1.85, 1.85] {
        for mut rig in powered() {
            rig.nodes[3].report.velocity = speed;
            // The controller receives the speed one tick later. Therefore only four of these five ticks have a speed above the threshold.
            rig.run(5);
            assert_eq!(rig.errors(), 0, "{:?}", rig.state());
            rig.run(1);
            assert_eq!((rig.state(), rig.torque), (ControllerState::Error, [0.0; 6]));
            assert_eq!(rig.status().joints[3].internal, joint_error::VELOCITY);
        }
    }
}

#[test]
fn j35_a_glitch_or_a_speed_within_the_limit_is_no_error() {
    for mut rig in powered() {
        for _ in 0..20 {
            rig.nodes[3].report.velocity = 1.9;
            rig.run(4);
            rig.nodes[3].report.velocity = 1.75;
            rig.run(1);
        }
        rig.nodes[3].report.velocity = -1.79;
        rig.run(100);
        assert_eq!(rig.errors(), 0, "{:?}", rig.state());
    }
}

#[test]
fn j35_answers_that_are_missing_neither_count_nor_excuse() {
    let mut config = Config { overspeed_ms: 3, ..Config::avena() };
    // While answers are missing, the controller counteracts the predicted motion, which needs torque. The torque
    // limit is very high, because an overload is not a subject of this test.
    config.joints[3].torque_max = 1e6;
    let mut rig = Rig::holding_with(config);
    rig.nodes[3].report.velocity = 1.9;
    rig.run(1);
    rig.nodes[3].silent = true;
    rig.run(2);
    rig.nodes[3].report.velocity = 0.0;
    rig.nodes[3].silent = false;
    rig.run(50);
    assert_eq!(rig.errors(), 0, "one measurement, seen for three ticks");
    rig.nodes[3].report.velocity = 1.9;
    for _ in 0..3 {
        rig.nodes[3].silent = true;
        rig.run(1);
        assert_eq!(rig.errors(), 0);
        rig.nodes[3].silent = false;
        rig.run(1);
    }
    rig.run(1);
    assert_eq!(rig.state(), ControllerState::Error);
    assert_eq!(rig.status().joints[3].internal, joint_error::VELOCITY);
}

#[test]
fn j35_a_joint_that_is_not_enabled_may_move() {
    let mut rig = Rig::with_a_slow_drive(Config::avena());
    rig.run(30);
    rig.nodes[2].report.velocity = 1.9;
    rig.run(100);
    assert_eq!(rig.errors(), 0);
}

#[test]
fn j35_an_arm_that_is_faster_than_its_drives_can_report_or_do_is_refused() {
    let mut config = Config::avena();
    assert_eq!(config.check(), Ok(()));
    config.joints[2].velocity_max = 1.6;
    let trip = ConfigError::SpeedTrip { joint: 3, value: 1.2 * 1.6, limit: 1.8 };
    assert_eq!(config.check(), Err(trip));
    assert!(trip.to_string().contains("joint 3") && trip.to_string().contains("1.920"), "{trip}");
    // If the speed trip of the drives is switched off, the over-speed threshold may be as high as the full scale of the reported velocity.
    config.joint_config_bits = 0x07;
    assert_eq!(config.check(), Ok(()));
    config.joints[2].velocity_max = 1.7;
    assert!(matches!(config.check(), Err(ConfigError::SpeedScale { joint: 3, .. })));
    config.velocity_full_scale = 6.283185;
    assert_eq!(config.check(), Ok(()));
    config.joints[2].velocity_max = f64::NAN;
    assert!(config.check().is_err());
}

#[test]
fn j43_position_limits_outside_the_working_area_are_refused() {
    for (min, max, value) in [(-3.05, 1.0, -3.05), (-1.0, 2.991, 2.991)] {
        let mut config = Config::avena();
        (config.joints[5].position_min, config.joints[5].position_max) = (min, max);
        let error = ConfigError::Position { joint: 6, value, limit: 2.9905 };
        assert_eq!(config.check(), Err(error));
        assert!(error.to_string().contains("joint 6"), "{error}");
        // If the drives do not keep to a working area, the limits of this area do not apply.
        config.joint_config_bits &= !0x01;
        assert_eq!(config.check(), Ok(()));
    }
}
