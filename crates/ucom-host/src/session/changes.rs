//! Performs single actions on several boards. The PC changes no board until all boards have answered. After a failure, the error lists the
//! boards that were already changed.

use std::collections::BTreeSet;

use ucom::BoardInfo;

use super::driver::Driver;
use super::error::SessionError;
use super::selection::Boards;
use crate::master::{Error, MasterError, Outcome, RawStatus, Request, StopLevel};

/// Board number, with the board's answer to PC_INFO.
pub type Numbered = (u8, BoardInfo);

/// Result of stopping several boards, or of switching off their outputs.
#[derive(Debug)]
pub struct Stopped {
    /// Boards that confirmed the stop command.
    pub boards: Vec<Numbered>,
    /// Boards that may still run, each with the reason why the stop failed.
    pub failed: Vec<(u8, SessionError)>,
}

/// Returns the board number and the answer that an outcome contains. The outcome must contain exactly one board.
fn numbered(outcome: Outcome) -> Result<Numbered, SessionError> {
    match outcome {
        Outcome::Status { board, info } => Ok((board, info)),
        Outcome::Info(seen) | Outcome::Started(seen) => Ok((seen.number, seen.info)),
        other => Err(other.into()),
    }
}

impl SessionError {
    /// Adds the list of the boards that were changed before this error.
    #[must_use]
    pub fn after(self, done: impl IntoIterator<Item = u8>) -> Self {
        let done: Vec<u8> = done.into_iter().collect();
        if done.is_empty() { self } else { Self::Partly { failure: Box::new(self), done } }
    }
}

impl Driver {
    /// Returns the number and the status of each board.
    ///
    /// # Errors
    /// Returns the error of the first board that does not answer.
    pub fn statuses(&mut self, boards: &[u8]) -> Result<Vec<Numbered>, SessionError> {
        boards.iter().map(|board| numbered(self.run(Request::Info { board: *board })?)).collect()
    }

    /// Changes one board after the other. The function changes no board until all boards have answered.
    ///
    /// # Errors
    /// Returns the error of the first board that fails. The error is [`SessionError::Partly`] if other boards were changed before.
    pub fn change_each(
        &mut self,
        boards: &[u8],
        request: impl Fn(u8) -> Request,
    ) -> Result<Vec<Numbered>, SessionError> {
        self.all_there(boards)?;
        let mut all: Vec<Numbered> = Vec::new();
        for board in boards {
            match self.run(request(*board)).and_then(numbered) {
                Ok(changed) => all.push(changed),
                Err(e) => return Err(e.after(all.iter().map(|(n, _)| *n))),
            }
        }
        Ok(all)
    }

    /// Sends a single PC_SETSTATUS with these two bytes to each board, or a single broadcast to all boards: `new = (old & ~mask) | value`.
    ///
    /// # Errors
    /// Returns the errors of [`Self::change_each`].
    pub fn set_raw_status(
        &mut self,
        boards: &Boards,
        (mask, value): (u8, u8),
        force: bool,
    ) -> Result<Vec<RawStatus>, SessionError> {
        let numbers = self.numbers(boards)?;
        self.all_there(&numbers)?;
        let targets: Vec<(Option<u8>, Vec<u8>)> = match boards {
            Boards::All if self.master.profile().broadcast_number().is_some() => vec![(None, numbers)],
            _ => numbers.into_iter().map(|n| (Some(n), vec![n])).collect(),
        };
        let mut all: Vec<RawStatus> = Vec::new();
        for (board, seen) in targets {
            match self.run(Request::RawStatus { board, seen, mask, value, force }) {
                Ok(Outcome::RawStatus(boards)) => all.extend(boards),
                Ok(other) => return Err(other.into()),
                Err(e) => return Err(e.after(all.iter().map(|b| b.board))),
            }
        }
        Ok(all)
    }

    /// Checks, for more than one board, that each board answers before the first board is changed.
    fn all_there(&mut self, boards: &[u8]) -> Result<(), SessionError> {
        let mut several = boards.iter().filter(|_| boards.len() > 1);
        several.try_for_each(|board| self.seen(*board).map(drop))
    }

    /// Stops boards down to the stop level `level`. The function sends all stop commands before any query, so that a
    /// silent board does not delay the stop of other boards. The result contains the failures of single boards.
    ///
    /// # Errors
    /// Returns an error if the boards on the bus are not known, or if no board answers.
    pub fn stop_each(&mut self, boards: &Boards, level: StopLevel) -> Result<Stopped, SessionError> {
        match boards {
            Boards::All => self.stop_at_once(None),
            Boards::Some(numbers) => self.stop_at_once(Some(numbers)),
            Boards::None => {}
        }
        let mut stopped = Stopped { boards: Vec::new(), failed: Vec::new() };
        for board in self.numbers_to_stop(boards)? {
            match self.run(Request::Stop { board, level, force: true }).and_then(numbered) {
                Ok(one) => stopped.boards.push(one),
                Err(failure) => {
                    self.note(format!("board {board}: {failure}"));
                    stopped.failed.push((board, failure));
                }
            }
            if self.stop_asked() {
                break;
            }
        }
        Ok(stopped)
    }

    /// Makes the outputs of boards safe; the control loops of the boards continue. Every board gets the command, even
    /// if other boards do not answer. The result contains the failures of single boards.
    pub fn outputs_safe(&mut self, boards: &[u8], force: bool) -> Stopped {
        let mut stopped = Stopped { boards: Vec::new(), failed: Vec::new() };
        for board in boards {
            // After Ctrl-C, the remaining boards do not get a command, so their state is unknown.
            let done = match self.stop_asked() {
                true => Err(Error::Master(MasterError::Cancelled).into()),
                false => self.run(Request::Stop { board: *board, level: StopLevel::Outputs, force }),
            };
            match done.and_then(numbered) {
                Ok(one) => stopped.boards.push(one),
                Err(failure) => {
                    self.note(format!("board {board}: {failure}"));
                    stopped.failed.push((*board, failure));
                }
            }
        }
        stopped
    }

    /// Ends a run of boards. The function stops all control loops at once, then stops the applications in reverse order, and then ends the
    /// session. The function returns the boards that may still run. Each reason of a failure is shown once, and the reason in `known` is
    /// not shown again.
    pub fn halt(&mut self, boards: &[u8], known: Option<String>) -> Vec<u8> {
        self.stop_at_once(Some(boards));
        // A lost bus is the reason of the failure for all boards, so it is shown only once.
        let mut noted: BTreeSet<String> = known.into_iter().collect();
        let mut running = BTreeSet::new();
        for level in [StopLevel::Loop, StopLevel::Application] {
            for board in boards.iter().rev() {
                if let Err(e) = self.stop_board(*board, level) {
                    if noted.insert(e.to_string()) {
                        self.note(format!("board {board}: {e}"));
                    }
                    running.insert(*board);
                } else if level == StopLevel::Application {
                    running.remove(board);
                }
            }
        }
        self.master.end_session();
        if running.is_empty() {
            self.nothing_is_left();
        }
        running.into_iter().collect()
    }
}
