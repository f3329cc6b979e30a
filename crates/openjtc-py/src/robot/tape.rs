//! What is recorded of a motion while it is executed.

use std::cell::{Cell, RefCell};

use jtc_host::Sample;
use jtc_host::recording::SampleSink;

/// What is recorded of a motion.
#[derive(Default)]
pub struct Tape {
    on: Cell<bool>,
    zero: Cell<Option<f64>>,
    samples: RefCell<Vec<Sample>>,
    sink: RefCell<Option<SampleSink>>,
}

impl Tape {
    /// From now on samples are kept, and written where there is a file; those before stay.
    pub fn record(&self, sink: Option<SampleSink>) {
        self.on.set(true);
        self.zero.set(None);
        *self.sink.borrow_mut() = sink;
    }

    /// Takes a sample on a clock of its own; the recording's begins at 0, and a further motion behind the last one.
    pub fn push(&self, sample: &Sample) {
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

    /// A sample that was kept before stays.
    pub fn keep(&self, sample: &Sample) {
        self.samples.borrow_mut().push(*sample);
    }

    /// Nothing more is kept.
    pub fn pause(&self) {
        self.on.set(false);
        self.sink.borrow_mut().take();
    }

    /// What was kept.
    pub fn take(&self) -> Vec<Sample> {
        self.pause();
        self.samples.take()
    }
}
