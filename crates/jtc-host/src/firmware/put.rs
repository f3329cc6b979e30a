//! Copying an image to the drive of a board.

use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::path::Path;
use std::time::Instant;

use super::drive::volume;
use super::{Drive, FirmwareError, Image};

/// Name of the file on the drive. It does not last: the ST-LINK takes its bytes as they come.
const FILE: &str = "openjtc.bin";
/// So many bytes are handed to the system at once, to show how far it is. In which order they get to the drive is the system's affair:
/// waiting for each piece would write the length of a part of the file into its directory, which the ST-LINK may take for the whole. What
/// comes of another order is found by what the program reads of its flash.
const PIECE: usize = 32 * 1024;

/// An image that is on its way into the flash.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    /// When the copying began: a controller that started before runs what was there.
    pub began: Instant,
    /// When this computer had handed over all bytes.
    pub ended: Instant,
    /// `FAIL.TXT` as it was before.
    pub failure_before: Option<String>,
    /// Why the system could not confirm that all was written. The drive vanishes when it has all bytes, and some systems report that as an
    /// error; what is in the flash shows what it was.
    pub doubt: Option<String>,
}

/// Copies the image to the drive; `progress` gets the bytes so far. Nothing is written where the drive has gone meanwhile, and its folder is
/// one of this computer's own disk.
///
/// # Errors
///
/// [`FirmwareError::Changed`] and [`FirmwareError::NotOpened`]: nothing was written. [`FirmwareError::DriveFull`] and
/// [`FirmwareError::NotWritten`]: the board has the program of before, or a part of one.
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

/// The new file on the drive, and on nothing else.
fn open(drive: &Drive, path: &Path) -> Result<File, FirmwareError> {
    let gone = || FirmwareError::Changed { what: format!("{}: the drive has gone", drive.path.display()) };
    let is_drive = |found: &fs::Metadata| drive.volume.is_none() || volume(found) == drive.volume;
    if !drive.is_there() || !fs::metadata(&drive.path).is_ok_and(|found| is_drive(&found)) {
        return Err(gone());
    }
    let not_opened =
        |source| FirmwareError::NotOpened { path: path.to_owned(), device: drive.device.clone(), source };
    let file = OpenOptions::new().write(true).create(true).truncate(true).open(path).map_err(not_opened)?;
    // It may have gone in between. From here on the open file keeps its file system.
    if file.metadata().is_ok_and(|found| !found.is_file() || is_drive(&found)) {
        return Ok(file);
    }
    drop(file);
    // Empty, and on a disk of this computer.
    let _ = fs::remove_file(path);
    Err(gone())
}

/// Waits until the bytes have left this computer.
fn flushed(file: &File) -> io::Result<()> {
    file.sync_all()
}
