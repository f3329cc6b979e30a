//! The trajectory store: which segments are accepted (J-30), and the points.
use jtc_wire::{DataStatus, RawPoint, Segment};

use crate::check::{Passed, SpeedRange, Violation};
use crate::interpolation::{SetPoint, Step};
use crate::remembered::remembered;
use crate::{JOINTS, POINTS_MAX, SEGMENT_POINTS_MAX, SEGMENTS_MAX};

/// This share of a step before a point is at the point.
const AT_POINT: f64 = 1e-9;

/// What was received of the current trajectory. `M` is the memory of its points.
#[derive(Clone, Debug)]
pub(crate) struct Store<M> {
    points: M,
    /// Points of the accepted segments.
    received: usize,
    /// Number of the next segment; equal to `segments` when the trajectory is complete.
    next_segment: u16,
    segments: u16,
    number: u16,
    /// Segment 0 came on a plain line.
    plain: bool,
    /// A Stop has dropped the upload: its other segments are refused until a segment 0 comes.
    dropped: bool,
    /// A Stop came during this upload, whose host survives no refused segment: it is completed and not executed.
    stopped: bool,
    /// What the check has found in an upload whose host survives no refused segment: it is completed and not executed.
    refused: Option<Violation>,
    step: Step,
    /// What the check knows of the accepted segments.
    passed: Passed,
    /// Points in memory, also of a trajectory that was given up, and their hash.
    held: usize,
    hash: u32,
}

/// What is remembered of the trajectory, without its points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StoreState {
    received: usize,
    next_segment: u16,
    segments: u16,
    number: u16,
    plain: bool,
    dropped: bool,
    stopped: bool,
    refused: Option<Violation>,
    step_ms: u16,
    passed: Passed,
    held: usize,
    hash: u32,
}

impl StoreState {
    /// ms between points.
    pub fn step_ms(&self) -> u16 {
        self.step_ms
    }
}

remembered!(StoreState {
    received,
    next_segment,
    segments,
    number,
    plain,
    dropped,
    stopped,
    refused,
    step_ms,
    passed,
    held,
    hash
});

/// Begins a hash of points, and mixes a word into it: a multiplication for each, so that copying a segment stays cheap.
const HASH_BEGIN: u32 = 0x811C_9DC5;
fn mix(hash: u32, word: u32) -> u32 {
    (hash.rotate_left(5) ^ word).wrapping_mul(0x9E37_79B1)
}

/// The hash of points that follow others with this one.
fn hash_points(hash: u32, points: &[RawPoint]) -> u32 {
    points.iter().fold(hash, |hash, point| {
        let pairs =
            [&point.position, &point.velocity, &point.acceleration].map(|channel| channel.as_chunks::<2>().0);
        pairs
            .iter()
            .flat_map(|pairs| pairs.iter())
            .fold(hash, |hash, &[a, b]| mix(hash, u32::from(a as u16) | u32::from(b as u16) << 16))
    })
}

impl<M: AsRef<[RawPoint]> + AsMut<[RawPoint]>> Store<M> {
    pub fn new(points: M) -> Self {
        Self {
            points,
            received: 0,
            next_segment: 0,
            segments: 0,
            number: 0,
            plain: false,
            dropped: false,
            stopped: false,
            refused: None,
            step: Step::new(1),
            passed: Passed::default(),
            held: 0,
            hash: HASH_BEGIN,
        }
    }

    /// Points that fit: never more than the protocol allows, never more than the memory holds.
    fn capacity(&self) -> usize {
        self.points.as_ref().len().min(POINTS_MAX)
    }

    pub fn clear(&mut self) {
        self.received = 0;
        self.next_segment = 0;
        self.segments = 0;
    }

    /// All segments are here.
    pub fn complete(&self) -> bool {
        self.segments > 0 && self.next_segment == self.segments
    }

    /// Segments are here, and others are still to come.
    fn receiving(&self) -> bool {
        self.segments > 0 && self.next_segment < self.segments
    }

    /// J-30: a Stop drops an upload that is not complete. One that was begun on a plain line, whose host would wait for ever, is
    /// completed and not executed. Returns whether there was one.
    pub fn drop_upload(&mut self) -> bool {
        let receiving = self.receiving();
        if receiving && self.plain {
            self.stopped = true;
        } else if receiving {
            self.clear();
            self.dropped = true;
        }
        receiving
    }

    /// A Stop came during the upload of this trajectory: it is not executed (J-30).
    pub fn stopped(&self) -> bool {
        self.stopped
    }

    /// The upload was begun on a plain line, whose host survives no refused segment (J-51).
    pub fn plain(&self) -> bool {
        self.plain
    }

    /// Keeps what the check has found in the upload that has been begun.
    pub fn refuse(&mut self, violation: Violation) {
        self.refused.get_or_insert(violation);
    }

    /// What the check has found in this trajectory: it is not executed (J-36).
    pub fn refused(&self) -> Option<Violation> {
        self.refused
    }

    /// Segment 0 of an upload was refused because of a Stop: the other segments of the upload are refused, too.
    pub fn refuse_rest(&mut self) {
        self.dropped = true;
    }

    /// The upload was dropped, and no other has been begun since.
    pub fn dropped(&self) -> bool {
        self.dropped
    }

    /// Time of the last point, ms.
    pub fn duration_ms(&self) -> u32 {
        // At most 11 999 · 65 535, which fits.
        (self.received.saturating_sub(1) as u32).saturating_mul(u32::from(self.step.ms))
    }

    /// Whether the segment may follow what was received. Changes nothing.
    pub fn check(&self, segment: &Segment<'_>) -> Result<(), DataStatus> {
        let first = segment.segment == 0;
        let before = if first { 0 } else { self.received };
        if segment.is_empty() {
            return Err(DataStatus::IncorrectValue);
        }
        if segment.len() > SEGMENT_POINTS_MAX || before + segment.len() > self.capacity() {
            return Err(DataStatus::TooManyPoints);
        }
        if usize::from(segment.segments) > SEGMENTS_MAX || usize::from(segment.segment) >= SEGMENTS_MAX {
            return Err(DataStatus::TooManySegments);
        }
        if segment.segment >= segment.segments {
            return Err(DataStatus::IncorrectSegmentOrder);
        }
        let in_order = segment.segment == self.next_segment
            && segment.segments == self.segments
            && segment.trajectory == self.number;
        if !first && !in_order {
            return Err(DataStatus::IncorrectSegmentOrder);
        }
        if segment.step_time == 0 || (!first && segment.step_time != self.step.ms) {
            return Err(DataStatus::IncorrectStepTime);
        }
        Ok(())
    }

    /// Begins to copy a segment that was accepted; segment 0 replaces what was there, and says whether its line is `plain`, and
    /// whether a Stop came before it had its turn.
    pub fn begin(&mut self, segment: &Segment<'_>, plain: bool, stopped: bool) {
        if segment.segment == 0 {
            self.clear();
            (self.held, self.hash) = (0, HASH_BEGIN);
            (self.plain, self.dropped, self.stopped, self.refused) = (plain, false, stopped, None);
            self.segments = segment.segments;
            self.number = segment.trajectory;
            self.step = Step::new(segment.step_time);
        }
    }

    /// Copies points `from..to` of the segment behind those received; they count from `commit` on.
    pub fn copy(&mut self, segment: &Segment<'_>, from: usize, to: usize) {
        let slots = self.points.as_mut().get_mut(self.received + from..self.received + to).unwrap_or(&mut []);
        for (slot, point) in slots.iter_mut().zip(segment.points_from(from)) {
            *slot = point;
        }
        self.hash = hash_points(self.hash, slots);
    }

    /// All points of the segment are copied; `passed` is what the check knows of all points so far.
    pub fn commit(&mut self, segment: &Segment<'_>, passed: Passed) {
        self.passed = passed;
        self.received = (self.received + segment.len()).min(self.capacity());
        self.next_segment = segment.segment + 1;
        self.held = self.received;
    }

    /// Hash of the points in memory and how many they are, also of a trajectory that was given up.
    pub fn points_hash(&self) -> (u32, u32) {
        (self.hash, self.held as u32)
    }

    /// Those points from number `first` on.
    pub fn held_points(&self, first: usize) -> &[RawPoint] {
        self.points.as_ref().get(first..self.held).unwrap_or(&[])
    }

    /// What is remembered, without the points.
    pub fn state(&self) -> StoreState {
        let Self {
            points: _,
            received,
            next_segment,
            segments,
            number,
            plain,
            dropped,
            stopped,
            refused,
            ref step,
            passed,
            held,
            hash,
        } = *self;
        let step_ms = step.ms;
        StoreState {
            received,
            next_segment,
            segments,
            number,
            plain,
            dropped,
            stopped,
            refused,
            step_ms,
            passed,
            held,
            hash,
        }
    }

    /// The same again; the points are put apart.
    pub fn restore(&mut self, state: &StoreState) {
        let StoreState {
            received,
            next_segment,
            segments,
            number,
            plain,
            dropped,
            stopped,
            refused,
            step_ms,
            passed,
            held,
            hash,
        } = *state;
        (self.plain, self.dropped, self.stopped, self.refused) = (plain, dropped, stopped, refused);
        (self.received, self.next_segment, self.segments) =
            (received.min(self.capacity()), next_segment, segments);
        (self.number, self.step, self.passed) = (number, Step::new(step_ms), passed);
        (self.held, self.hash) = (held.min(self.capacity()), hash);
    }

    /// Points from number `first` on.
    pub fn put_points(&mut self, first: usize, points: &[RawPoint]) {
        for (slot, point) in self.points.as_mut().iter_mut().skip(first).zip(points) {
            *slot = *point;
        }
    }

    /// How many points there are, the last of them, and what the check knows of them; `None` without points.
    pub fn tail(&self) -> Option<(u32, RawPoint, Passed)> {
        let last = *self.points.as_ref().get(..self.received)?.last()?;
        Some((self.received as u32, last, self.passed))
    }

    /// Speeds of the points.
    pub fn speeds(&self) -> &[SpeedRange; JOINTS] {
        &self.passed.speeds
    }

    /// ms between points.
    pub fn step_ms(&self) -> u16 {
        self.step.ms
    }

    /// Positions of point 0, rad.
    pub fn first(&self) -> Option<[f64; JOINTS]> {
        self.points.as_ref().get(..self.received)?.first().map(RawPoint::position_rad)
    }

    /// Set values `time_ms` after point 0, with velocities and accelerations as at full speed. `None` without points.
    pub fn at(&self, time_ms: f64) -> Option<SetPoint> {
        let mut at = SetPoint::default();
        self.put(time_ms, &mut at).then_some(at)
    }

    /// The same put where they are wanted, in place of what is there; false without points.
    #[inline]
    pub fn put(&self, time_ms: f64, at: &mut SetPoint) -> bool {
        let points = self.points.as_ref().get(..self.received).unwrap_or(&[]);
        let step_ms = f64::from(self.step.ms);
        // The product may be rounded to below a point that the time has reached. `as` saturates: a negative or NaN time is point 0.
        let index = (time_ms * self.step.per_ms + AT_POINT) as usize;
        let Some(start) = points.get(index).or(points.last()) else { return false };
        // Also at a point itself and at the last one, where it changes nothing: the same work in every tick.
        let (end, u) = match points.get(index + 1) {
            Some(end) => (end, (time_ms - index as f64 * step_ms).max(0.0) * self.step.per_ms),
            None => (start, 0.0),
        };
        self.step.between(start, end, u, at);
        true
    }
}
