//! Boards that a session has started, and its knowledge of them; shared by all programs that own a bus for others. In doubt a board
//! counts as started: one more stop costs nothing.
//!
//! - [`Held`]: the state, which the session's [`Operator`](super::Operator) writes in the middle of procedures.
//! - [`Session`]: a driver with that state; all starts and stops of boards go through it.

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

/// Boards that a session has started, and its knowledge of them.
#[derive(Default)]
pub struct Held {
    started: BTreeSet<u8>,
    running: BTreeSet<u8>,
    /// Boards whose control loops it supervises.
    pub followed: Followed,
    /// The last outputs of boards.
    pub snapshots: BTreeMap<u8, Snapshot>,
    /// The names of boards.
    pub known: BTreeMap<u8, Arc<Known>>,
    has_started: Arc<AtomicBool>,
}

impl Held {
    /// Creates a state without started boards; `has_started` tells other threads when that changes.
    pub fn new(has_started: Arc<AtomicBool>) -> Self {
        Self { has_started, ..Self::default() }
    }

    /// Boards whose applications the session has started.
    pub fn started(&self) -> &BTreeSet<u8> {
        &self.started
    }

    /// Boards whose control loops the session has started.
    pub fn running(&self) -> &BTreeSet<u8> {
        &self.running
    }

    /// An event of the bus: outputs are kept, and a change of a board that is supervised is returned.
    pub fn see(&mut self, event: &Event, now_us: u64) -> Option<Notice> {
        if let Event::Snapshot { board, snapshot } = event {
            self.snapshots.insert(*board, snapshot.clone());
        }
        self.followed.see(event, now_us)
    }

    /// These boards count as started.
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

/// Session on a bus, with its state.
pub struct Session {
    /// Procedures and boards.
    pub driver: Driver,
    /// Cache of names.
    pub cache: Cache,
    /// Meanings of the words.
    pub signals: SignalTable,
    /// Started boards and knowledge of them, shared with the operator of the driver.
    pub held: Rc<RefCell<Held>>,
}

impl Session {
    /// Lets the bus go on, waiting no longer than `patience`.
    pub fn turn(&mut self, patience: Duration) -> Result<(), SessionError> {
        self.driver.turn(patience)?;
        while let Some(event) = self.driver.master.take_event() {
            self.driver.note_event(&event, None);
        }
        Ok(())
    }

    /// Returns the boards that left or re-entered their control loops since the last call. Asks boards that send nothing.
    pub fn look(&mut self) -> Vec<Notice> {
        let now_us = self.driver.now_us();
        self.held.borrow_mut().followed.look(&mut self.driver.master, now_us)
    }

    /// Cancels background questions: the next request must not find a board busy.
    pub fn quiet(&mut self) {
        self.held.borrow_mut().followed.ask_no_more(&mut self.driver.master);
    }

    /// Ends the heartbeats unless this session has started boards or a client `commands`: boards of another PC must become safe if that
    /// PC is lost (D-50).
    pub fn rest(&mut self, commands: bool) {
        if self.driver.master.is_master() && self.held.borrow().started.is_empty() && !commands {
            self.driver.master.end_session();
        }
    }

    /// Returns the names and meanings of a board's values; asks the board if they are not known.
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

    /// The names of a board are known from now on, and its outputs are put together.
    pub fn knows(&mut self, known: Known) -> Arc<Known> {
        let known = Arc::new(known);
        self.driver.master.watch(known.board, Some(known.names.dimensions().so), true);
        self.held.borrow_mut().known.insert(known.board, known.clone());
        known
    }

    /// Runs an action by names; if a board turns out to have other names than the cached ones, runs it once more with those.
    pub fn by_names<T>(
        &mut self,
        mut act: impl FnMut(&mut Self, &Cache) -> Result<T, SessionError>,
    ) -> Result<T, SessionError> {
        let cache = self.cache.clone();
        with_names(&cache, |cache| act(self, cache))
    }

    /// Runs an action that starts or moves these boards. The boards count as started before anything is sent, because an end
    /// may be requested at any time. On failure, boards that were sent nothing or that answer that they are stopped no longer count.
    pub fn starting<T>(
        &mut self,
        boards: &[u8],
        act: impl FnOnce(&mut Self) -> Result<T, SessionError>,
    ) -> Result<T, SessionError> {
        // No board is sent anything if one of them does not answer.
        for board in boards {
            self.driver.seen(*board)?;
        }
        let counted = self.started();
        self.held.borrow_mut().starts(boards);
        let done = act(self);
        if done.is_err() {
            for board in boards.iter().filter(|board| !counted.contains(board)) {
                // A session that is not master has sent questions only.
                if !self.driver.master.is_master() || self.is_stopped(*board) {
                    self.runs_no_more(Some(*board));
                }
            }
        }
        done
    }

    /// Returns `true` if the board answers that its application does not run; asks even after a cancelled request.
    fn is_stopped(&mut self, board: u8) -> bool {
        self.driver.seen_for_certain(board).is_ok_and(|seen| !seen.info.status.has(Status::MSTART))
    }

    /// The control loops of these boards run from now on.
    pub fn runs(&mut self, boards: &[u8]) {
        let now_us = self.driver.now_us();
        self.held.borrow_mut().runs(boards, now_us);
    }

    /// Removes this board, or all, from the running boards; its last outputs no longer count as its state.
    pub fn runs_no_more(&mut self, board: Option<u8>) {
        self.held.borrow_mut().runs_no_more(board);
    }

    /// Records that the control loop of this board has ended while its application goes on. A board that this session has not started
    /// does not count as started by that: its heartbeats are not supervised here.
    pub fn only_started(&mut self, board: u8) {
        let mut held = self.held.borrow_mut();
        let counted = held.started.contains(&board);
        held.runs_no_more(Some(board));
        if counted {
            held.starts(&[board]);
        }
    }

    /// The number or the application of this board is another one, or none.
    pub fn forget(&mut self, board: u8) {
        let mut held = self.held.borrow_mut();
        held.runs_no_more(Some(board));
        held.known.remove(&board);
    }

    /// The boards that count as started.
    pub fn started(&self) -> Vec<u8> {
        self.held.borrow().started.iter().copied().collect()
    }

    /// Stops the boards that this session has started. Returns the boards whose stop is not certain; they still count as started.
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

    /// Applies the result of an update: boards that were written no longer run, and may have been restarted.
    pub fn updated(&mut self, report: &UpdateReport, start: bool) {
        for result in report.boards.iter().filter(|_| !report.dry_run) {
            match result.outcome {
                // The board runs on if it ran, or its state is unknown.
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

    /// Boards have new numbers, and names are of others from now on. Where not all is well, who has none now may run under the one it
    /// had, and who shows that it is started may have missed the reset.
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
