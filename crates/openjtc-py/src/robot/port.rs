//! The line to the controller, with the gate before it: what a Stop has overtaken is not sent, and the Stop itself waits for nothing.
//!
//! Every frame of every job passes here, and everything that waits for the controller reads here. So this is the one place that decides whether a
//! frame may still move the arm, and that writes a Stop as soon as one is asked for, whatever the thread of the connection is busy with.

use std::sync::Arc;
use std::time::Duration;

use jtc_host::port::Halts;
use jtc_host::port::sim::SimPort;
use jtc_host::{Port, PortError};
use jtc_wire::{FrameType, fixed};

use super::shared::Shared;
use super::worker::lock;

/// Longest that a read waits before it looks whether a Stop is asked for.
const LOOK: Duration = Duration::from_millis(10);
/// A frame of which no further piece came for so long is not completed any more.
const PIECE: Duration = Duration::from_millis(50);
/// A record of a Stop arrives within this time: it waits for nothing but the status that is just being sent.
const RECORD: Duration = Duration::from_millis(200);
/// A motion that was begun is in the statuses after this time, and after so many of them.
const BEGUN: (Duration, u64) = (Duration::from_millis(300), 3);

/// What the bytes go through.
pub enum Line {
    /// A simulator remains one: it is touched whatever the session does.
    Simulated(Box<SimPort>),
    /// A serial port or an agent.
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

/// A line behind its gate.
pub struct AnyPort {
    line: Line,
    shared: Arc<Shared>,
    /// How many halts there had been when what is being done was asked for.
    at: u64,
    /// Halts and Stops that were acted upon.
    done: (u64, u64),
    /// Stops and Pauses of other programs that are known here.
    foreign: Halts,
    /// Bytes of the frame being written that are still to come, and when its last piece was written.
    rest: (usize, Duration),
    /// When the last Stop was written.
    stopped: Option<Duration>,
    /// When the last frame that moves the arm was written, and how many statuses had come by then.
    begun: (Duration, u64),
}

impl AnyPort {
    /// A line whose gate follows what is asked for in `shared`.
    pub fn new(line: Line, shared: Arc<Shared>) -> Self {
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

    /// There is no real arm.
    pub fn is_simulated(&self) -> bool {
        matches!(self.line, Line::Simulated(_))
    }

    /// From now on something is done that was asked for after so many halts.
    pub fn begin(&mut self, at: u64) {
        self.at = at;
    }

    /// The caller writes the Stop that is due.
    pub fn take_over(&mut self) {
        self.done = (self.shared.halts(), self.shared.stops());
    }

    /// Time that is left until the record of a Stop must have come, which is no answer to anything that is sent after it.
    pub fn unsettled(&self) -> Option<Duration> {
        let left = (self.stopped? + RECORD).saturating_sub(self.now());
        (!left.is_zero()).then_some(left)
    }

    /// What was begun here last is in the statuses by now.
    pub fn is_shown(&self) -> bool {
        let (time, statuses) = BEGUN;
        self.now() >= self.begun.0 + time && self.shared.seen() >= self.begun.1 + statuses
    }

    /// Another program's Stop voids what was requested here before it, also what still waits for its turn. A Pause of a motion leaves the
    /// rest: it follows only after the motion is resumed. Where nothing moves, a Pause voids as a Stop does.
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

    /// The line withheld a frame because of another program's Stop or Pause: what waits here was requested before that, too. A motion that
    /// stays paused, because its Execute came too early, is no reason.
    fn withheld(&mut self, frame: &[u8], moved: bool) {
        self.take_foreign_halts();
        let stays_paused = moved && frame == fixed::EXECUTE;
        if !stays_paused && self.shared.halts() == self.at {
            self.shared.halt();
        }
    }

    /// Writes a Stop where one is asked for, or where what moves here was overtaken by a halt.
    fn act(&mut self) -> Result<(), PortError> {
        self.take_foreign_halts();
        let now = (self.shared.halts(), self.shared.stops());
        if now == self.done {
            return Ok(());
        }
        let due = now.1 != self.done.1 || self.shared.moves();
        if due && self.rest.0 > 0 && self.now() < self.rest.1 + PIECE {
            // An existing device would take it for a part of the frame.
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

    /// A frame that moves the arm, or lets go of it, passes only where nobody has stopped the arm since it was asked for.
    fn pass(&mut self, frame: &[u8]) -> Result<(), PortError> {
        let moves = frame == fixed::EXECUTE || is_jog(frame);
        if !moves && frame != fixed::TEACHING_MODE_ENABLE {
            return Ok(());
        }
        // In this order: a halt that comes between the two finds something to stop.
        let moved_before = self.shared.moves();
        if moves {
            self.shared.set_moves(true);
            self.begun = (self.now(), self.shared.seen());
        }
        if self.shared.halts() == self.at {
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

/// A jog with a velocity; one without brings the joints to rest.
fn is_jog(frame: &[u8]) -> bool {
    match frame {
        [_, kind, _, _, velocities @ .., _, _] => {
            *kind == FrameType::Jog as u8 && velocities.iter().any(|byte| *byte != 0)
        }
        _ => false,
    }
}

/// Length of the frame that begins with these bytes.
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
            // Pieces are longer than a header.
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

    /// The request counts from when it was made, and not from when its turn comes.
    fn ask_to_move(&mut self) -> Result<(), PortError> {
        self.take_foreign_halts();
        if self.shared.halts() != self.at {
            return Err(PortError::Halted { by: None });
        }
        let known = self.foreign.all;
        each_line!(mut port, self => port.ask_to_move_after(known))
    }

    fn ask_to_resume(&mut self) -> Result<(), PortError> {
        self.take_foreign_halts();
        if self.shared.halts() != self.at {
            return Err(PortError::Halted { by: None });
        }
        each_line!(mut port, self => port.ask_to_resume())
    }

    fn halts(&self) -> Halts {
        self.foreign
    }
}
