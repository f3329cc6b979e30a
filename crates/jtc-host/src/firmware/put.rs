//! Copying an image to the drive of a board.

use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::path::Path;
use std::time::Instant;

use super::drive::volume;
use super::{Drive, FirmwareError, Image};

/// Name of the file on the drive. The file does not last, because the ST-LINK consumes its bytes as they arrive.
const FILE: &str = "openjtc.bin";
/// Number of bytes per write, so that the progress can be shown. The system decides in which order the bytes reach the drive. A
/// flush after each piece would write the length of a partial file into the directory, and the ST-LINK may take that part for the
/// whole file. The flash report of the program reveals damage from another order.
const PIECE: usize = 32 * 1024;

/// Image that was handed over to the drive.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    /// Time when the copying began; a controller that started before runs the previous program.
    pub began: Instant,
    /// Time when this computer had handed over all bytes.
    pub ended: Instant,
    /// Content of `FAIL.TXT` before the copying.
    pub failure_before: Option<String>,
    /// Reason why the system could not confirm that all bytes were written. The drive vanishes after the last byte, and some
    /// systems report that as an error; the content of the flash shows the truth.
    pub doubt: Option<String>,
}

/// Copies the image to the drive; `progress` receives the number of bytes so far. If the drive was removed in the meantime and
/// its folder is on this computer's own disk, no byte is written.
///
/// # Errors
///
/// [`FirmwareError::Changed`] and [`FirmwareError::NotOpened`]: no byte was written. [`FirmwareError::DriveFull`] and
/// [`FirmwareError::NotWritten`]: the board has the previous program, or a part of one.
pub fn put(drive: &Drive, image: &Image, progress: &mut dyn FnMut(usize)) -> Result<Written, FirmwareError> {
    let failure_before = drive.failure();
    let path = drive.path.join(FILE);
    let began = Instant::now();
    let full = || FirmwareError::DriveFull {
        drive: drive.path.clone(),
        bytes: image.bytes().len(),
        failure: drive.failure(),
    };
    let failed = |source: io::Error, written: usize| match source.kind() {
        ErrorKind::StorageFull => full(),
        _ => FirmwareError::NotWritten { path: path.clone(), written, source },
    };
    let mut file = open(drive, &path).map_err(|error| match error {
        FirmwareError::NotOpened { source, .. } if source.kind() == ErrorKind::StorageFull => full(),
        error => error,
    })?;
    let mut written = 0;
    for piece in image.bytes().chunks(PIECE) {
        file.write_all(piece).map_err(|e| failed(e, written))?;
        written += piece.len();
        progress(written);
    }
    let doubt = match flushed(&file) {
        Err(e) if e.kind() == ErrorKind::StorageFull => return Err(failed(e, written)),
        Err(e) => Some(e.to_string()),
        Ok(()) => None,
    };
    Ok(Written { began, ended: Instant::now(), failure_before, doubt })
}

/// Opens the new file on the drive, and never on another file system.
fn open(drive: &Drive, path: &Path) -> Result<File, FirmwareError> {
    let gone = || FirmwareError::Changed { what: format!("{}: the drive has gone", drive.path.display()) };
    let is_drive = |found: &fs::Metadata| drive.volume.is_none() || volume(found) == drive.volume;
    if !drive.is_there() || !fs::metadata(&drive.path).is_ok_and(|found| is_drive(&found)) {
        return Err(gone());
    }
    let not_opened =
        |source| FirmwareError::NotOpened { path: path.to_owned(), device: drive.device.clone(), source };
    let file = OpenOptions::new().write(true).create(true).truncate(true).open(path).map_err(not_opened)?;
    // The drive may have been removed in between. From here on the open file keeps its file system.
    if file.metadata().is_ok_and(|found| !found.is_file() || is_drive(&found)) {
        return Ok(file);
    }
    drop(file);
    // The file is empty, and on a disk of this computer.
    let _ = fs::remove_file(path);
    Err(gone())
}

/// Waits until the bytes have left this computer.
fn flushed(file: &File) -> io::Result<()> {
    file.sync_all()
}
