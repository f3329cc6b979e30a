//! Runs the PC side over a bus in wall-clock time: one loop; what it prints waits for no reader.

use std::cell::RefCell;
use std::time::Duration;

use cli_kit::{Lines, Stop};
use serde_json::{Value, json};
use ucom::Profile;
use ucom_host::master::{
    Error, Event, Master, Outcome, ProcedureId, Request, ScanFinding, StopLevel, Supervision,
};

use crate::args::{Boards, LinkArgs};
use crate::bus_off;
use crate::cleanup::CleanupList;
use crate::commands::conformance::progress_line;
use crate::failure::{FAULT, Failure, NO_LINK, exit};
use crate::link::Link;
use crate::pump::{LOOK, Pump};

/// The PC side on an open bus.
pub struct Driver {
    /// Procedures and boards.
    pub master: Master,
    link: Link,
    pump: Pump,
    stop: Stop,
    cleanup: CleanupList,
    notes: Lines,
    lost: RefCell<Vec<Loss>>,
}

/// A board was lost, or has rebooted.
struct Loss {
    board: u8,
    rebooted: bool,
}

impl Driver {
    /// Opens the bus of the command line.
    pub fn open(args: &LinkArgs) -> Result<Self, Failure> {
        Self::with_profile(args, args.profile()?)
    }

    /// The same with another profile than the command line's.
    pub fn with_profile(args: &LinkArgs, profile: Profile) -> Result<Self, Failure> {
        let cleanup = CleanupList::default();
        let (stop, notes) = (cleanup.listen()?, Lines::stderr()?);
        let (master, link, pump) = (Master::new(profile), args.open()?, Pump::default());
        Ok(Self { master, link, pump, stop, cleanup, notes, lost: RefCell::default() })
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

    /// Hands over what has come and sends what is due, waiting for either no longer than `patience`.
    pub fn turn(&mut self, patience: Duration) -> Result<(), Failure> {
        let turned = self.pump.turn(&mut self.master, &mut self.link, patience);
        if let Some(news) = self.link.news() {
            self.note(news);
        }
        turned
    }

    /// Runs a procedure to its end. Ctrl-C cancels it: what it has to undo on the boards it still does.
    pub fn run(&mut self, request: Request) -> Result<Outcome, Failure> {
        self.run_with(request, &mut |_| {})
    }

    /// The same; every event goes to `see`.
    pub fn run_with(&mut self, request: Request, see: &mut dyn FnMut(&Event)) -> Result<Outcome, Failure> {
        self.drive(request, true, see)
    }

    /// Ends control loops before anything else is sent or asked: of these boards, or by broadcast of all.
    pub fn stop_at_once(&mut self, boards: Option<&[u8]>) {
        self.master.stop_at_once(self.link.now_us(), boards);
    }

    /// Stops a board, also after Ctrl-C: what was started is not left alone.
    pub fn stop_board(&mut self, board: u8, level: StopLevel) -> Result<(), Failure> {
        let request = Request::Stop { board, level, force: true };
        self.drive(request, false, &mut |_| {}).map(drop)
    }

    fn drive(
        &mut self,
        request: Request,
        can_be_cancelled: bool,
        see: &mut dyn FnMut(&Event),
    ) -> Result<Outcome, Failure> {
        self.cleanup.begin(&request);
        let times_off = self.link.times_bus_off();
        let result = match self.master.start(self.link.now_us(), request.clone()) {
            Ok(id) => self.finish(id, can_be_cancelled, see),
            Err(error) => Err(error.into()),
        };
        self.cleanup.end(&request, result.is_ok());
        // Who does not answer may never have been asked.
        result.map_err(|failure| match self.link.times_bus_off() > times_off && failure.exit == NO_LINK {
            true => {
                let message =
                    format!("{}; the CAN controller of this computer was bus-off meanwhile", failure.message);
                Failure { message, ..failure }.hint(bus_off::next(self.link.url()))
            }
            false => failure,
        })
    }

    fn finish(
        &mut self,
        id: ProcedureId,
        can_be_cancelled: bool,
        see: &mut dyn FnMut(&Event),
    ) -> Result<Outcome, Failure> {
        let mut waits_for_cancel = can_be_cancelled;
        loop {
            let broken = self.turn(LOOK).err();
            if let Some(failure) = &broken {
                // Its end follows at once, with what is known.
                self.master.abandon(id, &failure.message);
            }
            while let Some(event) = self.master.take_event() {
                see(&event);
                match event {
                    Event::Done { id: done, result } if done == id => {
                        return match (result, broken) {
                            (Err(Error::Bus { .. }), Some(failure)) => Err(failure),
                            // What became of boards is reported also when the bus fails.
                            (result, Some(_)) | (result @ Ok(Outcome::Update(_)), None) => Ok(result?),
                            (result, None) => {
                                let sent = self.pump.flush(&mut self.master, &mut self.link);
                                sent.and(result.map_err(Failure::from))
                            }
                        };
                    }
                    other => self.print_event(&other, Some(id)),
                }
            }
            if let Some(failure) = broken {
                return Err(failure);
            }
            if waits_for_cancel && self.stop.asked() {
                waits_for_cancel = false;
                self.note("cancelling; a second Ctrl-C ends at once".into());
                self.master.cancel(id);
            }
        }
    }

    /// What was started has been stopped.
    pub fn nothing_is_left(&self) {
        self.cleanup.forget();
    }

    /// A line on stderr.
    pub fn note(&self, text: String) {
        self.notes.push(text);
    }

    /// How often a board was lost or one of these has rebooted, by what was reported; a failure if that was so.
    pub fn nobody_lost(&self, boards: &[u8]) -> Result<(), Failure> {
        let lost = self.lost.borrow();
        let rebooted = lost.iter().filter(|l| l.rebooted && boards.contains(&l.board)).count();
        let times = |n: usize| if n == 1 { "once".to_owned() } else { format!("{n} times") };
        let mut what = Vec::new();
        match lost.iter().filter(|l| !l.rebooted).count() {
            0 => {}
            n => what.push(format!("{} a board was lost", times(n))),
        }
        if rebooted > 0 {
            what.push(format!("{} a board has rebooted", times(rebooted)));
        }
        if what.is_empty() {
            return Ok(());
        }
        Err(Failure::new(FAULT, "lost", what.join(", ")).hint("ucom doctor looks at bus and boards"))
    }

    /// Words for what happens beside a procedure.
    pub fn print_event(&self, event: &Event, during: Option<ProcedureId>) {
        if let Event::Supervision {
            board,
            change: change @ (Supervision::Lost | Supervision::Rebooted { .. }),
        } = event
        {
            let rebooted = *change != Supervision::Lost;
            self.lost.borrow_mut().push(Loss { board: *board, rebooted });
        }
        if let Some(text) = words(event, during) {
            self.note(text);
        }
    }

    /// The numbers of the boards that are meant; `all` asks who is there, and refuses a number that two boards have.
    pub fn numbers(&mut self, boards: &Boards) -> Result<Vec<u8>, Failure> {
        let numbers = self.numbers_to_stop(boards)?;
        match self.master.shared_numbers().into_iter().next() {
            Some(error) if *boards == Boards::All => Err(error.into()),
            _ => Ok(numbers),
        }
    }

    /// The same with the numbers that two boards have: a stop stops both.
    pub fn numbers_to_stop(&mut self, boards: &Boards) -> Result<Vec<u8>, Failure> {
        match boards {
            Boards::Some(numbers) => Ok(numbers.clone()),
            Boards::None => Ok(Vec::new()),
            Boards::All => {
                let Outcome::Scan(report) = self.run(Request::Scan)? else { return Ok(Vec::new()) };
                let mut numbers: Vec<u8> = report.boards.iter().map(|b| b.number).collect();
                numbers.extend(report.findings.iter().filter_map(|finding| match finding {
                    ScanFinding::NumberShared { board, .. } => Some(*board),
                    _ => None,
                }));
                numbers.sort_unstable();
                if !numbers.is_empty() {
                    // Who is there and is not among these numbers is not left out silently.
                    let more = report.findings.iter().filter(|finding| finding.error().is_none());
                    more.for_each(|finding| self.note(finding.to_string()));
                    return Ok(numbers);
                }
                let found = report.reports.ids.len();
                Err(match found {
                    0 => Failure::new(NO_LINK, "no-boards", "no board answers")
                        .hint("ucom doctor looks for the reason"),
                    n => Failure::new(
                        NO_LINK,
                        "no-numbers",
                        match n {
                            1 => "1 board is there, without a number".to_owned(),
                            n => format!("{n} boards are there, none has a number"),
                        },
                    )
                    .hint("ucom init numbers them"),
                })
            }
        }
    }
}

/// Words for an event; `None` where they would only repeat what a procedure reports itself.
pub fn words(event: &Event, during: Option<ProcedureId>) -> Option<String> {
    Some(match event {
        Event::Note { text, .. } => text.clone(),
        Event::Tested { test, .. } => progress_line(test),
        Event::BoardError { board, code, during: at } if *at != during || during.is_none() => {
            format!("board {board} reports {code}: {} {}", code.meaning(), code.reaction())
        }
        Event::Supervision { board, change } => match change {
            Supervision::Late => format!("board {board}: heartbeat is late"),
            Supervision::Lost => format!("board {board}: lost, no heartbeat any more"),
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
        Event::Debug { board, text } => format!("board {board} sends: {text}"),
        Event::Foreign(kind) => format!("frames of another protocol are on the bus: {kind}"),
        Event::CompetingMaster { function, to } => {
            format!("another PC talks on the bus: {} to {to}", function.name())
        }
        Event::NumberShared { board, found } => {
            Error::NumberShared { board: *board, found: found.clone(), given_back: false }.to_string()
        }
        Event::Overflow { dropped } => format!("{dropped} events were dropped"),
        _ => return None,
    })
}

/// Numbers that two boards have, as `--json` lists them.
pub fn shared_numbers(master: &Master) -> Vec<Value> {
    let value = |e: &Error| {
        let Error::NumberShared { board, found, .. } = e else { return Value::Null };
        json!({ "board": board, "flash_numbers": found, "code": e.code(), "message": e.to_string(), "hint": e.hint() })
    };
    master.shared_numbers().iter().map(value).collect()
}

/// Refuses to go on with a bus on which two boards have one number.
pub fn nothing_shared(master: &Master) -> Result<(), Failure> {
    master.shared_numbers().into_iter().next().map_or(Ok(()), |error| Err(error.into()))
}

impl From<Error> for Failure {
    fn from(e: Error) -> Self {
        Self::new(exit(e.kind()), e.code(), &e).hint(e.hint())
    }
}

/// An outcome that does not fit its request: a mistake in this program.
pub fn unexpected(outcome: &Outcome) -> Failure {
    Failure::new(crate::failure::FAULT, "internal", format!("unexpected outcome {outcome:?}"))
        .hint("this is a mistake in ucom; please report it")
}
