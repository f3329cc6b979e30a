//! State that all procedures share: clock, queued frames, mailboxes, and the last known states of the boards.

use crate::master::engine::boards::Boards;
use crate::master::engine::event::Event;
use crate::master::engine::holders::Holders;
use crate::master::engine::mailbox::{Forget, MAX_RECEIVED, Mailbox, Received};
use crate::master::engine::statistics::Statistics;
use crate::master::engine::times::Times;
use crate::master::error::LastReceived;
use crate::master::io::process_data::ProcessData;
use crate::master::io::{DescriptionKey, IoDescription};
use crate::master::reports::ProcedureId;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use ucom::{BufferPackage, Foreign, Frame, FromBoard, Function, Profile, Sequence, Status, ToBoard};

/// Limit of the events that the user has not fetched yet.
const MAX_EVENTS: usize = 4096;

struct Outgoing {
    serial: u64,
    owner: Option<ProcedureId>,
    /// Received frames that the procedure discards when this frame leaves the queue.
    forget: Forget,
    what: What,
}

enum What {
    Frame(Frame),
    /// Package of a board's inputs that begins with word `offset`. The values of the inputs are read when the package is sent, so queued
    /// inputs are never outdated.
    Inputs {
        board: u8,
        offset: u16,
    },
}

/// Role of this PC on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Session {
    /// The PC only listens and sends queries.
    Quiet,
    /// The PC is the master and sends heartbeats.
    Master { next_alive: u64 },
}

pub(crate) struct Core {
    pub profile: Profile,
    pub times: Times,
    /// Time of the last call of the master.
    pub now: u64,
    /// Time up to which waits of procedures can end: the time `received` of the last poll. The caller has delivered all
    /// frames that were received before this time. If the caller is late, frames that were received between this time
    /// and `now` are not delivered yet.
    pub fired: u64,
    /// Sum of the times that have certainly passed between received frames, µs. For each frame, the sum increases by
    /// the time from the delivery of the frame to the last value of `fired` before the next frame. Frames that were
    /// received together and delivered late do not increase the sum, so they do not look like a gap in a string.
    pub passed: u64,
    /// Time at which the caller delivered the last frame.
    handed_over: u64,
    /// Time at which this PC started to listen to the bus.
    pub since: Option<u64>,
    pub session: Session,
    /// Time, function and destination number of the last frame of another PC.
    pub competing_master: Option<(u64, Function, u8)>,
    /// Time until which a report of a board counts as an answer. A later report shows that the board has rebooted.
    pub report_until: u64,
    /// Times at which stop commands will be repeated, with the boards. `on_lost` or the caller has requested these
    /// stops. The master repeats them because a frame can be lost.
    pub stops: Vec<(u64, Sequence)>,
    /// Earliest time at which the inputs may be repeated.
    pub inputs_from: u64,
    pub boards: Boards,
    /// Boards that have answered, by number.
    pub holders: Holders,
    pub data: BTreeMap<u8, ProcessData>,
    pub descriptions: BTreeMap<DescriptionKey, IoDescription>,
    pub statistics: Statistics,
    pub mailboxes: BTreeMap<ProcedureId, Mailbox>,
    urgent: VecDeque<Frame>,
    normal: VecDeque<Outgoing>,
    /// Packages of inputs that are queued in `normal`. Each package is queued only once, so the queue stays short if the bus cannot carry
    /// all inputs.
    waiting_inputs: BTreeSet<(u8, u16)>,
    queued: u64,
    sent: u64,
    /// Time at which the last frame of a procedure left the queue.
    pub sent_at: u64,
    events: VecDeque<Event>,
    dropped: u64,
}

impl Core {
    pub(crate) fn new(profile: Profile) -> Self {
        Self {
            profile,
            times: Times::of(&profile),
            now: 0,
            fired: 0,
            passed: 0,
            handed_over: 0,
            since: None,
            session: Session::Quiet,
            competing_master: None,
            report_until: 0,
            stops: Vec::new(),
            inputs_from: 0,
            boards: Boards::default(),
            holders: Holders::default(),
            data: BTreeMap::new(),
            descriptions: BTreeMap::new(),
            statistics: Statistics::new(profile.bitrate),
            mailboxes: BTreeMap::new(),
            urgent: VecDeque::new(),
            normal: VecDeque::new(),
            waiting_inputs: BTreeSet::new(),
            queued: 0,
            sent: 0,
            sent_at: 0,
            events: VecDeque::new(),
            dropped: 0,
        }
    }

    /// Sets the current time, which never moves backwards.
    pub(crate) fn advance(&mut self, now: u64) {
        self.now = self.now.max(now);
        self.since.get_or_insert(self.now);
    }

    pub(crate) fn event(&mut self, event: Event) {
        // If the queue is full, all events except `Event::Done` are discarded.
        if self.events.len() >= MAX_EVENTS && !matches!(event, Event::Done { .. }) {
            self.dropped += 1;
        } else {
            self.events.push_back(event);
        }
    }

    pub(crate) fn take_event(&mut self) -> Option<Event> {
        let event = self.events.pop_front();
        if event.is_none() && self.dropped > 0 {
            return Some(Event::Overflow { dropped: core::mem::take(&mut self.dropped) });
        }
        event
    }

    /// Queues a frame before all other frames of the PC. The master uses this function for heartbeats and stops.
    pub(crate) fn urgent(&mut self, to: Sequence, message: ToBoard) {
        self.urgent.push_back(message.encode(to, &self.profile));
    }

    /// Queues a frame for the bus. The function returns the serial number of the frame for [`Core::left`].
    pub(crate) fn queue(
        &mut self,
        owner: Option<ProcedureId>,
        to: Sequence,
        message: ToBoard,
        forget: Forget,
    ) -> u64 {
        self.queue_frame(owner, message.encode(to, &self.profile), forget)
    }

    pub(crate) fn queue_frame(&mut self, owner: Option<ProcedureId>, frame: Frame, forget: Forget) -> u64 {
        self.push(owner, forget, What::Frame(frame))
    }

    /// Queues the package of a board's inputs that begins with word `offset`, unless this package is already queued.
    pub(crate) fn queue_inputs(&mut self, board: u8, offset: u16) {
        if self.waiting_inputs.insert((board, offset)) {
            self.push(None, Forget::Nothing, What::Inputs { board, offset });
        }
    }

    fn push(&mut self, owner: Option<ProcedureId>, forget: Forget, what: What) -> u64 {
        self.queued += 1;
        self.normal.push_back(Outgoing { serial: self.queued, owner, forget, what });
        self.queued
    }

    /// Returns the serial number of the last queued frame.
    pub(crate) fn queued(&self) -> u64 {
        self.queued
    }

    /// Returns `true` if the frame with this serial number has left the queue.
    pub(crate) fn left(&self, serial: u64) -> bool {
        self.sent >= serial
    }

    /// Returns the next frame for the bus.
    pub(crate) fn pop(&mut self) -> Option<Frame> {
        let frame = self.urgent.pop_front().or_else(|| self.pop_normal())?;
        self.note_sent(&frame);
        Some(frame)
    }

    fn pop_normal(&mut self) -> Option<Frame> {
        loop {
            let next = self.normal.pop_front()?;
            self.sent = next.serial;
            self.sent_at = self.now;
            if let Some(mailbox) = next.owner.and_then(|owner| self.mailboxes.get_mut(&owner)) {
                match next.forget {
                    Forget::Nothing => {}
                    Forget::Answers => mailbox.received.retain(|h| matches!(h.message, FromBoard::Error(_))),
                    Forget::All => {
                        mailbox.received.clear();
                        mailbox.raw.iter_mut().for_each(VecDeque::clear);
                    }
                }
            }
            let frame = match next.what {
                What::Frame(frame) => Some(frame),
                What::Inputs { board, offset } => self.inputs_frame(board, offset),
            };
            // Continues with the next frame if the inputs of this package no longer exist.
            if frame.is_some() {
                return frame;
            }
        }
    }

    fn inputs_frame(&mut self, board: u8, offset: u16) -> Option<Frame> {
        self.waiting_inputs.remove(&(board, offset));
        let package = BufferPackage::at(&self.data.get(&board)?.ci, offset)?;
        Some(ToBoard::Ci(package).encode(Sequence::new(board)?, &self.profile))
    }

    fn note_sent(&mut self, frame: &Frame) {
        let now = self.now;
        self.statistics.sent(now, frame);
        let Ok((function, to)) = frame.address() else { return };
        self.holders.may_change(function, to, frame.data(), &self.profile, self.now);
        let starts = |status: &u8| Status(*status).has(Status::MSTART);
        match function {
            Function::Start => self.may_start(to),
            Function::SetStatus if frame.data().get(1).is_some_and(starts) => self.may_start(to),
            Function::Reset => {
                self.report_until = self.report_until.max(now + self.times.report_window + 500_000)
            }
            Function::AskReport => {
                self.report_until = self.report_until.max(now + self.times.report_ask + 500_000)
            }
            _ => {}
        }
    }

    /// Records that a command to start the application was sent to a board, or to all boards by broadcast.
    fn may_start(&mut self, to: Sequence) {
        let broadcast = self.profile.broadcast_number() == Some(to);
        let addressed = self.boards.iter_mut().filter(|(number, _)| broadcast || *number == to.number());
        addressed.for_each(|(_, board)| board.stopped_at = None);
    }

    /// Discards the queued frames of a procedure.
    pub(crate) fn forget_queued(&mut self, owner: ProcedureId) {
        self.retain_queued(|next| next.owner != Some(owner));
    }

    /// Discards a board's queued inputs.
    pub(crate) fn forget_inputs(&mut self, board: u8) {
        self.waiting_inputs.retain(|(of, _)| *of != board);
        self.retain_queued(|next| !matches!(next.what, What::Inputs { board: of, .. } if of == board));
    }

    fn retain_queued(&mut self, keep: impl Fn(&Outgoing) -> bool) {
        self.normal.retain(keep);
        // A procedure may be waiting for a removed frame to leave the queue. Therefore all frames before the first
        // remaining frame count as sent.
        let before_first = self.normal.front().map_or(self.queued, |next| next.serial - 1);
        self.sent = self.sent.max(before_first);
    }

    pub(crate) fn idle(&self) -> bool {
        self.urgent.is_empty() && self.normal.is_empty()
    }

    /// Records the time at which the caller delivers a frame.
    pub(crate) fn mark_time(&mut self) {
        self.passed += self.fired.saturating_sub(self.handed_over);
        self.handed_over = self.now;
    }

    /// Delivers a board's message to the procedures whose filter accepts it.
    pub(crate) fn deliver(&mut self, from: u8, message: FromBoard) {
        let at = self.passed;
        for mailbox in self.mailboxes.values_mut() {
            if mailbox.filter.takes(from, message.function()) && mailbox.received.len() < MAX_RECEIVED {
                mailbox.received.push_back(Received { at, from, message });
            }
        }
    }

    /// Delivers the unparsed frame to the procedures that request unparsed frames.
    pub(crate) fn deliver_raw(&mut self, frame: &Frame) {
        let at = self.now;
        for raw in self.mailboxes.values_mut().filter_map(|mailbox| mailbox.raw.as_mut()) {
            if raw.len() < MAX_RECEIVED {
                raw.push_back((at, *frame));
            }
        }
    }

    /// Returns the procedure that has claimed a board.
    pub(crate) fn owner(&self, board: u8) -> Option<ProcedureId> {
        self.mailboxes.iter().find(|(_, mailbox)| mailbox.claims >> board & 1 == 1).map(|(id, _)| *id)
    }

    pub(crate) fn last_received(&self, board: u8) -> Option<LastReceived> {
        let (at, function) = self.boards.get(board)?.last?;
        Some(LastReceived { function, ago_ms: self.now.saturating_sub(at) / 1000 })
    }

    /// Handles a frame of another protocol.
    pub(crate) fn foreign(&mut self, foreign: Foreign) {
        if self.statistics.foreign(self.now, foreign) {
            self.event(Event::Foreign(foreign));
        }
    }

    /// Handles a frame that only another PC can have sent.
    pub(crate) fn competing_master_frame(&mut self, function: Function, to: u8, data: &[u8]) {
        self.statistics.competing_master += 1;
        if let Some(to) = Sequence::new(to) {
            self.holders.may_change(function, to, data, &self.profile, self.now);
        }
        if let Some(to) = Sequence::new(to)
            && matches!(function, Function::Start | Function::SetStatus)
        {
            self.may_start(to);
        }
        if function == Function::AskReport {
            // The reports that follow are answers to the other PC. These reports do not mean that a board has rebooted.
            self.report_until = self.report_until.max(self.now + self.times.report_ask + 500_000);
        }
        // A competing master is reported as an event only after at least 1 s without frames of another PC.
        let news = self.competing_master.is_none_or(|(at, ..)| self.now.saturating_sub(at) >= 1_000_000);
        self.competing_master = Some((self.now, function, to));
        if news {
            self.event(Event::CompetingMaster { function, to });
        }
    }
}
