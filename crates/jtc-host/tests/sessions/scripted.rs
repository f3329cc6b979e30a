//! Tests of a session with a scripted controller. The tests check the frames that the session sends, and the error when the link is lost.

use jtc_wire::{ControllerState, TrajectoryState};
use std::time::Duration;

use jtc_host::session::Flow;
use jtc_host::{Diagnose, Error, ErrorKind, MotionError};

/// Scripted controller that answers the session and records the bytes that the session writes.
mod answers {
    use std::cell::RefCell;
    use std::rc::Rc;
    use std::time::Duration;

    use jtc_host::Port;
    use jtc_host::Session;
    use jtc_host::port::test::ScriptedPort;
    use jtc_wire::{Response, Status};

    pub(super) type Written = Rc<RefCell<Vec<u8>>>;

    /// Simulates a controller that answers each frame with `status` and the response record of the frame. The
    /// controller also sends a status every 40 ms. After the time `end`, the controller sends nothing.
    pub(super) fn session(status: Status, end: Duration) -> (Session<impl Port>, Written) {
        let written = Written::default();
        let taken = Rc::clone(&written);
        let mut next = Duration::ZERO;
        let port = ScriptedPort::new(None, move |now, bytes| {
            taken.borrow_mut().extend_from_slice(bytes);
            if now >= end {
                return Vec::new();
            }
            let mut out = Vec::new();
            if let [_, kind, ..] = bytes {
                let response = Response {
                    frame_type: *kind,
                    status: jtc_wire::FrameStatus::NoError,
                    data: jtc_wire::DataStatus::NoError,
                    length: bytes.len() as u16,
                };
                out.extend(Status { response, ..status }.emit());
            }
            if now >= next {
                next = now + Duration::from_millis(40);
                out.extend(status.emit());
            }
            out
        });
        (Session::new(port), written)
    }
}

/// J-34: resume continues a paused motion, and does not start another motion.
#[test]
fn j34_resume_only_after_a_pause() {
    use TrajectoryState::{Execute, Finish, Null, Stop};
    for trajectory in [Null, Stop, Execute, Finish] {
        let (mut s, written) = answers::session(
            jtc_wire::Status {
                state: ControllerState::HoldPos.into(),
                trajectory: trajectory.into(),
                ..Default::default()
            },
            Duration::MAX,
        );
        let error = s.resume().unwrap_err();
        assert!(
            matches!(error, Error::Motion(MotionError::NotPaused { trajectory: t, .. }) if t == trajectory),
            "{error}"
        );
        assert_eq!((error.kind(), written.borrow().len()), (ErrorKind::Refused, 0), "{error}");
        // Only in the trajectory state Execute may a motion still be decelerating after a Pause. Only then does the
        // error suggest to repeat Resume.
        assert_eq!(error.hint().contains("traj resume"), trajectory == Execute, "{}", error.hint());
    }
    let (mut s, written) = answers::session(
        jtc_wire::Status {
            state: ControllerState::HoldPos.into(),
            trajectory: TrajectoryState::Pause.into(),
            ..Default::default()
        },
        Duration::MAX,
    );
    s.resume().unwrap();
    // Before Execute, the session may send only requests for the identity and the settings of the device.
    let written = written.borrow();
    let (before, last) = written.split_last_chunk::<7>().unwrap();
    assert_eq!(*last, jtc_wire::fixed::exec(jtc_wire::ExecCommand::Execute));
    let mut rest = before;
    while let Some(length) = rest.get(2..4) {
        let (frame, more) = rest.split_at(usize::from(u16::from_be_bytes([length[0], length[1]])));
        assert!(frame == jtc_wire::fixed::GET_INFO || frame == jtc_wire::fixed::get_settings(0), "{frame:?}");
        rest = more;
    }
}

/// If the link is lost during a motion, the error states that the arm may be moving. The session sends a Stop, because the controller may
/// still receive it.
#[test]
fn a_link_lost_in_motion_says_that_the_arm_may_be_moving() {
    let moving = jtc_wire::Status {
        state: ControllerState::Operate.into(),
        trajectory: TrajectoryState::Execute.into(),
        point: 1234,
        ..Default::default()
    };
    let (mut s, written) = answers::session(moving, Duration::from_millis(500));
    let error = s.follow(|_| Flow::Continue).unwrap_err();
    assert_eq!((error.kind(), error.code()), (ErrorKind::NoLink, "link-lost"));
    let text = error.to_string();
    assert!(text.contains("THE ARM MAY BE MOVING") && text.contains("point 1234 (1.234 s)"), "{text}");
    assert!(text.contains("a Stop was sent") && !text.contains("continues"), "{text}");
    assert!(error.hint().contains("emergency stop"), "{}", error.hint());
    assert_eq!(*written.borrow(), jtc_wire::fixed::exec(jtc_wire::ExecCommand::Stop));

    let (mut s, _) = answers::session(moving, Duration::ZERO);
    let text = s.stop().unwrap_err().to_string();
    assert!(text.contains("THE ARM MAY BE MOVING"), "{text}");

    let paused = jtc_wire::Status {
        state: ControllerState::HoldPos.into(),
        trajectory: TrajectoryState::Pause.into(),
        point: 700,
        ..Default::default()
    };
    let (mut s, written) = answers::session(paused, Duration::from_millis(500));
    let text = s.follow(|_| Flow::Continue).unwrap_err().to_string();
    assert!(text.contains("paused at point 700") && !text.contains("MAY BE MOVING"), "{text}");
    assert_eq!(written.borrow().len(), 0);
}

/// If the response record of a frame is missing, the frame may have arrived, and another line may have stopped the
/// arm since then. Therefore a frame that moves or releases the arm is repeated only if a response record reports
/// that the frame was damaged.
#[test]
fn what_moves_the_arm_is_not_sent_again_for_want_of_a_record() {
    use jtc_wire::{DataStatus, FrameStatus, Response, Status, fixed};
    let paused = Status {
        state: ControllerState::HoldPos.into(),
        trajectory: TrajectoryState::Pause.into(),
        ..Status::default()
    };
    // `of` is the frame under test. `records` contains the results in its response records, one for each
    // transmission; later transmissions get no response record. `done` is `true` if the controller executes the
    // frame.
    let session = |of: &'static [u8], records: &'static [FrameStatus], done: bool| {
        let (written, mut count) = (answers::Written::default(), 0);
        let taken = std::rc::Rc::clone(&written);
        let (mut status, mut next) = (paused, Duration::ZERO);
        let port = jtc_host::port::test::ScriptedPort::new(None, move |now, bytes: &[u8]| {
            let mut out = Vec::new();
            if let [_, frame_type, ..] = *bytes {
                let mut record = Some(FrameStatus::NoError);
                if bytes == of {
                    taken.borrow_mut().extend_from_slice(bytes);
                    record = records.get(count).copied();
                    count += 1;
                    if done {
                        status.trajectory = TrajectoryState::Execute.into();
                    }
                }
                if let Some(arrived) = record {
                    let length = bytes.len() as u16;
                    let response =
                        Response { frame_type, status: arrived, data: DataStatus::NoError, length };
                    out.extend(Status { response, ..status }.emit());
                }
            }
            if now >= next {
                next = now + Duration::from_millis(40);
                out.extend(status.emit());
            }
            out
        });
        (jtc_host::Session::new(port), written)
    };
    let count = |written: &answers::Written, frame: &[u8]| written.borrow().len() / frame.len();
    use FrameStatus::{DiscontinuousFrame, IncorrectCrc, NoError};
    for (records, done, sent, good) in [
        (&[][..], false, 1, false),
        (&[], true, 1, true),
        (&[IncorrectCrc], false, 2, false),
        (&[IncorrectCrc, DiscontinuousFrame, NoError], false, 3, true),
    ] {
        let (mut s, written) = session(&fixed::EXECUTE, records, done);
        let resumed = s.resume();
        assert_eq!(count(&written, &fixed::EXECUTE), sent, "{records:?}");
        match resumed {
            Ok(()) => assert!(good, "{records:?}"),
            Err(error) => {
                assert!(!good, "{records:?}: {error}");
                assert_eq!(error.code(), "link-lost", "{error}");
            }
        }
    }
    let (mut s, written) = session(&fixed::TEACHING_MODE_ENABLE, &[], false);
    s.teach(true).unwrap_err();
    assert_eq!(count(&written, &fixed::TEACHING_MODE_ENABLE), 1);
    // A Stop is sent again until it is confirmed.
    let (mut s, written) = session(&fixed::STOP, &[], false);
    s.stop().unwrap_err();
    assert_eq!(count(&written, &fixed::STOP), 4);
}
