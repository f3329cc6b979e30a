//! Events of a bus in virtual time.

use crate::{CanFrame, ControllerState};

/// Identifier of a member of a [`TimedBus`](crate::TimedBus). The identifier is valid only for this bus, and another
/// bus can panic if it is used there. Numbers increase and are never reused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MemberId(pub(super) usize);

/// Event on the bus, and the time at which the event occurred.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TimedEvent {
    /// Virtual time, ns.
    pub at_ns: u64,
    /// Event on the bus.
    pub what: BusEvent,
}

/// An event on the bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BusEvent {
    /// A member has received a frame.
    Received {
        /// Member that received the frame.
        member: MemberId,
        /// The received frame.
        frame: CanFrame,
    },
    /// A member's frame was transmitted and acknowledged.
    Sent {
        /// Member that sent the frame.
        member: MemberId,
        /// The transmitted frame.
        frame: CanFrame,
    },
    /// A member's frame is dropped, because the member does not repeat frames or is bus-off.
    Failed {
        /// Member that sent the frame.
        member: MemberId,
        /// The dropped frame.
        frame: CanFrame,
    },
    /// A transmission has failed. The senders repeat the frame, except senders that do not repeat frames.
    Error {
        /// Reason for the failure.
        error: BusError,
        /// Frame that failed; for a collision, the frame of the first sender.
        frame: CanFrame,
        /// All senders of the frame.
        senders: Vec<MemberId>,
    },
    /// A member's error state has changed.
    State {
        /// Member whose error state changed.
        member: MemberId,
        /// New state of the member's controller.
        state: ControllerState,
    },
}

/// Reasons why a transmission fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusError {
    /// Several members sent the same identifier with different data at the same time, which CAN forbids.
    Collision,
    /// No member acknowledged the frame.
    NotAcknowledged,
    /// A bit of the frame was disturbed on the bus.
    Disturbed,
}

/// Reasons why a frame cannot be queued.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum QueueError {
    /// The frame is a CAN FD frame, but the bus is classic.
    #[error("a bus in virtual time carries classic CAN frames only, no CAN FD frames")]
    NotClassic,
    /// The member's controller is bus-off until it recovers.
    #[error("the member is bus-off; its controller must recover first")]
    BusOff,
    /// The member's queue is full.
    #[error("{0} frames of this member are already waiting; the bus is overloaded, or no node acknowledges")]
    Full(usize),
    /// The member has left the bus.
    #[error("the member has left the bus")]
    Left,
}

/// Counters of a bus since it was created.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BusStats {
    /// Virtual time, ns.
    pub now_ns: u64,
    /// Time for which the bus was busy, including intermissions and error frames, ns.
    pub busy_ns: u64,
    /// Number of acknowledged frames.
    pub frames: u64,
    /// Number of identical frames that several members sent at the same time. A group of such frames is counted in
    /// `frames` as one frame.
    pub shared: u64,
    /// Number of collisions.
    pub collisions: u64,
    /// Number of frames that no member acknowledged.
    pub not_acknowledged: u64,
    /// Number of frames in which a bit was disturbed.
    pub disturbed: u64,
}

impl BusStats {
    /// Returns the share of the time since `earlier` for which the bus was busy, 0 to 1.
    pub fn load_since(&self, earlier: &Self) -> f64 {
        let time = self.now_ns.saturating_sub(earlier.now_ns);
        let busy = self.busy_ns.saturating_sub(earlier.busy_ns);
        if time == 0 { 0.0 } else { (busy as f64 / time as f64).min(1.0) }
    }
}
