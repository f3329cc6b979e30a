//! Division of a trajectory into segments for the upload.
//!
//! Normally a segment has 113 points, so its frame has 4,082 bytes. CRC-16 does not detect all double bit errors in a
//! frame of more than 4,095 bytes: x has the order 32,767 modulo the CRC polynomial.

use jtc_core::{SEGMENT_POINTS_MAX, SEGMENTS_MAX};

/// Maximum number of points of a segment for which CRC-16 detects every double bit error in the frame.
const SEGMENT_POINTS: usize = 113;
/// Number of points per segment for long trajectories, which would need more than 100 segments of 113 points.
const SEGMENT_POINTS_LONG: usize = 120;

/// Options for the upload.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UploadOptions {
    /// Points per segment. If the value is `None`, the upload chooses the number.
    pub points_per_segment: Option<usize>,
    /// Number of the trajectory.
    pub number: u16,
}

impl UploadOptions {
    /// Returns the number of points per segment for a trajectory of `points` points.
    pub fn segment_points(&self, points: usize) -> usize {
        let usual = if points > SEGMENT_POINTS * SEGMENTS_MAX { SEGMENT_POINTS_LONG } else { SEGMENT_POINTS };
        self.points_per_segment.unwrap_or(usual).clamp(1, SEGMENT_POINTS_MAX)
    }
}
