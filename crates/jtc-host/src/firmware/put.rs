//! Copying an image to the drive of a board.

use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::time::Instant;

use super::{Drive, FirmwareError, Image};

/// Name of the file on the drive. It does not last: the ST-LINK takes its bytes as they come.
const FILE: &str = "openjtc.bin";
/// The bytes go in this order, so many at once: what is behind the drive is no file system and cannot wait for those in front.
const PIECE: usize = 32 * 1024;

/// An image that is on its way into the flash.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    /// When the copying began: a controller that started before runs what was there.
    pub began: Instant,
    /// `FAIL.TXT` as it was before.
    pub failure_before: Option<String>,
    /// Why the system could not confirm that all was written. The drive vanishes when it has all bytes, and some systems report that as an
    /// error; what is in the flash shows what it was.
    pub doubt: Option<String>,
}

/// Copies the image to the drive; `progress` gets the bytes so far.
///
/// # Errors
///
/// [`FirmwareError::DriveFull`] and [`FirmwareError::NotWritten`]: the board has the program of before, or a part of one.
pub fn put(drive: &Drive, image: &Image, progress: &mut dyn FnMut(usize)) -> Result<Written, FirmwareError> {
    let failure_before = drive.failure();
    let path = drive.path.join(FILE);
    let began = Instant::now();
    let failed = |source: io::Error, written: usize| {
        if source.kind() == ErrorKind::StorageFull {
            let bytes = image.bytes().len();
            return FirmwareError::DriveFull { drive: drive.path.clone(), bytes, failure: drive.failure() };
        }
        FirmwareError::NotWritten { path: path.clone(), written, source }
    };
    let mut file =
        OpenOptions::new().write(true).create(true).truncate(true).open(&path).map_err(|e| failed(e, 0))?;
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
    Ok(Written { began, failure_before, doubt })
}

/// Waits until the bytes have left this computer.
fn flushed(file: &File) -> io::Result<()> {
    file.sync_all()
}
