//! What happens on the line.
use jtc_wire::{FrameType, Response};

use super::{Class, ClientId, Denied, Lease, Policy, PutOut, Will};

/// What has happened on a line since its owner began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Frames written that change something.
    pub sent: u64,
    /// Those that the device has accepted.
    pub accepted: u64,
    /// Those that it has refused.
    pub refused: u64,
    /// Frames that were not passed on.
    pub denied: u64,
    /// Clients that were put out.
    pub put_out: u64,
    /// Stops and Pauses that the device has not taken after many tries.
    pub not_taken: u64,
}

impl Counts {
    /// One more.
    pub(super) fn count(&mut self, event: &LineEvent) {
        let count = match event {
            LineEvent::Sent { .. } => &mut self.sent,
            LineEvent::Answered { response, .. } if response.accepted() => &mut self.accepted,
            LineEvent::Answered { .. } => &mut self.refused,
            LineEvent::Denied { .. } => &mut self.denied,
            LineEvent::PutOut { .. } => &mut self.put_out,
            LineEvent::NotTaken => &mut self.not_taken,
            LineEvent::Lease(_) | LineEvent::PolicyApplied { .. } | LineEvent::Will(_) => return,
        };
        *count += 1;
    }
}

/// Something that happened on the line and that somebody may want to know.
#[derive(Clone, Debug, PartialEq)]
pub enum LineEvent {
    /// A frame that changes something was written.
    Sent {
        /// Whose.
        client: ClientId,
        /// Its type.
        frame_type: FrameType,
        /// Its class.
        class: Class,
        /// All of it.
        bytes: Vec<u8>,
    },
    /// The device has answered a frame that changes something.
    Answered {
        /// Whose.
        client: ClientId,
        /// How.
        response: Response,
    },
    /// A frame was not passed on.
    Denied {
        /// Whose.
        client: ClientId,
        /// Its type.
        frame_type: FrameType,
        /// Why.
        denied: Denied,
    },
    /// Another client commands, or none.
    Lease(Option<Lease>),
    /// A client went, and its motion with it.
    PolicyApplied {
        /// Who it was.
        client: ClientId,
        /// What was done.
        policy: Policy,
    },
    /// A Stop or Pause was sent many times, and the device did not take it.
    NotTaken,
    /// Something else moves the arm, or the policy of somebody else acts on it; `None`: nothing moves any more.
    Will(Option<Will>),
    /// A client was put out.
    PutOut {
        /// Who it was.
        client: ClientId,
        /// Why.
        reason: PutOut,
    },
}
