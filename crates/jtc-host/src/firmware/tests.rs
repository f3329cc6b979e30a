//! From a file to a proof, with a board and an ST-LINK that are not real.

use std::fs;
use std::path::Path;
use std::time::Duration;

use host_kit::{Diagnose, ErrorKind};
use jtc_wire::{ControllerState, NodeState};

use super::fake::{Behaviour, Board, StLink, image_bytes, program_of};
use super::*;
use crate::Session;

const H745: &str = "nucleo-h745zi-q";
/// What is waited for comes at once, or never.
const LIMITS: Limits = Limits { wait: Duration::from_secs(20), pause: Duration::from_millis(20) };
const SHORT: Limits = Limits { wait: Duration::from_millis(300), pause: Duration::from_millis(20) };

fn image(board: &str, seed: u8) -> Image {
    Image::parse(Path::new("new.bin"), image_bytes(board, seed)).unwrap()
}

/// The board runs the image of seed 1; that of seed 2 is flashed.
fn flash(behaviour: Behaviour, limits: Limits) -> (Result<Proof, FirmwareError>, Board, StLink) {
    let board = Board::running(H745, Some(program_of(&image_bytes(H745, 1))));
    let link = StLink::new("NOD_H745ZIQ", &board, behaviour);
    let (drive, new) = (link.drive(), image(H745, 2));
    let before = Before { answers: look(&mut Session::new(board.port())).unwrap(), same_device: Some(true) };
    assert_eq!((before.to_confirm(), before.stored_arm()), (None, Some(true)));
    may_flash(&new, &drive, &before, Permissions::default()).unwrap();
    assert!(compare(&new, before.info().unwrap()).is_err(), "it does not run yet");
    let mut copied = 0;
    let written = put(&drive, &new, &mut |bytes| copied = bytes).unwrap();
    assert_eq!((copied, &written.doubt, &written.failure_before), (new.bytes().len(), &None, &None));
    let proof = prove(&new, &drive, &written, &mut board.opener(), limits);
    (proof, board, link)
}

#[test]
fn j67_a_board_is_flashed_and_proves_it() {
    let (proof, board, link) = flash(Behaviour::Takes, LIMITS);
    let proof = proof.unwrap();
    assert_eq!(proof.program, program_of(&image_bytes(H745, 2)));
    assert_eq!((proof.info.firmware(), proof.stored_arm()), ("0.2.0", true));
    assert_eq!(proof.drive, DriveAfter::CameBack);
    // It is the one image and not the other, whenever it is asked.
    let info = Session::new(board.port()).info().unwrap().unwrap();
    assert!(compare(&image(H745, 2), &info).is_ok());
    let said = compare(&image(H745, 1), &info).unwrap_err().to_string();
    assert!(said.contains("new.bin") && said.contains("CRC-32") && said.contains("0.2.0"), "{said}");
    drop(link);
}

#[test]
fn j67_a_hole_that_the_drive_does_not_report_is_found() {
    let (proof, ..) = flash(Behaviour::LeavesHole, LIMITS);
    let error = proof.unwrap_err();
    assert!(matches!(&error, FirmwareError::OtherProgram { why, .. } if why.contains("CRC-32")), "{error}");
    assert_eq!(error.kind(), ErrorKind::Fault);
}

#[test]
fn what_fail_txt_says_is_reported() {
    let (proof, _, link) = flash(Behaviour::Fails("The target flash is write protected\r\n"), LIMITS);
    let error = proof.unwrap_err();
    assert!(error.to_string().ends_with("The target flash is write protected"), "{error}");
    assert_eq!(error.kind(), ErrorKind::Device);
    // The same text of an earlier attempt is no report of the next one.
    let (drive, new) = (link.drive(), image(H745, 2));
    let written = put(&drive, &new, &mut |_| {}).unwrap();
    assert_eq!(written.failure_before.as_deref(), Some("The target flash is write protected"));
    let seen = wait_for_drive(&drive, &written, SHORT);
    assert!(matches!(seen, Ok(DriveAfter::Stayed)), "{seen:?}");
}

#[test]
fn a_drive_that_does_nothing_is_no_success() {
    let (proof, ..) = flash(Behaviour::Ignores, SHORT);
    let error = proof.unwrap_err();
    assert!(error.to_string().contains("the program of before still runs"), "{error}");
    assert_eq!(error.kind(), ErrorKind::Fault);
}

#[test]
fn without_a_line_the_drive_is_all_there_is() {
    let board = Board::running(H745, None);
    let link = StLink::new("NOD_H745ZIQ", &board, Behaviour::Takes);
    let drive = link.drive();
    let written = put(&drive, &image(H745, 2), &mut |_| {}).unwrap();
    assert_eq!(wait_for_drive(&drive, &written, LIMITS).unwrap(), DriveAfter::CameBack);
}

#[test]
fn a_program_that_does_not_report_its_flash_proves_nothing() {
    let board = Board::running(H745, None);
    let info = Session::new(board.port()).info().unwrap().unwrap();
    let error = compare(&image(H745, 1), &info).unwrap_err();
    assert!(matches!(error, FirmwareError::NotReported { .. }), "{error}");
}

#[test]
fn an_arm_with_torque_is_not_dropped() {
    let board = Board::running(H745, None);
    let link = StLink::new("NOD_H745ZIQ", &board, Behaviour::Ignores);
    let ask = || {
        let answers = look(&mut Session::new(board.port())).unwrap();
        let before = Before { answers, same_device: Some(true) };
        let all = Permissions { assume_board: true, accept_supply: true };
        may_flash(&image(H745, 2), &link.drive(), &before, all)
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
    // One drive that is enabled is enough.
    board.set_status(|status| {
        status.state = ControllerState::Error.into();
        status.joints[5].state = NodeState::ENABLED;
    });
    assert!(matches!(ask(), Err(FirmwareError::HasTorque { .. })));
}

#[test]
fn who_cannot_be_asked_has_to_be_answered_for() {
    let board = Board::running(H745, None);
    let answers = look(&mut Session::new(board.port())).unwrap();
    let of = |answers: &Answers, same_device| Before { answers: answers.clone(), same_device }.to_confirm();
    assert_eq!(of(&answers, Some(true)), None);
    for (answers, same) in
        [(&answers, Some(false)), (&answers, None), (&Answers::Nothing, Some(true)), (&Answers::NoPort, None)]
    {
        assert!(of(answers, same).unwrap().contains("supported"), "{answers:?} {same:?}");
    }
    board.hold(true);
    assert_eq!(look(&mut Session::new(board.port())).unwrap(), Answers::Nothing);
}

#[test]
fn an_image_goes_onto_its_own_board_only() {
    let quiet = |label: &str| {
        let link = StLink::new(label, &Board::running(H745, None), Behaviour::Ignores);
        let drive = link.drive();
        (link, drive)
    };
    let ask = |board: &str, drive: &Drive, runs: Option<&str>, permissions| {
        let answers = runs.map_or(Answers::Nothing, |runs| {
            look(&mut Session::new(Board::running(runs, None).port())).unwrap()
        });
        let before = Before { answers, same_device: Some(true) };
        let asked = may_flash(&image(board, 2), drive, &before, permissions);
        asked.map_err(|error| {
            assert_eq!(error.kind(), ErrorKind::Refused, "{error}");
            error.code()
        })
    };
    let none = Permissions::default();
    let (_h745, h745) = quiet("NOD_H745ZIQ");
    let (_cut, cut) = quiet("NODE_H743ZI");
    let all = Permissions { assume_board: true, accept_supply: true };
    assert_eq!(ask(H745, &h745, None, none), Ok(()));
    assert_eq!(ask("nucleo-h743zi2", &h745, None, all), Err("other-board"));
    // A label that is cut: the controller that runs there names the board, or a person.
    assert_eq!(ask("nucleo-h743zi2", &cut, None, none), Err("unnamed-board"));
    assert_eq!(ask("nucleo-h743zi2", &cut, None, Permissions { assume_board: true, ..none }), Ok(()));
    assert_eq!(ask("nucleo-h743zi2", &cut, Some("nucleo-h743zi2"), none), Ok(()));
    // Something else at the line is no board of this image, whatever a person says.
    assert_eq!(ask(H745, &h745, Some("simulator"), all), Err("other-controller"));
    // The supply of the core cannot be seen from outside.
    let ldo = "nucleo-h745zi-q-ldo";
    assert_eq!(ask(ldo, &h745, None, none), Err("other-supply"));
    assert_eq!(ask(ldo, &h745, Some(H745), none), Err("other-supply"));
    assert_eq!(ask(H745, &h745, Some(ldo), none), Err("other-supply"));
    assert_eq!(ask(ldo, &h745, Some(ldo), none), Ok(()));
    assert_eq!(ask(ldo, &h745, Some(H745), Permissions { accept_supply: true, ..none }), Ok(()));
}

#[test]
fn a_drive_that_cannot_be_written_is_an_error_with_the_path() {
    let board = Board::running(H745, None);
    let link = StLink::new("NOD_H745ZIQ", &board, Behaviour::Ignores);
    let drive = link.drive();
    fs::create_dir(link.path.join("openjtc.bin")).unwrap();
    let error = put(&drive, &image(H745, 2), &mut |_| {}).unwrap_err();
    assert!(matches!(error, FirmwareError::NotWritten { written: 0, .. }), "{error}");
    assert!(error.to_string().contains("openjtc.bin"), "{error}");
}

/// The device that is always full is the system's own.
#[cfg(target_os = "linux")]
#[test]
fn a_drive_that_is_full_says_what_that_means() {
    let board = Board::running(H745, None);
    let link = StLink::new("NOD_H745ZIQ", &board, Behaviour::Ignores);
    let drive = link.drive();
    std::os::unix::fs::symlink("/dev/full", link.path.join("openjtc.bin")).unwrap();
    fs::write(link.path.join("FAIL.TXT"), "no target").unwrap();
    let error = put(&drive, &image(H745, 2), &mut |_| {}).unwrap_err();
    assert!(matches!(&error, FirmwareError::DriveFull { bytes: 0x1000, .. }), "{error}");
    assert!(error.to_string().contains("no target") && error.hint().contains("BOOT0"), "{error}");
}
