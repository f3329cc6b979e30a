//! The events of a bus in virtual time.

use crate::{CanFrame, ControllerState};

/// A member of a [`TimedBus`](crate::TimedBus). Only valid for that bus: another bus may panic. The numbers increase and are never used
/// twice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MemberId(pub(super) usize);

/// An event and its time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TimedEvent {
    /// Virtual time, ns.
    pub at_ns: u64,
    /// The event.
    pub what: BusEvent,
}

/// An event on the bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BusEvent {
    /// A member has received a frame.
    Received {
        /// The receiver.
        member: MemberId,
        /// The frame.
        frame: CanFrame,
    },
    /// A member's frame was on the bus and was acknowledged.
    Sent {
        /// Sender.
        member: MemberId,
        /// The frame.
        frame: CanFrame,
    },
    /// A member's frame is dropped: its sender sends each frame only once, or is bus-off.
    Failed {
        /// Sender.
        member: MemberId,
        /// The frame.
        frame: CanFrame,
    },
    /// A frame has failed. Its senders try again, unless they send each frame only once.
    Error {
        /// Error.
        error: BusError,
        /// The frame (of a collision: of its first sender).
        frame: CanFrame,
        /// Senders.
        senders: Vec<MemberId>,
    },
    /// A member's error state has changed.
    State {
        /// Member with the new state.
        member: MemberId,
        /// The new state.
        state: ControllerState,
    },
}

/// Errors of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusError {
    /// Several members sent one identifier with different data at the same time, which CAN forbids.
    Collision,
    /// No member acknowledged.
    NotAcknowledged,
    /// A bit was disturbed on the wire.
    Disturbed,
}

/// Reasons why a frame cannot be queued.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum QueueError {
    /// The frame is a CAN FD frame, but the bus is classic.
    #[error("CAN FD frames are none of a bus in virtual time, which is classic")]
    NotClassic,
    /// The member's controller has left the bus until it recovers.
    #[error("the member is bus-off; its controller must recover first")]
    BusOff,
    /// The member's queue is full.
    #[error("{0} frames of this member wait already; is the bus overloaded, or does nobody acknowledge?")]
    Full(usize),
    /// The member has left.
    #[error("the member has left the bus")]
    Left,
}

/// Counters of a bus since its beginning.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BusStats {
    /// Virtual time, ns.
    pub now_ns: u64,
    /// Time for which the bus was busy, intermissions and error frames included, ns.
    pub busy_ns: u64,
    /// Frames that were acknowledged.
    pub frames: u64,
    /// Identical frames that several members sent at the same time (counted in `frames` as one).
    pub shared: u64,
    /// Collisions.
    pub collisions: u64,
    /// Frames that no member acknowledged.
    pub not_acknowledged: u64,
    /// Disturbed frames.
    pub disturbed: u64,
}

impl BusStats {
    /// Returns the share of the time since `earlier` in which the bus was busy, 0 to 1.
    pub fn load_since(&self, earlier: &Self) -> f64 {
        let time = self.now_ns.saturating_sub(earlier.now_ns);
        let busy = self.busy_ns.saturating_sub(earlier.busy_ns);
        if time == 0 { 0.0 } else { (busy as f64 / time as f64).min(1.0) }
    }
}
