//! Stops and Pauses on their way: ahead of all else, until the device has taken them.
use std::collections::VecDeque;
use std::time::Duration;

use jtc_host::port::line_time;
use jtc_wire::{ExecCommand, Response, STATUS_LEN, fixed};

use super::ClientId;
use super::class::HostFrame;

/// A record is awaited for so long, and three statuses on the line, before the frame is sent again.
const AWAITED: Duration = Duration::from_millis(150);
/// So often one is sent as soon as that is over; after that once in a while, until the device is there again.
const TRIES: u32 = 20;
const LATER: Duration = Duration::from_secs(1);

/// A Stop or a Pause, and who has asked for it.
#[derive(Debug)]
struct Halt {
    command: ExecCommand,
    askers: Vec<ClientId>,
    tries: u32,
    /// When it is sent again.
    again_at: Duration,
}

impl Halt {
    fn ask(&mut self, client: ClientId) {
        if !self.askers.contains(&client) {
            self.askers.push(client);
        }
    }
}

/// Those that are on their way. However many ask, one waits for the line, and each of them has its record.
#[derive(Debug, Default)]
pub(super) struct Halts {
    waiting: Option<Halt>,
    /// Written, and without a record.
    written: VecDeque<Halt>,
    /// A frame that may begin a motion has been written behind the last of them.
    motion_since: bool,
}

impl Halts {
    /// A client asks for one. A Stop takes the place of a Pause, never the other way.
    pub fn ask(&mut self, client: ClientId, command: ExecCommand) {
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

    /// The frame that is to be written before all others.
    pub fn frame(&self) -> Option<HostFrame> {
        self.waiting.as_ref().and_then(|halt| HostFrame::parse(fixed::exec(halt.command).to_vec()))
    }

    /// It was written; the line has carried it at `at`.
    pub fn written(&mut self, at: Duration, baud: Option<u32>) {
        if let Some(mut halt) = self.waiting.take() {
            halt.tries += 1;
            let awaited = if halt.tries > TRIES { LATER } else { AWAITED };
            halt.again_at = at + awaited + line_time(3 * STATUS_LEN, baud);
            self.written.push_back(halt);
            self.motion_since = false;
        }
    }

    /// A frame that may begin a motion was written.
    pub fn motion_written(&mut self) {
        self.motion_since = true;
    }

    /// The record of the first of them: who is to have it. One that says that the frame arrived damaged has it sent again.
    pub fn answered(&mut self, response: &Response, arrived: bool) -> Vec<(ClientId, Response)> {
        let Some(halt) = self.written.pop_front() else { return Vec::new() };
        if !arrived {
            self.again(halt);
            return Vec::new();
        }
        halt.askers.into_iter().map(|asker| (asker, *response)).collect()
    }

    /// Those whose record does not come are sent again. Returns whether one has been sent many times now.
    pub fn look(&mut self, now: Duration) -> bool {
        let mut many = false;
        while let Some(halt) = self.written.pop_front_if(|halt| now >= halt.again_at) {
            many |= halt.tries == TRIES;
            self.again(halt);
        }
        many
    }

    fn again(&mut self, halt: Halt) {
        // Behind a Stop a Pause would take its place.
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

    /// When one is to be written, or sent again.
    pub fn due(&self, now: Duration) -> Option<Duration> {
        if self.waiting.is_some() { Some(now) } else { self.written.front().map(|halt| halt.again_at) }
    }

    /// What was asked for, and sent more than once because the device does not take it.
    pub fn untaken(&self) -> Option<ExecCommand> {
        let again = self.waiting.iter().chain(&self.written).filter(|halt| halt.tries > 1);
        again.map(|halt| halt.command).max_by_key(|command| *command == ExecCommand::Stop)
    }

    /// All have their records.
    pub fn are_done(&self) -> bool {
        self.waiting.is_none() && self.written.is_empty()
    }
}
