//! Shares the serial line of one controller among many clients. The module does not do I/O: its functions take the
//! received bytes and the time, and return the bytes to be written.
//!
//! Each client uses the protocol of the serial line as if no other client existed. A client receives every status, but
//! only the response records of its own frames. Every program that can use a serial port can therefore also use a
//! shared line. The shared line decides which client may send which frame:
//!
//! - every client may send queries, Stops and Pauses; a Stop or a Pause is sent before all other frames;
//! - only the holder of the [`Lease`] may send other frames.
//!
//! Stops and Pauses have a common sequence of numbers (in the code: *halts*). A motion request that a client made
//! before the last Stop or Pause does not move the arm, even if its frames arrive later.
mod client;
mod device;
mod event;
mod frame_class;
mod lease;
mod motion_tracker;
mod stop_queue;
mod supervision;
mod tx_queue;
mod will;

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use jtc_wire::{ExecCommand, FrameType, Status, StatusCounters, StatusReceiver};

pub use agent_kit::access::Role;
pub use client::{ClientId, Delivery, Introduction, Policy, PutOut};
pub use event::{Counts, LineEvent};
pub use frame_class::FrameClass;
pub(crate) use frame_class::may_change_the_arm;
pub use lease::{Denied, Lease};
use lease::{NOT_ASKED, POLICY};
pub use will::{Applied, Moves, Will};

use client::Client;
use frame_class::HostFrame;
use motion_tracker::MotionTracker;
use stop_queue::StopQueue;
use supervision::Supervision;
use tx_queue::TxQueue;

/// Longest wait for the response record of a frame.
const RECORD_TIME: Duration = Duration::from_secs(2);
/// Longest wait from a response record until the controller sends the requested frame.
const RETURN_TIME: Duration = Duration::from_millis(500);
/// Hold-off after a Stop or a Pause of another client. During this time, motion requests are refused, because a
/// client may have sent them before it learnt of the Stop.
const CALM: Duration = Duration::from_secs(3);
/// Shortest remaining hold-off after a refused motion frame or a refused jog request.
const CALM_AGAIN: Duration = Duration::from_millis(500);

/// Written frame whose response record has not arrived yet.
struct Sent {
    client: ClientId,
    kind: u8,
    /// `true` if the transmission of the frame was aborted before its end. The controller answers an aborted frame with
    /// an error record.
    abandoned: bool,
    /// Time at which the serial line finishes the last byte of the frame.
    at: Duration,
}

/// Frame that the controller sends in addition to a response record.
struct Return {
    client: ClientId,
    kind: FrameType,
    until: Duration,
}

/// Serial line of one controller, with its clients.
pub struct SharedLine {
    clients: BTreeMap<ClientId, Client>,
    next_id: u64,
    tx_queue: TxQueue,
    sent: VecDeque<Sent>,
    returns: Option<Return>,
    /// Client whose frame was sent last. The frames of the clients are sent in rotation.
    last_turn: ClientId,
    lease: Option<Lease>,
    halts: StopQueue,
    /// Number of the last Stop or Pause, the name of its client, and the command.
    halted: (u64, String, ExecCommand),
    /// End of the hold-off. During the hold-off, only the client of the last Stop or Pause may begin a motion.
    calm_until: Duration,
    motion_tracker: MotionTracker,
    /// Name and policy of the last lease holder. The policy applies to the motion while no client holds the lease.
    left: (String, Policy),
    /// [`Will`] that was last reported as an event.
    will: Option<Will>,
    receiver: StatusReceiver,
    status: Option<(Duration, Status)>,
    supervision: Supervision,
    events: VecDeque<LineEvent>,
    counts: Counts,
}

/// Client number of the owner of the serial line. The owner sends commands for clients that are disconnected or have no
/// connection to the line.
pub const OWNER: ClientId = ClientId(0);
/// Placeholder client number for all clients that have requested a Stop or a Pause.
const HALTS: ClientId = ClientId(u64::MAX);

impl SharedLine {
    /// Creates a serial line with the bit rate `baud` in Bd; `None` means that the line has no bit rate.
    pub fn new(baud: Option<u32>) -> Self {
        Self {
            clients: BTreeMap::new(),
            next_id: OWNER.0 + 1,
            tx_queue: TxQueue::new(baud),
            sent: VecDeque::new(),
            returns: None,
            last_turn: OWNER,
            lease: None,
            halts: StopQueue::default(),
            halted: (0, String::new(), ExecCommand::Stop),
            calm_until: Duration::ZERO,
            motion_tracker: MotionTracker::default(),
            left: ("nobody".to_owned(), Policy::Continue),
            will: None,
            receiver: StatusReceiver::new(),
            status: None,
            supervision: Supervision::default(),
            events: VecDeque::new(),
            counts: Counts::default(),
        }
    }

    /// Adds a client to the serial line.
    pub fn join(&mut self, introduction: Introduction) -> ClientId {
        let id = ClientId(self.next_id);
        self.next_id += 1;
        let mut client = Client::new(introduction);
        // A new client's requests are newer than all Stops before its connection. However, its user may have decided
        // on a motion before the last Stop, so the hold-off also applies to the new client.
        (client.asked_after, client.calm_until) = (self.halted.0, self.calm_until);
        self.clients.insert(id, client);
        id
    }

    /// Removes a client from the serial line. Drops the client's frames that are not written yet, and applies the
    /// client's policy to its motion.
    pub fn leave(&mut self, client: ClientId, now: Duration) {
        let Some(gone) = self.clients.remove(&client) else { return };
        if let Some((outgoing, _)) = self.tx_queue.writing()
            && outgoing.client == client
            && let Some((outgoing, true)) = self.tx_queue.give_up(now)
        {
            self.note_written(outgoing, true);
        }
        if self.lease.as_ref().is_some_and(|lease| lease.holder == client) {
            self.end_lease(client, gone.introduction.policy, now);
            self.bequeath(gone.introduction.name, gone.introduction.policy);
        }
    }

    /// Returns the name, role and policy of a client.
    pub fn introduction(&self, client: ClientId) -> Option<&Introduction> {
        self.clients.get(&client).map(|client| &client.introduction)
    }

    /// Sets the policy of a client.
    pub fn set_policy(&mut self, client: ClientId, policy: Policy) {
        if let Some(client) = self.clients.get_mut(&client) {
            client.introduction.policy = policy;
        }
    }

    /// Returns the number of clients on the serial line.
    pub fn clients(&self) -> usize {
        self.clients.len()
    }

    /// Returns the last status, and the arrival time of this status.
    pub fn status(&self) -> Option<&(Duration, Status)> {
        self.status.as_ref()
    }

    /// Sends a Stop or a Pause of a client before all other frames. Repeats the Stop or Pause until the controller
    /// confirms it. Drops all frames that need the lease, if no byte of them was written yet. The clients of the
    /// dropped frames receive a notice that `name` stopped the arm.
    pub fn halt(&mut self, client: ClientId, name: &str, command: ExecCommand, now: Duration) {
        self.halt_by(client, client, name, command, now);
    }

    /// Like [`halt`](Self::halt), for a Stop or Pause that did not arrive as a frame of a client. The hold-off does
    /// not apply to `client`.
    pub fn halt_for(&mut self, client: Option<ClientId>, name: &str, command: ExecCommand, now: Duration) {
        self.halt_by(OWNER, client.unwrap_or(OWNER), name, command, now);
    }

    /// Sends a Stop or a Pause, and delivers its response record to `asker`. The hold-off does not apply to `own`.
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
        // After a Stop or Pause, the arm must hold its position, but in Teaching it would be compliant. A requested
        // Teaching could also begin as soon as the arm is at rest. A Stop or Pause therefore ends Teaching, whether
        // Teaching is active or only requested.
        if self.motion_tracker.may_teach(self.status.as_ref()) {
            self.motion_tracker.end_teaching(now);
        }
        let denied = Denied::Stopped { by: name };
        if let Some((outgoing, written)) = self.tx_queue.writing()
            && written == 0
            && outgoing.frame.class.needs_lease()
            && let Some((outgoing, _)) = self.tx_queue.give_up(now)
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

    /// Processes bytes that a client has sent, in pieces of any length.
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
            // A Stop is executed even if the agent disconnects the client because of its other frames.
            if allowed.is_ok() || matches!(frame.class, FrameClass::Halt(_)) {
                self.take_frame(id, frame, now);
            }
            if let Err(reason) = allowed {
                return self.put_out(id, reason, now);
            }
        }
    }

    fn take_frame(&mut self, id: ClientId, frame: HostFrame, now: Duration) {
        if let FrameClass::Halt(command) = frame.class {
            let (name, before) = (self.name(id), self.halted.0);
            self.halt(id, &name, command, now);
            // A client's own Stop does not invalidate the client's next request.
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
        if frame.class == FrameClass::Ask
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

    /// Checks that this client may send this frame.
    fn may_send(&mut self, id: ClientId, frame: &HostFrame, now: Duration) -> Result<(), Denied> {
        self.could_command(id, now)?;
        let motion = frame.class == FrameClass::Motion;
        // If a client stopped the motion, the upload of the motion ends at once.
        if (motion || frame.frame_type == FrameType::Trajectory) && self.is_halted(id) {
            return Err(self.stopped(id));
        }
        if motion {
            self.is_calm(id, now, CALM_AGAIN)?;
        }
        self.may_command(id, now)
    }

    /// Returns an error during the hold-off after another client's Stop or Pause. Each refused request extends the
    /// hold-off to at least `again` from now.
    fn is_calm(&mut self, id: ClientId, now: Duration, again: Duration) -> Result<(), Denied> {
        match self.clients.get_mut(&id) {
            Some(client) if now < client.calm_until => {
                client.calm_until = client.calm_until.max(now + again);
                Err(self.stopped(id))
            }
            _ => Ok(()),
        }
    }

    /// Returns the refusal of a request that was made before the last Stop or Pause.
    pub(super) fn stopped(&self, id: ClientId) -> Denied {
        Denied::Stopped { by: self.halted_by(id).to_owned() }
    }

    /// Returns the name of the client whose Stop or Pause invalidated the earlier requests of client `id`.
    pub fn halted_by(&self, id: ClientId) -> &str {
        if self.asked_after(id) == Some(NOT_ASKED) { POLICY } else { &self.halted.1 }
    }

    /// Permits the next motion of a client. `after` is the number of the last Stop or Pause that the client has seen. A
    /// later Stop or Pause revokes the permission, even if the motion request is still queued.
    ///
    /// # Errors
    ///
    /// [`Denied`] if another client holds the lease, during the hold-off, or after a Stop or Pause later than `after`.
    pub fn ask_to_move(&mut self, id: ClientId, after: u64, now: Duration) -> Result<(), Denied> {
        self.ask(id, after, Duration::ZERO, now)
    }

    /// Like [`ask_to_move`](Self::ask_to_move), for a request that is repeated while a key is pressed. Each refused
    /// repetition extends the hold-off. The arm therefore moves again only after the user has released the key.
    ///
    /// # Errors
    ///
    /// Errors of [`ask_to_move`](Self::ask_to_move).
    pub fn ask_to_jog(&mut self, id: ClientId, after: u64, now: Duration) -> Result<(), Denied> {
        self.ask(id, after, CALM_AGAIN, now)
    }

    /// Returns an error if the lease or a Stop of another client prevents a jog of this client. Each refused request
    /// extends the hold-off.
    ///
    /// # Errors
    ///
    /// Errors of [`ask_to_move`](Self::ask_to_move).
    pub fn could_jog(&mut self, id: ClientId, now: Duration) -> Result<(), Denied> {
        self.could_command(id, now)?;
        self.is_calm(id, now, CALM_AGAIN)
    }

    /// Returns an error if the lease or a Stop of another client prevents a motion of this client.
    ///
    /// # Errors
    ///
    /// Errors of [`ask_to_move`](Self::ask_to_move).
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

    /// Returns true if a Stop or a Pause followed the client's last motion request.
    pub fn is_halted(&self, id: ClientId) -> bool {
        self.asked_after(id).is_some_and(|number| number != self.halted.0)
    }

    /// Returns the number of the last Stop or Pause before the client's last motion request. If the client has made
    /// no motion request, returns the number of the last Stop or Pause before it connected.
    pub fn asked_after(&self, id: ClientId) -> Option<u64> {
        self.clients.get(&id).map(|client| client.asked_after)
    }

    /// Returns the number of Stops and Pauses of other clients since this client connected.
    pub fn halts_of_others(&self, id: ClientId) -> jtc_host::port::Halts {
        self.clients.get(&id).map(|client| client.halts).unwrap_or_default()
    }

    /// Returns the number of the last Stop or Pause.
    pub fn last_halt(&self) -> u64 {
        self.halted.0
    }

    /// Returns the name of the client that requested the last Stop or Pause, and the command.
    pub fn last_halt_by(&self) -> (&str, ExecCommand) {
        (&self.halted.1, self.halted.2)
    }

    /// Stops the arm because the agent is ending. Also prevents motions that clients are still preparing.
    pub fn end(&mut self, now: Duration) {
        self.halt(OWNER, "the agent, which ended", ExecCommand::Stop, now);
        self.motion_tracker.end_teaching(now);
    }

    /// Stops or pauses every motion on behalf of the line's owner. Sends the command even if the arm seems to be at
    /// rest, because the last status may be older than the last command. If the arm seems to be at rest, no hold-off
    /// begins for other clients, and the controller may refuse the command. Returns true if the arm may have been
    /// moving.
    fn hold(&mut self, name: &str, command: ExecCommand, now: Duration) -> bool {
        let moved = self.motion_tracker.may_move(self.status.as_ref(), now);
        if moved {
            self.halt(OWNER, name, command, now);
        } else {
            self.halts.ask(OWNER, command);
        }
        self.motion_tracker.end_teaching(now);
        moved
    }

    /// Returns false only if the arm is certainly at rest and no motion is about to begin.
    pub fn may_move(&self, now: Duration) -> bool {
        self.motion_tracker.may_move(self.status.as_ref(), now)
    }

    /// Returns true if the transmit queue is empty, and no Stop, Pause or end of Teaching waits for its response
    /// record.
    pub fn is_idle(&self) -> bool {
        self.halts.are_done() && self.motion_tracker.due().is_none() && self.tx_queue.is_free()
    }

    fn set_lease(&mut self, lease: Option<Lease>) {
        self.lease.clone_from(&lease);
        self.events.push_back(LineEvent::Lease(lease));
    }

    /// Refuses a frame of a client.
    fn refuse(&mut self, id: ClientId, frame: &HostFrame, denied: Denied) {
        let event = LineEvent::Denied { client: id, frame_type: frame.frame_type, denied: denied.clone() };
        self.events.push_back(event);
        if let Some(Err(reason)) = self.clients.get_mut(&id).map(|client| client.refuse(frame.refusal())) {
            return self.put_out(id, reason, self.now());
        }
        self.deliver(id, Delivery::Denied(denied));
    }

    /// Queues a delivery for a client.
    pub fn deliver(&mut self, id: ClientId, delivery: Delivery) {
        if let Some(Err(reason)) = self.clients.get_mut(&id).map(|client| client.deliver(delivery)) {
            self.put_out(id, reason, self.now());
        }
    }

    pub(super) fn put_out(&mut self, client: ClientId, reason: PutOut, now: Duration) {
        self.events.push_back(LineEvent::PutOut { client, reason });
        self.leave(client, now);
    }

    /// Removes and returns the deliveries that are queued for a client. Returns `None` if the client has disconnected.
    pub fn take_deliveries(&mut self, client: ClientId) -> Option<Vec<Delivery>> {
        self.clients.get_mut(&client).map(Client::take_deliveries)
    }

    /// Removes and returns the events since the last call of this function.
    pub fn take_events(&mut self) -> Vec<LineEvent> {
        let events: Vec<LineEvent> = self.events.drain(..).collect();
        events.iter().for_each(|event| self.counts.count(event));
        events
    }

    /// Returns the number of events of each kind that [`take_events`](Self::take_events) has returned.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// Returns the counters of the bytes and statuses that the controller has sent.
    pub fn received(&self) -> StatusCounters {
        self.receiver.counters()
    }

    /// Returns the approximate present time: the arrival time of the last status.
    fn now(&self) -> Duration {
        self.status.map_or(Duration::ZERO, |(at, _)| at)
    }

    fn name(&self, client: ClientId) -> String {
        match self.introduction(client) {
            Some(client) => client.name.clone(),
            None if client == OWNER => "the agent".to_owned(),
            None => "a disconnected client".to_owned(),
        }
    }
}
