//! What happens on the line.
use jtc_wire::{FrameType, Response};

use super::{Class, ClientId, Denied, Lease, Policy, PutOut};

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
    /// A client was put out.
    PutOut {
        /// Who it was.
        client: ClientId,
        /// Why.
        reason: PutOut,
    },
}
