//! Samples made small enough for a page: thinned without losing peaks, and packed as numbers in base64.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

use crate::sample::Sample;

/// Points per line; 16 000 keep the page below some 4 MB and are four times what a screen can show.
const POINTS_MAX: usize = 16_000;

/// Chooses which samples a page shows: all of them, or the lowest and highest value of each bucket.
pub(super) struct Thinner<'a> {
    samples: &'a [Sample],
    bucket: usize,
}

impl<'a> Thinner<'a> {
    pub(super) fn new(samples: &'a [Sample]) -> Self {
        let bucket = if samples.len() <= POINTS_MAX { 1 } else { (2 * samples.len()).div_ceil(POINTS_MAX) };
        Self { samples, bucket }
    }

    /// One in how many samples a point stands for; 1 = nothing was left out.
    pub(super) fn bucket(&self) -> usize {
        self.bucket
    }

    /// Times of the points, s.
    pub(super) fn times(&self) -> Vec<f64> {
        if self.bucket == 1 {
            return self.samples.iter().map(|s| s.time_s).collect();
        }
        let two = |b: &[Sample]| [b[0].time_s, b[b.len() / 2].time_s];
        self.samples.chunks(self.bucket).flat_map(two).collect()
    }

    /// Values at those times: of each bucket its extremes, in the order in which they occur.
    pub(super) fn values(&self, value: impl Fn(&Sample) -> f64) -> Vec<f64> {
        if self.bucket == 1 {
            return self.samples.iter().map(value).collect();
        }
        let extremes = |bucket: &[Sample]| {
            let mut ends: Option<((f64, usize), (f64, usize))> = None;
            for (i, v) in bucket.iter().map(&value).enumerate().filter(|(_, v)| v.is_finite()) {
                let (low, high) = ends.get_or_insert(((v, i), (v, i)));
                if v < low.0 {
                    *low = (v, i);
                }
                if v > high.0 {
                    *high = (v, i);
                }
            }
            let (low, high) = ends.unwrap_or(((f64::NAN, 0), (f64::NAN, 0)));
            if low.1 <= high.1 { [low.0, high.0] } else { [high.0, low.0] }
        };
        self.samples.chunks(self.bucket).flat_map(extremes).collect()
    }
}

/// As `{"k":"f32","d":base64}`; `null` when no value is known.
pub(super) fn fine(values: &[f64]) -> Value {
    if !values.iter().any(|v| v.is_finite()) {
        return Value::Null;
    }
    let bytes: Vec<u8> = values.iter().flat_map(|&v| (v as f32).to_le_bytes()).collect();
    json!({ "k": "f32", "d": STANDARD.encode(bytes) })
}

/// As `{"k":"i16","o":offset,"s":scale,"d":base64}` over the range of the values, -32768 where one is unknown; as
/// `{"k":"c","v":value}` when they are all the same; `null` when none is known.
pub(super) fn coarse(values: &[f64]) -> Value {
    let finite = || values.iter().copied().filter(|v| v.is_finite());
    let (Some(low), Some(high)) = (finite().reduce(f64::min), finite().reduce(f64::max)) else {
        return Value::Null;
    };
    if low == high && values.iter().all(|v| v.is_finite()) {
        return json!({ "k": "c", "v": low });
    }
    let offset = (low + high) / 2.0;
    let scale = ((high - low) / 65_534.0).max(f64::MIN_POSITIVE);
    let quantise = |v: f64| if v.is_finite() { ((v - offset) / scale).round() as i16 } else { i16::MIN };
    let bytes: Vec<u8> = values.iter().flat_map(|&v| quantise(v).to_le_bytes()).collect();
    json!({ "k": "i16", "o": offset, "s": scale, "d": STANDARD.encode(bytes) })
}

/// Runs of equal values as `[from_s, to_s, value]`.
pub(super) fn runs(samples: &[Sample], value: impl Fn(&Sample) -> u64) -> Value {
    let mut runs: Vec<(f64, f64, u64)> = Vec::new();
    for s in samples {
        let v = value(s);
        match runs.last_mut() {
            Some((_, to, last)) if *last == v => *to = s.time_s,
            Some((_, to, _)) => {
                *to = s.time_s;
                runs.push((s.time_s, s.time_s, v));
            }
            None => runs.push((s.time_s, s.time_s, v)),
        }
    }
    json!(runs)
}
