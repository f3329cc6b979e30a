//! Queue of Stops and Pauses, which are sent before all other frames and repeated until the controller confirms them.
use std::collections::VecDeque;
use std::time::Duration;

use jtc_host::port::line_time;
use jtc_wire::{ExecCommand, Response, STATUS_LEN, fixed};

use super::ClientId;
use super::frame_class::HostFrame;

/// Time after which a Stop or Pause without a response record is sent again. The time that three statuses need on the
/// serial line is added to this value.
const AWAITED: Duration = Duration::from_millis(150);
/// Number of times that a Stop or Pause is sent at the interval [`AWAITED`].
const TRIES: u32 = 20;
/// Interval of the later repetitions of a Stop or Pause. The repetitions end when the controller answers.
const LATER: Duration = Duration::from_secs(1);

/// Stop or Pause, and the clients that have requested it.
#[derive(Debug)]
struct Halt {
    command: ExecCommand,
    askers: Vec<ClientId>,
    tries: u32,
    /// Time at which the Stop or Pause is sent again.
    again_at: Duration,
}

impl Halt {
    fn ask(&mut self, client: ClientId) {
        if !self.askers.contains(&client) {
            self.askers.push(client);
        }
    }
}

/// Stops and Pauses that wait for their response records. The requests of several clients share one frame, and each
/// of these clients receives the response record of the frame.
#[derive(Debug, Default)]
pub(super) struct StopQueue {
    waiting: Option<Halt>,
    /// Stops and Pauses that were written, oldest first.
    written: VecDeque<Halt>,
    /// `true` if a frame that may begin a motion was written after the last Stop or Pause.
    motion_since: bool,
}

impl StopQueue {
    /// Adds a client's request for a Stop or a Pause. A Stop replaces a queued Pause, but a Pause never replaces a
    /// Stop.
    pub(super) fn ask(&mut self, client: ClientId, command: ExecCommand) {
        let covers = |halt: &Halt| halt.command == ExecCommand::Stop || halt.command == command;
        if let Some(waiting) = &mut self.waiting {
            if !covers(waiting) {
                waiting.command = command;
            }
            waiting.tries = 0;
            waiting.ask(client);
        } else if let Some(written) =
            self.written.back_mut().filter(|halt| covers(halt) && !self.motion_since)
        {
            written.tries = 0;
            written.ask(client);
        } else {
            self.waiting = Some(Halt { command, askers: vec![client], tries: 0, again_at: Duration::ZERO });
        }
    }

    /// Returns the Stop or Pause that must be written before all other frames.
    pub(super) fn frame(&self) -> Option<HostFrame> {
        self.waiting.as_ref().and_then(|halt| HostFrame::parse(fixed::exec(halt.command).to_vec()))
    }

    /// Records that the Stop or Pause was written. The serial line finishes the last byte of the frame at `at`.
    pub(super) fn written(&mut self, at: Duration, baud: Option<u32>) {
        if let Some(mut halt) = self.waiting.take() {
            halt.tries += 1;
            let awaited = if halt.tries > TRIES { LATER } else { AWAITED };
            halt.again_at = at + awaited + line_time(3 * STATUS_LEN, baud);
            self.written.push_back(halt);
            self.motion_since = false;
        }
    }

    /// Records that a frame that may begin a motion was written.
    pub(super) fn motion_written(&mut self) {
        self.motion_since = true;
    }

    /// Processes the response record of the oldest written Stop or Pause. Returns the clients that receive the record.
    /// If the Stop or Pause arrived damaged at the controller, it is sent again.
    pub(super) fn answered(&mut self, response: &Response, arrived: bool) -> Vec<(ClientId, Response)> {
        let Some(halt) = self.written.pop_front() else { return Vec::new() };
        if !arrived {
            self.again(halt);
            return Vec::new();
        }
        halt.askers.into_iter().map(|asker| (asker, *response)).collect()
    }

    /// Repeats each Stop or Pause whose response record is overdue. Returns true if a Stop or Pause has now been sent
    /// [`TRIES`] times.
    pub(super) fn look(&mut self, now: Duration) -> bool {
        let mut many = false;
        while let Some(halt) = self.written.pop_front_if(|halt| now >= halt.again_at) {
            many |= halt.tries == TRIES;
            self.again(halt);
        }
        many
    }

    fn again(&mut self, halt: Halt) {
        // A Pause after a Stop would replace the Stop, so this Pause is not sent again.
        if let Some(stop) = self.written.iter_mut().find(|halt| halt.command == ExecCommand::Stop) {
            return halt.askers.into_iter().for_each(|asker| stop.ask(asker));
        }
        match &mut self.waiting {
            Some(waiting) => {
                if halt.command == ExecCommand::Stop {
                    waiting.command = halt.command;
                }
                halt.askers.into_iter().for_each(|asker| waiting.ask(asker));
            }
            None => self.waiting = Some(halt),
        }
    }

    /// Returns the time at which the next Stop or Pause is written or repeated.
    pub(super) fn due(&self, now: Duration) -> Option<Duration> {
        if self.waiting.is_some() { Some(now) } else { self.written.front().map(|halt| halt.again_at) }
    }

    /// Returns the command that was sent more than once because the controller does not confirm it; a Stop has
    /// priority over a Pause.
    pub(super) fn untaken(&self) -> Option<ExecCommand> {
        let again = self.waiting.iter().chain(&self.written).filter(|halt| halt.tries > 1);
        again.map(|halt| halt.command).max_by_key(|command| *command == ExecCommand::Stop)
    }

    /// Returns true if every requested Stop or Pause has received its response record.
    pub(super) fn are_done(&self) -> bool {
        self.waiting.is_none() && self.written.is_empty()
    }
}
