//! Encoding of a log as bytes. A recording contains these bytes, so the log in a recording file can be replayed.

use std::path::{Path, PathBuf};

use host_kit::{Diagnose, Diagnosis, ErrorKind};
use jtc_wire::{LogState, POINT_LEN, RawPoint};

use super::{FlightLog, blocks_of};
use crate::recording::{self, RecordingError};

/// Magic bytes at the start of an encoded log. The last byte is the version of the format.
const MAGIC: &[u8; 8] = b"JTCLOG\0\x01";

/// Kinds of the sections of an encoded log.
mod part {
    pub(super) const STATE: u8 = 1;
    pub(super) const BLOCKS: u8 = 2;
    pub(super) const ARM: u8 = 3;
    pub(super) const FIRST_POINT: u8 = 4;
    pub(super) const POINTS: u8 = 5;
    pub(super) const POINTS_HASH: u8 = 6;
    pub(super) const DEVICE: u8 = 7;
}

/// Reason why a log cannot be read from a file.
#[derive(Debug, thiserror::Error)]
pub enum LogFileError {
    /// The file cannot be read or is not a recording.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The recording contains no log.
    #[error("{}: the file contains no log of a flight recorder", path.display())]
    NoLog {
        /// Path of the file.
        path: PathBuf,
    },
}

impl Diagnose for LogFileError {
    fn diagnosis(&self) -> Diagnosis {
        match self {
            Self::Recording(error) => error.diagnosis(),
            Self::NoLog { .. } => Diagnosis::new(
                ErrorKind::Usage,
                "no-log",
                "`jtc log fetch -o FILE.mcap` writes a log; `jtc report FILE` shows any recording",
            ),
        }
    }
}

impl FlightLog {
    /// Encodes the log as bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        let mut put = |kind: u8, data: &[u8]| {
            bytes.push(kind);
            bytes.extend((data.len() as u32).to_be_bytes());
            bytes.extend(data);
        };
        put(part::STATE, &[self.state as u8]);
        let words: Vec<u8> = self.blocks.iter().flatten().flat_map(|word| word.to_le_bytes()).collect();
        put(part::BLOCKS, &words);
        put(part::ARM, &self.arm);
        put(part::FIRST_POINT, &(self.first_point as u32).to_be_bytes());
        let points: Vec<u8> = self.points.iter().flat_map(RawPoint::emit).collect();
        put(part::POINTS, &points);
        put(part::POINTS_HASH, &self.points_hash.to_be_bytes());
        put(part::DEVICE, self.device.as_bytes());
        bytes
    }

    /// Reads the log from a file that `jtc log fetch` wrote.
    ///
    /// # Errors
    ///
    /// Returns an error if the file cannot be read or contains no log.
    pub fn load(path: &Path) -> Result<Self, LogFileError> {
        let bytes = recording::read_log(path)?;
        let log = bytes.as_deref().and_then(Self::from_bytes);
        log.ok_or_else(|| LogFileError::NoLog { path: path.to_owned() })
    }

    /// Decodes a log. Sections that a later version of the format has added are skipped. Returns `None` if the bytes are not a valid log.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let mut rest = bytes.strip_prefix(MAGIC)?;
        let mut log = Self::default();
        while let Some((head, after)) = rest.split_first_chunk::<5>() {
            let [kind, a, b, c, d] = *head;
            let len = u32::from_be_bytes([a, b, c, d]) as usize;
            let data = after.get(..len)?;
            rest = &after[len..];
            let number = || data.first_chunk().map(|bytes| u32::from_be_bytes(*bytes));
            match kind {
                part::STATE => log.state = LogState::from_byte(*data.first()?)?,
                part::BLOCKS => log.blocks = blocks_of(data),
                part::ARM => log.arm = data.to_vec(),
                part::FIRST_POINT => log.first_point = number()? as usize,
                part::POINTS => {
                    log.points = data.as_chunks::<POINT_LEN>().0.iter().map(RawPoint::parse).collect();
                }
                part::POINTS_HASH => log.points_hash = number()?,
                part::DEVICE => log.device = String::from_utf8_lossy(data).into_owned(),
                _ => {}
            }
        }
        rest.is_empty().then_some(log)
    }
}
