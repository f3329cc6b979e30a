//! Tests of the selection of the serial lines. The line of the drive's board is always queried.

use std::os::unix::fs::symlink;

use jtc_wire::ControllerState;

use super::*;
use crate::port::{Port, PortError};

/// Test set-up: drive and serial port of one USB device, and the serial port of another device.
struct Usb {
    folder: tempfile::TempDir,
    places: Places,
    drive: Drive,
}

impl Usb {
    fn new(link: &StLink) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir_all(at("class/tty")).unwrap();
        for (usb, tty) in [("1-2", "ttyACM0"), ("1-3", "ttyUSB0")] {
            let device = at(&format!("{usb}/tty/{tty}"));
            fs::create_dir_all(&device).unwrap();
            fs::write(at(usb).join("idVendor"), "").unwrap();
            symlink(device, at("class/tty").join(tty)).unwrap();
        }
        let usb = UsbDevice { folder: fs::canonicalize(at("1-2")).unwrap(), number: String::new() };
        let drive = Drive { usb: Some(usb), ..link.drive() };
        let places = Places {
            mounts: at("mounts"),
            by_label: at("by-label"),
            folders: Vec::new(),
            classes: at("class"),
            nodes: "/dev-of-test".into(),
        };
        Self { folder, places, drive }
    }

    fn open(
        &self,
        named: Option<&str>,
        mut open: impl FnMut(&str) -> Result<Box<dyn Port>, PortError>,
    ) -> Result<Lines, FirmwareError> {
        assert!(self.folder.path().exists());
        Lines::open(&self.places, &self.drive, named, &mut open)
    }
}

const OWN: &str = "/dev-of-test/ttyACM0";
const OTHER: &str = "/dev-of-test/ttyUSB0";

#[test]
fn the_board_of_the_drive_is_asked_whatever_port_is_named() {
    let (holds, idle) = (Board::running(H745, None), Board::running(H745, None));
    holds.set_status(|status| status.state = ControllerState::HoldPos.into());
    let link = StLink::new("NOD_H745ZIQ", &holds, Behaviour::Ignores);
    let usb = Usb::new(&link);
    for named in [None, Some(OWN), Some(OTHER), Some("/tmp/jtc")] {
        let mut lines =
            usb.open(named, |port| Ok(if port == OWN { holds.port() } else { idle.port() })).unwrap();
        assert_eq!(lines.proving(), Some((OWN, Some(true))));
        let before = lines.look().unwrap();
        let ports: Vec<_> = before.lines.iter().map(|line| (line.port.as_str(), line.same_device)).collect();
        let all = [(OWN, Some(true)), (OTHER, Some(false)), ("/tmp/jtc", None)];
        let expected: Vec<_> =
            all.into_iter().filter(|(port, _)| *port == OWN || named == Some(port)).collect();
        assert_eq!(ports, expected);
        let all = Permissions { assume_board: true, accept_supply: true };
        let asked = may_flash(&image(H745, 2), &usb.drive, &before, all);
        assert!(matches!(&asked, Err(FirmwareError::HasTorque { port, .. }) if port == OWN), "{asked:?}");
    }
    // If an arm is under torque on the line that the user selected, flashing is also refused.
    let mut lines =
        usb.open(Some(OTHER), |port| Ok(if port == OWN { idle.port() } else { holds.port() })).unwrap();
    let asked = may_flash(&image(H745, 2), &usb.drive, &lines.look().unwrap(), Permissions::default());
    assert!(matches!(&asked, Err(FirmwareError::HasTorque { port, .. }) if port == OTHER), "{asked:?}");
}

#[test]
fn a_board_that_another_program_has_open_is_not_flashed() {
    let board = Board::running(H745, None);
    let link = StLink::new("NOD_H745ZIQ", &board, Behaviour::Ignores);
    let usb = Usb::new(&link);
    let busy = |at: &'static str| {
        let board = board.clone();
        move |port: &str| match port == at {
            true => Err(PortError::Busy { path: port.into() }),
            false => Ok(board.port()),
        }
    };
    for (named, at) in [(None, OWN), (Some(OTHER), OWN), (Some(OTHER), OTHER), (Some("/tmp/jtc"), "/tmp/jtc")]
    {
        let error = usb.open(named, busy(at)).err().unwrap();
        assert!(matches!(&error, FirmwareError::NotAsked { port, .. } if port == at), "{error}");
        assert_eq!(error.kind(), ErrorKind::Refused);
    }
    // A port of the drive's board that cannot be opened is an error. The additional port that the user selected may
    // be missing.
    let permission = |port: &str| Err(PortError::Permission { path: port.into() });
    assert!(matches!(usb.open(None, permission), Err(FirmwareError::NotAsked { .. })));
    let gone = |port: &str| match port {
        OWN => Ok(board.port()),
        _ => Err(PortError::NotFound { path: port.into() }),
    };
    assert_eq!(usb.open(Some(OTHER), gone).err().unwrap().kind(), ErrorKind::NoLink);
}
