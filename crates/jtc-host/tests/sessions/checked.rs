//! Tests that a session runs only a trajectory that passed the check and was uploaded.

use jtc_core::{Config, Payload};
use jtc_wire::{NodeState, Status, TrajectoryState};
use std::time::Duration;

use jtc_host::session::{Flow, Outcome};
use jtc_host::{
    Arm, CheckError, CheckOptions, CheckedTrajectory, Diagnose, Error, ErrorKind, LinkError, MotionError,
    Trajectory, plan,
};
use jtc_sim::FaultKind;

use super::{Sim, fail, session};

/// Returns a session in HoldPos at the zero pose, with the default parameters.
fn ready() -> Sim {
    let mut session = session(None);
    session.push(&Arm::avena().parameter_set(), |_| {}).unwrap();
    let status = session.wait_ready(Duration::from_secs(15)).unwrap();
    assert!(status.joints.iter().all(|j| j.state == NodeState::ENABLED), "every drive is enabled");
    session
}

fn motion(to: f64) -> Trajectory {
    super::motion(to, 60.0)
}

fn check(trajectory: &Trajectory) -> Result<CheckedTrajectory, CheckError> {
    CheckedTrajectory::check(trajectory, &Arm::avena(), &[0.0; 6], &CheckOptions::default())
}

#[test]
fn what_the_check_refuses_never_becomes_a_checked_trajectory() {
    let mut fast = motion(0.5);
    fast.step_ms = 2;
    let error = check(&fast).unwrap_err();
    assert!(matches!(&error, CheckError::Refused(verdict) if !verdict.is_ok()), "{error}");
    let diagnosis = error.diagnosis();
    assert_eq!((diagnosis.code, diagnosis.kind), ("check", ErrorKind::Refused));
    // This value does not fit into a trajectory frame.
    let mut wild = motion(0.5);
    wild.points[3].velocity[2] = f64::NAN;
    assert!(matches!(check(&wild), Err(CheckError::Refused(_))));
    // The torque limit is so low that the motion needs more torque according to the arm model.
    let mut arm = Arm::avena();
    arm.joints[1].torque_max = 1.0;
    let options = CheckOptions { accept_device_limits: true, ..CheckOptions::default() };
    let error = CheckedTrajectory::check(&motion(0.5), &arm, &[0.0; 6], &options).unwrap_err();
    assert!(error.to_string().contains("torque over its limit: joint 2"), "{error}");
}

/// J-34: the first point must be within 0.02 rad of the arm's position.
#[test]
fn j34_an_arm_that_stands_elsewhere_is_refused_by_the_check() {
    let at = |q: f64| {
        let start = [0.0, q, 0.0, 0.0, 0.0, 0.0];
        CheckedTrajectory::check(&motion(0.5), &Arm::avena(), &start, &CheckOptions::default())
    };
    assert!(at(0.019).is_ok());
    let error = at(0.021).unwrap_err().to_string();
    assert!(error.contains("joint 2: +0.0210 rad away from the first point"), "{error}");
}

/// J-55: if the limits of arm and controller differ, the caller must accept the differences explicitly. If the caller accepts the
/// differences, the tighter limits apply.
#[test]
fn j55_an_arm_that_differs_from_the_controller_must_be_accepted() {
    let mut arm = Arm::avena();
    let device = arm.joints[0].acceleration_max;
    arm.joints[0].acceleration_max = 2.0 * device;
    let check = |arm: &Arm, trajectory: &Trajectory, accept_device_limits| {
        let options = CheckOptions { accept_device_limits, ..CheckOptions::default() };
        CheckedTrajectory::check(trajectory, arm, &[0.0; 6], &options)
    };
    let error = check(&arm, &motion(0.5), false).unwrap_err();
    let diagnosis = error.diagnosis();
    assert_eq!((diagnosis.code, diagnosis.kind), ("device-limits", ErrorKind::Refused));
    assert!(error.to_string().contains("joint 1, acceleration_max_rad_s2: "), "{error}");
    assert!(check(&arm, &motion(0.5), true).is_ok());
    // The check uses the gravity of the controller instead of the gravity in the file. With the gravity of the file, an arm without weight
    // would pass the check.
    let weightless = Arm { gravity: Some([0.0; 3]), ..Arm::avena() };
    let mut weak = weightless.clone();
    weak.joints[1].torque_max = 60.0;
    let bend = plan::joint_move(&[0.0; 6], &[0.0, 1.5, 0.0, 0.0, 0.0, 0.0], &weak.config(), 20.0).unwrap();
    assert!(check(&weightless, &bend, true).is_ok());
    let error = check(&weak, &bend, true).unwrap_err().to_string();
    assert!(error.contains("torque over its limit: joint 2"), "{error}");
    // The check uses the limit of the arm if this limit is tighter than the controller's limit.
    arm.joints[0].velocity_max = 0.1;
    let error = check(&arm, &motion(0.5), true).unwrap_err().to_string();
    assert!(error.contains("velocity over its limit: joint 1") && error.contains("(limit 0.1)"), "{error}");
}

#[test]
fn an_arm_that_is_none_checks_nothing() {
    let mut arm = Arm::avena();
    arm.model.links[3].mass = f64::NAN;
    let options = CheckOptions { accept_device_limits: true, ..CheckOptions::default() };
    let error = CheckedTrajectory::check(&motion(0.5), &arm, &[0.0; 6], &options).unwrap_err();
    assert!(matches!(error, CheckError::Arm(_)), "{error}");
}

/// The session executes only the trajectory that is in the controller.
#[test]
fn only_what_was_uploaded_is_executed() {
    let mut s = ready();
    let (first, second) = (check(&motion(0.5)).unwrap(), check(&motion(0.5)).unwrap());
    let refused = |s: &mut Sim, t: &CheckedTrajectory| {
        let sent = s.statistics().frames_sent;
        let error = s.execute(t).unwrap_err();
        assert!(matches!(error, Error::Motion(MotionError::NotUploaded)), "{error}");
        assert_eq!((s.statistics().frames_sent, error.kind()), (sent, ErrorKind::Refused), "nothing is sent");
    };
    refused(&mut s, &first);
    s.upload(&first, |_| Flow::Continue).unwrap();
    // This trajectory has the same points as the uploaded trajectory, but it passed another check, possibly for
    // another arm. The session refuses to execute it.
    refused(&mut s, &second);
    s.upload(&second, |_| Flow::Continue).unwrap();
    refused(&mut s, &first);
    // After a cancelled upload the session has no trajectory to execute.
    assert!(matches!(s.upload(&first, |_| Flow::Cancel), Err(Error::Cancelled)));
    refused(&mut s, &first);
    refused(&mut s, &second);
    // After an error the controller deletes its trajectory, so the session has no trajectory to execute.
    s.upload(&first, |_| Flow::Continue).unwrap();
    fail(&mut s, FaultKind::SafetyInput, 200);
    refused(&mut s, &first);
}

#[test]
fn a_run_has_an_outcome_and_its_figures() {
    let mut s = ready();
    let checked = check(&motion(0.5)).unwrap();
    s.upload(&checked, |_| Flow::Continue).unwrap();
    let run = s.run(&checked, |_| Flow::Continue);
    let Ok(Outcome::Finished(status)) = &run.outcome else { panic!("{:?}", run.outcome) };
    assert!((f64::from(status.joints[0].position) - 0.5).abs() < 0.01);
    let summary = run.summary(&Arm::avena());
    let moved = summary.joints[0].peak_velocity_rad_s.unwrap();
    assert!((0.2..1.5).contains(&moved), "{moved} rad/s");
    let error = summary.joints[0].max_error_mrad.unwrap();
    assert!(error > 0.0 && error < 20.0, "{error} mrad");
    assert_eq!(summary.joints[0].torque_limit_nm, Some(Arm::avena().joints[0].torque_max));
    // The arm is at the end of the first execution, and not at the first point. Therefore the controller rejects the
    // second execution (J-34), and `run` returns this error.
    let run = s.run(&checked, |_| Flow::Continue);
    assert!(matches!(run.outcome, Err(Error::Link(LinkError::Refused { .. }))), "{:?}", run.outcome);
}

/// J-60: the payload is changed while a motion is paused. If it is too heavy for the remainder of the motion, the
/// motion cannot be resumed.
#[test]
fn j60_what_remains_of_a_paused_motion_is_checked_with_the_payload() {
    let mut session = ready();
    // The arm is upright at first, and stretched out at the end.
    let stretched = [0.0, 1.5, 0.1, 0.0, 0.1, 0.0];
    let motion = plan::joint_move(&[0.0; 6], &stretched, &Config::avena(), 30.0).unwrap();
    let checked = check(&motion).unwrap();
    session.upload(&checked, |_| Flow::Continue).unwrap();
    session.execute(&checked).unwrap();
    session.wait_for("a second", Duration::from_secs(5), |s| s.point > 1000).unwrap();
    session.pause().unwrap();
    let paused = |s: &Status| s.trajectory == TrajectoryState::Pause;
    session.wait_for("pause", Duration::from_secs(5), paused).unwrap();
    // The first payload is too heavy for the remainder of the motion. The second payload is light enough.
    for (mass, goes_on) in [(6.0, false), (0.1, true)] {
        session.set_payload(&Payload { mass, com: [0.0, 0.0, 0.1], ..Payload::NONE }).unwrap();
        match session.resume() {
            Ok(()) => assert!(goes_on, "{mass} kg"),
            Err(error) => {
                assert!(!goes_on, "{mass} kg: {error}");
                let text = error.to_string();
                assert!(text.contains("torque over its limit: joint 2"), "{text}");
                assert!(text.ends_with("nothing was sent"), "{text}");
                assert_eq!(error.diagnosis().kind, ErrorKind::Refused);
                assert!(paused(&session.fresh_status().unwrap()));
            }
        }
    }
    let finished = |s: &Status| s.trajectory == TrajectoryState::Finish;
    session.wait_for("the end", Duration::from_secs(30), finished).unwrap();
}
