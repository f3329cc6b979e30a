//! Bodies of Trajectory frames: four numbers (trajectory, segment, number of segments, step time), followed by points
//! of eighteen int16 values.
use crate::frame::{JOINTS, POINT_LEN};

/// Trajectory point in the wire format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[repr(C)]
pub struct RawPoint {
    /// Raw positions; full scale is 3.141592 rad.
    pub position: [i16; JOINTS],
    /// Raw velocities; full scale is 6.283185 rad/s.
    pub velocity: [i16; JOINTS],
    /// Raw accelerations; full scale is 12.566370 rad/s².
    pub acceleration: [i16; JOINTS],
}

/// Position, in rad, for a raw value of 32767 in a trajectory point. The protocol defines these three full-scale
/// values; they are not rounded constants.
#[allow(clippy::approx_constant)]
pub const POSITION_SCALE: f64 = 3.141592;
/// Velocity, in rad/s, for a raw value of 32767 in a trajectory point.
#[allow(clippy::approx_constant)]
pub const VELOCITY_SCALE: f64 = 6.283185;
/// Acceleration, in rad/s², for a raw value of 32767 in a trajectory point.
pub const ACCELERATION_SCALE: f64 = 12.566370;

/// Raw value at full scale.
pub const RAW_FULL_SCALE: f64 = 32767.0;

/// Positions of the parts of a Trajectory body, counted from the first byte of the body.
pub mod field {
    use core::ops::Range;

    /// Position of the trajectory number, a u16.
    pub const TRAJECTORY: Range<usize> = 0..2;
    /// Position of the segment number, which counts from 0, a u16.
    pub const SEGMENT: Range<usize> = 2..4;
    /// Position of the number of segments, a u16.
    pub const SEGMENTS: Range<usize> = 4..6;
    /// Position of the time between points, ms, a u16.
    pub const STEP_TIME: Range<usize> = 6..8;
    /// Position of the first point.
    pub const POINTS: usize = 8;
}

impl RawPoint {
    /// Parses the 36 bytes of a point.
    #[inline]
    pub fn parse(bytes: &[u8; POINT_LEN]) -> Self {
        let i16_at = |i: usize| i16::from_be_bytes([bytes[2 * i], bytes[2 * i + 1]]);
        Self {
            position: core::array::from_fn(i16_at),
            velocity: core::array::from_fn(|j| i16_at(JOINTS + j)),
            acceleration: core::array::from_fn(|j| i16_at(2 * JOINTS + j)),
        }
    }

    /// Returns the 36 bytes of a point.
    pub fn emit(&self) -> [u8; POINT_LEN] {
        let mut bytes = [0; POINT_LEN];
        let values = self.position.iter().chain(&self.velocity).chain(&self.acceleration);
        for (to, value) in bytes.chunks_exact_mut(2).zip(values) {
            to.copy_from_slice(&value.to_be_bytes());
        }
        bytes
    }

    /// Returns the positions, rad: `raw * (3.141592 / 32767)`, with the quotient computed first.
    pub fn position_rad(&self) -> [f64; JOINTS] {
        self.position.map(|raw| f64::from(raw) * (POSITION_SCALE / RAW_FULL_SCALE))
    }

    /// Returns the velocities, rad/s: `raw * (6.283185 / 32767)`, with the quotient computed first.
    pub fn velocity_rad_s(&self) -> [f64; JOINTS] {
        self.velocity.map(|raw| f64::from(raw) * (VELOCITY_SCALE / RAW_FULL_SCALE))
    }

    /// Returns the accelerations, rad/s²: `raw * (12.566370 / 32767)`, with the quotient computed first.
    pub fn acceleration_rad_s2(&self) -> [f64; JOINTS] {
        self.acceleration.map(|raw| f64::from(raw) * (ACCELERATION_SCALE / RAW_FULL_SCALE))
    }
}

/// Borrowed view of a Trajectory body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Segment<'a> {
    /// Trajectory number.
    pub trajectory: u16,
    /// Number of this segment, counted from 0.
    pub segment: u16,
    /// Number of segments of the trajectory.
    pub segments: u16,
    /// Time between points, ms.
    pub step_time: u16,
    points: &'a [u8],
}

impl<'a> Segment<'a> {
    /// Parses a Trajectory body. Returns `None` if the body is too short for its header. Ignores an incomplete point
    /// at the end.
    pub fn parse(body: &'a [u8]) -> Option<Self> {
        let (head, points) = body.split_first_chunk::<{ field::POINTS }>()?;
        let u16_at = |i: usize| u16::from_be_bytes([head[i], head[i + 1]]);
        Some(Self {
            trajectory: u16_at(field::TRAJECTORY.start),
            segment: u16_at(field::SEGMENT.start),
            segments: u16_at(field::SEGMENTS.start),
            step_time: u16_at(field::STEP_TIME.start),
            points,
        })
    }

    /// Returns all points of the segment in order.
    pub fn points(&self) -> impl ExactSizeIterator<Item = RawPoint> + use<'a> {
        self.points_from(0)
    }

    /// Returns the points of the segment from number `first` on; empty if `first` is after the last point.
    pub fn points_from(&self, first: usize) -> impl ExactSizeIterator<Item = RawPoint> + use<'a> {
        self.points.as_chunks::<POINT_LEN>().0.get(first..).unwrap_or(&[]).iter().map(RawPoint::parse)
    }
}

impl Segment<'_> {
    /// Returns the number of points in the segment.
    pub fn len(&self) -> usize {
        self.points.len() / POINT_LEN
    }
    /// Returns true if the segment has no points.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Returns point `i` of the segment, or `None` if the segment has fewer points.
    pub fn point(&self, i: usize) -> Option<RawPoint> {
        self.points.as_chunks::<POINT_LEN>().0.get(i).map(RawPoint::parse)
    }
}
