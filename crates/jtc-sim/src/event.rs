//! Events of the simulation, used in reports and in live output.
use core::fmt;
use std::collections::VecDeque;

use jtc_bus::{GRIPPER, NodeState};
use jtc_core::{ControllerState, TrajectoryState};
use jtc_wire::FrameStatus;

use crate::faults::FaultKind;

/// Event of the simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// The controller changed its state.
    ControllerState {
        /// Previous state.
        from: ControllerState,
        /// New state.
        to: ControllerState,
    },
    /// The trajectory execution state changed.
    Execution {
        /// Previous state.
        from: TrajectoryState,
        /// New state.
        to: TrajectoryState,
    },
    /// The controller's error word changed.
    Errors {
        /// Previous error word.
        from: u16,
        /// New error word.
        to: u16,
    },
    /// A node changed its state.
    Node {
        /// Number of the node: 0 to 5 for the joints, 6 for the gripper.
        node: u8,
        /// Previous state.
        from: NodeState,
        /// New state.
        to: NodeState,
    },
    /// A host frame was processed.
    Frame {
        /// Type byte of the frame.
        frame_type: u8,
    },
    /// The controller received bytes that are not a valid frame.
    BadFrame {
        /// Reason why the frame is invalid.
        status: FrameStatus,
    },
    /// A fault begins.
    FaultBegins(FaultKind),
    /// A fault ends.
    FaultEnds(FaultKind),
    /// The watchdog reset the controller.
    WatchdogReset,
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ControllerState { from, to } => write!(f, "controller: {from:?} → {to:?}"),
            Self::Execution { from, to } => write!(f, "trajectory: {from:?} → {to:?}"),
            Self::Errors { from, to } => write!(f, "errors: 0x{from:04X} → 0x{to:04X}"),
            Self::Node { node, from, to } => match usize::from(*node) {
                GRIPPER => write!(f, "gripper: state {} → {}", from.code(), to.code()),
                joint => write!(f, "joint {}: state {} → {}", joint + 1, from.code(), to.code()),
            },
            Self::Frame { frame_type } => write!(f, "host frame 0x{frame_type:02X}"),
            Self::BadFrame { status } => write!(f, "bad host frame: {status:?}"),
            Self::FaultBegins(kind) => write!(f, "fault begins: {kind}"),
            Self::FaultEnds(kind) => write!(f, "fault ends: {kind}"),
            Self::WatchdogReset => f.write_str("the watchdog resets the controller"),
        }
    }
}

/// An event with the time at which it occurred.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogEntry {
    /// Time since the start of the simulation, µs.
    pub time_us: u64,
    /// Event of the simulation.
    pub event: Event,
}

impl fmt::Display for LogEntry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:10.3} s  {}", self.time_us as f64 * 1e-6, self.event)
    }
}

/// Log of the latest events.
#[derive(Clone, Debug, Default)]
pub struct Log {
    entries: VecDeque<LogEntry>,
    most: usize,
    dropped: u64,
}

impl Log {
    /// Creates a log that keeps the last `most` entries and counts the removed entries.
    pub fn new(most: usize) -> Self {
        Self { entries: VecDeque::new(), most, dropped: 0 }
    }

    pub(crate) fn push(&mut self, time_us: u64, event: Event) {
        self.entries.push_back(LogEntry { time_us, event });
        if self.entries.len() > self.most {
            self.entries.pop_front();
            self.dropped += 1;
        }
    }

    /// Returns the entries, oldest first.
    pub fn entries(&self) -> impl DoubleEndedIterator<Item = &LogEntry> + ExactSizeIterator {
        self.entries.iter()
    }

    /// Returns the number of entries that were removed because the log was full.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_log_keeps_what_happened_last() {
        let mut log = Log::new(2);
        for frame_type in 1..=5 {
            log.push(u64::from(frame_type), Event::Frame { frame_type });
        }
        let times: Vec<u64> = log.entries().map(|entry| entry.time_us).collect();
        assert_eq!((times, log.dropped()), (vec![4, 5], 3));
    }
}
