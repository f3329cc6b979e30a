//! Search for the first error while samples are streamed.

use std::collections::VecDeque;

use jtc_wire::ControllerState;

use super::RunFailure;
use super::failure::{Around, BEFORE, began_s, is_bad, why_it_ended};
use crate::recording::{Ending, RecordingInfo};
use crate::sample::Sample;

/// Search for the first error in streamed samples. The result is equal to the result of [`RunFailure::of_recording`].
#[derive(Clone, Debug, Default)]
pub(super) struct Watch {
    /// Most recent samples.
    recent: VecDeque<Sample>,
    /// `true` if a trajectory was executed.
    begun: bool,
    /// Start time of the run, computed from the last sample in motion. Before a motion, the start time is the time of the first sample.
    start_s: Option<f64>,
    in_motion: bool,
    /// First error before an execution, which is used only without an execution. `since` is the first error since the
    /// start of the execution.
    before: Option<Around>,
    since: Option<Around>,
}

impl Watch {
    pub(super) fn push(&mut self, sample: &Sample) {
        for around in [&mut self.before, &mut self.since].into_iter().flatten() {
            around.follow(sample);
        }
        if self.recent.len() > BEFORE {
            self.recent.pop_front();
        }
        self.recent.push_back(*sample);
        self.begun |= sample.is_operating();
        self.in_motion = sample.is_operating();
        if sample.state == ControllerState::Operate {
            self.start_s = Some(began_s(sample));
        }
        self.start_s.get_or_insert(sample.time_s);
        let first = if self.begun { &mut self.since } else { &mut self.before };
        if first.is_none() && is_bad(sample) {
            *first = Some(now(&self.recent, self.start_s));
        }
    }

    pub(super) fn failure(&self, info: &RecordingInfo, ending: &Ending) -> Option<RunFailure> {
        if let Some(around) = if self.begun { &self.since } else { &self.before } {
            return Some(RunFailure::found(info, around));
        }
        let reason = why_it_ended(ending, self.in_motion)?;
        Some(RunFailure::at(info, &now(&self.recent, self.start_s), vec![reason], None))
    }
}

/// Returns the last sample of `recent`, with the samples before it.
fn now(recent: &VecDeque<Sample>, start_s: Option<f64>) -> Around {
    Around {
        samples: recent.iter().copied().collect(),
        at: recent.len().saturating_sub(1),
        start_s: start_s.unwrap_or(0.0),
    }
}
