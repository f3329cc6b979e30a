//! Tests of the decision to flash a board. The decision depends on the report of the controller, the serial line and the image.

use jtc_wire::{ControllerState, NodeState, can_flag};

use super::*;
use crate::port::{Port, PortError};

#[test]
fn an_arm_with_torque_is_not_dropped() {
    let board = Board::running(H745, None);
    let link = StLink::new("NOD_H745ZIQ", &board, Behaviour::Ignores);
    let ask = || {
        let all = Permissions { assume_board: true, accept_supply: true };
        may_flash(&image(H745, 2), &link.drive(), &asked(&board, Some(true)), all)
    };
    assert!(ask().is_ok(), "Init, no drive enabled");
    for state in ControllerState::ALL {
        board.set_status(|status| status.state = state.into());
        let idle = [ControllerState::Init, ControllerState::Error].contains(&state);
        match ask() {
            Err(error @ FirmwareError::HasTorque { .. }) if !idle => {
                assert_eq!(error.kind(), ErrorKind::Refused)
            }
            asked => assert!(asked.is_ok() && idle, "{state}: {asked:?}"),
        }
    }
    // If one drive may hold the arm, flashing is refused. A drive may also hold the arm during a transition, a reaction to a fault or a
    // calibration.
    board.set_status(|status| status.state = ControllerState::Error.into());
    for code in 0..=255 {
        board.set_status(|status| status.joints[5].state = NodeState::new(code));
        let idle = [0, 1, 2, 10, 11, 255].contains(&code);
        assert_eq!(ask().is_ok(), idle, "{code}");
    }
}

#[test]
fn who_cannot_be_asked_has_to_be_answered_for() {
    let board = Board::running(H745, None);
    let new = image(H745, 2);
    let own = asked(&board, Some(true));
    assert_eq!(own.to_confirm(&new), None);
    for before in [asked(&board, Some(false)), asked(&board, None), Preflight::default()] {
        assert!(before.to_confirm(&new).unwrap().contains("supported"), "{before:?}");
    }
    // A report of another board does not replace the missing report of the drive's board. Such a report has no effect
    // once the drive's board itself reports.
    board.hold(true);
    let silent = asked(&board, Some(true));
    assert_eq!(silent.lines[0].answers, Answers::Nothing { bytes: 0 });
    board.hold(false);
    let both =
        |one: &Preflight, other: Preflight| Preflight { lines: [&one.lines[..], &other.lines].concat() };
    let question = both(&silent, asked(&board, Some(false))).to_confirm(&new).unwrap();
    assert!(question.contains("it may not be the board with this drive"), "{question}");
    assert_eq!(both(&own, asked(&board, Some(false))).to_confirm(&new), None);
}

#[test]
fn what_a_status_leaves_open_has_to_be_answered_for() {
    let board = Board::running(H745, None);
    let question = || asked(&board, Some(true)).to_confirm(&image(H745, 2));
    let reset = || {
        board.set_status(|status| {
            status.can_current = 0;
            status.joints[2].state = NodeState::READY;
            status.gripper = None;
        });
        assert_eq!(question(), None);
    };
    reset();
    board.set_status(|status| status.can_current = can_flag::no_answer(2));
    assert!(question().unwrap().contains("no answer from joint 3"));
    reset();
    // A joint in the state Start has not answered since the controller started, so the operator must confirm the
    // flashing.
    board.set_status(|status| status.joints[2].state = NodeState::START);
    assert!(question().unwrap().contains("no answer from joint 3"));
    reset();
    for (pump, state) in [(1, NodeState::READY), (0, NodeState::ENABLED)] {
        board.set_status(|status| {
            status.gripper = Some(jtc_wire::GripperStatus { pump, state, ..Default::default() });
        });
        assert!(question().unwrap().contains("gripper is on"));
    }
    reset();
    board.set_status(|status| status.can_current = can_flag::no_answer(6));
    assert_eq!(question(), None, "no gripper is there");
}

#[test]
fn the_question_names_what_no_file_and_no_line_shows() {
    let board = Board::running("nucleo-h743zi2", None);
    let question = |image: &Image| asked(&board, None).to_confirm(image).unwrap();
    let said = question(&image("nucleo-h743zi2", 2));
    assert!(said.contains("safety wires") && said.contains("file is complete"), "{said}");
    let folder = tempfile::tempdir().unwrap();
    super::super::fake::catalogue(folder.path(), &["nucleo-h743zi2"]);
    let listed = Image::read(&folder.path().join("nucleo-h743zi2.bin")).unwrap();
    assert!(!question(&listed).contains("file is complete"));
    // Bytes that do not form a status frame do not count as an answer of a controller.
    let noise = crate::port::test::ScriptedPort::new(None, |_, _| vec![0x55; 3]);
    let answers = look(&mut Session::new(noise)).unwrap();
    assert!(matches!(answers, Answers::Nothing { bytes: 1.. }), "{answers:?}");
    let before = Preflight { lines: vec![Asked { port: "ttyX".into(), same_device: Some(true), answers }] };
    let said = before.to_confirm(&listed).unwrap();
    assert!(said.contains("--baud"), "{said}");
}

/// Status frames that were buffered while the program waited for the operator are not used as the current state of the arm.
#[test]
fn a_second_look_sees_what_is_then() {
    let board = Board::running(H745, None);
    let mut session = Session::new(Keeps { port: board.port(), kept: Vec::new() });
    assert!(matches!(look(&mut session).unwrap(), Answers::Controller { torque: false, .. }));
    // Two minutes of status frames, all without torque, are buffered. Then a drive is enabled. The result must show
    // the torque, and not the buffered state.
    session.port_mut().keep(Duration::from_secs(120));
    board.set_status(|status| status.joints[0].state = NodeState::ENABLED);
    assert!(matches!(look(&mut session).unwrap(), Answers::Controller { torque: true, .. }));
    session.port_mut().keep(Duration::from_secs(120));
    board.hold(true);
    assert!(matches!(look(&mut session).unwrap(), Answers::Nothing { .. }));
}

/// Port that buffers unread data, like an operating system, and returns only a few bytes per read.
struct Keeps {
    port: Box<dyn Port>,
    kept: Vec<u8>,
}

impl Keeps {
    /// Buffers the data that the board sends during `time`, as if the program did not read.
    fn keep(&mut self, time: Duration) {
        let (end, mut buffer) = (self.port.now() + time, [0; 4096]);
        while self.port.now() < end {
            let n = self.port.read(&mut buffer, Duration::from_millis(50)).unwrap();
            self.kept.extend(&buffer[..n]);
        }
    }
}

impl Port for Keeps {
    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, PortError> {
        if self.kept.is_empty() {
            return self.port.read(buffer, timeout);
        }
        let n = self.kept.len().min(1_000);
        buffer[..n].copy_from_slice(&self.kept[..n]);
        self.kept.drain(..n);
        Ok(n)
    }
    fn write_all(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.port.write_all(bytes)
    }
    fn now(&self) -> Duration {
        self.port.now()
    }
    fn baud(&self) -> Option<u32> {
        self.port.baud()
    }
}

#[test]
fn an_image_goes_onto_its_own_board_only() {
    let quiet = |label: &str| {
        let link = StLink::new(label, &Board::running(H745, None), Behaviour::Ignores);
        let drive = link.drive();
        (link, drive)
    };
    let ask_over = |board: &str, drive: &Drive, runs: Option<&str>, same_device, permissions| {
        let before =
            runs.map_or(Preflight::default(), |runs| asked(&Board::running(runs, None), same_device));
        let asked = may_flash(&image(board, 2), drive, &before, permissions);
        asked.map_err(|error| {
            assert_eq!(error.kind(), ErrorKind::Refused, "{error}");
            error.code()
        })
    };
    let ask = |board: &str, drive: &Drive, runs: Option<&str>, permissions| {
        ask_over(board, drive, runs, Some(true), permissions)
    };
    let none = Permissions::default();
    let supply = Permissions { accept_supply: true, ..none };
    let (_h745, h745) = quiet("NOD_H745ZIQ");
    let (_cut, cut) = quiet("NODE_H743ZI");
    let all = Permissions { assume_board: true, accept_supply: true };
    assert_eq!(ask(H745, &h745, Some(H745), none), Ok(()));
    assert_eq!(ask("nucleo-h743zi2", &h745, None, all), Err("other-board"));
    // The label of the drive is truncated, so it does not identify the board. Either the running controller or the
    // operator must identify it.
    assert_eq!(ask("nucleo-h743zi2", &cut, None, none), Err("unnamed-board"));
    assert_eq!(ask("nucleo-h743zi2", &cut, None, Permissions { assume_board: true, ..none }), Ok(()));
    assert_eq!(ask("nucleo-h743zi2", &cut, Some("nucleo-h743zi2"), none), Ok(()));
    assert_eq!(
        ask_over("nucleo-h743zi2", &cut, Some("nucleo-h743zi2"), Some(false), none),
        Err("unnamed-board")
    );
    // The controller on the serial line runs on a board that does not match the image. Flashing is refused, even with
    // the confirmation of the operator.
    assert_eq!(ask(H745, &h745, Some("simulator"), all), Err("other-controller"));
    // Software cannot detect the core supply of the board. If a program already runs on this board, the core supply
    // matches this program.
    let ldo = "nucleo-h745zi-q-ldo";
    for (board, other) in [(ldo, H745), (H745, ldo)] {
        assert_eq!(ask(board, &h745, None, none), Err("other-supply"));
        assert_eq!(ask(board, &h745, Some(other), none), Err("other-supply"));
        assert_eq!(ask(board, &h745, Some(board), none), Ok(()));
        for same_device in [None, Some(false)] {
            assert_eq!(ask_over(board, &h745, Some(board), same_device, none), Err("other-supply"));
        }
        assert_eq!(ask(board, &h745, Some(other), supply), Ok(()));
        assert_eq!(ask(board, &h745, None, supply), Ok(()));
    }
}

/// The controller sends status frames, but its identity cannot be read. Therefore its board and its core supply are
/// unknown, and flashing is refused until the operator confirms the supply.
#[test]
fn a_controller_that_does_not_report_its_board_has_an_unknown_supply() {
    let link = StLink::new("NOD_H745ZIQ", &Board::running(H745, None), Behaviour::Ignores);
    let status = jtc_wire::Status { state: ControllerState::Init.into(), ..Default::default() };
    let port = crate::port::test::ScriptedPort::new(None, move |now, _| {
        if now.as_millis() % 40 == 0 { status.emit().to_vec() } else { Vec::new() }
    });
    let answers = look(&mut Session::new(port)).unwrap();
    assert!(matches!(answers, Answers::Controller { info: None, .. }), "{answers:?}");
    let before = Preflight { lines: vec![Asked { port: "ttyX".into(), same_device: Some(true), answers }] };
    let asked = may_flash(&image(H745, 2), &link.drive(), &before, Permissions::default());
    assert!(matches!(asked, Err(FirmwareError::Supply { runs: None, .. })), "{asked:?}");
}
