//! Why an image was not written to a board, or does not run there.

use std::io;
use std::path::PathBuf;

use jtc_wire::{Code, ControllerState};

use super::{CatalogueImage, DriveAfter};
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
    /// A serial port has to be asked before the board is flashed, and cannot be used.
    #[error("the board has to be asked over {port} before it is flashed: {source}")]
    NotAsked {
        /// The port.
        port: String,
        /// Why it cannot be used.
        source: PortError,
    },
    /// What was looked at before is not what is there.
    #[error("{what}")]
    Changed {
        /// What is another one.
        what: String,
    },
    /// The arm has torque.
    #[error(
        "the controller at {port} holds an arm (state {state}); flashing resets the board, and the arm falls"
    )]
    HasTorque {
        /// Its port.
        port: String,
        /// State of the controller.
        state: Code<ControllerState>,
    },
    /// The controller on the line is no board for this image.
    #[error("the controller at {port} runs on {runs}, and the image is for {board}")]
    OtherController {
        /// Its port.
        port: String,
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
    #[error("the image is for {board}, {}", as_supplied(board, runs))]
    Supply {
        /// Board of the image.
        board: String,
        /// What the board runs now, where it reports it and it is another image.
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
    /// No file can be made on the drive.
    #[error("{}: {}: {source}", path.display(), cannot_open(source))]
    NotOpened {
        /// The file on the drive.
        path: PathBuf,
        /// The device that is mounted there, where it is known.
        device: Option<PathBuf>,
        /// The system's words.
        source: io::Error,
    },
    /// The copying ended early.
    #[error("{}: {source} after {written} bytes; the board may hold a part of the image", path.display())]
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
    /// The drive does not behave as one does that has taken an image.
    #[error("the image was copied, and {seen}{}", with_doubt(doubt))]
    NotTaken {
        /// What became of the drive.
        seen: DriveAfter,
        /// What the system reported of the copying.
        doubt: Option<String>,
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

fn as_supplied(board: &str, runs: &Option<String>) -> String {
    match runs {
        Some(runs) => format!("and the board runs {runs}: its core may be supplied in another way"),
        None if board.ends_with("-ldo") => {
            "whose core is supplied by the LDO; as it is sold the board supplies it by the SMPS, \
             and no firmware reports that this one does not"
                .into()
        }
        None => {
            "whose core is supplied by the SMPS as it is sold, and no firmware reports that this one still is"
                .into()
        }
    }
}

fn cannot_open(source: &io::Error) -> &'static str {
    match source.kind() {
        io::ErrorKind::PermissionDenied => "nothing was written; this user may not write to the drive",
        io::ErrorKind::ReadOnlyFilesystem => "nothing was written; the drive is mounted read-only",
        _ => "nothing was written; no file can be made on the drive",
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
