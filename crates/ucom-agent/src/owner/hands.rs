//! What is done with the bus: turns, one thing after the other, and what is known of the boards by it.
use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};

use agent_kit::api::Problem;
use host_kit::{Diagnose as _, ErrorKind};
use ucom::Status;
use ucom_host::files::SignalTable;
use ucom_host::master::Request;
use ucom_host::session::{Cache, Driver, Followed, Known, Link, SessionError};

use super::Config;
use super::operator::{Hand, Local};
use super::shared::Shared;
use crate::happening::Happening;
use crate::picture::Values;
use crate::work::Work;

/// Longest wait of a turn.
const TURN: Duration = Duration::from_millis(5);
/// Before anything is asked the bus is listened to: another PC may be its master (D-08).
const LISTEN: Duration = Duration::from_millis(600);
/// A board that gave no names is not asked again so soon for those who only look.
const LEFT_ALONE: Duration = Duration::from_secs(3);

/// The session, and what belongs to it.
pub(crate) struct Hands {
    pub driver: Driver,
    pub cache: Cache,
    pub signals: SignalTable,
    shared: Arc<Shared>,
    pub(super) local: Rc<RefCell<Local>>,
}

impl Hands {
    /// Those of a session on this link.
    pub(super) fn new(shared: Arc<Shared>, config: Config, link: Link) -> Self {
        let Config { profile, signals, cache, cleanup } = config;
        let local = Rc::default();
        let hand = Hand { shared: shared.clone(), local: Rc::clone(&local) };
        let driver = Driver::new(profile, link, Box::new(hand), cleanup);
        Self { driver, cache, signals, shared, local }
    }

    /// Does what is asked for until the bus is gone or the agent ends.
    pub(super) fn serve(&mut self) -> Result<(), SessionError> {
        let start = Instant::now();
        let mut looked = false;
        while !self.shared.has_ended() {
            self.turn()?;
            if !looked && start.elapsed() >= LISTEN {
                looked = true;
                if self.driver.master.competing_master().is_none() {
                    // Who is there is asked again whenever somebody wants to know; a bus that is gone is seen in the next turn.
                    let _ = self.driver.run(Request::Scan);
                }
            }
            while !self.shared.has_ended()
                && let Some(work) = self.shared.queue.take()
            {
                self.work(work);
                self.turn()?;
                // Also while questions come without end.
                self.rest();
            }
            self.rest();
        }
        Ok(())
    }

    /// Lets the bus go on for a moment. The leases are looked at, too: see [`Hand`].
    fn turn(&mut self) -> Result<(), SessionError> {
        self.driver.turn(TURN)?;
        while let Some(event) = self.driver.master.take_event() {
            self.driver.note_event(&event, None);
        }
        let now_us = self.driver.now_us();
        let notices = self.local.borrow_mut().followed.look(&mut self.driver.master, now_us);
        let events = notices.into_iter().map(|notice| {
            let (board, change) = (notice.board, notice.change.name().to_owned());
            Happening::Loop { board, change }
        });
        self.local.borrow_mut().happened.extend(events);
        Ok(())
    }

    /// Heartbeats go out for who commands and for what this agent has started: boards of another PC become safe without that one (D-50).
    fn rest(&mut self) {
        if self.driver.master.is_master()
            && self.local.borrow().started.is_empty()
            && !self.shared.is_commanded()
        {
            self.driver.master.end_session();
        }
    }

    /// What was done is in the picture, and what has happened is written down: before who asked for it knows that it is done.
    pub(super) fn settle(&mut self) {
        self.local.borrow_mut().published = None;
        // A bus that is gone is seen in the next turn.
        let _ = self.driver.turn(Duration::ZERO);
    }

    fn work(&mut self, work: Work) {
        // What is asked in the background must not find a board busy.
        self.local.borrow_mut().followed.ask_no_more(&mut self.driver.master);
        self.local.borrow_mut().job = work.job;
        match work.asked.and_then(|asked| self.shared.too_late(asked)) {
            Some(late) => (work.act)(Err(late)),
            None => (work.act)(Ok(self)),
        }
        self.local.borrow_mut().job = None;
        self.shared.queue.done();
    }

    /// An error of the session; where a Stop or the agent's end was its cause, that.
    pub fn problem(&self, error: &SessionError) -> Problem {
        if !error.is_cancelled() {
            let kind = match (error.kind(), error) {
                // The agent is there, and so is the bus: it is the board that is not.
                (
                    ErrorKind::NoLink,
                    SessionError::Procedure(_) | SessionError::NoBoards | SessionError::NoNumbers { .. },
                ) => ErrorKind::Device,
                (kind, _) => kind,
            };
            return Problem::diagnosed(error).kind(kind);
        }
        self.shared.why_cancelled()
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

    /// The same for somebody who only looks. A board that gave no names is left alone for a while: commands wait meanwhile.
    pub fn known_to_viewers(&mut self, board: u8) -> Result<Arc<Known>, Problem> {
        if let Some((at, problem)) = self.local.borrow().nameless.get(&board)
            && at.elapsed() < LEFT_ALONE
        {
            return Err(problem.clone());
        }
        self.known(board).map_err(|error| {
            let problem = self.problem(&error);
            if !error.is_cancelled() {
                let failed = (Instant::now(), problem.clone());
                self.local.borrow_mut().nameless.insert(board, failed);
            }
            problem
        })
    }

    /// The names of a board are known from now on, and its outputs are put together.
    pub fn knows(&mut self, known: Known) -> Arc<Known> {
        let known = Arc::new(known);
        self.driver.master.watch(known.board, Some(known.names.dimensions().so), true);
        let mut local = self.local.borrow_mut();
        local.nameless.remove(&known.board);
        local.known.insert(known.board, known.clone());
        drop(local);
        known
    }

    /// These boards run from now on.
    pub fn runs(&mut self, boards: &[u8]) {
        let now_us = self.driver.now_us();
        let mut local = self.local.borrow_mut();
        local.started.extend(boards);
        local.running.extend(boards);
        local.followed = Followed::new(local.running.clone().into_iter(), now_us);
        self.shared.set_runs(true);
    }

    /// This board does not run any more, or none does; what it sent is no more its state.
    pub fn runs_no_more(&mut self, board: Option<u8>) {
        let now_us = self.driver.now_us();
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
        local.followed = Followed::new(local.running.clone().into_iter(), now_us);
        self.shared.set_runs(!local.started.is_empty());
    }

    /// The control loop of this board has ended, its application goes on. One that this agent has not started does not count by that:
    /// its heartbeats are nobody's business here.
    pub fn only_started(&mut self, board: u8) {
        let counted = self.local.borrow().started.contains(&board);
        self.runs_no_more(Some(board));
        if counted {
            self.has_started(board);
        }
    }

    /// The application of this board was started.
    pub fn has_started(&mut self, board: u8) {
        self.local.borrow_mut().started.insert(board);
        self.shared.set_runs(true);
    }

    /// The number or the application of this board is another one, or none.
    pub fn forget(&mut self, board: u8) {
        self.runs_no_more(Some(board));
        self.local.borrow_mut().known.remove(&board);
    }

    /// What is known of the values of a board.
    pub fn values_of(&self, known: &Arc<Known>) -> Values {
        let (master, board) = (&self.driver.master, known.board);
        let outputs = self.local.borrow().snapshots.get(&board).cloned();
        Values {
            known: known.clone(),
            outputs,
            inputs: master.inputs(board),
            parameters: master.parameters(board),
        }
    }

    /// The names of all boards are void.
    pub(super) fn forget_names(&mut self) {
        self.local.borrow_mut().known.clear();
    }

    /// The boards that count as started.
    pub(super) fn started(&self) -> Vec<u8> {
        self.local.borrow().started.iter().copied().collect()
    }

    /// Stops what this agent has started.
    pub(super) fn leave(&mut self) {
        let started = self.started();
        if !started.is_empty() {
            let not_stopped = self.driver.halt(&started, None);
            let not_stopped = not_stopped.iter().map(|board| format!("board {board}")).collect();
            self.shared.journal.write(Happening::Stopped { boards: started, not_stopped });
        }
    }
}
