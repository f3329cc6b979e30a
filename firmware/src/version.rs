//! Version record of this firmware at a fixed address in flash. Tools that can only read the file or the memory of the
//! firmware find the version record at this address.
use jtc_core::{POINTS_MAX, SEGMENT_POINTS_MAX, SEGMENTS_MAX};

use crate::{BAUD, BOARD, clock};

/// Address of the version record.
pub const ADDRESS: usize = 0x0800_0400;
/// First bytes of the version record.
pub const MAGIC: [u8; 8] = *b"OPENJTC\0";

/// The version record. Numbers in the record are little-endian, like all data of this processor. Texts in the record
/// are padded with zeros.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub struct Version {
    /// Identification of the record, which is [`MAGIC`].
    pub magic: [u8; 8],
    /// Layout version of the version record, which is 1.
    pub layout: u16,
    /// Size of the version record, bytes.
    pub size: u16,
    /// Version of the firmware, for example `0.1.0`.
    pub version: [u8; 12],
    /// Name of the board, spelled as its cargo feature.
    pub board: [u8; 24],
    /// Commit of the source, followed by `+` if files were changed after the commit; or `not-in-a-repo`.
    pub build: [u8; 24],
    /// Capacity of the trajectory memory, points.
    pub points: u32,
    /// Largest number of segments of a trajectory.
    pub segments: u32,
    /// Largest number of points of a segment.
    pub segment_points: u32,
    /// Number of ticks per second.
    pub tick_hz: u32,
    /// Rate of the serial lines, Bd.
    pub baud: u32,
    /// Frequency of the core, Hz.
    pub core_hz: u32,
}

impl Version {
    /// Returns the version record of this build.
    pub const fn this() -> Self {
        Self {
            magic: MAGIC,
            layout: 1,
            size: size_of::<Self>() as u16,
            version: padded(env!("CARGO_PKG_VERSION")),
            board: padded(BOARD),
            build: padded(env!("OPENJTC_BUILD")),
            points: POINTS_MAX as u32,
            segments: SEGMENTS_MAX as u32,
            segment_points: SEGMENT_POINTS_MAX as u32,
            tick_hz: clock::TICK_HZ,
            baud: BAUD,
            core_hz: clock::CORE_HZ,
        }
    }
}

/// Pads a text with zeros, or truncates the text if it is too long.
const fn padded<const N: usize>(text: &str) -> [u8; N] {
    let mut bytes = [0; N];
    let mut i = 0;
    while i < N && i < text.len() {
        bytes[i] = text.as_bytes()[i];
        i += 1;
    }
    bytes
}

const _: () = assert!(size_of::<Version>() == 96);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_record_names_this_build() {
        let version = Version::this();
        assert!(version.board.starts_with(BOARD.as_bytes()) && version.board[BOARD.len()] == 0);
        assert_eq!((version.points, version.segments, version.segment_points), (12_000, 100, 1_500));
        assert_eq!((version.tick_hz, version.size), (1_000, 96));
        assert_eq!(padded::<3>("abcd"), *b"abc");
    }
}
