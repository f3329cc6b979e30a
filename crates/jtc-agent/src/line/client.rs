//! A client on the line: what it has sent, what it is to get.
use std::collections::VecDeque;
use std::time::Duration;

use agent_kit::access::Role;
use jtc_host::port::Halts;
use jtc_wire::{ExecCommand, FRAME_MAX, FRAME_MIN, Response};

use super::Denied;
use super::class::HostFrame;

/// Bytes of frames that a client may have waiting: a trajectory in flight and some commands.
const WAITING_MAX: usize = 8 * FRAME_MAX;
/// As many frames, of whatever length: as many as it may send at once.
const FRAMES_WAITING: usize = 500;
/// Bytes that wait for a client that does not take them: two minutes of statuses.
const UNREAD_MAX: usize = 1 << 20;

/// Frames that a client may send, in a second and at once.
const FRAMES_PER_S: f64 = 250.0;
const FRAMES_AT_ONCE: f64 = 500.0;
/// Records that may wait for a client whose frames are refused: one goes with each status.
const REFUSALS_MAX: usize = 600;

/// A client by number; numbers are not used again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize)]
pub struct ClientId(pub u64);

/// What becomes of a motion when the client that commanded it goes, or shows no more that it is there.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize, utoipa::ToSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Policy {
    /// It goes on, as with a host whose cable is pulled.
    #[default]
    Continue,
    /// It pauses on the path.
    Pause,
    /// It stops on the path.
    Stop,
}

impl Policy {
    /// What is sent for it, if anything is.
    pub(super) fn command(self) -> Option<ExecCommand> {
        match self {
            Self::Continue => None,
            Self::Pause => Some(ExecCommand::Pause),
            Self::Stop => Some(ExecCommand::Stop),
        }
    }

    /// In a word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Continue => "continue",
            Self::Pause => "pause",
            Self::Stop => "stop",
        }
    }
}

/// How a client presents itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Introduction {
    /// What people call it.
    pub name: String,
    /// What it may do.
    pub role: Role,
    /// What becomes of its motion without it.
    pub policy: Policy,
}

/// What a client gets.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Delivery {
    /// Bytes of the device: statuses, and what it asked for.
    Bytes(Vec<u8>),
    /// A frame that it sent was not passed on; its record, which says no more than "not allowed", follows in a status.
    Denied(Denied),
    /// What it has asked about the lease was not done.
    LeaseDenied(Denied),
    /// Another client asks for the lease.
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

/// Why a client was put out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PutOut {
    /// It sent bytes that are no frame of a host.
    #[error("it sent bytes that are no frame of this protocol")]
    NoFrame,
    /// It sent more than the line and the others bear.
    #[error(
        "it sent more than {FRAMES_PER_S} frames a second, or more than {FRAMES_WAITING} frames or {WAITING_MAX} bytes wait for the line"
    )]
    TooMuch,
    /// It commanded, and nothing was received from it for seconds.
    #[error("it commanded, and nothing was received from it for some seconds")]
    Silent,
    /// It does not read.
    #[error("it has left more than {UNREAD_MAX} bytes unread")]
    Unread,
}

/// A client.
pub(super) struct Client {
    pub introduction: Introduction,
    /// Bytes of a frame that is not whole yet.
    partial: Vec<u8>,
    /// Frames that wait for the line.
    pub waiting: VecDeque<HostFrame>,
    waiting_bytes: usize,
    /// How many of them are those of one who commands.
    commands: usize,
    /// Records of frames that were not passed on.
    refusals: VecDeque<Response>,
    deliveries: VecDeque<Delivery>,
    unread: usize,
    /// No motion begins before: somebody else has stopped the arm.
    pub calm_until: Duration,
    /// The last halt, by number, that what it does now was asked for after.
    pub asked_after: u64,
    /// Stops and Pauses of others since it came.
    pub halts: Halts,
    /// For how long it commands without showing that it is there; `None`: as long as it is connected.
    pub lasts: Option<Duration>,
    /// When it has shown last that it is there.
    pub shown_at: Duration,
    /// When its last frame arrived.
    pub heard_at: Duration,
    /// Its lease has lapsed, and it has not asked for another since.
    pub lapsed: bool,
    /// Frames that it may send at once, and when that was.
    allowance: f64,
    allowed_at: Duration,
}

impl Client {
    pub fn new(introduction: Introduction) -> Self {
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
            lasts: None,
            lapsed: false,
            shown_at: Duration::ZERO,
            heard_at: Duration::ZERO,
            allowance: FRAMES_AT_ONCE,
            allowed_at: Duration::ZERO,
        }
    }

    /// Takes bytes from the front of `bytes` until a frame is whole.
    pub fn next_frame(&mut self, bytes: &mut &[u8]) -> Result<Option<HostFrame>, PutOut> {
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

    /// It may send another frame now.
    pub fn allow(&mut self, now: Duration) -> Result<(), PutOut> {
        let passed = now.saturating_sub(self.allowed_at).as_secs_f64();
        self.allowance = (self.allowance + passed * FRAMES_PER_S).min(FRAMES_AT_ONCE) - 1.0;
        self.allowed_at = now;
        if self.allowance < 0.0 { Err(PutOut::TooMuch) } else { Ok(()) }
    }

    /// A frame of its own was refused: its record goes with one of the next statuses.
    pub fn refuse(&mut self, response: Response) -> Result<(), PutOut> {
        self.refusals.push_back(response);
        if self.refusals.len() > REFUSALS_MAX { Err(PutOut::TooMuch) } else { Ok(()) }
    }

    /// The record of a refused frame that has not gone to it yet.
    pub fn take_refusal(&mut self) -> Option<Response> {
        self.refusals.pop_front()
    }

    /// A frame waits for its turn.
    pub fn wait(&mut self, frame: HostFrame) -> Result<(), PutOut> {
        self.waiting_bytes += frame.bytes.len();
        self.commands += usize::from(frame.class.needs_lease());
        self.waiting.push_back(frame);
        if self.waiting_bytes > WAITING_MAX || self.waiting.len() > FRAMES_WAITING {
            Err(PutOut::TooMuch)
        } else {
            Ok(())
        }
    }

    /// The next frame in its turn.
    pub fn take_waiting(&mut self) -> Option<HostFrame> {
        let frame = self.waiting.pop_front()?;
        self.waiting_bytes -= frame.bytes.len();
        self.commands -= usize::from(frame.class.needs_lease());
        Some(frame)
    }

    /// Takes the frames out that only one who commands sends; the others keep their order. It costs nothing where there are none, whatever
    /// else waits: a Stop does it with every client.
    pub fn take_commands(&mut self) -> Vec<HostFrame> {
        if self.commands == 0 {
            return Vec::new();
        }
        let (taken, kept) = self.waiting.drain(..).partition(|frame| frame.class.needs_lease());
        (self.waiting, self.commands) = (kept, 0);
        self.waiting_bytes = self.waiting.iter().map(|frame| frame.bytes.len()).sum();
        VecDeque::into(taken)
    }

    /// Gives it something, if it reads.
    pub fn deliver(&mut self, delivery: Delivery) -> Result<(), PutOut> {
        self.unread += delivery.len();
        self.deliveries.push_back(delivery);
        if self.unread > UNREAD_MAX { Err(PutOut::Unread) } else { Ok(()) }
    }

    /// What it has not had yet.
    pub fn take_deliveries(&mut self) -> Vec<Delivery> {
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
