//! Boards that a session has started, and the data about them. All programs that own a bus and share the bus with other programs use this
//! module. The list of started boards includes boards whose state is uncertain, because an additional stop does no harm.
//!
//! - [`Held`]: state of the session, which the session's [`Operator`](super::Operator) updates even during procedures.
//! - [`Session`]: a driver with the state of the session. Every start and stop of a board uses [`Session`].

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use ucom::Status;

use super::cache::Cache;
use super::driver::Driver;
use super::error::SessionError;
use super::followed::{Followed, Notice};
use super::known::Known;
use super::values::with_names;
use crate::files::SignalTable;
use crate::master::io::Snapshot;
use crate::master::update::{UpdateOutcome, UpdateReport};
use crate::master::{Event, InitReport};

/// Boards that a session has started, and the data about these boards.
#[derive(Default)]
pub struct Held {
    started: BTreeSet<u8>,
    running: BTreeSet<u8>,
    /// Boards whose control loops the session supervises.
    pub followed: Followed,
    /// Last sensor outputs of boards.
    pub snapshots: BTreeMap<u8, Snapshot>,
    /// Names of the boards' signals.
    pub known: BTreeMap<u8, Arc<Known>>,
    has_started: Arc<AtomicBool>,
}

impl Held {
    /// Creates the state of a session that has started no boards. `has_started` shows other threads whether there are started boards.
    pub fn new(has_started: Arc<AtomicBool>) -> Self {
        Self { has_started, ..Self::default() }
    }

    /// Returns the boards whose applications the session has started.
    pub fn started(&self) -> &BTreeSet<u8> {
        &self.started
    }

    /// Returns the boards whose control loops the session has started.
    pub fn running(&self) -> &BTreeSet<u8> {
        &self.running
    }

    /// Handles an event of the bus: stores outputs of boards, and returns the change of a supervised board.
    pub fn see(&mut self, event: &Event, now_us: u64) -> Option<Notice> {
        if let Event::Snapshot { board, snapshot } = event {
            self.snapshots.insert(*board, snapshot.clone());
        }
        self.followed.see(event, now_us)
    }

    /// Adds these boards to the list of started boards.
    fn starts(&mut self, boards: &[u8]) {
        self.started.extend(boards);
        self.show();
    }

    fn runs(&mut self, boards: &[u8], now_us: u64) {
        self.running.extend(boards);
        self.followed.add(boards, now_us);
        self.starts(boards);
    }

    fn runs_no_more(&mut self, board: Option<u8>) {
        let boards: Vec<u8> = match board {
            Some(board) => vec![board],
            None => self.started.iter().chain(&self.running).chain(self.snapshots.keys()).copied().collect(),
        };
        for board in boards {
            self.started.remove(&board);
            self.running.remove(&board);
            self.snapshots.remove(&board);
            self.followed.remove(board);
        }
        self.show();
    }

    fn show(&self) {
        self.has_started.store(!self.started.is_empty(), Ordering::Relaxed);
    }
}

/// Session on a bus, with the state of the boards that it has started.
pub struct Session {
    /// Driver that runs the procedures on the bus.
    pub driver: Driver,
    /// Cache of the signal names.
    pub cache: Cache,
    /// Signal tables with the types, scales and units of the signals' words.
    pub signals: SignalTable,
    /// Started boards and data about them, shared with the operator of the driver.
    pub held: Rc<RefCell<Held>>,
}

impl Session {
    /// Handles the frames of the bus for a short time. The function waits at most `patience`.
    pub fn turn(&mut self, patience: Duration) -> Result<(), SessionError> {
        self.driver.turn(patience)?;
        while let Some(event) = self.driver.master.take_event() {
            self.driver.note_event(&event, None);
        }
        Ok(())
    }

    /// Returns the boards that have left or re-entered their control loops since the last call. The function reads the status of boards
    /// that send no outputs.
    pub fn look(&mut self) -> Vec<Notice> {
        let now_us = self.driver.now_us();
        self.held.borrow_mut().followed.look(&mut self.driver.master, now_us)
    }

    /// Cancels background queries, so that the next request does not find the board busy.
    pub fn quiet(&mut self) {
        self.held.borrow_mut().followed.ask_no_more(&mut self.driver.master);
    }

    /// Ends the heartbeats if this session has not started a board and no client holds the lease (`commands` is
    /// `false`). Otherwise, the heartbeats would keep the boards of another PC running after that PC was lost (D-50).
    pub fn rest(&mut self, commands: bool) {
        if self.driver.master.is_master() && self.held.borrow().started.is_empty() && !commands {
            self.driver.master.end_session();
        }
    }

    /// Returns the names and the meanings of a board's signals. The function requests the names from the board if they are not known.
    pub fn known(&mut self, board: u8) -> Result<Arc<Known>, SessionError> {
        let kept = self.held.borrow().known.get(&board).cloned();
        let info = self.driver.master.boards().get(board).and_then(|board| board.info);
        let same = |known: &Arc<Known>| {
            info.is_some_and(|info| {
                (info.flash_number, info.program_id, info.date)
                    == (known.info.flash_number, known.info.program_id, known.info.date)
            })
        };
        if let Some(known) = kept.filter(same)
            && self.driver.master.description(board).is_some()
        {
            return Ok(known);
        }
        let started = info.is_some_and(|info| info.status.has(Status::MSTART));
        let known = match started {
            true => self.cache.described(&mut self.driver, &self.signals, board)?,
            false => self.cache.known(&mut self.driver, &self.signals, board)?,
        };
        Ok(self.knows(known))
    }

    /// Stores the signal names of a board, and begins to reassemble the board's outputs.
    pub fn knows(&mut self, known: Known) -> Arc<Known> {
        let known = Arc::new(known);
        self.driver.master.watch(known.board, Some(known.names.dimensions().so), true);
        self.held.borrow_mut().known.insert(known.board, known.clone());
        known
    }

    /// Runs an action that uses the signal names of boards. If the cached names of a board are wrong, the function
    /// reads the names from the board and runs the action once more.
    pub fn by_names<T>(
        &mut self,
        mut act: impl FnMut(&mut Self, &Cache) -> Result<T, SessionError>,
    ) -> Result<T, SessionError> {
        let cache = self.cache.clone();
        with_names(&cache, |cache| act(self, cache))
    }

    /// Runs an action that starts or moves these boards. The boards are listed as started before any frame is sent,
    /// because the user may end the action at any time. If the action fails, a board that was not listed before is
    /// removed again if no command was sent to it or if it answers that it is stopped.
    pub fn starting<T>(
        &mut self,
        boards: &[u8],
        act: impl FnOnce(&mut Self) -> Result<T, SessionError>,
    ) -> Result<T, SessionError> {
        // If a board does not answer this query, no board gets a command.
        for board in boards {
            self.driver.seen(*board)?;
        }
        let counted = self.started();
        self.held.borrow_mut().starts(boards);
        let done = act(self);
        if done.is_err() {
            for board in boards.iter().filter(|board| !counted.contains(board)) {
                // If this session is not the master, it has sent only queries, so the board was not started.
                if !self.driver.master.is_master() || self.is_stopped(*board) {
                    self.runs_no_more(Some(*board));
                }
            }
        }
        done
    }

    /// Returns `true` if the board answers that its application does not run. The function sends the query even if the request was
    /// cancelled.
    fn is_stopped(&mut self, board: u8) -> bool {
        self.driver.seen_for_certain(board).is_ok_and(|seen| !seen.info.status.has(Status::MSTART))
    }

    /// Records that the control loops of these boards run.
    pub fn runs(&mut self, boards: &[u8]) {
        let now_us = self.driver.now_us();
        self.held.borrow_mut().runs(boards, now_us);
    }

    /// Removes this board, or all boards, from the lists of started and running boards, together with their last outputs.
    pub fn runs_no_more(&mut self, board: Option<u8>) {
        self.held.borrow_mut().runs_no_more(board);
    }

    /// Records that the control loop of this board has ended but its application still runs. The board stays listed
    /// as started only if this session has started it.
    pub fn only_started(&mut self, board: u8) {
        let mut held = self.held.borrow_mut();
        let counted = held.started.contains(&board);
        held.runs_no_more(Some(board));
        if counted {
            held.starts(&[board]);
        }
    }

    /// Removes all data about a board whose number or application has changed or no longer exists.
    pub fn forget(&mut self, board: u8) {
        let mut held = self.held.borrow_mut();
        held.runs_no_more(Some(board));
        held.known.remove(&board);
    }

    /// Returns the boards that are listed as started.
    pub fn started(&self) -> Vec<u8> {
        self.held.borrow().started.iter().copied().collect()
    }

    /// Stops the boards that this session has started. The function returns the boards that may still run; these boards stay listed as
    /// started.
    pub fn leave(&mut self) -> Vec<u8> {
        self.quiet();
        let started = self.started();
        if started.is_empty() {
            return Vec::new();
        }
        let not_stopped = self.driver.halt(&started, None);
        for board in started.into_iter().filter(|board| !not_stopped.contains(board)) {
            self.runs_no_more(Some(board));
        }
        not_stopped
    }

    /// Updates the state of the session after an update of boards. A board whose program was written does not run any
    /// more, unless the update has restarted it.
    pub fn updated(&mut self, report: &UpdateReport, start: bool) {
        for result in report.boards.iter().filter(|_| !report.dry_run) {
            match result.outcome {
                // With these outcomes, the board may run as before the update.
                UpdateOutcome::NotStarted
                | UpdateOutcome::Cancelled
                | UpdateOutcome::UpToDate
                | UpdateOutcome::ProgramUpToDate
                | UpdateOutcome::Unknown => {}
                UpdateOutcome::Incomplete
                | UpdateOutcome::Written
                | UpdateOutcome::Verified
                | UpdateOutcome::Running => self.forget(result.board),
            }
            let untouched = matches!(result.outcome, UpdateOutcome::NotStarted | UpdateOutcome::Cancelled);
            if start && !untouched {
                self.held.borrow_mut().starts(&[result.board]);
            }
        }
    }

    /// Updates the state of the session after boards got new numbers. The function removes all stored signal names. After a complete init,
    /// no board is listed as started. After an incomplete init, boards that are not in the report stay listed, because they may run under
    /// their old numbers. Boards whose status shows a started application are listed, because they may not have received the reset.
    pub fn renumbered(&mut self, report: Option<&InitReport>) {
        let mut held = self.held.borrow_mut();
        match report {
            Some(report) if report.is_ok() => held.runs_no_more(None),
            Some(report) => {
                for board in &report.boards {
                    held.runs_no_more(Some(board.number));
                    if board.info.status.has(Status::MSTART) {
                        held.starts(&[board.number]);
                    }
                }
            }
            None => {}
        }
        held.known.clear();
    }
}
