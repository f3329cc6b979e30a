//! Tests of the recovery to HoldPos: reports from each state, and cancelling by the user.

use std::sync::Arc;
use std::time::Duration;

use jtc_wire::{ControllerState, TrajectoryState};

use jtc_bus::Joint;
use jtc_host::session::{Flow, ParameterSource, RecoverParameters, RecoverStep};
use jtc_host::{
    Arm, CheckError, CheckOptions, CheckedTrajectory, Diagnose, Error, ErrorKind, ParametersError,
};
use jtc_sim::FaultKind;

use super::{Sim, fail, motion, ready, session};

/// Starts a motion of several seconds from HoldPos.
fn move_arm(s: &mut Sim) {
    let t = CheckedTrajectory::check(&motion(1.0, 50.0), &Arm::avena(), &[0.0; 6], &CheckOptions::default())
        .unwrap();
    s.upload(&t, |_| Flow::Continue).unwrap();
    s.execute(&t).unwrap();
    s.wait_for("motion", Duration::from_secs(10), |s| s.state == ControllerState::Operate && s.point > 100)
        .unwrap();
}

/// The recovery reports each of its steps to the user, from each state.
#[test]
fn recover_says_each_step_of_each_state() {
    fn words(s: &mut Sim, source: ParameterSource<'_>) -> Vec<String> {
        let mut steps = Vec::new();
        let done = s.recover(source, |step| steps.push(step.to_string()));
        assert_eq!(
            done.map(|s| (s.state, s.errors)).ok(),
            Some((ControllerState::HoldPos.into(), 0)),
            "{steps:?}"
        );
        steps
    }
    let kept = "friction, gains and arm model: unchanged, as the controller received them before";
    let done = "HoldPos, no errors";
    let mut s = session(None);
    let fresh = words(&mut s, ParameterSource::ControllerDefaults);
    assert!(fresh[0].starts_with("found: state ") && fresh[0].contains("friction not given"), "{fresh:?}");
    assert!(
        fresh.contains(
            &"friction, gains and arm model: the defaults of the controller, those of its built-in arm"
                .to_owned()
        ),
        "{fresh:?}"
    );
    assert_eq!(fresh.last().unwrap(), done);
    assert_eq!(words(&mut s, ParameterSource::None), ["found: state HoldPos, trajectory Null", kept, done]);
    s.teach(true).unwrap();
    s.wait_for("teaching", Duration::from_secs(1), |s| s.state == ControllerState::Teaching).unwrap();
    assert_eq!(
        words(&mut s, ParameterSource::None),
        ["found: state Teaching, trajectory Null", kept, "switching teaching off", done]
    );
    move_arm(&mut s);
    assert_eq!(
        words(&mut s, ParameterSource::None),
        ["found: state Operate, trajectory Execute", kept, "stopping the motion", done]
    );
    fail(&mut s, FaultKind::SafetyInput, 3_000);
    let stopped = words(&mut s, ParameterSource::None);
    assert!(
        stopped[0].starts_with("found: state Error, trajectory Null; ")
            && stopped[0].contains("emergency input")
    );
    assert_eq!(stopped[1], kept);
    assert!(stopped[2].starts_with("clearing the "), "{stopped:?}");
    let waiting = "the safety input is low: release the emergency stop (waiting)";
    assert_eq!(stopped.iter().filter(|s| *s == waiting).count(), 1, "{stopped:?}");
    assert_eq!(stopped.last().unwrap(), done);
    fail(&mut s, FaultKind::MotorFault { joint: Joint::ALL[2], bits: 2 }, 300);
    let faulty = words(&mut s, ParameterSource::None);
    assert!(faulty.iter().any(|s| s == "clearing the errors of the controller and of joint 3"), "{faulty:?}");
}

/// A recovery that is cancelled during a motion stops the motion and sends no other frame.
#[test]
fn j33_recover_that_is_ended_stops_what_moves_and_sends_no_more() {
    let mut s = session(None);
    s.recover(ParameterSource::ControllerDefaults, |_| {}).unwrap();
    move_arm(&mut s);
    let error = s.recover_until(ParameterSource::None, || true, |_| {}).unwrap_err();
    assert!(matches!(error, Error::Cancelled) && error.kind() == ErrorKind::Fault, "{error}");
    let status = s.fresh_status().unwrap();
    assert_eq!(
        (status.state, status.trajectory),
        (ControllerState::HoldPos.into(), TrajectoryState::Stop.into())
    );
    // In teaching the operator guides the arm. A recovery that is cancelled sends no frame and does not end teaching.
    s.teach(true).unwrap();
    s.wait_for("teaching", Duration::from_secs(1), |s| s.state == ControllerState::Teaching).unwrap();
    let sent = s.statistics().frames_sent;
    let error = s.recover_until(ParameterSource::None, || true, |_| {}).unwrap_err();
    assert!(matches!(error, Error::Cancelled), "{error}");
    assert_eq!(
        (s.statistics().frames_sent, s.fresh_status().unwrap().state),
        (sent, ControllerState::Teaching.into())
    );
}

#[test]
fn recover_brings_a_fresh_controller_up_and_waits_for_the_emergency_stop() {
    let mut s = session(Some(921_600));
    let status = s.recover(ParameterSource::ControllerDefaults, |_| {}).unwrap();
    assert_eq!(status.state, ControllerState::HoldPos);
    fail(&mut s, FaultKind::SafetyInput, 5_000);
    let mut steps = Vec::new();
    let status = s.recover(ParameterSource::None, |step| steps.push(step.clone())).unwrap();
    assert_eq!((status.state, status.errors), (ControllerState::HoldPos.into(), 0));
    assert!(steps.contains(&RecoverStep::SafetyInput), "{steps:?}");
}

/// J-55: a controller without parameters does not receive the parameters of an arm that the user did not select. The recovery does not add
/// the missing parameters of an incomplete arm.
#[test]
fn j55_recover_gives_no_numbers_that_nobody_named() {
    let mut s = session(Some(921_600));
    let (sent, mut steps) = (s.statistics().frames_sent, 0);
    let error = s.recover(ParameterSource::None, |_| steps += 1).unwrap_err();
    assert!(
        matches!(&error, Error::Parameters(ParametersError::NoSource { missing }) if missing.len() == 3),
        "{error}"
    );
    assert_eq!((error.kind(), s.statistics().frames_sent, steps), (ErrorKind::Refused, sent, 0));
    assert!(error.hint().contains("--arm FILE") && error.hint().contains("--defaults"), "{}", error.hint());

    let arm = Arm { pid: None, ..Arm::avena() };
    let half = arm.parameter_set();
    let error = s.recover(ParameterSource::Arm { name: "half.toml", set: &half }, |_| {}).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Refused);
    assert!(error.to_string().contains("half.toml: PID gains missing"), "{error}");
    assert_eq!(s.statistics().frames_sent, sent);

    // The controller now has one parameter of another arm, its default gains. The recovery must send all parameters
    // of the file.
    s.use_default(jtc_host::session::Parameter::Pid).unwrap();
    let set = Arm::avena().parameter_set();
    let before = s.statistics().frames_sent;
    let mut steps = Vec::new();
    let status = s
        .recover(ParameterSource::Arm { name: "avena.toml", set: &set }, |step| steps.push(step.to_string()))
        .unwrap();
    assert_eq!(
        (status.state, s.statistics().frames_sent - before),
        (ControllerState::HoldPos.into(), 3),
        "{steps:?}"
    );
    assert!(steps.iter().any(|s| s.contains("those of avena.toml")), "{steps:?}");
    // The controller already holds the arm with its present parameters, so the recovery sends no others. The recovery
    // reports this as a step.
    let mut steps = Vec::new();
    s.recover(ParameterSource::Arm { name: "avena.toml", set: &set }, |step| steps.push(step.to_string()))
        .unwrap();
    assert_eq!(s.statistics().frames_sent - before, 3);
    assert!(steps.iter().any(|s| s.contains("not with those of avena.toml")), "{steps:?}");
}

/// After an error, the parameters of the arm that the user selected are sent before the torque is switched on.
#[test]
fn j55_after_an_error_the_named_arm_is_powered() {
    let mut s = ready(Some(921_600));
    fail(&mut s, FaultKind::SafetyInput, 500);
    let set = Arm::avena().parameter_set();
    let mut steps = Vec::new();
    s.recover(ParameterSource::Arm { name: "avena.toml", set: &set }, |step| steps.push(step.clone()))
        .unwrap();
    let give = steps.iter().position(|s| matches!(s, RecoverStep::Give(Some(_)))).expect("given");
    let clear = steps.iter().position(|s| matches!(s, RecoverStep::Clear(_))).expect("cleared");
    assert!(give < clear, "{steps:?}");
    // If the user selects no arm, the controller keeps its parameters. The recovery reports this as a step.
    fail(&mut s, FaultKind::SafetyInput, 500);
    let mut steps = Vec::new();
    s.recover(ParameterSource::None, |step| steps.push(step.clone())).unwrap();
    assert!(steps.contains(&RecoverStep::Keep), "{steps:?}");
}

/// J-55: before the recovery sends a parameter, it rejects gains that do not keep the arm stable, and limits that differ from the
/// controller's limits.
#[test]
fn j55_recover_checks_the_arm_before_anything_is_sent() {
    let mut s = session(Some(921_600));
    let mut refused = |arm: Arm| {
        let parameters = RecoverParameters::Arm { arm: Arc::new(arm), accept_device_limits: false };
        s.recover_with(&parameters, || false, |step| panic!("{step}")).unwrap_err()
    };
    let mut shaky = Arm::avena();
    shaky.pid.as_mut().expect("gains")[1].kd *= 1_000.0;
    let error = refused(shaky);
    assert!(matches!(error, Error::Parameters(ParametersError::Unstable { .. })), "{error}");
    let mut slow = Arm::avena();
    slow.joints[2].velocity_max *= 0.5;
    let error = refused(slow.clone());
    assert!(matches!(error, Error::Check(CheckError::DeviceLimits { .. })), "{error}");
    // The controller still lacks all three parameters.
    assert_eq!(s.fresh_status().unwrap().jtc_init.count_ones(), 3);

    let parameters = RecoverParameters::Arm { arm: Arc::new(slow), accept_device_limits: true };
    let mut steps = Vec::new();
    let status = s.recover_with(&parameters, || false, |step| steps.push(step.clone())).unwrap();
    assert_eq!(status.state, ControllerState::HoldPos);
    assert!(matches!(&steps[0], RecoverStep::Differs(_)), "{steps:?}");
}
