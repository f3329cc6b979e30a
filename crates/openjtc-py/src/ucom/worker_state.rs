//! Session that runs in its own thread and executes the requests from Python.

use std::cell::RefCell;
use std::ops::{Deref, DerefMut};
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use ucom::Profile;
use ucom_host::files::{Inventory, SignalTable};
use ucom_host::session::{Cache, CleanupList, Driver, FlashRecords, Held, Link, Session, SessionError};

use super::operator::Hand;
use super::shared::Shared;
use super::simulated::Simulated;

/// Maximum duration of one pass of the session's main loop. Waits for the bus itself are shorter.
const TURN: Duration = Duration::from_millis(25);

/// Maximum wait for the first outputs of a board, µs. Boards send outputs every few milliseconds.
const FIRST_US: u64 = 500_000;

/// Configuration of a session.
pub(super) struct Config {
    /// Profile that describes how boards interpret the protocol.
    pub profile: Profile,
    /// Signal table: the meaning of the words of inputs, outputs and parameters.
    pub signals: SignalTable,
    /// Cache of signal names.
    pub cache: Cache,
    /// Inventory of the chain, and the path of the inventory file.
    pub inventory: Option<Inventory>,
    pub inventory_file: Option<PathBuf>,
    /// Time without a call after which the session stops the boards that it has started. `None` means that the boards continue to run.
    pub deadline: Option<Duration>,
    /// Simulated chain that ends with the session.
    pub simulated: Option<Arc<Simulated>>,
}

/// Session with its inventory and records.
pub(super) struct WorkerState {
    pub session: Session,
    pub inventory: Option<Inventory>,
    pub inventory_file: Option<PathBuf>,
    /// Records of the images that updates have written to boards.
    pub records: FlashRecords,
    pub shared: Arc<Shared>,
    deadline: Option<Duration>,
    /// The field `_simulated` is declared after the session, so that the simulated chain is dropped after the bus is closed.
    _simulated: Option<Arc<Simulated>>,
}

impl Deref for WorkerState {
    type Target = Session;

    fn deref(&self) -> &Session {
        &self.session
    }
}

impl DerefMut for WorkerState {
    fn deref_mut(&mut self) -> &mut Session {
        &mut self.session
    }
}

impl WorkerState {
    /// Creates a session on this link.
    pub(super) fn new(shared: Arc<Shared>, config: Config, link: Link) -> Self {
        let Config { profile, signals, cache, inventory, inventory_file, deadline, simulated } = config;
        let held: Rc<RefCell<Held>> = Rc::default();
        let hand = Hand::new(shared.clone(), Rc::clone(&held));
        let driver = Driver::new(profile, link, Box::new(hand), CleanupList::default());
        // The cache is kept in memory, so that heartbeats and stops of this thread do not wait for a disk.
        let session = Session { driver, cache: cache.in_memory(), signals, held };
        let records = FlashRecords::new(inventory_file.clone());
        Self { session, inventory, inventory_file, records, shared, deadline, _simulated: simulated }
    }

    /// Runs requests until the bus is lost or the session ends.
    pub(super) fn serve(&mut self) -> Result<(), SessionError> {
        let shared = self.shared.clone();
        while !shared.has_ended() {
            self.turn()?;
            while !shared.has_ended() && shared.take(self) {
                self.turn()?;
                self.session.rest(false);
            }
            self.keep_deadline();
            self.session.rest(false);
        }
        Ok(())
    }

    /// Stops the boards if the Python program makes no call before the deadline. Heartbeats prove only that this computer works, not
    /// that the Python program works.
    fn keep_deadline(&mut self) {
        if let Some(deadline) = self.deadline
            && self.shared.silence() >= deadline
            && !self.started().is_empty()
        {
            let not_stopped = self.leave();
            let time_s = self.driver.now_us() as f64 * 1e-6;
            self.shared.deadline(time_s, deadline, &not_stopped);
            self.shared.asked();
        }
    }

    /// Runs one pass of the session's main loop on the bus, and reports changes of boards.
    fn turn(&mut self) -> Result<(), SessionError> {
        self.session.turn(TURN)?;
        if self.shared.queue.stop_waits() {
            return Ok(());
        }
        let notices = self.session.look();
        let held = self.held.borrow();
        notices.iter().for_each(|notice| Hand::noticed(&self.shared, &held, notice, None));
        Ok(())
    }

    /// Sends all frames of a request before the caller receives the result.
    pub(super) fn settle(&mut self) {
        // An error is ignored here. If the bus is lost, the next pass of the main loop reports the loss.
        let _ = self.driver.turn(Duration::ZERO);
        self.shared.queue.done();
    }

    /// Waits at most 0.5 s for the first outputs of boards that were just started, so that the values of the outputs are known.
    pub(super) fn first_outputs(&mut self, boards: &[u8]) -> Result<(), SessionError> {
        let end_us = self.driver.now_us() + FIRST_US;
        let missing =
            |state: &Self| boards.iter().any(|board| !state.held.borrow().snapshots.contains_key(board));
        while missing(self) && self.driver.now_us() < end_us && !self.driver.stop_asked() {
            self.turn()?;
        }
        Ok(())
    }
}
