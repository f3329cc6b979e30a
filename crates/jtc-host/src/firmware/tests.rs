//! Tests of all steps of flashing, from reading an image file to verifying the flash, with a simulated board and ST-LINK.

use std::fs;
use std::path::Path;
use std::time::Duration;

use host_kit::{Diagnose, ErrorKind};

use super::fake::{Behaviour, Board, StLink, image_bytes, program_of};
use super::*;
use crate::Session;

mod before;
#[cfg(unix)]
mod lines;

const H745: &str = "nucleo-h745zi-q";
/// Time limits for tests in which the expected event occurs immediately. `SHORT` contains the time limits for tests
/// in which the awaited event never occurs.
const LIMITS: Limits = Limits { wait: Duration::from_secs(20), pause: Duration::from_millis(20) };
const SHORT: Limits = Limits { wait: Duration::from_millis(300), pause: Duration::from_millis(20) };

fn image(board: &str, seed: u8) -> Image {
    Image::parse(Path::new("new.bin"), image_bytes(board, seed)).unwrap()
}

/// Returns the paths on a computer without drives and ports.
fn places() -> Places {
    let nowhere = || Path::new("/nowhere-of-test").to_owned();
    Places {
        mounts: nowhere(),
        by_label: nowhere(),
        folders: Vec::new(),
        classes: nowhere(),
        nodes: nowhere(),
    }
}

/// Returns the report of the board on a serial line. `same_device` is `true` if the line belongs to the drive's USB device.
fn asked(board: &Board, same_device: Option<bool>) -> Preflight {
    let answers = look(&mut Session::new(board.port())).unwrap();
    Preflight { lines: vec![Asked { port: "ttyX".into(), same_device, answers }] }
}

/// Writes the image of seed 2 to a board that runs the image of seed 1.
fn flash(behaviour: Behaviour, limits: Limits) -> (Result<Verification, FirmwareError>, Board, StLink) {
    let board = Board::running(H745, Some(program_of(&image_bytes(H745, 1))));
    let link = StLink::new("NOD_H745ZIQ", &board, behaviour);
    let (drive, new) = (link.drive(), image(H745, 2));
    let before = asked(&board, Some(true));
    assert_eq!((before.to_confirm(&new), before.stored_arm()), (None, Some(true)));
    may_flash(&new, &drive, &before, Permissions::default()).unwrap();
    assert!(compare(&new, before.info().unwrap()).is_err(), "it does not run yet");
    let mut copied = 0;
    let written = write_image(&drive, &new, &mut |bytes| copied = bytes).unwrap();
    assert_eq!((copied, &written.doubt, &written.failure_before), (new.bytes().len(), &None, &None));
    let verification = verify_program(&places(), &new, &drive, &written, &mut board.opener(), limits);
    (verification, board, link)
}

#[test]
fn j67_a_board_is_flashed_and_proves_it() {
    let (verification, board, link) = flash(Behaviour::Takes, LIMITS);
    let verification = verification.unwrap();
    assert_eq!(verification.program, program_of(&image_bytes(H745, 2)));
    assert_eq!((verification.info.firmware(), verification.stored_arm()), ("0.2.0", true));
    assert_eq!(verification.drive, DriveAfter::CameBack);
    // The report that the new program sends matches the new image and does not match the old image.
    let info = Session::new(board.port()).info().unwrap().unwrap();
    assert!(compare(&image(H745, 2), &info).is_ok());
    let said = compare(&image(H745, 1), &info).unwrap_err().to_string();
    assert!(said.contains("new.bin") && said.contains("CRC-32") && said.contains("0.2.0"), "{said}");
    drop(link);
}

#[test]
fn j67_a_hole_that_the_drive_does_not_report_is_found() {
    let (verification, ..) = flash(Behaviour::LeavesHole, LIMITS);
    let error = verification.unwrap_err();
    assert!(matches!(&error, FirmwareError::OtherProgram { why, .. } if why.contains("CRC-32")), "{error}");
    assert_eq!(error.kind(), ErrorKind::Fault);
}

#[test]
fn j67_the_program_of_before_may_start_anew_before_it_is_stopped() {
    let (verification, ..) = flash(Behaviour::StartsBeforeAnew, LIMITS);
    assert_eq!(verification.unwrap().program, program_of(&image_bytes(H745, 2)));
}

#[test]
fn a_controller_that_never_has_read_its_flash_is_not_waited_for() {
    // The clock of this simulated controller stands still, so the controller always seems to have just started. The
    // program must still stop waiting for its flash report.
    let mut asked = 0;
    let port = crate::port::test::ScriptedPort::new(Some(9_600), move |_, bytes| {
        if bytes.is_empty() {
            return jtc_wire::Status::default().emit().to_vec();
        }
        asked += 1;
        assert!(asked < 10_000, "it is asked for ever");
        let response =
            jtc_wire::Response::good(jtc_wire::FrameType::GetInfo, jtc_wire::DataStatus::NoError, 6);
        let mut out = jtc_wire::Status { response, ..Default::default() }.emit().to_vec();
        let mut frame = [0; jtc_wire::ANSWER_MAX];
        let n = jtc_wire::Answer::Info(jtc_wire::Info::default()).emit(&mut frame).unwrap();
        out.extend(&frame[..n]);
        out
    });
    let info = info_with_program(&mut Session::new(port)).unwrap().unwrap();
    assert_eq!(info.program, None);
}

#[test]
fn what_fail_txt_says_is_reported() {
    let (verification, _, link) = flash(Behaviour::Fails("The target flash is write protected\r\n"), LIMITS);
    let error = verification.unwrap_err();
    assert!(error.to_string().ends_with("The target flash is write protected"), "{error}");
    assert_eq!(error.kind(), ErrorKind::Device);
    // The failure text of an earlier attempt stays on the drive. This text must not be used as the result of the next
    // attempt.
    let (drive, new) = (link.drive(), image(H745, 2));
    let written = write_image(&drive, &new, &mut |_| {}).unwrap();
    assert_eq!(written.failure_before.as_deref(), Some("The target flash is write protected"));
    let seen = wait_for_drive(&places(), &drive, &written, SHORT).unwrap_err();
    assert!(matches!(seen, FirmwareError::NotTaken { seen: DriveAfter::Stayed, .. }), "{seen}");
}

#[test]
fn a_drive_that_does_nothing_is_no_success() {
    let (verification, ..) = flash(Behaviour::Ignores, SHORT);
    let error = verification.unwrap_err();
    assert!(error.to_string().contains("the previous program still runs"), "{error}");
    assert_eq!(error.kind(), ErrorKind::Fault);
}

#[test]
fn without_a_line_the_drive_is_all_there_is() {
    let board = Board::running(H745, None);
    let link = StLink::new("NOD_H745ZIQ", &board, Behaviour::Takes);
    let drive = link.drive();
    let written = write_image(&drive, &image(H745, 2), &mut |_| {}).unwrap();
    assert_eq!(wait_for_drive(&places(), &drive, &written, LIMITS).unwrap(), DriveAfter::CameBack);
}

#[test]
fn a_drive_that_does_not_come_back_is_no_success_where_the_system_is_in_doubt() {
    let board = Board::running(H745, None);
    let link = StLink::new("NOD_H745ZIQ", &board, Behaviour::Ignores);
    let drive = link.drive();
    let written = write_image(&drive, &image(H745, 2), &mut |_| {}).unwrap();
    let doubtful = Written { doubt: Some("Input/output error".into()), ..written.clone() };
    // If the drive never disappears, it has not accepted the image. If the drive was removed, it may have accepted
    // the image.
    let stayed = wait_for_drive(&places(), &drive, &written, SHORT).unwrap_err();
    assert!(stayed.to_string().contains("has not disappeared"), "{stayed}");
    fs::remove_dir_all(&link.path).unwrap();
    assert_eq!(wait_for_drive(&places(), &drive, &written, SHORT).unwrap(), DriveAfter::Gone);
    let gone = wait_for_drive(&places(), &drive, &doubtful, SHORT).unwrap_err();
    assert!(gone.to_string().contains("Input/output error"), "{gone}");
    assert_eq!((stayed.kind(), gone.kind()), (ErrorKind::Fault, ErrorKind::Fault));
}

#[test]
fn nothing_is_written_where_the_drive_has_gone() {
    let board = Board::running(H745, None);
    let link = StLink::new("NOD_H745ZIQ", &board, Behaviour::Ignores);
    let drive = link.drive();
    let refused = |drive: &Drive| {
        let error = write_image(drive, &image(H745, 2), &mut |_| {}).unwrap_err();
        assert!(matches!(error, FirmwareError::Changed { .. }), "{error}");
        assert_eq!(error.kind(), ErrorKind::Refused);
        assert!(!link.path.join("openjtc.bin").exists());
    };
    // The test simulates that another file system is mounted at the path of the drive.
    refused(&Drive { volume: Some(u64::MAX), ..drive.clone() });
    // The drive was removed, so the mount point is an empty folder.
    fs::remove_file(link.path.join("DETAILS.TXT")).unwrap();
    refused(&drive);
}

#[test]
fn a_program_that_does_not_report_its_flash_proves_nothing() {
    let board = Board::running(H745, None);
    let info = Session::new(board.port()).info().unwrap().unwrap();
    let error = compare(&image(H745, 1), &info).unwrap_err();
    assert!(matches!(error, FirmwareError::NotReported { .. }), "{error}");
}

#[test]
fn a_drive_that_cannot_be_written_is_an_error_with_the_path() {
    let board = Board::running(H745, None);
    let link = StLink::new("NOD_H745ZIQ", &board, Behaviour::Ignores);
    let drive = link.drive();
    fs::create_dir(link.path.join("openjtc.bin")).unwrap();
    let error = write_image(&drive, &image(H745, 2), &mut |_| {}).unwrap_err();
    assert!(matches!(error, FirmwareError::NotOpened { .. }), "{error}");
    assert!(error.to_string().contains("openjtc.bin"), "{error}");
    assert!(error.to_string().contains("nothing was written"), "{error}");
    assert_eq!(error.kind(), ErrorKind::Refused);
}

#[test]
fn a_drive_that_may_not_be_written_says_how_it_can() {
    for (os, words) in [(13, "this user may not write"), (30, "mounted read-only")] {
        let (path, device) = ("/media/x/openjtc.bin".into(), Some("/dev/sdq".into()));
        let error = FirmwareError::NotOpened { path, device, source: std::io::Error::from_raw_os_error(os) };
        assert!(error.to_string().contains(words), "{error}");
        assert!(error.hint().contains("udisksctl mount -b /dev/sdq"), "{}", error.hint());
    }
}

/// On Linux, the device `/dev/full` is always full.
#[cfg(target_os = "linux")]
#[test]
fn a_drive_that_is_full_says_what_that_means() {
    let board = Board::running(H745, None);
    let link = StLink::new("NOD_H745ZIQ", &board, Behaviour::Ignores);
    let drive = link.drive();
    std::os::unix::fs::symlink("/dev/full", link.path.join("openjtc.bin")).unwrap();
    fs::write(link.path.join("FAIL.TXT"), "no target").unwrap();
    let error = write_image(&drive, &image(H745, 2), &mut |_| {}).unwrap_err();
    assert!(matches!(&error, FirmwareError::DriveFull { .. }), "{error}");
    assert!(error.to_string().contains("1048644 bytes"), "{error}");
    assert!(error.to_string().contains("no target") && error.hint().contains("BOOT0"), "{error}");
}
