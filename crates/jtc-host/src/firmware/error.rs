//! Errors when an image is written to a board, and when the program verifies that the board runs it.

use std::io;
use std::path::PathBuf;

use jtc_wire::{Code, ControllerState};

use super::{CatalogueImage, DriveAfter};
use crate::port::PortError;

/// Reason why a board was not flashed, or why the program could not verify that the board runs the image.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FirmwareError {
    /// A file cannot be read.
    #[error("{}: {source}", path.display())]
    File {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The file is not firmware for these boards.
    #[error("{}: not firmware for a board of this project: {why}", path.display())]
    NoImage {
        /// Path of the file.
        path: PathBuf,
        /// Text that describes the fault in the file.
        why: String,
    },
    /// No catalogue of firmware images is installed.
    #[error("no firmware images are installed: no firmware.json in {}", listed(folders))]
    NoCatalogue {
        /// Folders that were searched.
        folders: Vec<PathBuf>,
    },
    /// The catalogue of images is invalid, or does not match the image files.
    #[error("{}: {why}", path.display())]
    BadCatalogue {
        /// Path of the catalogue.
        path: PathBuf,
        /// Text that describes the fault in the catalogue.
        why: String,
    },
    /// The catalogue has no image for this board.
    #[error("no image for the board {board}; the images are for {}", known.join(", "))]
    NoBoard {
        /// Name of the requested board.
        board: String,
        /// Names of the boards in the catalogue.
        known: Vec<String>,
    },
    /// A file differs from the file of the release.
    #[error(
        "{}: this is not the released file: {bytes} bytes with the SHA-256 {sha256}, expected {} with {}", path.display(), listed.bytes, listed.sha256
    )]
    Damaged {
        /// Path of the file.
        path: PathBuf,
        /// SHA-256 of the file.
        sha256: String,
        /// Length of the file, bytes.
        bytes: u64,
        /// Entry of the file in the catalogue.
        listed: Box<CatalogueImage>,
    },
    /// The folder is not the mount point of an ST-LINK drive.
    #[error("{}: not the drive of an ST-LINK: {why}", path.display())]
    NoDrive {
        /// Path of the folder.
        path: PathBuf,
        /// Reason why the folder is not a drive.
        why: String,
    },
    /// No ST-LINK drive is mounted.
    #[error("no drive of an ST-LINK is mounted")]
    NoneFound,
    /// Several ST-LINK drives are mounted, but the user did not select one of them.
    #[error("several drives of ST-LINKs are mounted: {}", listed(drives))]
    Several {
        /// Mount points of the drives.
        drives: Vec<PathBuf>,
    },
    /// The program must query the board over a serial port before it flashes the board, but the port cannot be used.
    #[error("the board must report its state over {port} before it is flashed: {source}")]
    NotAsked {
        /// Name of the serial port.
        port: String,
        /// Reason why the port cannot be used.
        source: PortError,
    },
    /// The drive or the board has changed since the last check.
    #[error("{what}")]
    Changed {
        /// Text that describes the change.
        what: String,
    },
    /// The arm is or may be under torque, so the board must not be reset.
    #[error(
        "the controller at {port} holds an arm (state {state}); flashing resets the board, and the arm falls"
    )]
    HasTorque {
        /// Port of the controller.
        port: String,
        /// State of the controller.
        state: Code<ControllerState>,
    },
    /// The controller on the serial line runs on a board that does not match the image.
    #[error("the controller at {port} runs on {runs}, but the image is for {board}")]
    OtherController {
        /// Port of the controller.
        port: String,
        /// Name of the board that the controller reports.
        runs: String,
        /// Board for which the image was built.
        board: String,
    },
    /// The drive belongs to a different board than the image.
    #[error("{}: this drive belongs to a board {named}, but the image is for {board}", drive.display())]
    OtherBoard {
        /// Path of the drive.
        drive: PathBuf,
        /// Board name on the drive.
        named: String,
        /// Board for which the image was built.
        board: String,
    },
    /// The drive does not name its board.
    #[error("{}: the drive{} does not report its board; the image is for {board}", drive.display(), of_label(label))]
    UnnamedBoard {
        /// Path of the drive.
        drive: PathBuf,
        /// Label of the drive; `None` if the label is unknown.
        label: Option<String>,
        /// Board for which the image was built.
        board: String,
    },
    /// The image needs one of two core supplies, and the wiring of the board may use the other one.
    #[error("the image is for {board}, {}", as_supplied(board, runs))]
    Supply {
        /// Board for which the image was built.
        board: String,
        /// Board for which the running program was built; `None` if the controller does not report it, or if it is
        /// the board of the image.
        runs: Option<String>,
    },
    /// The drive does not have space for the image file.
    #[error("{}: the drive has no space for {bytes} bytes{}", drive.display(), with_failure(failure))]
    DriveFull {
        /// Path of the drive.
        drive: PathBuf,
        /// Size of the image, bytes.
        bytes: usize,
        /// Content of `FAIL.TXT`.
        failure: Option<String>,
    },
    /// The file on the drive cannot be created.
    #[error("{}: {}: {source}", path.display(), cannot_open(source))]
    NotOpened {
        /// Path of the file on the drive.
        path: PathBuf,
        /// Block device of the drive; `None` if the device is unknown.
        device: Option<PathBuf>,
        /// Error of the operating system.
        source: io::Error,
    },
    /// An error interrupted the copying of the file.
    #[error("{}: {source} after {written} bytes; the board may contain a part of the image", path.display())]
    NotWritten {
        /// Path of the file on the drive.
        path: PathBuf,
        /// Number of bytes written before the error.
        written: usize,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The ST-LINK reports that it could not write the image.
    #[error("{}: the ST-LINK could not write the image: {text}", drive.display())]
    Refused {
        /// Path of the drive.
        drive: PathBuf,
        /// Content of `FAIL.TXT`.
        text: String,
    },
    /// The drive does not behave like a drive that has accepted an image.
    #[error("the image was copied, but {seen}{}", with_doubt(doubt))]
    NotTaken {
        /// Observed behaviour of the drive.
        seen: DriveAfter,
        /// Error that the operating system reported while the image was copied. The copy may still be complete.
        doubt: Option<String>,
    },
    /// The running program differs from the image.
    #[error("the board does not run {}: {why}; it reports {runs}", path.display())]
    OtherProgram {
        /// Path of the image file.
        path: PathBuf,
        /// Version and board that the controller reports.
        runs: String,
        /// Text that describes the difference between the flash of the board and the image.
        why: String,
    },
    /// The program on the board does not report the content of its flash.
    #[error(
        "the board runs {runs}, which does not report the content of its flash, so the image cannot be verified"
    )]
    NotReported {
        /// Version and board that the controller reports.
        runs: String,
    },
    /// No controller answers on the serial line.
    #[error("no controller answers")]
    NoController,
    /// No controller started with the image in time.
    #[error(
        "the image was copied, but no controller started with it within {waited_s:.0} s: {last}{}",
        with_doubt(doubt)
    )]
    NotStarted {
        /// Time for which the program waited, s.
        waited_s: f64,
        /// Text that describes the last observation.
        last: String,
        /// Error that the operating system reported during the copying.
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

fn as_supplied(board: &str, runs: &Option<String>) -> String {
    match runs {
        Some(runs) => format!("but the board runs {runs}: its core may have another supply"),
        None if board.ends_with("-ldo") => {
            "with its core supplied by the LDO; a new board supplies its core by the SMPS, and no firmware reports a change on this board"
                .into()
        }
        None => {
            "with its core supplied by the SMPS, as on a new board; no firmware confirms this for this board"
                .into()
        }
    }
}

fn cannot_open(source: &io::Error) -> &'static str {
    match source.kind() {
        io::ErrorKind::PermissionDenied => "nothing was written; this user may not write to the drive",
        io::ErrorKind::ReadOnlyFilesystem => "nothing was written; the drive is mounted read-only",
        _ => "nothing was written; the file cannot be created on the drive",
    }
}

fn with_failure(failure: &Option<String>) -> String {
    failure.as_ref().map_or(String::new(), |text| format!(", and reports: {text}"))
}

fn with_doubt(doubt: &Option<String>) -> String {
    doubt
        .as_ref()
        .map_or(String::new(), |doubt| format!(" (at the end of the copy the system reported: {doubt})"))
}
