//! Why an image was not written to a board, or does not run there.

use std::io;
use std::path::PathBuf;

use host_kit::{Diagnose, Diagnosis, ErrorKind};
use jtc_wire::{Code, ControllerState};

use super::CatalogueImage;
use crate::port::PortError;

/// Why a board was not flashed, or is not known to run what was flashed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FirmwareError {
    /// A file cannot be read.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The system's words.
        source: io::Error,
    },
    /// The file is no firmware of these boards.
    #[error("{}: no firmware for a board of this project: {why}", path.display())]
    NoImage {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// No images are installed.
    #[error("no firmware images are installed: no firmware.json in {}", listed(folders))]
    NoCatalogue {
        /// Where it was looked for.
        folders: Vec<PathBuf>,
    },
    /// The catalogue of images is none, or does not fit its images.
    #[error("{}: {why}", path.display())]
    BadCatalogue {
        /// The catalogue.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// No image of the catalogue is for this board.
    #[error("no image for the board {board}; there are those for {}", known.join(", "))]
    NoBoard {
        /// The board asked for.
        board: String,
        /// The boards of the catalogue.
        known: Vec<String>,
    },
    /// A file is not the one that was released.
    #[error(
        "{}: {bytes} bytes with the SHA-256 {sha256}, and {} with {} were released", path.display(), listed.bytes, listed.sha256
    )]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Its digest.
        sha256: String,
        /// Its length.
        bytes: u64,
        /// What the catalogue lists.
        listed: Box<CatalogueImage>,
    },
    /// A folder is no drive of an ST-LINK.
    #[error("{}: no drive of an ST-LINK: {why}", path.display())]
    NoDrive {
        /// The folder.
        path: PathBuf,
        /// What was found.
        why: String,
    },
    /// No drive is there.
    #[error("no drive of an ST-LINK is mounted")]
    NoneFound,
    /// No drive was named, and several are there.
    #[error("several drives of ST-LINKs are mounted: {}", listed(drives))]
    Several {
        /// Where.
        drives: Vec<PathBuf>,
    },
    /// The arm has torque.
    #[error("the controller holds an arm (state {state}); flashing resets the board, and the arm falls")]
    HasTorque {
        /// State of the controller.
        state: Code<ControllerState>,
    },
    /// The controller on the line is no board for this image.
    #[error("the controller on the serial line runs on {runs}, and the image is for {board}")]
    OtherController {
        /// What it reports.
        runs: String,
        /// Board of the image.
        board: String,
    },
    /// The drive belongs to another board.
    #[error("{}: the drive of a board {named}, and the image is for {board}", drive.display())]
    OtherBoard {
        /// The drive.
        drive: PathBuf,
        /// What the drive calls its board.
        named: String,
        /// Board of the image.
        board: String,
    },
    /// The drive does not name its board.
    #[error("{}: the drive{} does not report its board; the image is for {board}", drive.display(), of_label(label))]
    UnnamedBoard {
        /// The drive.
        drive: PathBuf,
        /// Its label.
        label: Option<String>,
        /// Board of the image.
        board: String,
    },
    /// The image may supply the core in another way than the board is wired for.
    #[error("the image is for {board}, {}", as_supplied(runs))]
    Supply {
        /// Board of the image.
        board: String,
        /// What the board runs now, where it is known.
        runs: Option<String>,
    },
    /// The drive takes no file of this size.
    #[error("{}: the drive has no room for {bytes} bytes{}", drive.display(), with_failure(failure))]
    DriveFull {
        /// The drive.
        drive: PathBuf,
        /// Bytes of the image.
        bytes: usize,
        /// Its `FAIL.TXT`.
        failure: Option<String>,
    },
    /// The copying ended early.
    #[error("{}: {source} after {written} bytes; the board holds a part of the image", path.display())]
    NotWritten {
        /// The file on the drive.
        path: PathBuf,
        /// Bytes until then.
        written: usize,
        /// The system's words.
        source: io::Error,
    },
    /// The ST-LINK reports that it could not write the image.
    #[error("{}: the ST-LINK could not write the image: {text}", drive.display())]
    Refused {
        /// The drive.
        drive: PathBuf,
        /// What `FAIL.TXT` says.
        text: String,
    },
    /// The program that runs is another one.
    #[error("the board does not run {}: {why}; it reports {runs}", path.display())]
    OtherProgram {
        /// The image.
        path: PathBuf,
        /// Version and board that the controller reports.
        runs: String,
        /// In what its flash differs.
        why: String,
    },
    /// The program that runs does not report its flash.
    #[error(
        "the board runs {runs}, which does not report what is in its flash: it is not proved that it is the image"
    )]
    NotReported {
        /// Version and board that the controller reports.
        runs: String,
    },
    /// No controller answers on the line.
    #[error("no controller answers")]
    NoController,
    /// No controller started in time.
    #[error(
        "the image was copied, and no controller started with it within {waited_s:.0} s: {last}{}",
        with_doubt(doubt)
    )]
    NotStarted {
        /// How long was waited, s.
        waited_s: f64,
        /// What was seen last.
        last: String,
        /// What the system reported of the copying.
        doubt: Option<String>,
    },
    /// The serial port cannot be used.
    #[error(transparent)]
    Port(#[from] PortError),
}

fn listed(paths: &[PathBuf]) -> String {
    paths.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ")
}

fn of_label(label: &Option<String>) -> String {
    label.as_ref().map_or(String::new(), |label| format!(", {label},"))
}

fn as_supplied(runs: &Option<String>) -> String {
    match runs {
        Some(runs) => format!("and the board runs {runs}: its core may be supplied in another way"),
        None => "whose core is supplied by the LDO; as it is sold the board supplies it by the SMPS".into(),
    }
}

fn with_failure(failure: &Option<String>) -> String {
    failure.as_ref().map_or(String::new(), |text| format!(", and reports: {text}"))
}

fn with_doubt(doubt: &Option<String>) -> String {
    doubt
        .as_ref()
        .map_or(String::new(), |doubt| format!(" (at the end of the copying the system reported: {doubt})"))
}

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
                 bridges are as the image needs them: `--accept-supply`",
            ),
            Self::DriveFull { .. } => of(
                Fault,
                "drive-full",
                "a drive of a few kB means that the ST-LINK does not reach the processor: BOOT0 to 3.3 V, power off and on, and try again \
                 (docs/board.md, section 5)",
            ),
            Self::NotWritten { .. } => {
                of(Fault, "not-written", "is the cable in place? Plug the board in again, and flash again")
            }
            Self::Refused { .. } => of(
                Device,
                "flash-refused",
                "unplug the board and plug it in again, and flash again; what the words mean: docs/board.md, section 3",
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
                "press the board's reset button and compare again: `jtc firmware verify`; the rate of the line is that of the image (`--baud`)",
            ),
            Self::Port(e) => e.diagnosis(),
        }
    }
}
