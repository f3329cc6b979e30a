//! Advice for the user if an image could not be written to a board, or if the board does not run the image.

use host_kit::{Diagnose, Diagnosis, ErrorKind};

use super::FirmwareError;

impl Diagnose for FirmwareError {
    fn diagnosis(&self) -> Diagnosis {
        use ErrorKind::{Device, Fault, NoLink, Refused, Usage};
        let of = Diagnosis::new;
        match self {
            Self::File { .. } => of(Usage, "file", "check the name and the rights of the file"),
            Self::NoImage { .. } => of(
                Usage,
                "no-image",
                "`jtc firmware list` shows the installed images; `cargo xtask firmware` builds images; nothing was written",
            ),
            Self::NoCatalogue { .. } => of(
                Usage,
                "no-images",
                "name a file with `jtc firmware flash --image FILE`, or install the package with the images; OPENJTC_FIRMWARE names another folder",
            ),
            Self::BadCatalogue { .. } => {
                of(Usage, "bad-catalogue", "install the package again; nothing was written")
            }
            Self::NoBoard { .. } => of(
                Usage,
                "no-board",
                "the name is printed on the board; `jtc firmware list` shows the images",
            ),
            Self::Damaged { .. } => {
                of(Refused, "damaged-image", "nothing was written. Install the package again")
            }
            Self::NoDrive { .. } => {
                of(Usage, "no-drive", "`jtc firmware list` shows the drives; nothing was written")
            }
            Self::NoneFound => of(
                NoLink,
                "no-drive",
                "connect the USB connector of the ST-LINK (CN1) and mount its drive (`udisksctl mount -b /dev/sdX`); `--drive DIR` names the folder \
                 of the drive",
            ),
            Self::Several { .. } => {
                of(Usage, "several-drives", "choose a drive with `--drive DIR`; nothing was written")
            }
            Self::NotAsked { source, .. } => Diagnosis::new(
                Refused,
                "not-asked",
                format!(
                    "nothing was written. Only the board itself reports whether its arm has torque; also end an agent (`jtc serve`) that uses its \
                     port: {}",
                    source.hint()
                ),
            ),
            Self::Changed { .. } => of(
                Refused,
                "changed",
                "nothing was written. `jtc firmware list` shows the present drives; then flash again",
            ),
            Self::HasTorque { .. } => of(
                Refused,
                "has-torque",
                "nothing was written. Support the arm, remove its torque with `jtc disable`, then flash again",
            ),
            Self::OtherController { .. } => of(
                Refused,
                "other-controller",
                "nothing was written. Name the serial port of the board with this drive: `jtc ports`, then `--port PATH`",
            ),
            Self::OtherBoard { .. } => of(
                Refused,
                "other-board",
                "nothing was written. `jtc firmware list` shows drives and images; the name is printed on the board",
            ),
            Self::UnnamedBoard { .. } => of(
                Refused,
                "unnamed-board",
                "nothing was written. Read the name that is printed on the board; if it matches the image, use `--assume-board`",
            ),
            Self::Supply { .. } => of(
                Refused,
                "other-supply",
                "nothing was written. Firmware for the wrong supply makes a board unreachable (docs/board.md, section 5). If the solder bridges \
                 match the image, use `--accept-supply`; unchanged bridges need the image without -ldo",
            ),
            Self::DriveFull { .. } => of(
                Fault,
                "drive-full",
                "a drive of a few kB means that the ST-LINK does not reach the processor: connect BOOT0 to 3.3 V, switch the power off and on, and \
                 try again (docs/board.md, section 5)",
            ),
            Self::NotOpened { device, .. } => {
                let device = device.as_ref().map_or("/dev/sdX".into(), |device| device.display().to_string());
                Diagnosis::new(
                    Refused,
                    "not-opened",
                    format!(
                        "mount the drive again, writable for this user: `udisksctl unmount -b {device}`, then `udisksctl mount -b {device}`"
                    ),
                )
            }
            Self::NotWritten { .. } => {
                of(Fault, "not-written", "check the cable, plug the board in again, and flash again")
            }
            Self::Refused { .. } => of(
                Device,
                "flash-refused",
                "unplug the board, plug it in again, and flash again; docs/board.md, section 11, explains the message",
            ),
            Self::NotTaken { .. } => of(
                Fault,
                "not-taken",
                "the content of the flash is unknown: run `jtc firmware verify` over the board's serial port, or flash again",
            ),
            Self::OtherProgram { .. } => of(
                Fault,
                "other-program",
                "flash the image again: the flash has another program, which must not run with an arm",
            ),
            Self::NotReported { .. } => of(
                Fault,
                "not-reported",
                "firmware since version 0.2.0 reports its flash; `jtc info` shows the report of this firmware",
            ),
            Self::NoController => of(
                NoLink,
                "no-controller",
                "check that this is the port of the board, at the rate of its firmware; `jtc doctor` finds the reason",
            ),
            Self::NotStarted { .. } => of(
                Fault,
                "not-started",
                "press the reset button of the board and compare again with `jtc firmware verify`, at the rate of the image",
            ),
            Self::Port(e) => e.diagnosis(),
        }
    }
}
