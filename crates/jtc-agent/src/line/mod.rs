//! Many clients on the line of one controller, without I/O: bytes and time go in, bytes come out.
//!
//! A client speaks the protocol of the line as if it were alone: it sends frames, and receives every status with the records of its own
//! frames only. That is why every program that can use a serial port can use a shared line. What is added is who may send what: questions
//! from anyone who was let in, a Stop and a Pause from the same ahead of all else, everything else from the one who has the [`Lease`].
mod class;
mod client;
mod device;
mod event;
mod halts;
mod lease;
mod moving;
mod outbox;
mod supervision;
mod will;

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use jtc_wire::{ExecCommand, FrameType, Status, StatusCounters, StatusReceiver};

pub use agent_kit::access::Role;
pub use class::Class;
pub(crate) use class::may_change_the_arm;
pub use client::{ClientId, Delivery, Introduction, Policy, PutOut};
pub use event::{Counts, LineEvent};
pub use lease::{Denied, Lease};
use lease::{NOT_ASKED, POLICY};
pub use will::{Applied, Moves, Will};

use class::HostFrame;
use client::Client;
use halts::Halts;
use moving::Moving;
use outbox::Outbox;
use supervision::Supervision;

/// Records that do not come within this time behind their frame do not come any more.
const RECORD_TIME: Duration = Duration::from_secs(2);
/// Nor do frames that a request returns.
const RETURN_TIME: Duration = Duration::from_millis(500);
/// For so long after somebody else's Stop nobody can ask for a motion: what asks may have been on its way before.
const CALM: Duration = Duration::from_secs(3);
/// And for so long after one that was refused for that.
const CALM_AGAIN: Duration = Duration::from_millis(500);

/// A frame that was written and has no record yet.
struct Sent {
    client: ClientId,
    kind: u8,
    /// It was given up in the middle: its record is a bad one.
    abandoned: bool,
    /// When the line will have carried it.
    at: Duration,
}

/// What a device is to return beside a record.
struct Return {
    client: ClientId,
    kind: FrameType,
    until: Duration,
}

/// One line, many clients.
pub struct SharedLine {
    clients: BTreeMap<ClientId, Client>,
    next_id: u64,
    outbox: Outbox,
    sent: VecDeque<Sent>,
    returns: Option<Return>,
    /// Whose frame was sent last: the next client has its turn.
    last_turn: ClientId,
    lease: Option<Lease>,
    halts: Halts,
    /// How many halts there were, who asked for the last, and for what.
    halted: (u64, String, ExecCommand),
    /// No motion begins before that was not asked for by the one who asked for the last halt.
    calm_until: Duration,
    moving: Moving,
    /// Whose policy acts on what moves while nobody commands: that of the last who did.
    left: (String, Policy),
    /// What was reported last.
    will: Option<Will>,
    receiver: StatusReceiver,
    status: Option<(Duration, Status)>,
    supervision: Supervision,
    events: VecDeque<LineEvent>,
    counts: Counts,
}

/// The owner of the line itself, which acts for clients that have gone and for those that have no end of the line of their own.
pub const OWNER: ClientId = ClientId(0);
/// Stands for all who have asked for a Stop or a Pause.
const HALTS: ClientId = ClientId(u64::MAX);

impl SharedLine {
    /// A line at this rate, Bd, if it has one.
    pub fn new(baud: Option<u32>) -> Self {
        Self {
            clients: BTreeMap::new(),
            next_id: OWNER.0 + 1,
            outbox: Outbox::new(baud),
            sent: VecDeque::new(),
            returns: None,
            last_turn: OWNER,
            lease: None,
            halts: Halts::default(),
            halted: (0, String::new(), ExecCommand::Stop),
            calm_until: Duration::ZERO,
            moving: Moving::default(),
            left: ("nobody".to_owned(), Policy::Continue),
            will: None,
            receiver: StatusReceiver::new(),
            status: None,
            supervision: Supervision::default(),
            events: VecDeque::new(),
            counts: Counts::default(),
        }
    }

    /// A client comes.
    pub fn join(&mut self, introduction: Introduction) -> ClientId {
        let id = ClientId(self.next_id);
        self.next_id += 1;
        let mut client = Client::new(introduction);
        // It knows of what was stopped before; what it is to do may have been asked for before that.
        (client.asked_after, client.calm_until) = (self.halted.0, self.calm_until);
        self.clients.insert(id, client);
        id
    }

    /// A client goes. What it has sent and is not on the line yet is dropped; its motion follows its policy.
    pub fn leave(&mut self, client: ClientId, now: Duration) {
        let Some(gone) = self.clients.remove(&client) else { return };
        if let Some((outgoing, _)) = self.outbox.writing()
            && outgoing.client == client
            && let Some((outgoing, true)) = self.outbox.give_up(now)
        {
            self.note_written(outgoing, true);
        }
        if self.lease.as_ref().is_some_and(|lease| lease.holder == client) {
            self.end_lease(client, gone.introduction.policy, now);
            self.bequeath(gone.introduction.name, gone.introduction.policy);
        }
    }

    /// How a client has presented itself.
    pub fn introduction(&self, client: ClientId) -> Option<&Introduction> {
        self.clients.get(&client).map(|client| &client.introduction)
    }

    /// The policy of a client from now on.
    pub fn set_policy(&mut self, client: ClientId, policy: Policy) {
        if let Some(client) = self.clients.get_mut(&client) {
            client.introduction.policy = policy;
        }
    }

    /// How many clients there are.
    pub fn clients(&self) -> usize {
        self.clients.len()
    }

    /// The last status, and when it came.
    pub fn status(&self) -> Option<&(Duration, Status)> {
        self.status.as_ref()
    }

    /// Stops or pauses the motion for a client, ahead of all else: what is sent already and not on the line yet is dropped. It is sent again
    /// until the device has taken it. `name`: who it is, for those who ask why their frames were not passed on.
    pub fn halt(&mut self, client: ClientId, name: &str, command: ExecCommand, now: Duration) {
        self.halt_by(client, client, name, command, now);
    }

    /// The same for somebody who has no end of the line, or not at hand; `client` is the one who may go on at once, where it is one.
    pub fn halt_for(&mut self, client: Option<ClientId>, name: &str, command: ExecCommand, now: Duration) {
        self.halt_by(OWNER, client.unwrap_or(OWNER), name, command, now);
    }

    /// `asker` has the record, `own` may go on at once.
    fn halt_by(&mut self, asker: ClientId, own: ClientId, name: &str, command: ExecCommand, now: Duration) {
        let name = name.to_owned();
        self.halted = (self.halted.0 + 1, name.clone(), command);
        self.calm_until = now + CALM;
        for (_, other) in self.clients.iter_mut().filter(|(id, _)| **id != own) {
            other.calm_until = now + CALM;
            other.halts.all += 1;
            other.halts.stops += u64::from(command == ExecCommand::Stop);
        }
        self.halts.ask(asker, command);
        // Whoever stops an arm wants it held: one that is taught, or will be as soon as it stands, is loose.
        if self.moving.may_teach(self.status.as_ref()) {
            self.moving.end_teaching(now);
        }
        let denied = Denied::Stopped { by: name };
        if let Some((outgoing, written)) = self.outbox.writing()
            && written == 0
            && outgoing.frame.class.needs_lease()
            && let Some((outgoing, _)) = self.outbox.give_up(now)
        {
            self.refuse(outgoing.client, &outgoing.frame, denied.clone());
        }
        let clients: Vec<ClientId> = self.clients.keys().copied().collect();
        for id in clients {
            let Some(client) = self.clients.get_mut(&id) else { continue };
            for frame in client.take_commands() {
                self.refuse(id, &frame, denied.clone());
            }
        }
    }

    /// Bytes that a client has sent, in any pieces.
    pub fn from_client(&mut self, id: ClientId, mut bytes: &[u8], now: Duration) {
        loop {
            let Some(client) = self.clients.get_mut(&id) else { return };
            let frame = match client.next_frame(&mut bytes) {
                Ok(Some(frame)) => frame,
                Ok(None) => return,
                Err(reason) => return self.put_out(id, reason, now),
            };
            client.heard_at = now;
            let allowed = client.allow(now);
            // A Stop counts also of one who is put out for what else it has sent.
            if allowed.is_ok() || matches!(frame.class, Class::Halt(_)) {
                self.take_frame(id, frame, now);
            }
            if let Err(reason) = allowed {
                return self.put_out(id, reason, now);
            }
        }
    }

    fn take_frame(&mut self, id: ClientId, frame: HostFrame, now: Duration) {
        if let Class::Halt(command) = frame.class {
            let (name, before) = (self.name(id), self.halted.0);
            self.halt(id, &name, command, now);
            // What it stops itself on its way, it goes on from.
            if let Some(client) = self.clients.get_mut(&id)
                && client.asked_after == before
            {
                client.asked_after = before + 1;
            }
            return;
        }
        if frame.class.needs_lease()
            && let Err(denied) = self.may_send(id, &frame, now)
        {
            return self.refuse(id, &frame, denied);
        }
        if frame.class == Class::Ask
            && let Err(denied) = self.may_ask(id, now)
        {
            return self.refuse(id, &frame, denied);
        }
        let viewer = self.introduction(id).is_some_and(|client| client.role == Role::Viewer);
        if viewer && frame.reads_log() {
            return self.refuse(id, &frame, Denied::Viewer);
        }
        if let Some(Err(reason)) = self.clients.get_mut(&id).map(|client| client.wait(frame)) {
            self.put_out(id, reason, now);
        }
    }

    /// This frame may be sent by this client.
    fn may_send(&mut self, id: ClientId, frame: &HostFrame, now: Duration) -> Result<(), Denied> {
        self.could_command(id, now)?;
        let motion = frame.class == Class::Motion;
        // An upload that leads to no motion any more ends at once.
        if (motion || frame.frame_type == FrameType::Trajectory) && self.is_halted(id) {
            return Err(self.stopped(id));
        }
        if motion {
            self.is_calm(id, now, CALM_AGAIN)?;
        }
        self.may_command(id, now)
    }

    /// Nobody else has stopped the arm just now. `again`: where somebody has, what insists for so long waits for as long behind that.
    fn is_calm(&mut self, id: ClientId, now: Duration, again: Duration) -> Result<(), Denied> {
        match self.clients.get_mut(&id) {
            Some(client) if now < client.calm_until => {
                client.calm_until = client.calm_until.max(now + again);
                Err(self.stopped(id))
            }
            _ => Ok(()),
        }
    }

    /// What this client was asked for is not done.
    pub(super) fn stopped(&self, id: ClientId) -> Denied {
        Denied::Stopped { by: self.halted_by(id).to_owned() }
    }

    /// Who has stopped or paused what this client was asked for.
    pub fn halted_by(&self, id: ClientId) -> &str {
        if self.asked_after(id) == Some(NOT_ASKED) { POLICY } else { &self.halted.1 }
    }

    /// A client asks for what may move the arm, knowing of the halt number `after`. From then on only that moves it: a Stop or a Pause behind
    /// that halt takes it back, however long it has waited since.
    ///
    /// # Errors
    ///
    /// [`Denied`]: another one commands, or somebody else has just stopped the arm.
    pub fn ask_to_move(&mut self, id: ClientId, after: u64, now: Duration) -> Result<(), Denied> {
        self.ask(id, after, Duration::ZERO, now)
    }

    /// The same for what is asked for again and again as long as somebody holds a key down: it has to be let go before it moves the arm anew.
    ///
    /// # Errors
    ///
    /// Those of [`ask_to_move`](Self::ask_to_move).
    pub fn ask_to_jog(&mut self, id: ClientId, after: u64, now: Duration) -> Result<(), Denied> {
        self.ask(id, after, CALM_AGAIN, now)
    }

    /// The client could ask for a jog, as far as others are concerned; one that insists behind a Stop waits on.
    ///
    /// # Errors
    ///
    /// Those of [`ask_to_move`](Self::ask_to_move).
    pub fn could_jog(&mut self, id: ClientId, now: Duration) -> Result<(), Denied> {
        self.could_command(id, now)?;
        self.is_calm(id, now, CALM_AGAIN)
    }

    /// The client could ask for what may move the arm, as far as others are concerned.
    ///
    /// # Errors
    ///
    /// Those of [`ask_to_move`](Self::ask_to_move).
    pub fn could_ask(&mut self, id: ClientId, now: Duration) -> Result<(), Denied> {
        self.could_command(id, now)?;
        self.is_calm(id, now, Duration::ZERO)
    }

    fn ask(&mut self, id: ClientId, after: u64, again: Duration, now: Duration) -> Result<(), Denied> {
        self.could_command(id, now)?;
        self.is_calm(id, now, again)?;
        if after != self.halted.0 {
            return Err(self.stopped(id));
        }
        if let Some(client) = self.clients.get_mut(&id) {
            client.asked_after = after;
        }
        Ok(())
    }

    /// What this client has asked for was stopped or paused since.
    pub fn is_halted(&self, id: ClientId) -> bool {
        self.asked_after(id).is_some_and(|number| number != self.halted.0)
    }

    /// The last halt that this client has asked for its motion after; that before it came, where it has not.
    pub fn asked_after(&self, id: ClientId) -> Option<u64> {
        self.clients.get(&id).map(|client| client.asked_after)
    }

    /// Stops and Pauses of others since this client came.
    pub fn halts_of_others(&self, id: ClientId) -> jtc_host::port::Halts {
        self.clients.get(&id).map(|client| client.halts).unwrap_or_default()
    }

    /// Number of the last halt.
    pub fn last_halt(&self) -> u64 {
        self.halted.0
    }

    /// Who asked for the last halt, and for what.
    pub fn last_halt_by(&self) -> (&str, ExecCommand) {
        (&self.halted.1, self.halted.2)
    }

    /// Brings the arm to rest for the end of the owner. What somebody still prepares moves it no more.
    pub fn end(&mut self, now: Duration) {
        self.halt(OWNER, "the end of the agent", ExecCommand::Stop, now);
        self.moving.end_teaching(now);
    }

    /// Ends whatever moves the arm, for the owner. Where nothing seems to move it is sent as well, as a status is older than the last
    /// command, and the device refuses it then; that holds nobody else up. Returns whether something may have moved.
    fn hold(&mut self, name: &str, command: ExecCommand, now: Duration) -> bool {
        let moved = self.moving.may_move(self.status.as_ref(), now);
        if moved {
            self.halt(OWNER, name, command, now);
        } else {
            self.halts.ask(OWNER, command);
        }
        self.moving.end_teaching(now);
        moved
    }

    /// The arm may be moving, or may begin to. In doubt it may.
    pub fn may_move(&self, now: Duration) -> bool {
        self.moving.may_move(self.status.as_ref(), now)
    }

    /// Nothing waits for the line, nor for a record of a Stop.
    pub fn is_idle(&self) -> bool {
        self.halts.are_done() && self.moving.due().is_none() && self.outbox.is_free()
    }

    fn set_lease(&mut self, lease: Option<Lease>) {
        self.lease.clone_from(&lease);
        self.events.push_back(LineEvent::Lease(lease));
    }

    /// A frame of this client is not passed on.
    fn refuse(&mut self, id: ClientId, frame: &HostFrame, denied: Denied) {
        let event = LineEvent::Denied { client: id, frame_type: frame.frame_type, denied: denied.clone() };
        self.events.push_back(event);
        if let Some(Err(reason)) = self.clients.get_mut(&id).map(|client| client.refuse(frame.refusal())) {
            return self.put_out(id, reason, self.now());
        }
        self.deliver(id, Delivery::Denied(denied));
    }

    /// Gives a client something to read.
    pub fn deliver(&mut self, id: ClientId, delivery: Delivery) {
        if let Some(Err(reason)) = self.clients.get_mut(&id).map(|client| client.deliver(delivery)) {
            self.put_out(id, reason, self.now());
        }
    }

    pub(super) fn put_out(&mut self, client: ClientId, reason: PutOut, now: Duration) {
        self.events.push_back(LineEvent::PutOut { client, reason });
        self.leave(client, now);
    }

    /// What a client has not had yet; `None` when there is no such client any more.
    pub fn take_deliveries(&mut self, client: ClientId) -> Option<Vec<Delivery>> {
        self.clients.get_mut(&client).map(Client::take_deliveries)
    }

    /// What has happened since the last call.
    pub fn take_events(&mut self) -> Vec<LineEvent> {
        let events: Vec<LineEvent> = self.events.drain(..).collect();
        events.iter().for_each(|event| self.counts.count(event));
        events
    }

    /// How often each has happened, as far as [`take_events`](Self::take_events) has returned it.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// What came from the device.
    pub fn received(&self) -> StatusCounters {
        self.receiver.counters()
    }

    /// About now: when the last status came.
    fn now(&self) -> Duration {
        self.status.map_or(Duration::ZERO, |(at, _)| at)
    }

    fn name(&self, client: ClientId) -> String {
        match self.introduction(client) {
            Some(client) => client.name.clone(),
            None if client == OWNER => "the owner of the line".to_owned(),
            None => "a client that has gone".to_owned(),
        }
    }
}
