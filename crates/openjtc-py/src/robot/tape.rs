//! Samples that are recorded while a motion is executed.

use std::cell::{Cell, RefCell};

use jtc_host::Sample;
use jtc_host::recording::SampleSink;

/// Recorded samples of a motion.
#[derive(Default)]
pub(crate) struct Tape {
    on: Cell<bool>,
    zero: Cell<Option<f64>>,
    samples: RefCell<Vec<Sample>>,
    sink: RefCell<Option<SampleSink>>,
}

impl Tape {
    /// Starts recording. If a sink exists, the samples are also passed to the sink. Earlier samples are kept.
    pub(crate) fn record(&self, sink: Option<SampleSink>) {
        self.on.set(true);
        self.zero.set(None);
        *self.sink.borrow_mut() = sink;
    }

    /// Records a sample. Shifts the time of the sample, so that the recording begins at time 0, and a second motion
    /// continues 1 ms after the last sample.
    pub(crate) fn push(&self, sample: &Sample) {
        if !self.on.get() {
            return;
        }
        let zero = self.zero.get().unwrap_or_else(|| {
            let last = self.samples.borrow().last().map_or(0.0, |last| last.time_s + 1e-3);
            let zero = sample.time_s - last;
            self.zero.set(Some(zero));
            zero
        });
        let sample = Sample { time_s: sample.time_s - zero, ..*sample };
        if let Some(sink) = &*self.sink.borrow() {
            sink.write(&sample);
        }
        self.samples.borrow_mut().push(sample);
    }

    /// Appends a sample without changing its time and without passing it to the sink.
    pub(crate) fn keep(&self, sample: &Sample) {
        self.samples.borrow_mut().push(*sample);
    }

    /// Stops recording.
    pub(crate) fn pause(&self) {
        self.on.set(false);
        self.sink.borrow_mut().take();
    }

    /// Stops recording and returns the recorded samples.
    pub(crate) fn take(&self) -> Vec<Sample> {
        self.pause();
        self.samples.take()
    }
}
