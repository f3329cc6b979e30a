//! The way back to HoldPos: what it reports from each state, and how a person ends it.

use jtc_wire::{ControllerState, TrajectoryState};
use std::time::Duration;

use jtc_bus::Joint;
use jtc_core::Config;
use jtc_host::port::sim::SimPort;
use jtc_host::session::{Flow, ParameterSource};
use jtc_host::{Arm, CheckOptions, CheckedTrajectory, Error, ErrorKind, Session, plan};
use jtc_sim::{Fault, FaultKind, SimConfig, Trigger, World};

type Sim = Session<SimPort>;

fn session() -> Sim {
    Session::new(SimPort::new(World::new(SimConfig { baud: None, ..SimConfig::default() })))
}

/// On a path of some seconds, from HoldPos.
fn move_arm(s: &mut Sim) {
    let t = plan::joint_move(&[0.0; 6], &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0], &Config::avena(), 50.0).unwrap();
    let t = CheckedTrajectory::check(&t, &Arm::avena(), &[0.0; 6], &CheckOptions::default()).unwrap();
    s.upload(&t, |_| Flow::Continue).unwrap();
    s.execute(&t).unwrap();
    s.wait_for("motion", Duration::from_secs(10), |s| s.state == ControllerState::Operate && s.point > 100)
        .unwrap();
}

/// What a person reads on the way back, from each state.
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
    let kept = "friction, gains and arm model: those that the controller was given before";
    let done = "HoldPos, no errors";
    let mut s = session();
    let fresh = words(&mut s, ParameterSource::ControllerDefaults);
    assert!(fresh[0].starts_with("found: state ") && fresh[0].contains("friction not given"), "{fresh:?}");
    assert!(
        fresh.contains(
            &"friction, gains and arm model: the controller's own defaults, those of its built-in arm"
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
    s.port_mut().world_mut().inject(Fault {
        kind: FaultKind::SafetyInput,
        trigger: Trigger::At(0),
        duration_ms: Some(3_000),
    });
    s.wait_for("error", Duration::from_secs(1), |s| s.state == ControllerState::Error).unwrap();
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
    s.port_mut().world_mut().inject(Fault {
        kind: FaultKind::MotorFault { joint: Joint::ALL[2], bits: 2 },
        trigger: Trigger::At(0),
        duration_ms: Some(300),
    });
    s.wait_for("error", Duration::from_secs(1), |s| s.state == ControllerState::Error).unwrap();
    let faulty = words(&mut s, ParameterSource::None);
    assert!(faulty.iter().any(|s| s == "clearing the errors of the controller and of joint 3"), "{faulty:?}");
}

/// A person who wants it to end ends it; what moves is brought to a stand first, and nothing else is sent.
#[test]
fn j33_recover_that_is_ended_stops_what_moves_and_sends_no_more() {
    let mut s = session();
    s.recover(ParameterSource::ControllerDefaults, |_| {}).unwrap();
    move_arm(&mut s);
    let error = s.recover_until(ParameterSource::None, || true, |_| {}).unwrap_err();
    assert!(matches!(error, Error::Cancelled) && error.kind() == ErrorKind::Fault, "{error}");
    let status = s.fresh_status().unwrap();
    assert_eq!(
        (status.state, status.trajectory),
        (ControllerState::HoldPos.into(), TrajectoryState::Stop.into())
    );
    // In teaching the arm is somebody's: it is left as it is.
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
