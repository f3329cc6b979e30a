//! Tests of host supervision (J-59). The controller detects if the session that commands the motion is still alive. A
//! session that only observes does not count as alive.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

use jtc_core::settings;
use jtc_host::port::sim::SimPort;
use jtc_host::port::test::ScriptedPort;
use jtc_host::session::{Flow, Outcome};
use jtc_host::{Arm, CheckOptions, CheckedTrajectory, Session};
use jtc_wire::{ControllerState, SettingValue, Status, TrajectoryState};

use super::{Sim, motion, session};

/// Returns a session in which the controller holds the arm. Another session has set `host_timeout_ms`, so this session
/// must read this setting.
fn supervised(ms: u16, baud: Option<u32>) -> Sim {
    let mut first = session(baud);
    let setting = settings::named("host_timeout_ms").unwrap().number;
    first.set_settings(&[SettingValue { setting, joint: 0, value: f64::from(ms) }]).unwrap();
    let mut s = Session::new(first.into_port());
    s.use_defaults().unwrap();
    s.wait_ready(Duration::from_secs(15)).unwrap();
    s
}

/// Starts a motion of about 6 s.
fn begin(s: &mut Sim) {
    let (motion, options) = (motion(1.0, 12.0), CheckOptions::default());
    let checked = CheckedTrajectory::check(&motion, &Arm::avena(), &[0.0; 6], &options).unwrap();
    s.upload(&checked, |_| Flow::Continue).unwrap();
    s.execute(&checked).unwrap();
}

#[test]
fn j59_a_session_that_follows_a_motion_keeps_it_going() {
    for (ms, baud) in [
        (100, None),
        (250, Some(115_200)),
        (500, Some(115_200)),
        (1000, None),
        (1500, Some(115_200)),
        (2000, Some(921_600)),
        (3000, None),
    ] {
        let mut s = supervised(ms, baud);
        begin(&mut s);
        let start = s.now();
        let mut paused = false;
        let outcome = s.follow(|status| {
            paused |= status.trajectory == TrajectoryState::Pause;
            Flow::Continue
        });
        assert!(matches!(outcome, Ok(Outcome::Finished(_))), "{ms} ms at {baud:?} Bd: {outcome:?}");
        assert!(!paused, "{ms} ms at {baud:?} Bd");
        assert!(s.now() - start > Duration::from_secs(3), "the motion is longer than the timeout");
    }
}

#[test]
fn j59_a_session_that_watches_its_teaching_keeps_it_going() {
    for ms in [150, 1000, 2500] {
        let mut s = supervised(ms, Some(115_200));
        s.teach(true).unwrap();
        s.pass(Duration::from_secs(6)).unwrap();
        assert_eq!(s.last().unwrap().state, ControllerState::Teaching, "{ms} ms");
    }
}

/// While a session repeats GetInfo during a motion, the controller also answers the other requests of this session.
#[test]
fn j50_requests_wait_for_the_answer_that_is_on_its_way() {
    let mut s = supervised(100, Some(115_200));
    begin(&mut s);
    for n in 0..60 {
        s.pass(Duration::from_millis(7 * n)).unwrap();
        s.settings().unwrap_or_else(|e| panic!("request {n}: {e}"));
    }
}

#[test]
fn j59_a_motion_whose_session_has_gone_is_paused() {
    for ms in [100, 1000, 2000] {
        let mut s = supervised(ms, None);
        begin(&mut s);
        s.pass(Duration::from_millis(500)).unwrap();
        assert_eq!(s.last().unwrap().trajectory, TrajectoryState::Execute);
        // A second session now uses the port. The second session only observes and sends no GetInfo, so the controller
        // receives no sign of a host and pauses the motion.
        let mut watching: Session<SimPort> = Session::new(s.into_port());
        watching.pass(Duration::from_millis(u64::from(ms) + 1000)).unwrap();
        let status = watching.last().copied().unwrap();
        assert_eq!(status.trajectory, TrajectoryState::Pause, "{ms} ms");
        assert_eq!((status.state.known(), status.errors), (Some(ControllerState::HoldPos), 0), "{ms} ms");
    }
}

#[test]
fn j59_a_session_that_only_watches_sends_nothing() {
    let written = Rc::<RefCell<Vec<u8>>>::default();
    let taken = Rc::clone(&written);
    let port = ScriptedPort::new(None, move |now: Duration, bytes: &[u8]| {
        taken.borrow_mut().extend_from_slice(bytes);
        let due = now.as_millis().is_multiple_of(40);
        if due { Status::default().emit().to_vec() } else { Vec::new() }
    });
    let mut s = Session::new(port);
    s.pass(Duration::from_secs(10)).unwrap();
    assert!(s.statistics().statuses > 200);
    assert_eq!(written.borrow().len(), 0);
}
