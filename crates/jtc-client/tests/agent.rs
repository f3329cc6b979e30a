//! Tests of sessions through an agent, which have the same functions as sessions on a serial port. Several clients
//! can have sessions at the same time.
use crate::common;

use std::time::{Duration, Instant};

use common::Served;
use jtc_client::AgentPort;
use jtc_host::check::CheckOptions;
use jtc_host::port::{Halts, Port as _};
use jtc_host::session::{Flow, Outcome};
use jtc_host::{Arm, CheckedTrajectory, Diagnose, Error, ErrorKind, LinkError, PortError, Session, plan};
use jtc_wire::{ControllerState, TrajectoryState};
use test_kit::patience::{LONGEST, Patience, until};
use test_kit::written::text_with;

/// Sends the default parameters to the controller, and waits until the controller holds the arm.
fn hold(session: &mut Session<AgentPort>) {
    session.use_defaults().expect("it takes them");
    session.wait_ready(LONGEST).expect("it holds the arm");
}

/// Returns a checked motion that starts at the zero pose and takes some seconds.
fn motion(percent: f64) -> CheckedTrajectory {
    let arm = Arm::avena();
    let to = [0.4, -0.3, 0.3, 0.4, -0.3, 0.4];
    let trajectory =
        plan::joint_move(&[0.0; 6], &to, &arm.config(), percent).expect("it is within the limits");
    CheckedTrajectory::check(&trajectory, &arm, &[0.0; 6], &CheckOptions::default())
        .expect("it is within the limits")
}

#[test]
fn one_runs_a_motion_while_another_looks_is_denied_and_stops_it() {
    let served = Served::start(921_600);
    let mut anna = served.operator("anna");
    hold(&mut anna);
    let checked = motion(5.0);
    anna.upload(&checked, |_| Flow::Continue).expect("it takes it");
    anna.execute(&checked).expect("it starts");

    let mut bob = served.operator("bob");
    let status = bob.fresh_status().expect("it looks");
    assert_eq!((status.state.known(), status.is_executing()), (Some(ControllerState::Operate), true));
    let denied = bob.gripper(true).expect_err("anna commands");
    assert!(matches!(&denied, LinkError::Denied { reason, .. } if reason.contains("anna")), "{denied}");
    assert_eq!(denied.kind(), ErrorKind::Refused);
    // A Stop needs no lease and, on this computer, no token.
    let mut passer_by = served.session("a passer-by", None);
    passer_by.stop().expect("it is taken");
    let outcome = anna.follow(|_| Flow::Continue).expect("it comes to an end");
    assert!(matches!(outcome, Outcome::Stopped(status) if status.trajectory == TrajectoryState::Stop));
    let refused = passer_by.teach(true).expect_err("a viewer");
    assert!(refused.to_string().contains("can only read and stop"), "{refused}");

    // When anna has disconnected, bob receives the lease at once.
    drop(anna);
    until("the end of her lease", || served.line.with(|line, _| line.lease().is_none()));
    bob.gripper(true).expect("nobody else commands");
    let words = ["\"joined\"", "anna", "\"denied\"", "TrajSetExecStatus", "\"lease\"", "\"left\""];
    text_with(&served.log, &words);
}

#[test]
fn a_stop_in_the_middle_of_an_upload_is_taken_and_the_upload_says_who_it_was() {
    let served = Served::start(115_200);
    let mut anna = served.operator("anna");
    hold(&mut anna);
    let checked = motion(10.0);
    let url = served.url();
    let mut done = 0;
    let error = anna
        .upload(&checked, |progress| {
            done += 1;
            if done == 2 {
                assert!(progress.segments_done < progress.segments);
                let (status, body) = served.get("POST /api/stop");
                assert_eq!((status, body.contains("stop")), (200, true), "{url}");
            }
            Flow::Continue
        })
        .expect_err("it was stopped");
    assert!(
        matches!(&error, Error::Link(LinkError::Denied { reason, .. }) if reason.contains("127.0.0.1")),
        "{error}"
    );
}

/// A client that does not know about a Stop sends requests that are older than the Stop. Such requests cannot move
/// the arm.
#[test]
fn what_a_client_was_asked_for_before_a_stop_moves_nothing_until_somebody_asks_anew() {
    let served = Served::start(921_600);
    let mut anna = served.operator("anna");
    hold(&mut anna);
    // Only a refusal by the agent is an error. The controller may accept or refuse the jog.
    let sent = |anna: &mut Session<AgentPort>| match anna.jog(&[0.0; 6]) {
        Err(Error::Link(LinkError::Denied { reason, .. })) => Err(reason),
        _ => Ok(()),
    };
    sent(&mut anna).expect("nobody has stopped anything");
    assert_eq!(served.get("POST /api/stop").0, 200);
    let end = Instant::now() + Duration::from_millis(3_500);
    while Instant::now() < end {
        anna.fresh_status().expect("it reports");
    }
    let denied = sent(&mut anna).expect_err("it was asked for before the Stop");
    assert!(denied.contains("has stopped"), "{denied}");
    let denied = anna.upload(&motion(10.0), |_| Flow::Continue).expect_err("it leads to no motion");
    assert!(matches!(&denied, Error::Link(LinkError::Denied { .. })), "{denied}");
    anna.gripper(false).expect("it moves nothing");
    anna.ask_to_move().expect("it is there");
    sent(&mut anna).expect("somebody asks for it now");
}

#[test]
fn the_end_of_an_agent_is_known_to_its_clients_at_once() {
    let mut served = Served::start(921_600);
    let mut anna = served.operator("anna");
    anna.fresh_status().expect("it reports");
    let url = served.url();
    served.end();
    let error = (0..100).find_map(|_| anna.fresh_status().err()).expect("it is gone");
    assert!(matches!(error, LinkError::Port(PortError::AgentGone { .. })), "{error}");
    let error = jtc_client::AgentPort::open(&url, &Default::default()).err().expect("nobody is there");
    assert!(matches!(error, PortError::NoAgent { .. }), "{error}");
    assert_eq!(error.kind(), ErrorKind::NoLink);
}

#[test]
fn a_client_is_known_by_the_name_that_it_gives_whatever_is_in_it() {
    let served = Served::start(921_600);
    let name = "Zoë & Bob: a=b?c#d/e %41+~";
    let (mut zoe, mut other) = (served.operator(name), served.operator("other"));
    zoe.gripper(false).expect("nobody else commands");
    let error = other.gripper(false).expect_err("another one commands");
    assert!(error.to_string().contains(name), "{error}");
}

#[test]
fn one_that_hangs_commands_no_more_and_has_to_come_again() {
    let served = Served::start(921_600);
    let (mut anna, mut bob) = (served.operator("anna"), served.operator("bob"));
    anna.gripper(false).expect("nobody else commands");
    assert!(matches!(bob.gripper(false), Err(LinkError::Denied { .. })));
    // The client anna does not read its messages.
    let mut patience = Patience::begin();
    while served.line.with(|line, _| line.lease().is_some()) {
        patience.pause("the end of her lease");
        bob.fresh_status().expect("it reports");
    }
    bob.gripper(false).expect("nobody commands");
    drop(bob);
    until("the end of his lease", || served.line.with(|line, _| line.lease().is_none()));
    // The agent has disconnected anna, because her information about the arm is outdated.
    let gone = anna.gripper(false).expect_err("she was put out");
    assert!(matches!(gone, LinkError::Port(PortError::AgentGone { .. })), "{gone}");
}

#[test]
fn a_status_that_is_asked_for_is_no_old_one_however_long_nobody_read() {
    let served = Served::start(921_600);
    let (mut anna, mut looks) = (served.operator("anna"), served.operator("looks"));
    looks.fresh_status().expect("it reports");
    hold(&mut anna);
    for _ in 0..8 {
        std::thread::sleep(Duration::from_millis(500));
        anna.fresh_status().expect("it reports");
    }
    let status = looks.fresh_status().expect("it reports");
    assert_eq!(status.state, ControllerState::HoldPos);
}

/// The agent refuses a queued request that is older than a Stop. The client counts the Stops and Pauses of other
/// clients. If the count has changed since the request, the client does not ask the agent to permit the motion.
#[test]
fn a_client_counts_the_stops_and_pauses_of_others_and_asks_for_what_was_requested_after_them() {
    let served = Served::start(921_600);
    let mut anna = served.operator("anna");
    hold(&mut anna);
    let known = |anna: &mut Session<AgentPort>| {
        for _ in 0..5 {
            anna.fresh_status().expect("it reports");
        }
        anna.port().halts()
    };
    assert_eq!(known(&mut anna), Halts::default());
    // A client's own Stop is not counted as a Stop of another client.
    let _ = anna.stop();
    assert_eq!(known(&mut anna), Halts::default());
    assert_eq!(served.get("POST /api/stop").0, 200);
    assert_eq!(known(&mut anna), Halts { all: 1, stops: 1 });
    let _ = anna.stop();
    assert_eq!(served.get("POST /api/pause").0, 200);
    assert_eq!(known(&mut anna), Halts { all: 2, stops: 1 });
    // The test waits longer than the hold-off before a new request.
    std::thread::sleep(Duration::from_millis(3_500));
    let sent = |anna: &mut Session<AgentPort>| match anna.jog(&[0.0; 6]) {
        Err(Error::Link(LinkError::Denied { reason, .. })) => Err(reason),
        _ => Ok(()),
    };
    for before in [0, 1] {
        anna.port_mut().ask_to_move_after(before).expect("it is there");
        sent(&mut anna).expect_err("it was requested before the last of them");
    }
    anna.port_mut().ask_to_move_after(2).expect("it is there");
    sent(&mut anna).expect("it was requested after them");
}
