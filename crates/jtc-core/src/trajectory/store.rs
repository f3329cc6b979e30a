//! Trajectory store: accepts segments (J-30) and contains the points.
use jtc_wire::{DataStatus, RawPoint, Segment};

use crate::bit_codec::bit_codec;
use crate::interpolation::{SetPoint, Step};
use crate::trajectory::check::{Passed, SpeedRange, Violation};
use crate::{JOINTS, POINTS_MAX, SEGMENT_POINTS_MAX, SEGMENTS_MAX};

/// Tolerance before a trajectory point, as a share of the step between points. A time within this tolerance is treated as the time of the
/// point.
const AT_POINT: f64 = 1e-9;

/// Trajectory with the segments that have been received. `M` is the memory for the points.
#[derive(Clone, Debug)]
pub(crate) struct Store<M> {
    points: M,
    /// Number of points in the accepted segments.
    received: usize,
    /// Index of the next segment. The index of the next segment is equal to `segments` when the trajectory is complete.
    next_segment: u16,
    segments: u16,
    number: u16,
    /// `true` if segment 0 came on a plain line.
    plain: bool,
    /// `true` if a Stop has dropped the upload. The controller then refuses further segments of this upload until a segment 0 arrives.
    dropped: bool,
    /// `true` if a Stop came during an upload that began on a plain line. The host of such an upload cannot handle a
    /// refused segment. The host can therefore complete the upload, but the controller does not execute it.
    stopped: bool,
    /// Violation that the check has found in an upload that began on a plain line. The host of such an upload cannot
    /// handle a refused segment. The host can therefore complete the upload, but the controller does not execute it.
    refused: Option<Violation>,
    step: Step,
    /// State of the check after the accepted segments.
    passed: Passed,
    /// Number of points in memory. `hash` is the hash of these points. Both values include the points of a discarded
    /// trajectory.
    held: usize,
    hash: u32,
}

/// State of the trajectory store, without the points.
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
    /// Returns the time between points of the trajectory, ms.
    pub(crate) fn step_ms(&self) -> u16 {
        self.step_ms
    }
}

bit_codec!(StoreState {
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

/// Start value of a hash of points. `mix` adds a word to the hash with a single multiplication, because copying a segment must take little
/// time.
const HASH_BEGIN: u32 = 0x811C_9DC5;
fn mix(hash: u32, word: u32) -> u32 {
    (hash.rotate_left(5) ^ word).wrapping_mul(0x9E37_79B1)
}

/// Returns the hash of all points, from the `hash` of the points before `points`.
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
    pub(crate) fn new(points: M) -> Self {
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

    /// Returns the number of points that the store can contain. The capacity is the lower of the limits of the protocol and of the memory.
    fn capacity(&self) -> usize {
        self.points.as_ref().len().min(POINTS_MAX)
    }

    pub(crate) fn clear(&mut self) {
        self.received = 0;
        self.next_segment = 0;
        self.segments = 0;
    }

    /// Returns `true` if all segments have been received.
    pub(crate) fn complete(&self) -> bool {
        self.segments > 0 && self.next_segment == self.segments
    }

    /// Returns `true` if some segments have been received and others are missing.
    fn receiving(&self) -> bool {
        self.segments > 0 && self.next_segment < self.segments
    }

    /// Drops an incomplete upload because of a Stop (J-30). An upload that began on a plain line can be completed but is not executed,
    /// because its host would otherwise wait for ever. Returns `true` if an upload was incomplete.
    pub(crate) fn drop_upload(&mut self) -> bool {
        let receiving = self.receiving();
        if receiving && self.plain {
            self.stopped = true;
        } else if receiving {
            self.clear();
            self.dropped = true;
        }
        receiving
    }

    /// Returns `true` if a Stop came during the upload of this trajectory, so that the controller does not execute it (J-30).
    pub(crate) fn stopped(&self) -> bool {
        self.stopped
    }

    /// Returns `true` if the upload began on a plain line. The host of a plain line cannot handle a refused segment (J-51).
    pub(crate) fn plain(&self) -> bool {
        self.plain
    }

    /// Stores the violation that the check has found in the present upload.
    pub(crate) fn refuse(&mut self, violation: Violation) {
        self.refused.get_or_insert(violation);
    }

    /// Returns the violation that the check has found in this trajectory. The controller does not execute a trajectory with a violation
    /// (J-36).
    pub(crate) fn refused(&self) -> Option<Violation> {
        self.refused
    }

    /// Refuses the later segments of an upload whose segment 0 was refused because of a Stop.
    pub(crate) fn refuse_rest(&mut self) {
        self.dropped = true;
    }

    /// Returns `true` if a Stop has dropped the upload and no other upload has begun after the Stop.
    pub(crate) fn dropped(&self) -> bool {
        self.dropped
    }

    /// Returns the time of the last point, ms.
    pub(crate) fn duration_ms(&self) -> u32 {
        // The product of points and step is at most 11 999 · 65 535, which fits into 32 bits.
        (self.received.saturating_sub(1) as u32).saturating_mul(u32::from(self.step.ms))
    }

    /// Checks that the segment may follow the segments that were received. The check does not change the store.
    pub(crate) fn check(&self, segment: &Segment<'_>) -> Result<(), DataStatus> {
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

    /// Begins to copy an accepted segment. Segment 0 replaces the old trajectory. `plain` is `true` if the segment came on a plain line.
    /// `stopped` is `true` if a Stop came before the segment was processed.
    pub(crate) fn begin(&mut self, segment: &Segment<'_>, plain: bool, stopped: bool) {
        if segment.segment == 0 {
            self.clear();
            (self.held, self.hash) = (0, HASH_BEGIN);
            (self.plain, self.dropped, self.stopped, self.refused) = (plain, false, stopped, None);
            self.segments = segment.segments;
            self.number = segment.trajectory;
            self.step = Step::new(segment.step_time);
        }
    }

    /// Copies points `from..to` of the segment into the memory after the received points. The call of `commit` makes the copied points
    /// valid.
    pub(crate) fn copy(&mut self, segment: &Segment<'_>, from: usize, to: usize) {
        let slots = self.points.as_mut().get_mut(self.received + from..self.received + to).unwrap_or(&mut []);
        for (slot, point) in slots.iter_mut().zip(segment.points_from(from)) {
            *slot = point;
        }
        self.hash = hash_points(self.hash, slots);
    }

    /// Adds the segment to the trajectory, after all its points have been copied. `passed` is the state of the check after all points that
    /// have been received.
    pub(crate) fn commit(&mut self, segment: &Segment<'_>, passed: Passed) {
        self.passed = passed;
        self.received = (self.received + segment.len()).min(self.capacity());
        self.next_segment = segment.segment + 1;
        self.held = self.received;
    }

    /// Returns the hash and the number of the points in memory, including the points of a discarded trajectory.
    pub(crate) fn points_hash(&self) -> (u32, u32) {
        (self.hash, self.held as u32)
    }

    /// Returns the points in memory, beginning with number `first`.
    pub(crate) fn held_points(&self, first: usize) -> &[RawPoint] {
        self.points.as_ref().get(first..self.held).unwrap_or(&[])
    }

    /// Returns the state of the store, without the points.
    pub(crate) fn state(&self) -> StoreState {
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

    /// Restores the state of the store. The caller restores the points separately.
    pub(crate) fn restore(&mut self, state: &StoreState) {
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

    /// Writes points into the memory, starting with number `first`.
    pub(crate) fn put_points(&mut self, first: usize, points: &[RawPoint]) {
        for (slot, point) in self.points.as_mut().iter_mut().skip(first).zip(points) {
            *slot = *point;
        }
    }

    /// Returns the number of points, the last point, and the state of the check after the last point. Returns `None` if the store contains
    /// no points.
    pub(crate) fn tail(&self) -> Option<(u32, RawPoint, Passed)> {
        let last = *self.points.as_ref().get(..self.received)?.last()?;
        Some((self.received as u32, last, self.passed))
    }

    /// Returns the velocity ranges of the joints at and between the stored points.
    pub(crate) fn speeds(&self) -> &[SpeedRange; JOINTS] {
        &self.passed.speeds
    }

    /// Returns the time between points of the trajectory, ms.
    pub(crate) fn step_ms(&self) -> u16 {
        self.step.ms
    }

    /// Returns the positions of point 0, rad.
    pub(crate) fn first(&self) -> Option<[f64; JOINTS]> {
        self.points.as_ref().get(..self.received)?.first().map(RawPoint::position_rad)
    }

    /// Returns the set values at `time_ms` after point 0, with velocities and accelerations for full speed. Returns `None` if the store
    /// contains no points.
    pub(crate) fn at(&self, time_ms: f64) -> Option<SetPoint> {
        let mut at = SetPoint::default();
        self.put(time_ms, &mut at).then_some(at)
    }

    /// Like [`Self::at`], but writes the set values to `at`. Returns `false` if the store contains no points.
    #[inline]
    pub(crate) fn put(&self, time_ms: f64, at: &mut SetPoint) -> bool {
        let points = self.points.as_ref().get(..self.received).unwrap_or(&[]);
        let step_ms = f64::from(self.step.ms);
        // Due to rounding, the product of time and `per_ms` can be just below the index of a point that the time has
        // reached. The conversion with `as` saturates, so a negative time or a time of NaN results in point 0.
        let index = (time_ms * self.step.per_ms + AT_POINT) as usize;
        let Some(start) = points.get(index).or(points.last()) else { return false };
        // At a point and at the last point, the interpolation has no effect. The interpolation is computed
        // nevertheless, because every tick must do the same work.
        let (end, u) = match points.get(index + 1) {
            Some(end) => (end, (time_ms - index as f64 * step_ms).max(0.0) * self.step.per_ms),
            None => (start, 0.0),
        };
        self.step.between(start, end, u, at);
        true
    }
}
