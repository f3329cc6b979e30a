//! Curves of a report. For a short recording, a curve contains every sample. A longer recording is divided into
//! pieces of equal length, and a curve contains the minimum and the maximum of each piece.

use crate::sample::{JointSample, Sample};

/// Maximum number of points per curve. With 16 000 points per curve, the page stays below about 4 MB, and a curve has four times the
/// resolution of a screen.
pub(super) const POINTS_MAX: usize = 16_000;

/// Kinds of values of a joint that are plotted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Curve {
    SetPosition,
    Position,
    SetVelocity,
    SetAcceleration,
    Velocity,
    /// Position error, mrad.
    Error,
    TorqueModel,
    TorquePid,
    TorqueFriction,
    Torque,
    Temperature,
}

/// Number of curves of a joint.
const KINDS: usize = Curve::Temperature as usize + 1;
const ALL: usize = 6 * KINDS;

/// Returns the values of a joint, in the order of [`Curve`].
fn values(joint: &JointSample) -> [f64; KINDS] {
    [
        joint.set_position,
        joint.position,
        joint.set_velocity,
        joint.set_acceleration,
        joint.velocity,
        joint.position_error() * 1e3,
        joint.torque_model,
        joint.torque_p + joint.torque_i + joint.torque_d,
        joint.torque_friction,
        joint.torque,
        joint.temperature,
    ]
}

/// Piece of the recording with its start, its middle, and the minimum and maximum of each curve.
#[derive(Clone, Debug)]
struct Bucket {
    begin_s: f64,
    middle_s: f64,
    /// Minimum of each curve in the piece. If all values are unknown, the minimum is set above the maximum.
    low: [f64; ALL],
    high: [f64; ALL],
    /// `true` if the lowest value occurred before the highest value.
    low_first: [bool; ALL],
}

impl Bucket {
    fn new(time_s: f64) -> Self {
        Self {
            begin_s: time_s,
            middle_s: time_s,
            low: [f64::INFINITY; ALL],
            high: [f64::NEG_INFINITY; ALL],
            low_first: [true; ALL],
        }
    }

    fn push(&mut self, sample: &Sample) {
        for (j, joint) in sample.joints.iter().enumerate() {
            for (kind, value) in values(joint).into_iter().enumerate() {
                if !value.is_finite() {
                    continue;
                }
                let i = j * KINDS + kind;
                let first = self.low[i] > self.high[i];
                if value < self.low[i] {
                    (self.low[i], self.low_first[i]) = (value, first);
                }
                if value > self.high[i] {
                    (self.high[i], self.low_first[i]) = (value, true);
                }
            }
        }
    }

    /// Joins this bucket with the next bucket, which has the same length.
    fn join(&mut self, next: &Self) {
        self.middle_s = next.begin_s;
        for i in 0..ALL {
            if next.low[i] > next.high[i] {
                continue;
            }
            if self.low[i] > self.high[i] {
                (self.low[i], self.high[i], self.low_first[i]) =
                    (next.low[i], next.high[i], next.low_first[i]);
                continue;
            }
            let (lower, higher) = (next.low[i] < self.low[i], next.high[i] > self.high[i]);
            self.low_first[i] = match (lower, higher) {
                (true, true) => next.low_first[i],
                (true, false) => false,
                (false, true) => true,
                (false, false) => self.low_first[i],
            };
            self.low[i] = self.low[i].min(next.low[i]);
            self.high[i] = self.high[i].max(next.high[i]);
        }
    }
}

/// Curves of streamed samples, with bounded memory use. If there are too many buckets, each pair of neighbouring buckets is joined.
#[derive(Clone, Debug)]
pub(super) struct Curves {
    buckets: Vec<Bucket>,
    /// Number of samples in a bucket. If the number is 1, each sample is one point of the curve.
    width: usize,
    /// Number of samples that the last bucket already contains.
    filled: usize,
    last_s: f64,
}

impl Curves {
    pub(super) fn new() -> Self {
        Self { buckets: Vec::new(), width: 1, filled: 0, last_s: 0.0 }
    }

    pub(super) fn push(&mut self, sample: &Sample) {
        if self.buckets.is_empty() || self.filled == self.width {
            // A bucket of several samples is drawn as two points, so only half as many buckets are allowed.
            while self.buckets.len() >= if self.width == 1 { POINTS_MAX } else { POINTS_MAX / 2 } {
                self.double();
            }
            self.buckets.push(Bucket::new(sample.time_s));
            self.filled = 0;
        }
        if let Some(bucket) = self.buckets.last_mut() {
            if self.filled == self.width / 2 {
                bucket.middle_s = sample.time_s;
            }
            bucket.push(sample);
        }
        self.filled += 1;
        self.last_s = sample.time_s;
    }

    /// Joins the buckets in pairs. Before the call, all buckets must be full.
    fn double(&mut self) {
        for i in 0..self.buckets.len() / 2 {
            let (first, next) = self.buckets.split_at_mut(2 * i + 1);
            if let (Some(first), Some(next)) = (first.last_mut(), next.first()) {
                first.join(next);
            }
            self.buckets.swap(i, 2 * i);
        }
        self.buckets.truncate(self.buckets.len() / 2);
        self.width *= 2;
        self.filled = self.width;
    }

    /// Returns the size of the curves in memory.
    pub(super) fn bytes(&self) -> usize {
        self.buckets.capacity() * size_of::<Bucket>()
    }

    /// Returns the number of samples per bucket. If the number is 1, every sample is a point of the curve.
    pub(super) fn bucket(&self) -> usize {
        self.width
    }

    /// Returns the number of points of each curve.
    pub(super) fn len(&self) -> usize {
        self.buckets.len() * if self.width == 1 { 1 } else { 2 }
    }

    /// Returns the times of the points, s.
    pub(super) fn times(&self) -> Vec<f64> {
        if self.width == 1 {
            return self.buckets.iter().map(|bucket| bucket.begin_s).collect();
        }
        let mut times: Vec<f64> =
            self.buckets.iter().flat_map(|bucket| [bucket.begin_s, bucket.middle_s]).collect();
        // The curve ends at the last sample, even if the last piece is incomplete.
        if let Some(last) = times.last_mut().filter(|_| self.filled < self.width) {
            *last = self.last_s;
        }
        times
    }

    /// Returns the values of a curve at the times of [`Self::times`]. The values are the minimum and maximum of each bucket, in the order
    /// in which they occurred. An unknown value is NaN.
    pub(super) fn values(&self, curve: Curve, joint: usize) -> Vec<f64> {
        let i = joint * KINDS + curve as usize;
        let mut values = Vec::with_capacity(self.len());
        for bucket in &self.buckets {
            let (low, high) = (bucket.low[i], bucket.high[i]);
            match (low <= high, self.width) {
                (false, 1) => values.push(f64::NAN),
                (false, _) => values.extend([f64::NAN; 2]),
                (true, 1) => values.push(low),
                (true, _) if bucket.low_first[i] => values.extend([low, high]),
                (true, _) => values.extend([high, low]),
            }
        }
        values
    }
}

/// Number of pieces that remain after a long sequence of states is reduced. The sequence is reduced when it has twice
/// as many pieces.
const RUNS_MAX: usize = 8_192;

/// Rule that determines the value of a piece which replaces two pieces.
#[derive(Clone, Copy, Debug)]
pub(super) enum Joined {
    /// The joined piece has the value of the longer piece. States use this rule.
    Longer,
    /// The joined piece has the bits of both pieces. Error words use this rule, so that no error is lost.
    Both,
}

/// Sequence of pieces with a constant value, each as `(from_s, to_s, value)`.
#[derive(Clone, Debug)]
pub(super) struct Runs {
    runs: Vec<(f64, f64, u64)>,
    joined: Joined,
}

impl Runs {
    pub(super) fn new(joined: Joined) -> Self {
        Self { runs: Vec::new(), joined }
    }

    pub(super) fn push(&mut self, time_s: f64, value: u64) {
        match self.runs.last_mut() {
            Some((_, to, last)) if *last == value => *to = time_s,
            Some((_, to, _)) => {
                *to = time_s;
                self.runs.push((time_s, time_s, value));
            }
            None => self.runs.push((time_s, time_s, value)),
        }
        if self.runs.len() > 2 * RUNS_MAX {
            self.halve();
        }
    }

    /// Joins the pieces in pairs. Neighbouring pieces whose values are equal afterwards are also joined.
    fn halve(&mut self) {
        // The last piece is not joined with another piece, because the last piece may still become longer.
        let last = self.runs.pop();
        let mut fewer: Vec<(f64, f64, u64)> = Vec::with_capacity(RUNS_MAX);
        for two in self.runs.chunks(2) {
            let (Some(&(from, middle, first)), Some(&(begin, to, second))) = (two.first(), two.last()) else {
                continue;
            };
            let value = match self.joined {
                Joined::Both => first | second,
                Joined::Longer if to - begin > middle - from => second,
                Joined::Longer => first,
            };
            match fewer.last_mut() {
                Some((_, end, same)) if *same == value => *end = to,
                _ => fewer.push((from, to, value)),
            }
        }
        fewer.extend(last);
        self.runs = fewer;
    }

    /// Returns the memory size of the pieces.
    pub(super) fn bytes(&self) -> usize {
        self.runs.capacity() * size_of::<(f64, f64, u64)>()
    }

    pub(super) fn as_slice(&self) -> &[(f64, f64, u64)] {
        &self.runs
    }
}
