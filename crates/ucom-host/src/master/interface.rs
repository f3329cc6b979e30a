//! Interface of the master for a driver: [`Master`].
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use std::task::{Context, Poll, Waker};

use crate::master::engine::{Boards, Core, Event, Link, Mailbox, Session, Statistics, lock};
use crate::master::error::{Error, MasterError, SignalError};
use crate::master::io::process_data::ProcessData;
use crate::master::io::{DescriptionKey, IoDescription, Kind, ParValue, SnapshotAssembler};
use crate::master::procedures::work::{Work, work};
use crate::master::reports::{ProcedureId, Request};
use ucom::{Foreign, Frame, Function, Profile, Sequence};

/// PC side of one UCoM bus.
pub struct Master {
    core: Arc<Mutex<Core>>,
    work: BTreeMap<ProcedureId, Work>,
    next_id: u64,
}

impl Master {
    /// Creates a master that only listens until a caller starts a procedure or a session.
    pub fn new(profile: Profile) -> Self {
        Self { core: Arc::new(Mutex::new(Core::new(profile))), work: BTreeMap::new(), next_id: 1 }
    }

    /// Starts a procedure. [`Event::Done`] reports the end of the procedure. The function returns an error while another procedure works
    /// with the same board.
    pub fn start(&mut self, now: u64, request: Request) -> Result<ProcedureId, Error> {
        let (id, name, claims) = (ProcedureId(self.next_id), request.name(), request.claims());
        {
            let mut core = lock(&self.core);
            core.advance(now);
            if let Some(other) = core.mailboxes.values().find(|mailbox| mailbox.claims & claims != 0) {
                let shared = other.claims & claims;
                let boards = (0..32).filter(|b| shared >> b & 1 == 1).collect();
                return Err(MasterError::Busy { boards, with: other.name }.into());
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

    /// Cancels a procedure. Before the master reports [`Event::Done`], the procedure still undoes its changes on the boards.
    pub fn cancel(&mut self, id: ProcedureId) {
        if let Some(mailbox) = lock(&self.core).mailboxes.get_mut(&id) {
            mailbox.cancel = true;
        }
        self.run();
    }

    /// Ends a procedure without sending another frame, because the bus is lost. The master reports [`Event::Done`] at once. For an update,
    /// the event contains the known state of each board. For conformance tests, it contains the finished tests. For all other procedures,
    /// it contains [`MasterError::Bus`].
    pub fn abandon(&mut self, id: ProcedureId, reason: &str) {
        if let Some(mailbox) = lock(&self.core).mailboxes.get_mut(&id) {
            mailbox.bus_gone = Some(reason.into());
        }
        self.run();
    }

    /// Handles a received frame; see [`Frame::received`].
    pub fn handle(&mut self, now: u64, received: Result<Frame, Foreign>) {
        {
            let mut core = lock(&self.core);
            core.advance(now);
            core.received(received);
        }
        self.run();
    }

    /// Returns the next frame that the driver must send. The driver must call `poll` until it returns `None`.
    pub fn poll(&mut self, now: u64) -> Option<Frame> {
        self.poll_behind(now, now)
    }

    /// Like `poll`, for a driver that has delivered only the frames that were received up to the time `received`.
    /// Waits of procedures end only up to the time `received`, but heartbeats are sent up to `now`.
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

    /// Returns the time at which the driver must call [`Master::poll`] next, unless a frame arrives earlier. If the result is `None`, the
    /// driver needs to call `poll` only when a frame arrives.
    pub fn next_deadline(&self) -> Option<u64> {
        let core = lock(&self.core);
        if !core.idle() {
            return Some(core.now);
        }
        let waiting = core.mailboxes.values().filter_map(|mailbox| mailbox.wake);
        waiting.chain(core.duties_deadline()).min()
    }

    /// Removes and returns the oldest event.
    pub fn take_event(&mut self) -> Option<Event> {
        lock(&self.core).take_event()
    }

    /// Returns `true` if a procedure is in progress.
    pub fn is_busy(&self) -> bool {
        !self.work.is_empty()
    }

    /// Advances every procedure as far as the received frames and the time allow.
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

    /// Returns the profile in use.
    pub fn profile(&self) -> Profile {
        lock(&self.core).profile
    }

    /// Returns `true` if this PC sends heartbeats.
    pub fn is_master(&self) -> bool {
        lock(&self.core).session != Session::Quiet
    }

    /// Returns the last frame of another PC (D-08): its time, its function, and the number that it was sent to.
    pub fn competing_master(&self) -> Option<(u64, Function, u8)> {
        lock(&self.core).competing_master
    }

    /// Ends the heartbeats and the repeated inputs. Running boards then become safe by themselves, because the
    /// heartbeats are missing (D-50).
    pub fn end_session(&mut self) {
        let mut core = lock(&self.core);
        core.session = Session::Quiet;
        core.stops.clear();
    }

    /// Returns the last known state of the boards.
    pub fn boards(&self) -> Boards {
        lock(&self.core).boards.clone()
    }

    /// Returns an error for each board number that two boards share. A procedure that uses such a number ends with
    /// the same error.
    pub fn shared_numbers(&self) -> Vec<Error> {
        lock(&self.core).holders.all_shared().into_iter().map(Error::from).collect()
    }

    /// Returns the counters of the frames on the bus.
    pub fn statistics(&self) -> Statistics {
        lock(&self.core).statistics.clone()
    }

    /// Sets an input of a board whose description is known. The master sends the input at once. If this PC repeats the inputs of the board,
    /// it also repeats the new value (D-34).
    pub fn set_input(&mut self, now: u64, board: u8, name: &str, value: u16) -> Result<u16, SignalError> {
        let index = self.signal(now, board, Kind::Ci, name)?;
        let mut core = lock(&self.core);
        if let Some(data) = core.data.get_mut(&board)
            && let Some(place) = data.ci.get_mut(usize::from(index))
        {
            *place = value;
            data.ci_known.insert(index);
            core.send_input(board, index);
        }
        Ok(index)
    }

    /// Writes a parameter of a board whose description is known. The board does not answer, so the PC's copy of the
    /// parameters marks the value as assumed (D-35).
    pub fn set_parameter(&mut self, now: u64, board: u8, name: &str, value: u16) -> Result<u16, SignalError> {
        let index = self.signal(now, board, Kind::Par, name)?;
        lock(&self.core).send_parameter(board, index, value);
        Ok(index)
    }

    fn signal(&mut self, now: u64, board: u8, kind: Kind, name: &str) -> Result<u16, SignalError> {
        lock(&self.core).advance(now);
        let description = self.description(board).ok_or(SignalError::NoApplication { board, valid: true })?;
        description.find(board, kind, name)
    }

    /// Returns the description of a board, if it is known.
    pub fn description(&self, board: u8) -> Option<IoDescription> {
        let core = lock(&self.core);
        let key = core.data.get(&board)?.description?;
        core.descriptions.get(&key).cloned()
    }

    /// Returns all descriptions of boards that the master knows. The caller can store them for the next session.
    pub fn descriptions(&self) -> BTreeMap<DescriptionKey, IoDescription> {
        lock(&self.core).descriptions.clone()
    }

    /// Stores a description of a board from an earlier session (D-36).
    pub fn know_description(&mut self, key: DescriptionKey, description: IoDescription) {
        lock(&self.core).descriptions.insert(key, description);
    }

    /// Returns `true` if this PC sends the inputs of a board cyclically, so that the loss of one frame has no lasting effect (D-34).
    pub fn repeats_inputs(&self, board: u8) -> bool {
        lock(&self.core).data.get(&board).is_some_and(|data| data.repeat.is_some())
    }

    /// Returns the inputs of a board: the values that were set last, or the board's initial values. An input is `None` if neither value is
    /// known since the application started.
    pub fn inputs(&self, board: u8) -> Vec<Option<u16>> {
        lock(&self.core).data.get(&board).map(ProcessData::inputs).unwrap_or_default()
    }

    /// Returns the parameters that this PC assumes for a board.
    pub fn parameters(&self, board: u8) -> Vec<ParValue> {
        lock(&self.core).data.get(&board).map(|d| d.par.values().to_vec()).unwrap_or_default()
    }

    /// Starts or stops reporting the sensor outputs of a board as [`Event::Snapshot`]. If the board's description is
    /// not known, the caller must pass the number of outputs in `dimension`.
    pub fn watch(&mut self, board: u8, dimension: Option<u16>, on: bool) {
        let mut core = lock(&self.core);
        let data = core.data.entry(board & 31).or_default();
        data.watched = on;
        if let Some(dimension) = dimension.filter(|d| usize::from(*d) != data.so.dimension()) {
            data.so = SnapshotAssembler::new(dimension);
        }
    }

    /// Makes this PC the master without a procedure. From this call on, the PC sends heartbeats.
    pub fn begin_session(&mut self, now: u64) {
        let mut core = lock(&self.core);
        core.advance(now);
        core.start_session();
    }

    /// Sends a command that stops control loops (ADMIN_DATA, all 0) before all queued frames, and repeats it twice
    /// shortly afterwards. The command is sent to the given boards, in reverse order, or to all boards by broadcast.
    /// This function does not wait for an answer; [`Request::Stop`] checks each board.
    pub fn stop_at_once(&mut self, now: u64, boards: Option<&[u8]>) {
        let mut core = lock(&self.core);
        core.advance(now);
        let profile = core.profile;
        let valid = |number: u8| Sequence::new(number).filter(|n| profile.is_board(*n));
        let to: Vec<Sequence> = match (boards, profile.broadcast_number()) {
            (Some(boards), _) => boards.iter().rev().copied().filter_map(valid).collect(),
            (None, Some(broadcast)) => vec![broadcast],
            (None, None) => (0..32).filter_map(valid).collect(),
        };
        to.iter().for_each(|to| match profile.broadcast_number() == Some(*to) {
            true => core.stop_all_inputs(),
            false => core.stop_inputs(to.number()),
        });
        to.into_iter().for_each(|to| core.stop_running(to));
    }
}
