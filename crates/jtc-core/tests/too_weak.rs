//! Tests of an arm in a pose in which its torque limits cannot hold it (J-06, J-20, J-43).
use crate::rig;

use jtc_core::{Config, ControllerState, Parameters, joint_error};
use jtc_dynamics::Dynamics;
use jtc_wire::{DataStatus, FrameType};
use rig::Rig;

const POSE: [f64; 6] = [0.0, 0.6, 0.0, 0.0, 0.0, 0.0];

/// The torque limit of joint 2 suffices to hold the arm upright, but in `POSE` this limit is only 80 % of the required torque.
fn weak() -> Config {
    let mut config = Config::avena();
    let gravity = Dynamics::new(&Parameters::avena().model, config.gravity).gravity_torque(&POSE);
    config.joints[1].torque_max = 0.8 * gravity[1].abs();
    config
}

/// A hand moves the arm to a pose in which the joint needs more than its torque limit. Teaching must continue with
/// the torque at its limit. If `torque_release` is set, the controller releases the arm instead.
#[test]
fn j43_j66_an_arm_that_is_led_to_where_it_cannot_be_held_goes_on_being_taught() {
    for (torque_release, end) in [(false, ControllerState::Teaching), (true, ControllerState::Error)] {
        let mut rig = Rig::holding_with(Config { torque_release, ..weak() });
        assert_eq!(rig.ask(FrameType::TeachingModeEnable, &[]), DataStatus::NoError);
        rig.run(20);
        assert_eq!(rig.state(), ControllerState::Teaching);
        rig.follow = false;
        let mut last = ControllerState::Teaching;
        for _ in 0..600 {
            rig.nodes[1].report.position = (rig.nodes[1].report.position + 0.001).min(POSE[1]);
            rig.tick();
            let state = rig.state();
            assert!(
                state == last || (last, state) == (ControllerState::Teaching, end),
                "{last:?} to {state:?}"
            );
            last = state;
        }
        assert_eq!(last, end);
        if !torque_release {
            assert!((rig.torque[1].abs() - weak().joints[1].torque_max).abs() < 0.05, "{}", rig.torque[1]);
            continue;
        }
        assert_eq!(rig.status().joints[1].internal, joint_error::TORQUE);
        // The torque is off now. The controller requires the arm model again, also while the error is latched.
        assert_eq!(rig.status().jtc_init, 0b100);
        rig.clear(true, 0x7F);
        rig.run(50);
        assert_eq!((rig.state(), rig.torque), (ControllerState::Init, [0.0; 6]));
    }
}

/// The controller checks that the torque limits can hold the arm only when it begins to hold the arm. The controller
/// must not check this while a hand moves the arm.
#[test]
fn j06_the_model_is_judged_where_init_ends() {
    let mut rig = Rig::new(weak());
    rig.nodes[6].silent = true;
    rig.follow = false;
    rig.defaults();
    rig.run(300);
    for to in [POSE[1], 0.0] {
        rig.push(1, to);
        rig.run(200);
        assert_eq!((rig.state(), rig.status().jtc_init), (ControllerState::Init, 0), "joint 2 at {to}");
    }
    rig.nodes[6].silent = false;
    rig.until(1_000, |r| r.state() == ControllerState::HoldPos);
}
