//! The session in its thread, and what Python asks of it.

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
    /// With no call for so long what the session has started is stopped; `None`: it runs on.
    pub deadline: Option<Duration>,
    /// The simulated chain that ends with the session.
    pub simulated: Option<Arc<Simulated>>,
}

/// The session, and what belongs to it.
pub struct Hands {
    pub session: Session,
    pub inventory: Option<Inventory>,
    pub inventory_file: Option<PathBuf>,
    /// What updates wrote to boards.
    pub records: FlashRecords,
    pub shared: Arc<Shared>,
    deadline: Option<Duration>,
    /// Behind the session: it goes when the bus is closed.
    _simulated: Option<Arc<Simulated>>,
}

impl Deref for Hands {
    type Target = Session;

    fn deref(&self) -> &Session {
        &self.session
    }
}

impl DerefMut for Hands {
    fn deref_mut(&mut self) -> &mut Session {
        &mut self.session
    }
}

impl Hands {
    /// Those of a session on this link.
    pub fn new(shared: Arc<Shared>, config: Config, link: Link) -> Self {
        let Config { profile, signals, cache, inventory, inventory_file, deadline, simulated } = config;
        let held: Rc<RefCell<Held>> = Rc::default();
        let hand = Hand::new(shared.clone(), Rc::clone(&held));
        let driver = Driver::new(profile, link, Box::new(hand), CleanupList::default());
        // Heartbeats and stops of this thread wait for no disk.
        let session = Session { driver, cache: cache.in_memory(), signals, held };
        let records = FlashRecords::new(inventory_file.clone());
        Self { session, inventory, inventory_file, records, shared, deadline, _simulated: simulated }
    }

    /// Does what is asked for until the bus is gone or the session ends.
    pub fn serve(&mut self) -> Result<(), SessionError> {
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

    /// Heartbeats show that this computer lives, not that the program does which commands the boards: where that asks for nothing any
    /// more its boards are stopped.
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

    /// Lets the bus go on for a moment.
    fn turn(&mut self) -> Result<(), SessionError> {
        self.session.turn(TURN)?;
        if self.shared.stop_waits() {
            return Ok(());
        }
        let notices = self.session.look();
        let held = self.held.borrow();
        notices.iter().for_each(|notice| Hand::noticed(&self.shared, &held, notice, None));
        Ok(())
    }

    /// What was asked for is on the bus before who asked knows that it is done.
    pub fn settle(&mut self) {
        // A bus that is gone is seen in the next turn.
        let _ = self.driver.turn(Duration::ZERO);
    }

    /// Waits for the first outputs of boards that run now, so that they have values; no longer than a moment.
    pub fn first_outputs(&mut self, boards: &[u8]) -> Result<(), SessionError> {
        let end_us = self.driver.now_us() + FIRST_US;
        let missing =
            |hands: &Self| boards.iter().any(|board| !hands.held.borrow().snapshots.contains_key(board));
        while missing(self) && self.driver.now_us() < end_us && !self.driver.stop_asked() {
            self.turn()?;
        }
        Ok(())
    }
}
