//! Advice for an image that was not written to a board, or does not run there.

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
                "`jtc firmware list` shows the images that are installed; `cargo xtask firmware` builds them; nothing was written",
            ),
            Self::NoCatalogue { .. } => of(
                Usage,
                "no-images",
                "name a file: `jtc firmware flash --image FILE`; or install the package, which brings the images; OPENJTC_FIRMWARE names \
                 another folder",
            ),
            Self::BadCatalogue { .. } => {
                of(Usage, "bad-catalogue", "install the package again; nothing was written")
            }
            Self::NoBoard { .. } => of(
                Usage,
                "no-board",
                "the name is printed on the board; `jtc firmware list` shows the images",
            ),
            Self::Damaged { .. } => of(
                Refused,
                "damaged-image",
                "nothing was written. Install the package again: the file is not the one that was released",
            ),
            Self::NoDrive { .. } => of(
                Usage,
                "no-drive",
                "`jtc firmware list` shows the drives that are found; nothing was written",
            ),
            Self::NoneFound => of(
                NoLink,
                "no-drive",
                "connect the USB connector of the ST-LINK (CN1) and mount its drive (`udisksctl mount -b /dev/sdX`); `--drive DIR` names \
                 where it is",
            ),
            Self::Several { .. } => {
                of(Usage, "several-drives", "choose one with `--drive DIR`; nothing was written")
            }
            Self::NotAsked { source, .. } => Diagnosis::new(
                Refused,
                "not-asked",
                format!(
                    "nothing was written. Only the board itself reports whether its arm has torque; an agent (`jtc serve`) that has its port \
                     has to end, too: {}",
                    source.hint()
                ),
            ),
            Self::Changed { .. } => of(
                Refused,
                "changed",
                "nothing was written. `jtc firmware list` shows what is there now; then flash again",
            ),
            Self::HasTorque { .. } => of(
                Refused,
                "has-torque",
                "nothing was written. Support the arm, then `jtc disable` takes its torque off; flash then",
            ),
            Self::OtherController { .. } => of(
                Refused,
                "other-controller",
                "nothing was written. Name the serial port of the board that has the drive: `jtc ports`, then `--port PATH`",
            ),
            Self::OtherBoard { .. } => of(
                Refused,
                "other-board",
                "nothing was written. `jtc firmware list` shows drives and images; the name is printed on the board",
            ),
            Self::UnnamedBoard { .. } => of(
                Refused,
                "unnamed-board",
                "nothing was written. Read the name that is printed on the board; if it is that of the image: `--assume-board`",
            ),
            Self::Supply { .. } => of(
                Refused,
                "other-supply",
                "nothing was written. Firmware for the wrong supply makes a board unreachable (docs/board.md, section 5); if the solder \
                 bridges are as the image needs them (never changed: the image without -ldo): `--accept-supply`",
            ),
            Self::DriveFull { .. } => of(
                Fault,
                "drive-full",
                "a drive of a few kB means that the ST-LINK does not reach the processor: BOOT0 to 3.3 V, power off and on, and try again \
                 (docs/board.md, section 5)",
            ),
            Self::NotOpened { device, .. } => {
                let device = device.as_ref().map_or("/dev/sdX".into(), |device| device.display().to_string());
                Diagnosis::new(
                    Refused,
                    "not-opened",
                    format!(
                        "mount the drive anew, for this user and to be written: `udisksctl unmount -b {device}`, then `udisksctl mount -b \
                         {device}`"
                    ),
                )
            }
            Self::NotWritten { .. } => {
                of(Fault, "not-written", "is the cable in place? Plug the board in again, and flash again")
            }
            Self::Refused { .. } => of(
                Device,
                "flash-refused",
                "unplug the board and plug it in again, and flash again; what the words mean: docs/board.md, section 11",
            ),
            Self::NotTaken { .. } => of(
                Fault,
                "not-taken",
                "what is in flash is not known: `jtc firmware verify`, over the board's serial port; else flash again",
            ),
            Self::OtherProgram { .. } => of(
                Fault,
                "other-program",
                "flash the image again: what is in flash is not it, and may not be run with an arm",
            ),
            Self::NotReported { .. } => of(
                Fault,
                "not-reported",
                "firmware from 0.2.0 on reports its flash; `jtc info` shows what this one reports",
            ),
            Self::NoController => of(
                NoLink,
                "no-controller",
                "is it the port of the board, at the rate of its firmware? `jtc doctor` looks for the reason",
            ),
            Self::NotStarted { .. } => of(
                Fault,
                "not-started",
                "press the board's reset button and compare again: `jtc firmware verify`; the rate of the line is that of the image",
            ),
            Self::Port(e) => e.diagnosis(),
        }
    }
}
