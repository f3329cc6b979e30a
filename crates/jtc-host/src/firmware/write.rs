//! Functions that copy an image to the drive of a board.

use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::path::Path;
use std::time::Instant;

use super::drive::volume;
use super::{Drive, FirmwareError, Image};

/// Name of the image file on the drive. The ST-LINK processes the bytes when they arrive, so the file does not stay on the drive.
const FILE: &str = "openjtc.bin";
/// Number of bytes that the program writes at once. Small writes allow the program to show its progress. The operating system decides in
/// which order the bytes reach the drive. The program does not flush after each write. A flush would also write the length of the partial
/// file to the directory, so the ST-LINK might treat the partial file as complete. If a wrong order damages the flash, the flash report of
/// the controller shows the damage.
const PIECE: usize = 32 * 1024;

/// Record of an image that was copied to the drive.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    /// Time at which the copying of the image began. A controller that started before this time runs the previous program.
    pub began: Instant,
    /// Time at which this computer had sent all bytes to the drive.
    pub ended: Instant,
    /// Content of `FAIL.TXT` before the copying.
    pub failure_before: Option<String>,
    /// Reason why the operating system could not confirm that all bytes were written. The drive disappears after the last byte, and some
    /// systems report this disappearance as an error. Only the content of the flash shows if the write succeeded.
    pub doubt: Option<String>,
}

/// Copies the image to the drive. `progress` receives the number of bytes copied so far. If the drive was removed,
/// the function writes nothing, because the folder would then be on a disk of this computer.
///
/// # Errors
///
/// Returns [`FirmwareError::Changed`] or [`FirmwareError::NotOpened`] if no byte was written. Returns
/// [`FirmwareError::DriveFull`] or [`FirmwareError::NotWritten`] if the copying failed. The board then has the
/// previous program or only a part of a program.
pub fn write_image(
    drive: &Drive,
    image: &Image,
    progress: &mut dyn FnMut(usize),
) -> Result<Written, FirmwareError> {
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

/// Creates the file on the drive. If the file was created on another file system, the function removes this file.
fn open(drive: &Drive, path: &Path) -> Result<File, FirmwareError> {
    let gone =
        || FirmwareError::Changed { what: format!("{}: the drive has disappeared", drive.path.display()) };
    let is_drive = |found: &fs::Metadata| drive.volume.is_none() || volume(found) == drive.volume;
    if !drive.is_there() || !fs::metadata(&drive.path).is_ok_and(|found| is_drive(&found)) {
        return Err(gone());
    }
    let not_opened =
        |source| FirmwareError::NotOpened { path: path.to_owned(), device: drive.device.clone(), source };
    let file = OpenOptions::new().write(true).create(true).truncate(true).open(path).map_err(not_opened)?;
    // The drive may have been removed since the first check. From here on no further check is needed, because an open
    // file always stays on its file system.
    if file.metadata().is_ok_and(|found| !found.is_file() || is_drive(&found)) {
        return Ok(file);
    }
    drop(file);
    // The new file is empty and is on a disk of this computer.
    let _ = fs::remove_file(path);
    Err(gone())
}

/// Waits until this computer has sent all bytes to the drive.
fn flushed(file: &File) -> io::Result<()> {
    file.sync_all()
}
