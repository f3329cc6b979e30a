//! Client on the serial line, with its received frames and its queued deliveries.
use std::collections::VecDeque;
use std::time::Duration;

use agent_kit::access::Role;
use agent_kit::lease::Presence;
use jtc_host::port::Halts;
use jtc_wire::{ExecCommand, FRAME_MAX, FRAME_MIN, Response};

use super::Denied;
use super::frame_class::HostFrame;

/// Largest number of queued bytes of a client's frames. This is enough for some commands and for those frames of an
/// upload that are sent without waiting for a response.
const WAITING_MAX: usize = 8 * FRAME_MAX;
/// Largest number of queued frames of a client; equal to the number of frames that a client may send in one burst.
const FRAMES_WAITING: usize = 500;
/// Largest number of unread bytes of a client; this number is enough for two minutes of statuses.
const UNREAD_MAX: usize = 1 << 20;

/// Largest number of frames that a client may send, per second and in one burst.
const FRAMES_PER_S: f64 = 250.0;
const FRAMES_AT_ONCE: f64 = 500.0;
/// Largest number of queued response records for refused frames. Each status delivers at most one of them.
const REFUSALS_MAX: usize = 600;

/// Number that identifies a client. Client numbers are not reused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize)]
pub struct ClientId(pub u64);

/// Policy for a motion when the client that commanded it disconnects or falls silent.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize, utoipa::ToSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Policy {
    /// The motion continues, as it does when the cable of a host is pulled.
    #[default]
    Continue,
    /// The motion pauses on the path.
    Pause,
    /// The motion stops on the path.
    Stop,
}

impl Policy {
    /// Returns the Stop or Pause of the policy; `None` for the policy Continue.
    pub(super) fn command(self) -> Option<ExecCommand> {
        match self {
            Self::Continue => None,
            Self::Pause => Some(ExecCommand::Pause),
            Self::Stop => Some(ExecCommand::Stop),
        }
    }

    /// Returns the name of the policy.
    pub fn name(self) -> &'static str {
        match self {
            Self::Continue => "continue",
            Self::Pause => "pause",
            Self::Stop => "stop",
        }
    }
}

/// Data that describes a client when it connects.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Introduction {
    /// Name of the client, which users see.
    pub name: String,
    /// Role of the client.
    pub role: Role,
    /// Policy for the client's motion when the client disconnects or its lease lapses.
    pub policy: Policy,
}

/// Data that the serial line delivers to a client.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Delivery {
    /// Bytes from the controller: statuses, and answers to the client's own requests.
    Bytes(Vec<u8>),
    /// Reason why a frame of the client was not passed on to the controller. The response record of the refused frame
    /// follows in a status; the record only contains "not allowed".
    Denied(Denied),
    /// Reason why the agent refused a request about the lease.
    LeaseDenied(Denied),
    /// Name of another client that requests the lease.
    LeaseWanted(String),
}

impl Delivery {
    fn len(&self) -> usize {
        match self {
            Self::Bytes(bytes) => bytes.len(),
            Self::Denied(_) | Self::LeaseDenied(_) | Self::LeaseWanted(_) => 64,
        }
    }
}

/// Reason why the agent disconnected a client.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PutOut {
    /// The client sent bytes that are not a host frame.
    #[error("the client sent bytes that are not a frame of this protocol")]
    NoFrame,
    /// The client sent too many bytes or frames, which would disturb the other clients.
    #[error(
        "the client sent more than {FRAMES_PER_S} frames per second, or has more than {FRAMES_WAITING} \
         frames or {WAITING_MAX} bytes in the queue"
    )]
    TooMuch,
    /// The lease holder sent no data for several seconds.
    #[error("the client held the lease, and was silent for some seconds")]
    Silent,
    /// The client does not read its data.
    #[error("the client has left more than {UNREAD_MAX} bytes unread")]
    Unread,
}

/// Client on the serial line.
pub(super) struct Client {
    pub introduction: Introduction,
    /// Bytes of an incomplete frame.
    partial: Vec<u8>,
    /// Frames of the client that are queued for the serial line.
    pub waiting: VecDeque<HostFrame>,
    waiting_bytes: usize,
    /// Number of queued frames that need the lease.
    commands: usize,
    /// Response records of refused frames.
    refusals: VecDeque<Response>,
    deliveries: VecDeque<Delivery>,
    unread: usize,
    /// End of the hold-off after a Stop or a Pause of another client. During the hold-off, no motion of this client
    /// begins.
    pub calm_until: Duration,
    /// Number of the last Stop or Pause that the client knew when it made its last motion request.
    pub asked_after: u64,
    /// Number of Stops and Pauses of other clients since this client connected.
    pub halts: Halts,
    /// Time when the client was last active, and the duration of its lease.
    pub presence: Presence,
    /// Arrival time of the client's last frame.
    pub heard_at: Duration,
    /// `true` if the client's lease has lapsed and the client has not requested the lease again.
    pub lapsed: bool,
    /// Number of frames that the client may still send at once. `allowed_at` is the time at which this number was
    /// computed.
    allowance: f64,
    allowed_at: Duration,
}

impl Client {
    pub(super) fn new(introduction: Introduction) -> Self {
        Self {
            introduction,
            partial: Vec::new(),
            waiting: VecDeque::new(),
            waiting_bytes: 0,
            commands: 0,
            refusals: VecDeque::new(),
            deliveries: VecDeque::new(),
            unread: 0,
            calm_until: Duration::ZERO,
            asked_after: 0,
            halts: Halts::default(),
            presence: Presence { lasts: None, seen: Duration::ZERO },
            lapsed: false,
            heard_at: Duration::ZERO,
            allowance: FRAMES_AT_ONCE,
            allowed_at: Duration::ZERO,
        }
    }

    /// Removes bytes from the front of `bytes` until a frame of the client is complete.
    pub(super) fn next_frame(&mut self, bytes: &mut &[u8]) -> Result<Option<HostFrame>, PutOut> {
        loop {
            let wanted = match self.partial.get(2..4) {
                None => 4,
                Some(length) => usize::from(u16::from_be_bytes([length[0], length[1]])),
            };
            if !(4..=FRAME_MAX).contains(&wanted) || (self.partial.len() >= 4 && wanted < FRAME_MIN) {
                return Err(PutOut::NoFrame);
            }
            if self.partial.len() < wanted {
                if bytes.is_empty() {
                    return Ok(None);
                }
                let (taken, rest) = bytes.split_at((wanted - self.partial.len()).min(bytes.len()));
                self.partial.extend(taken);
                *bytes = rest;
                continue;
            }
            let frame = HostFrame::parse(std::mem::take(&mut self.partial));
            return frame.map(Some).ok_or(PutOut::NoFrame);
        }
    }

    /// Checks that the client may send another frame now.
    pub(super) fn allow(&mut self, now: Duration) -> Result<(), PutOut> {
        let passed = now.saturating_sub(self.allowed_at).as_secs_f64();
        self.allowance = (self.allowance + passed * FRAMES_PER_S).min(FRAMES_AT_ONCE) - 1.0;
        self.allowed_at = now;
        if self.allowance < 0.0 { Err(PutOut::TooMuch) } else { Ok(()) }
    }

    /// Queues the response record of a refused frame. The response record is in one of the next statuses.
    pub(super) fn refuse(&mut self, response: Response) -> Result<(), PutOut> {
        self.refusals.push_back(response);
        if self.refusals.len() > REFUSALS_MAX { Err(PutOut::TooMuch) } else { Ok(()) }
    }

    /// Removes and returns the next queued response record of a refused frame.
    pub(super) fn take_refusal(&mut self) -> Option<Response> {
        self.refusals.pop_front()
    }

    /// Queues a frame of the client for the serial line.
    pub(super) fn wait(&mut self, frame: HostFrame) -> Result<(), PutOut> {
        self.waiting_bytes += frame.bytes.len();
        self.commands += usize::from(frame.class.needs_lease());
        self.waiting.push_back(frame);
        if self.waiting_bytes > WAITING_MAX || self.waiting.len() > FRAMES_WAITING {
            Err(PutOut::TooMuch)
        } else {
            Ok(())
        }
    }

    /// Removes and returns the next queued frame of the client.
    pub(super) fn take_waiting(&mut self) -> Option<HostFrame> {
        let frame = self.waiting.pop_front()?;
        self.waiting_bytes -= frame.bytes.len();
        self.commands -= usize::from(frame.class.needs_lease());
        Some(frame)
    }

    /// Removes the queued frames that need the lease; the remaining frames keep their order. Returns at once without
    /// such a frame, because every Stop calls this function for all clients.
    pub(super) fn take_commands(&mut self) -> Vec<HostFrame> {
        if self.commands == 0 {
            return Vec::new();
        }
        let (taken, kept) = self.waiting.drain(..).partition(|frame| frame.class.needs_lease());
        (self.waiting, self.commands) = (kept, 0);
        self.waiting_bytes = self.waiting.iter().map(|frame| frame.bytes.len()).sum();
        VecDeque::into(taken)
    }

    /// Queues a delivery for the client. Returns an error if the number of unread bytes of the client exceeds the
    /// limit.
    pub(super) fn deliver(&mut self, delivery: Delivery) -> Result<(), PutOut> {
        self.unread += delivery.len();
        self.deliveries.push_back(delivery);
        if self.unread > UNREAD_MAX { Err(PutOut::Unread) } else { Ok(()) }
    }

    /// Removes and returns the queued deliveries of the client.
    pub(super) fn take_deliveries(&mut self) -> Vec<Delivery> {
        self.unread = 0;
        self.deliveries.drain(..).collect()
    }
}

#[cfg(test)]
mod tests {
    use jtc_wire::fixed;

    use super::*;

    #[test]
    fn a_stop_takes_out_what_commands_and_leaves_the_rest_in_its_order() {
        let mut client =
            Client::new(Introduction { name: "anna".into(), role: Role::Operator, policy: Policy::Continue });
        let frame = |bytes: &[u8]| HostFrame::parse(bytes.to_vec()).expect("a frame");
        for bytes in [
            &fixed::GET_INFO[..],
            &fixed::exec(ExecCommand::Execute),
            &fixed::get_settings(0),
            &fixed::gripper_control(true),
        ] {
            client.wait(frame(bytes)).expect("there is room");
        }
        assert_eq!(client.take_commands().len(), 2);
        assert!(client.take_commands().is_empty());
        assert_eq!(client.take_waiting(), Some(frame(&fixed::GET_INFO)));
        assert_eq!(client.take_waiting(), Some(frame(&fixed::get_settings(0))));
        assert_eq!((client.take_waiting(), client.waiting_bytes, client.commands), (None, 0, 0));
        let mut room = (0..).take_while(|_| client.wait(frame(&fixed::GET_INFO)).is_ok());
        assert_eq!(room.by_ref().count(), FRAMES_WAITING, "short frames have a bound of their own");
    }
}
