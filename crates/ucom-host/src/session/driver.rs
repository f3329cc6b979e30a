//! Runs procedures on a bus in real time, in one loop.

use std::cell::RefCell;
use std::time::Duration;

use host_kit::{Diagnose, ErrorKind};
use ucom::Profile;

use super::cleanup::CleanupList;
use super::error::SessionError;
use super::link::Link;
use super::pump::{LOOK, Pump};
use super::selection::Boards;
use crate::master::conformance::{ConformanceTest, Verdict};
use crate::master::{
    BoardSeen, Error, Event, IdentityError, Master, MasterError, Outcome, ProcedureId, Request, ScanFinding,
    StopLevel, Supervision,
};

/// Interface to the operator of a session. The operator can end the session, and receives notes in addition to the results.
pub trait Operator {
    /// Returns `true` if the operator requested an end (Ctrl-C).
    fn stop_asked(&self) -> bool;
    /// Shows a line of text to the operator. The implementation must return without waiting until the line is read.
    fn note(&self, text: String);
    /// Handles an event that is not a result of the running procedure. `text` is the note about the event.
    fn happened(&self, _event: &Event, text: Option<String>) {
        if let Some(text) = text {
            self.note(text);
        }
    }
    /// The driver calls this function once in each iteration of its loop, even during procedures. The implementation can perform work that
    /// cannot wait until the procedures end.
    fn turned(&self, _master: &mut Master, _link: &mut Link) {}
}

/// Connection of the PC side to an open bus.
pub struct Driver {
    /// Master that runs the procedures and stores the state of the boards.
    pub master: Master,
    link: Link,
    pump: Pump,
    operator: Box<dyn Operator>,
    cleanup: CleanupList,
    lost: RefCell<Vec<Loss>>,
}

/// Loss or reboot of a board during the session.
struct Loss {
    board: u8,
    rebooted: bool,
}

impl Driver {
    /// Creates the PC side on an open bus. `cleanup` lists the work of the driver's requests that would remain undone if the process ended.
    pub fn new(profile: Profile, link: Link, operator: Box<dyn Operator>, cleanup: CleanupList) -> Self {
        let (master, pump) = (Master::new(profile), Pump::default());
        Self { master, link, pump, operator, cleanup, lost: RefCell::default() }
    }

    /// Returns the time since the bus was opened, µs.
    pub fn now_us(&self) -> u64 {
        self.link.now_us()
    }

    /// Returns the link to the bus.
    pub fn link(&mut self) -> &mut Link {
        &mut self.link
    }

    /// Returns `true` if the operator requested an end.
    pub fn stop_asked(&self) -> bool {
        self.operator.stop_asked()
    }

    /// Delivers received frames to the master and sends the frames that are due. The function waits at most `patience` until a frame
    /// arrives or is due.
    pub fn turn(&mut self, patience: Duration) -> Result<(), SessionError> {
        let turned = self.pump.turn(&mut self.master, &mut self.link, patience);
        self.operator.turned(&mut self.master, &mut self.link);
        if let Some(news) = self.link.news() {
            self.note(news);
        }
        turned
    }

    /// Runs a procedure to its end. Ctrl-C cancels the procedure, but the procedure still undoes its changes on the boards.
    pub fn run(&mut self, request: Request) -> Result<Outcome, SessionError> {
        self.run_with(request, &mut |_| {})
    }

    /// Like `run`, but passes every event of the master to `see`.
    pub fn run_with(
        &mut self,
        request: Request,
        see: &mut dyn FnMut(&Event),
    ) -> Result<Outcome, SessionError> {
        self.drive(request, true, &mut |_, event| see(event))
    }

    /// Reads a board's identity and state.
    pub fn seen(&mut self, board: u8) -> Result<BoardSeen, SessionError> {
        self.ask(board, true)
    }

    /// Like `seen`, but Ctrl-C does not cancel the read. After a cancelled procedure, a board can be in any state, so
    /// its state must be read.
    pub fn seen_for_certain(&mut self, board: u8) -> Result<BoardSeen, SessionError> {
        self.ask(board, false)
    }

    fn ask(&mut self, board: u8, can_be_cancelled: bool) -> Result<BoardSeen, SessionError> {
        match self.drive(Request::Info { board }, can_be_cancelled, &mut |_, _| {})? {
            Outcome::Info(seen) => Ok(seen),
            other => Err(other.into()),
        }
    }

    /// Stops the control loops of these boards, or of all boards by broadcast, before any other frame is sent.
    pub fn stop_at_once(&mut self, boards: Option<&[u8]>) {
        self.master.stop_at_once(self.link.now_us(), boards);
    }

    /// Stops a board. Ctrl-C does not prevent this stop, so that no started board continues to run.
    pub fn stop_board(&mut self, board: u8, level: StopLevel) -> Result<(), SessionError> {
        let request = Request::Stop { board, level, force: true };
        self.drive(request, false, &mut |_, _| {}).map(drop)
    }

    pub(super) fn drive(
        &mut self,
        request: Request,
        can_be_cancelled: bool,
        see: &mut dyn FnMut(&mut Master, &Event),
    ) -> Result<Outcome, SessionError> {
        self.cleanup.begin(&request);
        let times_off = self.link.times_bus_off();
        let result = match self.master.start(self.link.now_us(), request.clone()) {
            Ok(id) => self.finish(id, can_be_cancelled, see),
            Err(error) => Err(error.into()),
        };
        self.cleanup.end(&request, result.is_ok());
        // If this computer was bus-off, a board that does not answer may not have received the request.
        let was_off = self.link.times_bus_off() > times_off;
        result.map_err(|failure| match was_off && failure.kind() == ErrorKind::NoLink {
            true => SessionError::BusOff { failure: Box::new(failure), url: self.link.url().into() },
            false => failure,
        })
    }

    fn finish(
        &mut self,
        id: ProcedureId,
        can_be_cancelled: bool,
        see: &mut dyn FnMut(&mut Master, &Event),
    ) -> Result<Outcome, SessionError> {
        let mut waits_for_cancel = can_be_cancelled;
        loop {
            let broken = self.turn(LOOK).err();
            if let Some(failure) = &broken {
                // The bus has failed while the procedure was in progress. The procedure ends at once, and its report contains the results
                // that are known.
                self.master.abandon(id, &failure.to_string());
            }
            while let Some(event) = self.master.take_event() {
                see(&mut self.master, &event);
                match event {
                    Event::Done { id: done, result } if done == id => {
                        return match (result, broken) {
                            (Err(Error::Master(MasterError::Bus { .. })), Some(failure)) => Err(failure),
                            // The report of an update or of conformance tests is returned even if the bus fails.
                            (result, Some(_)) | (result @ Ok(Outcome::Update(_)), None) => Ok(result?),
                            (result, None) => {
                                let sent = self.pump.flush(&mut self.master, &mut self.link);
                                sent.and(result.map_err(SessionError::from))
                            }
                        };
                    }
                    other => self.note_event(&other, Some(id)),
                }
            }
            if let Some(failure) = broken {
                return Err(failure);
            }
            if waits_for_cancel && self.stop_asked() {
                waits_for_cancel = false;
                self.note("cancelling; a second Ctrl-C ends at once".into());
                self.master.cancel(id);
            }
        }
    }

    /// Removes all boards from the list of unfinished work, because all started boards have been stopped.
    pub fn nothing_is_left(&self) {
        self.cleanup.forget();
    }

    /// Shows a line of text to the operator.
    pub fn note(&self, text: String) {
        self.operator.note(text);
    }

    /// Returns an error if a board was lost, or if one of the given boards has rebooted. The check uses the supervision events that were
    /// received so far.
    pub fn nobody_lost(&self, boards: &[u8]) -> Result<(), SessionError> {
        let losses = self.lost.borrow();
        let lost = losses.iter().filter(|l| !l.rebooted).count();
        let rebooted = losses.iter().filter(|l| l.rebooted && boards.contains(&l.board)).count();
        if lost + rebooted == 0 { Ok(()) } else { Err(SessionError::Lost { lost, rebooted }) }
    }

    /// Passes an event to the operator, with the note about the event. `during` is the procedure that is running.
    pub fn note_event(&self, event: &Event, during: Option<ProcedureId>) {
        if let Event::Supervision {
            board,
            change: change @ (Supervision::Lost | Supervision::Rebooted { .. }),
        } = event
        {
            let rebooted = *change != Supervision::Lost;
            self.lost.borrow_mut().push(Loss { board: *board, rebooted });
        }
        self.operator.happened(event, event_text(event, during));
    }

    /// Passes an event to the operator without a note.
    pub(super) fn pass_over(&self, event: &Event) {
        self.operator.happened(event, None);
    }

    /// Returns the numbers of the selected boards. For `all`, the function scans the bus and returns an error if two boards have the same
    /// number.
    pub fn numbers(&mut self, boards: &Boards) -> Result<Vec<u8>, SessionError> {
        let numbers = self.numbers_to_stop(boards)?;
        match self.master.shared_numbers().into_iter().next() {
            Some(error) if *boards == Boards::All => Err(error.into()),
            _ => Ok(numbers),
        }
    }

    /// Like `numbers`, but accepts numbers that two boards share, because a stop command reaches both boards.
    pub fn numbers_to_stop(&mut self, boards: &Boards) -> Result<Vec<u8>, SessionError> {
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
                    // Shows the other findings of the scan, for example boards without a number, so that the user
                    // notices them.
                    let more = report.findings.iter().filter(|finding| finding.error().is_none());
                    more.for_each(|finding| self.note(finding.to_string()));
                    return Ok(numbers);
                }
                Err(match report.reports.ids.len() {
                    0 => SessionError::NoBoards,
                    boards => SessionError::NoNumbers { boards },
                })
            }
        }
    }
}

/// Returns the note about an event; returns `None` if the procedure itself reports the event.
pub fn event_text(event: &Event, during: Option<ProcedureId>) -> Option<String> {
    Some(match event {
        Event::Note { text, .. } => text.clone(),
        Event::Tested { test, .. } => test_text(test),
        Event::BoardError { board, code, during: at } if *at != during || during.is_none() => {
            format!("board {board} reports {code}: {} {}", code.meaning(), code.reaction())
        }
        Event::Supervision { board, change } => match change {
            Supervision::Late => format!("board {board}: the heartbeat is late"),
            Supervision::Lost => format!("board {board}: lost, its heartbeats have stopped"),
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
            format!("another PC sends on the bus: {} to {to}", function.name())
        }
        Event::NumberShared { board, found } => Error::Identity(IdentityError::NumberShared {
            board: *board,
            found: found.clone(),
            given_back: false,
        })
        .to_string(),
        Event::Overflow { dropped } => format!("{dropped} events were dropped"),
        _ => return None,
    })
}

/// Returns an error if two boards on the bus have the same number.
pub fn nothing_shared(master: &Master) -> Result<(), SessionError> {
    master.shared_numbers().into_iter().next().map_or(Ok(()), |error| Err(error.into()))
}

/// Returns a short line of text about a finished conformance test.
fn test_text(test: &ConformanceTest) -> String {
    let how = match &test.verdict {
        Verdict::Pass => "passed",
        Verdict::Fail(_) => "failed",
        Verdict::Skipped(_) => "skipped",
    };
    format!("{} {}: {how}", test.id, test.subject())
}
