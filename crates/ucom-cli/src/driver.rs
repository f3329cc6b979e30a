//! Runs the PC side over a bus in wall-clock time: one loop, no thread.

use std::time::Duration;

use cli_kit::{Output, Stop};
use ucom::Profile;
use ucom::master::{Error, Event, Master, Outcome, ProcedureId, Request, StopLevel};

use crate::args::{Boards, LinkArgs};
use crate::failure::{Failure, NO_LINK};
use crate::link::{Link, from_wire};

/// Longest wait: so often Ctrl-C is looked at.
const LOOK: Duration = Duration::from_millis(50);

/// The PC side on an open bus.
pub struct Driver {
    /// Procedures and boards.
    pub master: Master,
    link: Link,
    stop: Stop,
    out: Output,
}

impl Driver {
    /// Opens the bus of the command line.
    pub fn open(args: &LinkArgs, out: &Output) -> Result<Self, Failure> {
        Self::with_profile(args, args.profile()?, out)
    }

    /// The same with another profile than the command line's.
    pub fn with_profile(args: &LinkArgs, profile: Profile, out: &Output) -> Result<Self, Failure> {
        let stop = Stop::listen()?;
        Ok(Self { master: Master::new(profile), link: args.open()?, stop, out: *out })
    }

    /// µs since the bus was opened.
    pub fn now_us(&self) -> u64 {
        self.link.now_us()
    }

    /// The bus.
    pub fn link(&mut self) -> &mut Link {
        &mut self.link
    }

    /// Ctrl-C was pressed.
    pub fn stop_asked(&self) -> bool {
        self.stop.asked()
    }

    /// Sends what is due and hands over what comes, waiting for it no longer than `patience`.
    pub fn turn(&mut self, patience: Duration) -> Result<(), Failure> {
        self.send_due()?;
        let due = self.master.next_deadline().map_or(u64::MAX, |at| at.saturating_sub(self.link.now_us()));
        let mut wait = patience.min(LOOK).min(Duration::from_micros(due));
        // All that has come is handed over before anything is sent or given up.
        while let Some(frame) = self.link.receive(wait)? {
            self.master.handle(self.link.now_us(), from_wire(&frame));
            wait = Duration::ZERO;
        }
        self.send_due()
    }

    fn send_due(&mut self) -> Result<(), Failure> {
        while let Some(frame) = self.master.poll(self.link.now_us()) {
            self.link.send(&frame)?;
        }
        Ok(())
    }

    /// Runs a procedure to its end. Ctrl-C cancels it: what it has to undo on the boards it still does.
    pub fn run(&mut self, request: Request) -> Result<Outcome, Failure> {
        self.run_with(request, &mut |_| {})
    }

    /// The same; every event goes to `see`.
    pub fn run_with(&mut self, request: Request, see: &mut dyn FnMut(&Event)) -> Result<Outcome, Failure> {
        let id = self.master.start(self.link.now_us(), request)?;
        let mut cancelled = false;
        loop {
            if let Err(failure) = self.turn(LOOK) {
                return self.abandon(id, failure, see);
            }
            while let Some(event) = self.master.take_event() {
                see(&event);
                match event {
                    Event::Done { id: done, result } if done == id => {
                        let sent = self.send_due();
                        return match result {
                            // What became of boards is told also when the bus fails at the very end.
                            Ok(report @ Outcome::Update(_)) => Ok(report),
                            result => sent.and(result.map_err(Failure::from)),
                        };
                    }
                    other => self.tell(&other, Some(id)),
                }
            }
            if self.stop.asked() && !cancelled {
                cancelled = true;
                self.out.note("cancelling; a second Ctrl-C ends at once");
                self.master.cancel(id);
            }
        }
    }

    /// The bus is gone: an update still tells what it knows of each board, anything else ends with the failure.
    fn abandon(
        &mut self,
        id: ProcedureId,
        failure: Failure,
        see: &mut dyn FnMut(&Event),
    ) -> Result<Outcome, Failure> {
        self.master.abandon(id, &failure.message);
        while let Some(event) = self.master.take_event() {
            see(&event);
            match event {
                Event::Done { id: done, result: Ok(outcome) } if done == id => return Ok(outcome),
                other => self.tell(&other, Some(id)),
            }
        }
        Err(failure)
    }

    /// Stops a board, also after Ctrl-C: what was started is not left alone.
    pub fn stop_board(&mut self, board: u8, level: StopLevel) -> Result<(), Failure> {
        let id = self.master.start(self.link.now_us(), Request::Stop { board, level, force: true })?;
        loop {
            self.turn(LOOK)?;
            while let Some(event) = self.master.take_event() {
                if let Event::Done { id: done, result } = event
                    && done == id
                {
                    return result.map(|_| ()).map_err(Failure::from);
                }
            }
        }
    }

    /// Words for what happens beside a procedure.
    pub fn tell(&self, event: &Event, during: Option<ProcedureId>) {
        if let Some(text) = words(event, during) {
            self.out.note(text);
        }
    }

    /// The numbers of the boards that are meant; `all` asks who is there.
    pub fn numbers(&mut self, boards: &Boards) -> Result<Vec<u8>, Failure> {
        match boards {
            Boards::Some(numbers) => Ok(numbers.clone()),
            Boards::None => Ok(Vec::new()),
            Boards::All => {
                let Outcome::Scan(report) = self.run(Request::Scan)? else { return Ok(Vec::new()) };
                let numbers: Vec<u8> = report.boards.iter().map(|b| b.number).collect();
                if !numbers.is_empty() {
                    return Ok(numbers);
                }
                let found = report.reports.ids.len();
                Err(match found {
                    0 => Failure::new(NO_LINK, "no-boards", "no board answers")
                        .hint("ucom doctor looks for the reason"),
                    n => Failure::new(
                        NO_LINK,
                        "no-numbers",
                        format!("{n} boards are there, none has a number"),
                    )
                    .hint("ucom init numbers them"),
                })
            }
        }
    }
}

/// Words for an event; `None` where they would only repeat what a procedure says itself.
pub fn words(event: &Event, during: Option<ProcedureId>) -> Option<String> {
    use ucom::master::Supervision;
    Some(match event {
        Event::Note { text, .. } => text.clone(),
        Event::BoardError { board, code, during: at } if *at != during || during.is_none() => {
            format!("board {board} reports {code}: {} {}", code.meaning(), code.reaction())
        }
        Event::Supervision { board, change } => match change {
            Supervision::Late => format!("board {board}: life sign is late"),
            Supervision::Lost => format!("board {board}: lost, no life sign any more"),
            Supervision::Back => format!("board {board}: back"),
            Supervision::Rebooted { ucom_id } => {
                format!(
                    "board {board} (UCoM id 0x{ucom_id:02X}) has rebooted and lost its number: `ucom init`"
                )
            }
            Supervision::UnknownRebooted { ucom_id } => {
                format!("a board with UCoM id 0x{ucom_id:02X} has rebooted")
            }
        },
        Event::Debug { board, text } => format!("board {board} says: {text}"),
        Event::Foreign(kind) => format!("frames of another protocol are on the bus: {kind}"),
        Event::ForeignMaster { function, to } => {
            format!("another PC talks on the bus: {} to {to}", function.name())
        }
        Event::Overflow { dropped } => format!("{dropped} events were dropped"),
        _ => return None,
    })
}

impl From<Error> for Failure {
    fn from(e: Error) -> Self {
        Self::new(e.exit_code(), e.code(), &e).hint(e.hint())
    }
}

/// An outcome that does not fit its request: a mistake in this program.
pub fn unexpected(outcome: &Outcome) -> Failure {
    Failure::new(crate::failure::FAULT, "internal", format!("unexpected outcome {outcome:?}"))
        .hint("this is a mistake in ucom; please report it")
}
