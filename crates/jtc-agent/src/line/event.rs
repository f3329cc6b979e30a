//! Events on the serial line.
use jtc_wire::{FrameType, Response};

use super::{ClientId, Denied, FrameClass, Lease, Policy, PutOut, Will};

/// Counts of events on the serial line since its thread started.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Number of written frames that change the state of the controller.
    pub sent: u64,
    /// Number of state-changing frames that the controller accepted.
    pub accepted: u64,
    /// Number of state-changing frames that the controller refused.
    pub refused: u64,
    /// Number of client frames that the agent did not send to the controller.
    pub denied: u64,
    /// Number of clients that the agent disconnected.
    pub put_out: u64,
    /// Number of Stops and Pauses that the controller did not confirm after many tries.
    pub not_taken: u64,
}

impl Counts {
    /// Adds an event to the counts.
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

/// Event on the serial line.
#[derive(Clone, Debug, PartialEq)]
pub enum LineEvent {
    /// Written frame that changes the state of the controller.
    Sent {
        /// Client that sent the frame.
        client: ClientId,
        /// Type of the frame.
        frame_type: FrameType,
        /// Class of the written frame.
        class: FrameClass,
        /// Bytes of the complete frame.
        bytes: Vec<u8>,
    },
    /// Answer of the controller to a frame that changes its state.
    Answered {
        /// Client that sent the frame.
        client: ClientId,
        /// Answer of the controller.
        response: Response,
    },
    /// Client frame that the agent did not send to the controller.
    Denied {
        /// Client that sent the frame.
        client: ClientId,
        /// Type of the frame.
        frame_type: FrameType,
        /// Reason why the frame was not sent.
        denied: Denied,
    },
    /// Change of the lease holder.
    Lease(Option<Lease>),
    /// Policy that was applied to the motion of a client after the client disconnected or its lease lapsed.
    PolicyApplied {
        /// Client whose policy was applied.
        client: ClientId,
        /// Policy that was applied.
        policy: Policy,
    },
    /// Stop or Pause that was sent many times without a confirmation of the controller.
    NotTaken,
    /// Change of the cause of a motion, or of the client whose policy applies to the motion. `None` means that no
    /// motion is in progress or expected any more.
    Will(Option<Will>),
    /// Disconnection of a client by the agent.
    PutOut {
        /// Number of the disconnected client.
        client: ClientId,
        /// Reason why the agent disconnected the client.
        reason: PutOut,
    },
}
