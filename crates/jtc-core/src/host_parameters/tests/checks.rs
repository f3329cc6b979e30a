//! Tests of the checks of payload, gains and model (J-06, J-53, J-60, J-71).
use jtc_dynamics::Payload;

use super::*;
use crate::config::defaults;

/// Executes all slices of the built-in model. Returns the number of slices, and `true` if the model was accepted.
fn take_model(parameters: &mut HostParameters, at: Option<&[f64; JOINTS]>, config: &Config) -> (usize, bool) {
    let mut progress = SliceProgress::Begin;
    for slice in 1..100 {
        match parameters.set_model(&defaults::MODEL, progress, at, config) {
            SliceOutcome::Done => return (slice, true),
            SliceOutcome::Refused(_) => return (slice, false),
            SliceOutcome::Unfinished(next) => progress = next,
        }
    }
    panic!("the model needs too many slices")
}

/// Returns gains that need more inertia than any joint has. The derivative torque is delayed by at least 3 ms. A Kd
/// of 1e6 N·m·s/rad therefore needs more than 0.75 · 0.003 s · 1e6 N·m·s/rad, which is over 2000 kg·m².
fn too_stiff() -> [PidGains; JOINTS] {
    defaults::PID.map(|gains| PidGains { kd: 1e6, ..gains })
}

/// The first slice checks the masses, 17 slices compute the inertia in one pose each, and the last slice uses the model.
#[test]
fn j71_a_model_takes_19_slices() {
    let config = Config::avena();
    let mut parameters = HostParameters::new(&config);
    assert_eq!(take_model(&mut parameters, None, &config), (1 + 17 + 1, true));
}

#[test]
fn j71_a_model_is_compared_with_received_gains_only() {
    let config = Config::avena();
    for (received, accepted) in [(false, true), (true, false)] {
        let mut parameters = HostParameters::new(&config);
        parameters.pid = too_stiff();
        if received {
            parameters.receive(missing_parameter::PID);
        }
        assert_eq!(take_model(&mut parameters, None, &config), (19, accepted), "{received}");
    }
}

#[test]
fn j71_gains_are_borne_only_by_a_known_inertia_that_is_high_enough() {
    let config = Config::avena();
    let mut parameters = HostParameters::new(&config);
    assert!(!parameters.gains_are_borne(&config), "the inertia is not known");
    take_model(&mut parameters, None, &config);
    assert!(parameters.gains_are_borne(&config));
    parameters.pid = too_stiff();
    assert!(!parameters.gains_are_borne(&config));
}

/// Gravity acts sideways, and torque limits of 0.01 N·m cannot hold the arm, so the model is refused. The inertia of
/// a refused model is not used.
#[test]
fn j71_a_refused_model_does_not_change_the_inertia() {
    let mut config = Config::avena();
    config.gravity = [9.81, 0.0, 0.0];
    config.joints.iter_mut().for_each(|joint| joint.torque_max = 0.01);
    let mut parameters = HostParameters::new(&config);
    assert_eq!(take_model(&mut parameters, Some(&[0.0; JOINTS]), &config), (19, false));
    assert!(!parameters.gains_are_borne(&config));
}

#[test]
fn j71_settings_that_affect_the_inertia_make_the_controller_compute_it_again() {
    let before = Config::avena();
    let (mut delay, mut rotor, mut range, mut speed) =
        (before.clone(), before.clone(), before.clone(), before.clone());
    delay.delay_ticks += 1;
    rotor.joints[5].rotor_inertia += 0.25;
    range.joints[4].position_max -= 0.25;
    speed.joints[3].velocity_max -= 0.25;
    for (name, config, again) in [
        ("delay", &delay, true),
        ("rotor", &rotor, true),
        ("range", &range, true),
        ("speed", &speed, false),
        ("no change", &before, false),
    ] {
        let mut parameters = HostParameters::new(&before);
        take_model(&mut parameters, None, &before);
        let outcome = parameters.look_again(SliceProgress::Begin, config, &before);
        assert_eq!(matches!(outcome, SliceOutcome::Unfinished(SliceProgress::Pose(1))), again, "{name}");
        assert_eq!(matches!(outcome, SliceOutcome::Done), !again, "{name}");
        // After the model was withdrawn, the inertia is not computed. The controller checks the model when the host
        // sends it again.
        parameters.withdraw_model();
        let outcome = parameters.look_again(SliceProgress::Begin, config, &before);
        assert!(matches!(outcome, SliceOutcome::Done), "{name}");
        assert_eq!(parameters.gains_are_borne(&before), !again, "{name}");
    }
}

/// Gravity is zero before the change, so the joints need no torque. After the change, the payload is accepted if each
/// joint needs at most its torque limit.
#[test]
fn j60_a_payload_may_need_the_whole_torque_limit() {
    let at = [0.0; JOINTS];
    for (times, carried) in [(1.0, true), (0.999, false), (1.001, true)] {
        let (mut still, mut config) = (Config::avena(), Config::avena());
        still.gravity = [0.0; 3];
        config.gravity = [9.81, 0.0, 0.0];
        let mut parameters = HostParameters::new(&still);
        parameters.receive(missing_parameter::MODEL);
        let needed = HostParameters::new(&config).dynamics.gravity_torque(&at);
        for (joint, needed) in config.joints.iter_mut().zip(needed) {
            joint.torque_max = times * needed.abs();
        }
        assert_eq!(parameters.carries(Some(&at), &config), carried, "{times}");
        assert!(parameters.carries(None, &config), "the positions are not known");
        parameters.withdraw_model();
        assert!(parameters.carries(Some(&at), &config), "the model is not known");
    }
}

#[test]
fn j60_without_torque_the_model_contains_the_whole_payload() {
    let at = [0.0, 0.7, 0.3, 0.0, 0.2, 0.0];
    let mut config = Config::avena();
    let mut parameters = HostParameters::new(&config);
    config.payload = Payload { mass: 2.0, com: [0.0, 0.0, 0.1], inertia: [0.0; 6] };
    let whole = HostParameters::new(&config).dynamics.gravity_torque(&at);
    parameters.change_payload(&config, 2.0);
    assert_ne!(parameters.dynamics.gravity_torque(&at), whole);
    parameters.end_blend();
    assert_eq!(parameters.dynamics.gravity_torque(&at), whole);
    assert_eq!((parameters.blend_left_ms(), parameters.next_mass()), (0, 0.0));
}

/// The friction polynomial of 1e6 N·m exceeds the torque limit of every joint. The settings are refused only if the
/// polynomial is in use, not if a friction table is in use.
#[test]
fn j53_settings_need_not_fit_a_polynomial_that_is_not_in_use() {
    let config = Config::avena();
    for (table, fits) in [(true, true), (false, false)] {
        let mut parameters = HostParameters::new(&config);
        parameters.receive(missing_parameter::FRICTION);
        parameters.friction_is_table = table;
        assert!(parameters.fits(&config));
        parameters.polynomial[1][0] = 1e6;
        assert_eq!(parameters.fits(&config), fits, "{table}");
    }
}

/// The blend takes 500 ms. After 250 ms, Kp is the mean of the old and of the new gains.
#[test]
fn j71_new_gains_are_blended_in() {
    let mut parameters = HostParameters::new(&Config::avena());
    let before = parameters.pid;
    let after = before.map(|gains| PidGains { kp: 0.5 * gains.kp, ..gains });
    parameters.trial.begin(&before, &after);
    parameters.put_pid(&after);
    let mut gains = None;
    (0..250).for_each(|_| gains = parameters.try_gains(true));
    let gains = gains.expect("gains of the blend");
    for j in 0..JOINTS {
        assert!((gains[j].kp - 0.75 * before[j].kp).abs() < 1e-9 * before[j].kp, "{j}: {}", gains[j].kp);
    }
    for _ in 0..250 {
        parameters.try_gains(true);
    }
    assert!(parameters.try_gains(true).is_none(), "the blend is over");
}
