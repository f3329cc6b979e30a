//! The segments that a trajectory is sent in.
//!
//! Frames are short (113 points, 4,082 bytes): beyond 4,095 bytes CRC-16 misses some double bit errors, because x has order
//! 32,767 modulo its polynomial.

use jtc_core::{SEGMENT_POINTS_MAX, SEGMENTS_MAX};

/// Points of a segment whose frame CRC-16 protects against every double bit error.
const SEGMENT_POINTS: usize = 113;
/// Points of a segment when 113 would need more than 100 segments.
const SEGMENT_POINTS_LONG: usize = 120;

/// How to upload.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UploadOptions {
    /// Points per segment; `None` chooses.
    pub points_per_segment: Option<usize>,
    /// Number of the trajectory.
    pub number: u16,
}

impl UploadOptions {
    /// Points per segment for a trajectory of `points`.
    pub fn segment_points(&self, points: usize) -> usize {
        let usual = if points > SEGMENT_POINTS * SEGMENTS_MAX { SEGMENT_POINTS_LONG } else { SEGMENT_POINTS };
        self.points_per_segment.unwrap_or(usual).clamp(1, SEGMENT_POINTS_MAX)
    }
}
