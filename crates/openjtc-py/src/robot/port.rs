//! Line to the controller with a filter. The filter sends no frame that was requested before a Stop, and sends the
//! Stop itself at once.
//!
//! All jobs write their frames through this module, and every wait for the controller reads through it. The decision
//! whether a frame is still allowed to move the arm is therefore made only here. The module writes a Stop as soon as
//! a caller requests the Stop, even in the middle of a job.

use std::sync::Arc;
use std::time::Duration;

use jtc_host::port::Halts;
use jtc_host::port::sim::SimPort;
use jtc_host::{Port, PortError};
use jtc_wire::{FrameType, fixed};

use super::shared::Shared;
use crate::threads::lock;

/// Maximum duration of a read before the port checks whether a Stop was requested.
const LOOK: Duration = Duration::from_millis(10);
/// Maximum time between two pieces of a frame. After a longer pause, the port does not expect the missing bytes of the frame any more.
const PIECE: Duration = Duration::from_millis(50);
/// Maximum time until the response record of a Stop arrives. Only a status that is already being sent can delay the response record.
const RECORD: Duration = Duration::from_millis(200);
/// Minimum time, and minimum number of received statuses, after the start of a motion. When both are reached, the
/// statuses show this motion.
const BEGUN: (Duration, u64) = (Duration::from_millis(300), 3);

/// Line without the filter.
pub(crate) enum Line {
    /// Line to a simulator. The variant for the simulator is separate, so that disturbances can be applied to the simulated arm during
    /// any job.
    Simulated(Box<SimPort>),
    /// Line to a serial port or an agent.
    Other(Box<dyn Port>),
}

macro_rules! each_line {
    ($port:ident, $own:ident => $do:expr) => {
        match &$own.line {
            Line::Simulated($port) => $do,
            Line::Other($port) => $do,
        }
    };
    (mut $port:ident, $own:ident => $do:expr) => {
        match &mut $own.line {
            Line::Simulated($port) => $do,
            Line::Other($port) => $do,
        }
    };
}

/// Line with the filter.
pub(crate) struct AnyPort {
    line: Line,
    shared: Arc<Shared>,
    /// Number of Stops that had been requested when the current request was made.
    at: u64,
    /// Numbers of handled Stops, in the form that [`Shared::stops`] returns.
    done: (u64, u64),
    /// Number of Stops and Pauses of other programs that were already handled.
    foreign: Halts,
    /// Time of the last written frame that moves the arm, and number of statuses that were received before this
    /// frame.
    rest: (usize, Duration),
    /// Time of the last written Stop.
    stopped: Option<Duration>,
    /// Time of the last written frame that moves the arm, and the number of statuses before this frame.
    begun: (Duration, u64),
}

impl AnyPort {
    /// Makes a line whose filter uses the Stops in `shared`.
    pub(crate) fn new(line: Line, shared: Arc<Shared>) -> Self {
        Self {
            line,
            shared,
            at: 0,
            done: (0, 0),
            foreign: Halts::default(),
            rest: (0, Duration::ZERO),
            stopped: None,
            begun: (Duration::ZERO, 0),
        }
    }

    /// Returns `true` if the arm is simulated.
    pub(crate) fn is_simulated(&self) -> bool {
        matches!(self.line, Line::Simulated(_))
    }

    /// Begins a request. `at` is the number of Stops that had been requested when the request was made.
    pub(crate) fn begin(&mut self, at: u64) {
        self.at = at;
    }

    /// Marks all Stops as handled. The caller itself writes the Stop frame.
    pub(crate) fn take_over(&mut self) {
        self.done = self.shared.stops();
    }

    /// Returns the remaining time in which the record of the last Stop can still arrive. The session must not mistake
    /// this record for the answer to a later frame.
    pub(crate) fn unsettled(&self) -> Option<Duration> {
        let left = (self.stopped? + RECORD).saturating_sub(self.now());
        (!left.is_zero()).then_some(left)
    }

    /// Returns `true` if the statuses already show the motion that was started last.
    pub(crate) fn is_shown(&self) -> bool {
        let (time, statuses) = BEGUN;
        self.now() >= self.begun.0 + time && self.shared.seen() >= self.begun.1 + statuses
    }

    /// Handles Stops and Pauses of other programs. A Stop cancels all earlier requests of this connection, including waiting requests. A
    /// Pause during a motion does not cancel waiting requests, because they are executed only after the motion is resumed. At rest, a
    /// Pause cancels requests like a Stop.
    fn take_foreign_halts(&mut self) {
        let now = each_line!(port, self => port.halts());
        if now == self.foreign {
            return;
        }
        let stopped = now.stops != self.foreign.stops;
        self.foreign = now;
        if stopped || !self.shared.moves() {
            self.shared.halt();
        }
    }

    /// Handles a frame that the line did not send because of another program's Stop or Pause. The waiting requests were
    /// made before that Stop or Pause, so they are cancelled. The requests are kept only if the frame is an Execute and
    /// the motion stays paused.
    fn withheld(&mut self, frame: &[u8], moved: bool) {
        self.take_foreign_halts();
        let stays_paused = moved && frame == fixed::EXECUTE;
        if !stays_paused && self.shared.queue.stops() == self.at {
            self.shared.halt();
        }
    }

    /// Writes a Stop frame if a new Stop was requested. A Stop that concerns only this connection is written only
    /// while this connection moves the arm.
    fn act(&mut self) -> Result<(), PortError> {
        self.take_foreign_halts();
        let now = self.shared.stops();
        if now == self.done {
            return Ok(());
        }
        let due = now.1 != self.done.1 || self.shared.moves();
        if due && self.rest.0 > 0 && self.now() < self.rest.1 + PIECE {
            // The Stop is not written yet, because existing devices would parse it as part of the unfinished frame.
            return Ok(());
        }
        self.done = now;
        if due {
            self.rest.0 = 0;
            self.stopped = Some(self.now());
            each_line!(mut port, self => port.write_all(&fixed::STOP))?;
        }
        Ok(())
    }

    /// Refuses a frame that moves the arm or starts Teaching, if a Stop was requested after this frame was requested.
    fn pass(&mut self, frame: &[u8]) -> Result<(), PortError> {
        let moves = frame == fixed::EXECUTE || is_jog(frame);
        if !moves && frame != fixed::TEACHING_MODE_ENABLE {
            return Ok(());
        }
        // `moves` is set before the number of Stops is checked. A Stop that is requested between these two steps then
        // finds a motion that it must stop.
        let moved_before = self.shared.moves();
        if moves {
            self.shared.set_moves(true);
            self.begun = (self.now(), self.shared.seen());
        }
        if self.shared.queue.stops() == self.at {
            return Ok(());
        }
        self.shared.set_moves(moved_before);
        Err(PortError::Halted { by: None })
    }

    fn touch(&mut self) {
        if let Line::Simulated(port) = &mut self.line {
            for touch in std::mem::take(&mut *lock(&self.shared.touches)) {
                touch(port.world_mut());
            }
        }
    }
}

/// Returns `true` for a jog with a velocity other than 0. A jog with velocity 0 brings the joints to rest.
fn is_jog(frame: &[u8]) -> bool {
    match frame {
        [_, kind, _, _, velocities @ .., _, _] => {
            *kind == FrameType::Jog as u8 && velocities.iter().any(|byte| *byte != 0)
        }
        _ => false,
    }
}

/// Returns the length of the frame that begins with these bytes.
fn length(frame: &[u8]) -> usize {
    frame.get(2..4).map_or(0, |n| usize::from(n[0]) << 8 | usize::from(n[1]))
}

impl Port for AnyPort {
    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, PortError> {
        let end = self.now() + timeout;
        loop {
            self.touch();
            self.act()?;
            let left = end.saturating_sub(self.now()).min(LOOK);
            let n = each_line!(mut port, self => port.read(buffer, left))?;
            if n > 0 || self.now() >= end {
                return Ok(n);
            }
        }
    }

    fn write_all(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.act()?;
        let moved = self.shared.moves();
        self.pass(bytes)?;
        if bytes == fixed::STOP {
            self.stopped = Some(self.now());
        }
        let whole = if self.rest.0 > 0 && self.now() < self.rest.1 + PIECE {
            self.rest.0
        } else {
            // The length of the frame can be read, because the first piece always contains the complete header.
            length(bytes)
        };
        let written = each_line!(mut port, self => port.write_all(bytes));
        if let Err(PortError::Halted { by: Some(_) }) = written {
            self.withheld(bytes, moved);
        }
        written?;
        self.rest = (whole.saturating_sub(bytes.len()), self.now());
        Ok(())
    }

    fn now(&self) -> Duration {
        each_line!(port, self => port.now())
    }

    fn baud(&self) -> Option<u32> {
        each_line!(port, self => port.baud())
    }

    fn name(&self) -> String {
        each_line!(port, self => port.name())
    }

    fn take_denial(&mut self) -> Option<String> {
        each_line!(mut port, self => port.take_denial())
    }

    /// Requests permission from the line to move the arm. Returns an error if a Stop was requested after the current
    /// request was made, even if the job began after the Stop.
    fn ask_to_move(&mut self) -> Result<(), PortError> {
        self.take_foreign_halts();
        if self.shared.queue.stops() != self.at {
            return Err(PortError::Halted { by: None });
        }
        let known = self.foreign.all;
        each_line!(mut port, self => port.ask_to_move_after(known))
    }

    fn ask_to_resume(&mut self) -> Result<(), PortError> {
        self.take_foreign_halts();
        if self.shared.queue.stops() != self.at {
            return Err(PortError::Halted { by: None });
        }
        each_line!(mut port, self => port.ask_to_resume())
    }

    fn halts(&self) -> Halts {
        self.foreign
    }
}
