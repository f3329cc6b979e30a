//! The session in its thread, what it has started, and what is known of the boards by it.

use std::cell::RefCell;
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use ucom::{Profile, Status};
use ucom_host::files::{Inventory, SignalTable};
use ucom_host::master::InitReport;
use ucom_host::master::update::{UpdateOutcome, UpdateReport};
use ucom_host::session::{Cache, CleanupList, Driver, Followed, Known, Link, SessionError, with_names};

use super::operator::{Hand, Local};
use super::shared::Shared;
use super::simulated::Simulated;

/// Longest wait of a turn; the bus itself is waited for less long.
const TURN: Duration = Duration::from_millis(25);

/// Outputs come every few milliseconds: the first ones are waited for so long, µs.
const FIRST_US: u64 = 500_000;

/// What is known beforehand.
pub struct Config {
    /// How boards read the protocol.
    pub profile: Profile,
    /// What their words mean.
    pub signals: SignalTable,
    /// Where names are remembered.
    pub cache: Cache,
    /// Who stands where, and the file that it is kept in.
    pub inventory: Option<Inventory>,
    pub inventory_file: Option<PathBuf>,
    /// The simulated chain that ends with the session.
    pub simulated: Option<Arc<Simulated>>,
}

/// The session, and what belongs to it.
pub struct Hands {
    pub driver: Driver,
    pub cache: Cache,
    pub signals: SignalTable,
    pub inventory: Option<Inventory>,
    pub inventory_file: Option<PathBuf>,
    pub shared: Arc<Shared>,
    pub local: Rc<RefCell<Local>>,
    /// Behind the driver: it goes when the bus is closed.
    _simulated: Option<Arc<Simulated>>,
}

impl Hands {
    /// Those of a session on this link.
    pub fn new(shared: Arc<Shared>, config: Config, link: Link) -> Self {
        let Config { profile, signals, cache, inventory, inventory_file, simulated } = config;
        let local = Rc::default();
        let hand = Hand { shared: shared.clone(), local: Rc::clone(&local) };
        let driver = Driver::new(profile, link, Box::new(hand), CleanupList::default());
        // Heartbeats and stops of this thread wait for no disk.
        let cache = cache.in_memory();
        Self { driver, cache, signals, inventory, inventory_file, shared, local, _simulated: simulated }
    }

    /// Does what is asked for until the bus is gone or the session ends.
    pub fn serve(&mut self) -> Result<(), SessionError> {
        let shared = self.shared.clone();
        while !shared.has_ended() {
            self.turn()?;
            while !shared.has_ended() && shared.take(self) {
                self.turn()?;
                self.rest();
            }
            self.rest();
        }
        Ok(())
    }

    /// Asks nothing in the background any more: what comes now must not find a board busy.
    pub fn quiet(&mut self) {
        self.local.borrow_mut().followed.ask_no_more(&mut self.driver.master);
    }

    /// Lets the bus go on for a moment.
    fn turn(&mut self) -> Result<(), SessionError> {
        self.driver.turn(TURN)?;
        while let Some(event) = self.driver.master.take_event() {
            self.driver.note_event(&event, None);
        }
        if self.shared.stop_waits() {
            return Ok(());
        }
        let now_us = self.driver.now_us();
        let notices = self.local.borrow_mut().followed.look(&mut self.driver.master, now_us);
        let local = self.local.borrow();
        notices.iter().for_each(|notice| Hand::noticed(&self.shared, &local, notice, None));
        Ok(())
    }

    /// Heartbeats go out for what this session has started: boards of another PC become safe without that one (D-50).
    fn rest(&mut self) {
        if self.driver.master.is_master() && self.local.borrow().started.is_empty() {
            self.driver.master.end_session();
        }
    }

    /// What was asked for is on the bus before who asked knows that it is done.
    pub fn settle(&mut self) {
        // A bus that is gone is seen in the next turn.
        let _ = self.driver.turn(Duration::ZERO);
    }

    /// Names and meanings of a board's values; asks for them where they are not known.
    pub fn known(&mut self, board: u8) -> Result<Arc<Known>, SessionError> {
        let kept = self.local.borrow().known.get(&board).cloned();
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
        self.local.borrow_mut().known.insert(known.board, known.clone());
        known
    }

    /// Does something by names; where a board turns out to have others than were kept, once more by those that it sends.
    pub fn by_names<T>(
        &mut self,
        mut act: impl FnMut(&mut Self, &Cache) -> Result<T, SessionError>,
    ) -> Result<T, SessionError> {
        let cache = self.cache.clone();
        with_names(&cache, |cache| act(self, cache))
    }

    /// Does what starts these boards or moves them. They count before anything is sent: Ctrl-C may come at any time. When it fails
    /// those count no more that it was not sent to, or that answer that they are stopped.
    pub fn starting<T>(
        &mut self,
        boards: &[u8],
        act: impl FnOnce(&mut Self) -> Result<T, SessionError>,
    ) -> Result<T, SessionError> {
        // Nothing is sent to any where one does not answer.
        for board in boards {
            self.driver.seen(*board)?;
        }
        let counted = self.started();
        self.local.borrow_mut().started.extend(boards);
        let done = act(self);
        if done.is_err() {
            for board in boards.iter().filter(|board| !counted.contains(board)) {
                // Who is no master has only asked.
                if !self.driver.master.is_master() || self.is_stopped(*board) {
                    self.runs_no_more(Some(*board));
                }
            }
        }
        done
    }

    /// The board answers that its application does not run; it is asked also where what was begun was cancelled.
    fn is_stopped(&mut self, board: u8) -> bool {
        self.driver.seen_for_certain(board).is_ok_and(|seen| !seen.info.status.has(Status::MSTART))
    }

    /// These boards run from now on.
    pub fn runs(&mut self, boards: &[u8]) {
        let mut local = self.local.borrow_mut();
        local.started.extend(boards);
        local.running.extend(boards);
        drop(local);
        self.follow();
    }

    /// Waits for the first outputs of boards that run now, so that they have values; no longer than a moment.
    pub fn first_outputs(&mut self, boards: &[u8]) -> Result<(), SessionError> {
        let end_us = self.driver.now_us() + FIRST_US;
        let missing =
            |hands: &Self| boards.iter().any(|board| !hands.local.borrow().snapshots.contains_key(board));
        while missing(self) && self.driver.now_us() < end_us && !self.driver.stop_asked() {
            self.turn()?;
        }
        Ok(())
    }

    /// This board does not run any more, or none does; what it sent is no more its state.
    pub fn runs_no_more(&mut self, board: Option<u8>) {
        let mut local = self.local.borrow_mut();
        match board {
            Some(board) => {
                local.started.remove(&board);
                local.running.remove(&board);
                local.snapshots.remove(&board);
            }
            None => {
                local.started.clear();
                local.running.clear();
                local.snapshots.clear();
            }
        }
        drop(local);
        self.follow();
    }

    /// The control loop of this board has ended, its application goes on. One that this session has not started does not count by that:
    /// its heartbeats are nobody's business here.
    pub fn only_started(&mut self, board: u8) {
        let counted = self.local.borrow().started.contains(&board);
        self.runs_no_more(Some(board));
        if counted {
            self.local.borrow_mut().started.insert(board);
        }
    }

    fn follow(&mut self) {
        self.quiet();
        let now_us = self.driver.now_us();
        let mut local = self.local.borrow_mut();
        local.followed = Followed::new(local.running.clone().into_iter(), now_us);
    }

    /// The number or the application of this board is another one, or none.
    pub fn forget(&mut self, board: u8) {
        self.runs_no_more(Some(board));
        self.local.borrow_mut().known.remove(&board);
    }

    /// The boards that count as started.
    pub fn started(&self) -> Vec<u8> {
        self.local.borrow().started.iter().copied().collect()
    }

    /// Stops what this session has started. Returns the boards whose end is not certain.
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

    /// What an update leaves of the boards: those that were written do not run any more, and may have been started anew.
    pub fn updated(&mut self, report: &UpdateReport, start: bool) {
        for result in report.boards.iter().filter(|_| !report.dry_run) {
            match result.outcome {
                // It runs on if it ran, or nobody knows.
                UpdateOutcome::NotStarted
                | UpdateOutcome::Cancelled
                | UpdateOutcome::UpToDate
                | UpdateOutcome::Unknown => {}
                UpdateOutcome::Incomplete
                | UpdateOutcome::Written
                | UpdateOutcome::Verified
                | UpdateOutcome::Running => self.forget(result.board),
            }
            let untouched = matches!(result.outcome, UpdateOutcome::NotStarted | UpdateOutcome::Cancelled);
            if start && !untouched {
                self.local.borrow_mut().started.insert(result.board);
            }
        }
    }

    /// Boards have new numbers, and names are of others from now on. Where not all is well, who has none now may run under the one it
    /// had, and who shows that it is started may have missed the reset.
    pub fn renumbered(&mut self, report: Option<&InitReport>) {
        match report {
            Some(report) if report.is_ok() => self.runs_no_more(None),
            Some(report) => {
                for board in &report.boards {
                    self.runs_no_more(Some(board.number));
                    if board.info.status.has(Status::MSTART) {
                        self.local.borrow_mut().started.insert(board.number);
                    }
                }
            }
            None => {}
        }
        self.local.borrow_mut().known.clear();
    }
}
