//! Data that a report needs from the samples. The samples are streamed, so the memory use does not increase with the number of samples.

use super::curves::{Curves, Joined, Runs};
use super::summary::Figures;
use super::watch::Watch;
use super::{RunFailure, Summary};
use crate::recording::{Ending, RecordingInfo};
use crate::sample::Sample;

/// Samples reduced to the content of a report: values for each joint, curves with their minimum and maximum, and the first error.
///
/// A digest needs about 20 MB of memory, independent of the length of the recording. The plots show each sample if there are at most 16,000
/// samples.
#[derive(Clone, Debug)]
pub struct Digest {
    samples: u64,
    first_s: Option<f64>,
    last_s: f64,
    figures: Figures,
    watch: Watch,
    pub(super) curves: Curves,
    pub(super) states: Runs,
    pub(super) trajectory: Runs,
    pub(super) errors: Runs,
}

impl Default for Digest {
    fn default() -> Self {
        Self::new()
    }
}

impl Digest {
    /// Creates a digest without samples.
    pub fn new() -> Self {
        Self {
            samples: 0,
            first_s: None,
            last_s: 0.0,
            figures: Figures::default(),
            watch: Watch::default(),
            curves: Curves::new(),
            states: Runs::new(Joined::Longer),
            trajectory: Runs::new(Joined::Longer),
            errors: Runs::new(Joined::Both),
        }
    }

    /// Creates a digest of `samples`, which are sorted oldest first.
    pub fn of(samples: &[Sample]) -> Self {
        let mut digest = Self::new();
        samples.iter().for_each(|sample| digest.push(sample));
        digest
    }

    /// Adds the next sample.
    pub fn push(&mut self, sample: &Sample) {
        self.samples += 1;
        self.first_s.get_or_insert(sample.time_s);
        self.last_s = sample.time_s;
        self.figures.push(sample);
        self.watch.push(sample);
        self.curves.push(sample);
        self.states.push(sample.time_s, u64::from(sample.state.byte()));
        self.trajectory.push(sample.time_s, u64::from(sample.trajectory.byte()));
        self.errors.push(sample.time_s, u64::from(sample.errors));
    }

    /// Returns the number of samples.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Returns the approximate size in memory.
    pub fn bytes(&self) -> usize {
        let runs = [&self.states, &self.trajectory, &self.errors].map(Runs::bytes);
        size_of::<Self>() + self.curves.bytes() + runs.iter().sum::<usize>()
    }

    /// Returns the times of the first and of the last sample, s.
    pub(super) fn span_s(&self) -> Option<(f64, f64)> {
        self.first_s.map(|first| (first, self.last_s))
    }

    /// Returns the summary, with the names and limits of `info`.
    pub fn summary(&self, info: &RecordingInfo) -> Summary {
        self.figures.summary(info)
    }

    /// Returns the failure of the recorded run, like [`RunFailure::of_recording`].
    pub fn failure(&self, info: &RecordingInfo, ending: &Ending) -> Option<RunFailure> {
        self.watch.failure(info, ending)
    }
}
