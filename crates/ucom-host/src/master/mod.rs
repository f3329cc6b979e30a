//! The PC side: procedures as state machines without I/O.
//!
//! A [`Master`] is fed with frames and with time and gives frames back; it never waits, has no clock and no thread.
//! A driver is a loop of a few lines:
//!
//! 1. hand over every frame that has arrived: [`Master::handle`];
//! 2. send while [`Master::poll`] gives frames;
//! 3. look at [`Master::take_event`];
//! 4. wait for the next frame, at most until [`Master::next_deadline`].
//!
//! What has arrived is handed over before `poll` is called: waiting ends only in `poll`, so a driver that comes late
//! mistakes no answer for silence ([`Master::poll_behind`] for what came while it handed over). Time is in microseconds from any start and must not go back (a monotonic clock).
//!
//! ```
//! use ucom_host::master::{Event, Master, Outcome, Request};
//! use ucom::Profile;
//!
//! let mut master = Master::new(Profile::default());
//! let id = master.start(0, Request::Scan).unwrap();
//! let mut now = 0;
//! let report = loop {
//!     while let Some(frame) = master.poll(now) {
//!         println!("{frame}"); // a driver sends it; nobody answers on this bus
//!     }
//!     match master.take_event() {
//!         Some(Event::Done { result: Ok(Outcome::Scan(report)), .. }) => break report,
//!         _ => now = master.next_deadline().expect("the scan is under way"),
//!     }
//! };
//! assert!(report.boards.is_empty());
//! ```
//!
//! Procedures that change something make this PC the master of the bus first: it listens for another one (D-08), then
//! sends heartbeats until [`Master::end_session`]. Scan, information and descriptions change nothing and send none.

mod boards;
mod byte_order;
pub mod conformance;
mod control;
mod counted;
pub mod doctor;
mod error;
mod error_codes;
mod event;
#[cfg(feature = "fuzzing")]
#[doc(hidden)]
pub mod fuzzing;
mod holders;
mod init;
pub mod io;
mod link;
mod load;
pub mod probe;
mod procedures;
mod raw_status;
mod repair;
mod request;
mod run;
mod scan;
mod shared;
mod statistics;
mod stop;
mod supervise;

mod times;
pub mod update;

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use std::task::{Context, Poll, Waker};

pub use boards::{Board, Boards, Life};
pub use control::AdminChange;
pub use counted::counted;
pub use error::{Error, Incomplete, LastReceived, Received};
pub use event::{Event, Supervision};
pub use host_kit::ErrorKind;
pub use init::{InitFinding, InitOptions, InitReport};
pub use load::{LoadForecast, frame_bits};
pub use procedures::{Outcome, ProcedureId, Request};
pub use raw_status::{RawStatus, expected_status};
pub use run::{RunBoard, RunOptions, RunReport, Setting};
pub use scan::{Reports, ScanFinding, ScanReport};
pub use statistics::{Rate, Statistics, WINDOW_US};
pub use stop::StopLevel;

use io::{DescriptionKey, IoDescription, Kind, ParValue};
use link::{Link, lock};
use procedures::{Work, work};
use shared::{Core, Mailbox, Session};
use ucom::{BoardInfo, Foreign, Frame, Profile};

/// A board as it answered PC_INFO.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BoardSeen {
    /// Its number.
    pub number: u8,
    /// The numbers.
    pub info: BoardInfo,
    /// Its description; `None`: it never came whole.
    pub description: Option<String>,
}

/// The PC side of one bus.
pub struct Master {
    core: Arc<Mutex<Core>>,
    work: BTreeMap<ProcedureId, Work>,
    next_id: u64,
}

impl Master {
    /// Listens; sends nothing by itself.
    pub fn new(profile: Profile) -> Self {
        Self { core: Arc::new(Mutex::new(Core::new(profile))), work: BTreeMap::new(), next_id: 1 }
    }

    /// Starts a procedure; its end comes as [`Event::Done`]. Refused while another one works with the same board.
    pub fn start(&mut self, now: u64, request: Request) -> Result<ProcedureId, Error> {
        let (id, name, claims) = (ProcedureId(self.next_id), request.name(), request.claims());
        {
            let mut core = lock(&self.core);
            core.advance(now);
            if let Some(other) = core.mailboxes.values().find(|mailbox| mailbox.claims & claims != 0) {
                let shared = other.claims & claims;
                let boards = (0..32).filter(|b| shared >> b & 1 == 1).collect();
                return Err(Error::Busy { boards, with: other.name });
            }
            let bears_shared_numbers = request.bears_shared_numbers();
            core.mailboxes.insert(id, Mailbox { name, claims, bears_shared_numbers, ..Default::default() });
        }
        self.next_id += 1;
        let link = Link { core: self.core.clone(), id };
        self.work.insert(id, work(link, request));
        self.run();
        Ok(id)
    }

    /// Ends a procedure; what it has to undo on the boards it still does, then [`Event::Done`] comes.
    pub fn cancel(&mut self, id: ProcedureId) {
        if let Some(mailbox) = lock(&self.core).mailboxes.get_mut(&id) {
            mailbox.cancel = true;
        }
        self.run();
    }

    /// The bus is gone: ends a procedure without another frame. [`Event::Done`] comes at once: an update's with what
    /// is known of each board, the conformance tests' with those that were done, any other's with [`Error::Bus`].
    pub fn abandon(&mut self, id: ProcedureId, reason: &str) {
        if let Some(mailbox) = lock(&self.core).mailboxes.get_mut(&id) {
            mailbox.bus_gone = Some(reason.into());
        }
        self.run();
    }

    /// A frame has arrived; see [`Frame::received`].
    pub fn handle(&mut self, now: u64, received: Result<Frame, Foreign>) {
        {
            let mut core = lock(&self.core);
            core.advance(now);
            core.received(received);
        }
        self.run();
    }

    /// The next frame to send; call it until it gives none.
    pub fn poll(&mut self, now: u64) -> Option<Frame> {
        self.poll_behind(now, now)
    }

    /// The same for a driver that has handed over what arrived up to `received`, not what came between that and `now`: no
    /// wait ends beyond `received`, but heartbeats go out.
    pub fn poll_behind(&mut self, now: u64, received: u64) -> Option<Frame> {
        {
            let mut core = lock(&self.core);
            core.advance(now);
            core.fired = core.fired.max(received);
            core.duties();
        }
        self.run();
        lock(&self.core).pop()
    }

    /// When [`Master::poll`] has something to do next, unless a frame arrives before. `None`: only when one arrives.
    pub fn next_deadline(&self) -> Option<u64> {
        let core = lock(&self.core);
        if !core.idle() {
            return Some(core.now);
        }
        let waiting = core.mailboxes.values().filter_map(|mailbox| mailbox.wake);
        waiting.chain(core.duties_deadline()).min()
    }

    /// What has happened, oldest first.
    pub fn take_event(&mut self) -> Option<Event> {
        lock(&self.core).take_event()
    }

    /// Whether a procedure is under way.
    pub fn is_busy(&self) -> bool {
        !self.work.is_empty()
    }

    /// Moves every procedure as far as it can go.
    fn run(&mut self) {
        let mut context = Context::from_waker(Waker::noop());
        let core = self.core.clone();
        self.work.retain(|id, work| match work.as_mut().poll(&mut context) {
            Poll::Pending => true,
            Poll::Ready(result) => {
                let mut core = lock(&core);
                core.forget_queued(*id);
                core.mailboxes.remove(id);
                core.event(Event::Done { id: *id, result });
                false
            }
        });
    }

    /// The profile in use.
    pub fn profile(&self) -> Profile {
        lock(&self.core).profile
    }

    /// Whether heartbeats go out.
    pub fn is_master(&self) -> bool {
        lock(&self.core).session != Session::Quiet
    }

    /// No more heartbeats and repeated inputs: boards that run become safe by themselves (D-50).
    pub fn end_session(&mut self) {
        let mut core = lock(&self.core);
        core.session = Session::Quiet;
        core.stops.clear();
    }

    /// The boards as last seen.
    pub fn boards(&self) -> Boards {
        lock(&self.core).boards.clone()
    }

    /// Numbers that two boards have, each as the error that procedures end with.
    pub fn shared_numbers(&self) -> Vec<Error> {
        lock(&self.core).holders.all_shared()
    }

    /// Counters of the bus.
    pub fn statistics(&self) -> Statistics {
        lock(&self.core).statistics.clone()
    }

    /// Sets an input of a described board: sent at once, and repeated while the board runs (D-34).
    pub fn set_input(&mut self, now: u64, board: u8, name: &str, value: u16) -> Result<u16, Error> {
        let index = self.signal(now, board, Kind::Ci, name)?;
        let mut core = lock(&self.core);
        if let Some(data) = core.data.get_mut(&board)
            && let Some(place) = data.ci.get_mut(usize::from(index))
        {
            *place = value;
            core.send_input(board, index);
        }
        Ok(index)
    }

    /// Writes a parameter of a described board; there is no answer, the shadow takes it as assumed (D-35).
    pub fn set_parameter(&mut self, now: u64, board: u8, name: &str, value: u16) -> Result<u16, Error> {
        let index = self.signal(now, board, Kind::Par, name)?;
        lock(&self.core).send_parameter(board, index, value);
        Ok(index)
    }

    fn signal(&mut self, now: u64, board: u8, kind: Kind, name: &str) -> Result<u16, Error> {
        lock(&self.core).advance(now);
        let description = self.description(board).ok_or(Error::NoApplication { board, valid: true })?;
        description.find(board, kind, name)
    }

    /// The description of a board, when it is known.
    pub fn description(&self, board: u8) -> Option<IoDescription> {
        let core = lock(&self.core);
        let key = core.data.get(&board)?.description?;
        core.descriptions.get(&key).cloned()
    }

    /// All known descriptions, to be kept for the next time.
    pub fn descriptions(&self) -> BTreeMap<DescriptionKey, IoDescription> {
        lock(&self.core).descriptions.clone()
    }

    /// Descriptions from the last time (D-36).
    pub fn know_description(&mut self, key: DescriptionKey, description: IoDescription) {
        lock(&self.core).descriptions.insert(key, description);
    }

    /// Inputs of a board as last set.
    pub fn inputs(&self, board: u8) -> Vec<u16> {
        lock(&self.core).data.get(&board).map(|d| d.ci.clone()).unwrap_or_default()
    }

    /// Parameters of a board as this PC believes them to be.
    pub fn parameters(&self, board: u8) -> Vec<ParValue> {
        lock(&self.core).data.get(&board).map(|d| d.par.values().to_vec()).unwrap_or_default()
    }

    /// Snapshots of a board's sensor outputs as [`Event::Snapshot`]; `dimension` where it is not described yet.
    pub fn watch(&mut self, board: u8, dimension: Option<u16>, on: bool) {
        let mut core = lock(&self.core);
        let data = core.data.entry(board & 31).or_default();
        data.watched = on;
        if let Some(dimension) = dimension.filter(|d| usize::from(*d) != data.so.dimension()) {
            data.so = io::SnapshotAssembler::new(dimension);
        }
    }

    /// Makes this PC the master without a procedure: heartbeats from now on.
    pub fn begin_session(&mut self, now: u64) {
        let mut core = lock(&self.core);
        core.advance(now);
        core.start_session();
    }
}
