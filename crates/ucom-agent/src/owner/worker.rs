//! Worker, which executes requests on the bus in turns and stores the results about the boards.
use std::cell::RefCell;
use std::ops::{Deref, DerefMut};
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};

use agent_kit::api::Problem;
use host_kit::{Diagnose as _, ErrorKind, owner};
use ucom_host::master::Request;
use ucom_host::session::{Driver, FlashRecords, Held, Known, Link, Session, SessionError};

use super::Config;
use super::ask::Tag;
use super::operator::{Hand, Local};
use super::shared::Shared;
use crate::event::ChainEvent;
use crate::snapshot::Values;

/// Longest wait for a frame in one cycle of the bus loop.
const TURN: Duration = Duration::from_millis(5);
/// Time for which the agent only listens before its first query, to find out whether another PC is the master of the
/// bus (D-08).
const LISTEN: Duration = Duration::from_millis(600);
/// Time for which requests without the lease do not query a board again after the board returned no names.
const LEFT_ALONE: Duration = Duration::from_secs(3);

/// Owner of a session on the bus: executes the requests and stores the data of the session.
pub(crate) struct Worker {
    pub session: Session,
    /// Records of the images that firmware updates wrote to boards.
    pub records: FlashRecords,
    shared: Arc<Shared>,
    pub(super) local: Rc<RefCell<Local>>,
}

impl Deref for Worker {
    type Target = Session;

    fn deref(&self) -> &Session {
        &self.session
    }
}

impl DerefMut for Worker {
    fn deref_mut(&mut self) -> &mut Session {
        &mut self.session
    }
}

impl Worker {
    /// Creates a worker with a session on `link`.
    pub(super) fn new(shared: Arc<Shared>, config: Config, link: Link) -> Self {
        let Config { profile, signals, cache, cleanup, inventory } = config;
        let local = Rc::default();
        let held = Rc::new(RefCell::new(Held::new(shared.runs.clone())));
        let hand = Hand { shared: shared.clone(), held: Rc::clone(&held), local: Rc::clone(&local) };
        let driver = Driver::new(profile, link, Box::new(hand), cleanup);
        let (session, records) = (Session { driver, cache, signals, held }, FlashRecords::new(inventory));
        Self { session, records, shared, local }
    }

    /// Serves requests until the bus is lost or the agent ends.
    pub(super) fn serve(&mut self) -> Result<(), SessionError> {
        let start = Instant::now();
        let mut looked = false;
        while !self.shared.has_ended() {
            self.turn()?;
            if !looked && start.elapsed() >= LISTEN {
                looked = true;
                if self.driver.master.competing_master().is_none() {
                    // If the scan fails, a client can request another scan. If the bus is lost, the next call of
                    // `turn` detects the loss.
                    let _ = self.driver.run(Request::Scan);
                }
            }
            while !self.shared.has_ended()
                && let Some(turn) = self.shared.queue.take()
            {
                self.serve_one(turn);
                self.turn()?;
                // `rest` is also called between requests. Otherwise, queries that arrive without a pause would
                // prevent the end of the heartbeats.
                self.rest();
            }
            self.rest();
        }
        // If a client requested a Stop just before the end, this call sends its frames.
        self.turn()
    }

    /// Runs one cycle of the bus loop: handles frames for a short time, and records boards that left or re-entered
    /// their control loops. Also checks the leases; see [`Hand`].
    fn turn(&mut self) -> Result<(), SessionError> {
        self.session.turn(TURN)?;
        let events = self.session.look().into_iter().map(|notice| {
            let (board, change) = (notice.board, notice.change.name().to_owned());
            ChainEvent::Loop { board, change }
        });
        self.local.borrow_mut().happened.extend(events);
        Ok(())
    }

    /// Ends the heartbeats if no client holds the lease and this agent has started no board.
    fn rest(&mut self) {
        let commands = self.shared.is_commanded();
        self.session.rest(commands);
    }

    /// Publishes the snapshot and the events of a request and marks the request as ended, all before the client
    /// receives the answer.
    pub(super) fn settle(&mut self) {
        self.local.borrow_mut().published = None;
        // If the bus is lost, the next call of `turn` detects the loss.
        let _ = self.driver.turn(Duration::ZERO);
        self.shared.queue.done();
    }

    /// Executes one request.
    fn serve_one(&mut self, turn: owner::Turn<Self, Tag>) {
        // Cancels background queries of the session, so that the board is not busy when the request begins.
        self.quiet();
        self.local.borrow_mut().job = turn.tag.job;
        turn.run(self);
        self.local.borrow_mut().job = None;
        // If a request was abandoned or did not begin, `settle` was not called, so the request is marked as done
        // here.
        self.shared.queue.done();
    }

    /// Returns the problem for an error of the bus session. If a Stop or the end of the agent caused the error, the
    /// problem states this cause.
    pub(crate) fn problem(&self, error: &SessionError) -> Problem {
        if !error.is_cancelled() {
            let kind = match (error.kind(), error) {
                // The agent and the bus are available; only the board is not available.
                (
                    ErrorKind::NoLink,
                    SessionError::Procedure(_) | SessionError::NoBoards | SessionError::NoNumbers { .. },
                ) => ErrorKind::Device,
                (kind, _) => kind,
            };
            return Problem::of(error).kind(kind);
        }
        self.shared.why_cancelled()
    }

    /// Returns the names and meanings of the values of a board, for requests without the lease. If a board returned no names, the
    /// agent does not query this board again for 3 s, because commands wait during a query.
    pub(crate) fn known_to_viewers(&mut self, board: u8) -> Result<Arc<Known>, Problem> {
        if let Some((at, problem)) = self.local.borrow().nameless.get(&board)
            && at.elapsed() < LEFT_ALONE
            && !self.held.borrow().known.contains_key(&board)
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

    /// Returns the last known values of a board.
    pub(crate) fn values_of(&self, known: &Arc<Known>) -> Values {
        let (master, board) = (&self.driver.master, known.board);
        let outputs = self.held.borrow().snapshots.get(&board).cloned();
        Values {
            known: known.clone(),
            outputs,
            inputs: master.inputs(board),
            parameters: master.parameters(board),
        }
    }

    /// Stops the boards that this agent has started.
    pub(super) fn leave(&mut self) {
        let started = self.started();
        if !started.is_empty() {
            let not_stopped = self.session.leave();
            let not_stopped = not_stopped.iter().map(|board| format!("board {board}")).collect();
            self.shared.journal.write(ChainEvent::Stopped { boards: started, not_stopped });
        }
    }
}
