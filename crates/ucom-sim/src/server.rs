//! Server that connects a simulated chain with clients of socketcand, in real time.

use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, Instant};

use can_link::{
    BusError, BusEvent, BusStats, CanFrame, ClientEvent, ClientId, ErrorState, Id, ListenError, MemberId,
    SocketcandGateway, TimedBus, TimedEvent,
};
use ucom::{Format, Frame};

use crate::{ChainSim, Fault};

/// Name of the simulated bus.
const CHANNEL: &str = "can0";
/// Longest time, in µs, for which the computer can be busy before the virtual time pauses. Without this pause, the
/// boards would detect the loss of their PC.
const CATCH_UP_US: u64 = 200_000;

/// Server that connects socketcand clients with the boards of the chain, over a simulated bus and in real time.
pub struct ChainServer<'a> {
    gateway: SocketcandGateway,
    bus: TimedBus,
    chain: ChainSim,
    /// Bus members that belong to the chain, in the order of the chain.
    inside: Vec<MemberId>,
    clients: BTreeMap<ClientId, MemberId>,
    /// Disconnected clients whose frames still wait for the bus.
    leaving: Vec<MemberId>,
    started: Instant,
    start_us: u64,
    /// Last frame on the wire: the time in ns at which it ended, the frame, and the copies of it that clients
    /// receive.
    carried: Option<(u64, CanFrame, Vec<CanFrame>)>,
    /// Clients that received a message that their CAN controller is bus-off.
    off: BTreeSet<ClientId>,
    /// Time of the last report that a controller has left the bus, ns.
    off_reported_ns: Option<u64>,
    note: Box<dyn FnMut(String) + 'a>,
}

impl<'a> ChainServer<'a> {
    /// Creates a server that listens for clients at an address; with port 0, the system selects a free port. The simulated bus has
    /// `bitrate` bit/s and uses the random seed `seed`. `note` receives messages for the operator while the server runs.
    ///
    /// # Errors
    /// Returns an error if the address cannot be used for listening.
    pub fn bind(
        address: &str,
        chain: ChainSim,
        bitrate: u32,
        seed: u64,
        note: impl FnMut(String) + 'a,
    ) -> Result<Self, ListenError> {
        let gateway = SocketcandGateway::bind(address, &[CHANNEL])?;
        let mut bus = TimedBus::new(bitrate, seed);
        bus.set_recovers_by_itself(true);
        let inside = (0..chain.members()).map(|_| bus.join()).collect();
        Ok(Self {
            gateway,
            bus,
            chain,
            inside,
            clients: BTreeMap::new(),
            leaving: Vec::new(),
            started: Instant::now(),
            start_us: 0,
            carried: None,
            off: BTreeSet::new(),
            off_reported_ns: None,
            note: Box::new(note),
        })
    }

    /// Returns the CAN URL for clients on this host.
    pub fn url(&self) -> String {
        self.gateway.url(CHANNEL)
    }

    /// Returns the counters of the simulated bus.
    pub fn stats(&self) -> BusStats {
        self.bus.stats()
    }

    /// Serves the clients and the boards. The function waits for an event of a client, at most until the next event
    /// of the chain or the bus, and at most for `patience`.
    pub fn turn(&mut self, patience: Duration) {
        let now_us = self.now_us();
        self.advance(now_us);
        let bus = &mut self.bus;
        self.leaving.retain(|member| {
            let stays = bus.pending(*member) > 0;
            if !stays {
                bus.leave(*member);
            }
            stays
        });
        let due_us = self.due_us().saturating_sub(self.now_us());
        let mut patience = Duration::from_micros(due_us).min(patience);
        while let Some(event) = self.gateway.next(patience) {
            // A frame that arrives now is put on the bus at the present time, not at the time when the clock was last read.
            let now_us = self.now_us();
            self.advance(now_us);
            self.received(event.client, event.event);
            patience = Duration::ZERO;
        }
    }

    /// Returns the virtual time, derived from the clock, µs.
    fn now_us(&mut self) -> u64 {
        let now = self.start_us + self.started.elapsed().as_micros() as u64;
        let reached = self.bus.now_ns() / 1000;
        if now.saturating_sub(reached) > CATCH_UP_US {
            (self.started, self.start_us) = (Instant::now(), reached + CATCH_UP_US / 4);
            return self.start_us;
        }
        now
    }

    /// Returns the time of the next event that does not come from a client, µs.
    fn due_us(&self) -> u64 {
        let bus = self.bus.next_ns().map_or(u64::MAX, |ns| ns.div_ceil(1000));
        bus.min(self.chain.next_due_us())
    }

    /// Advances the virtual time of the chain and the bus.
    fn advance(&mut self, to_us: u64) {
        loop {
            let at_us = self.due_us().clamp(self.bus.now_ns() / 1000, to_us);
            for member in self.chain.advance(at_us) {
                self.bus.clear(self.inside[member]);
            }
            self.bus.set_disturbance(self.chain.disturbance());
            for (i, member) in self.inside.iter().enumerate() {
                self.bus.set_acknowledges(*member, self.chain.is_powered(i));
                while let Some(frame) = self.chain.poll(i) {
                    let wire = on_wire(&frame);
                    if wire.is_none_or(|wire| self.bus.queue(*member, wire).is_err()) {
                        self.chain.not_sent(i, &frame);
                        break;
                    }
                }
            }
            match self.bus.advance_to(at_us * 1000) {
                Some(event) => self.happened(&event),
                None if at_us >= to_us && self.chain.next_due_us() > to_us => return,
                None => {}
            }
        }
    }

    fn happened(&mut self, event: &TimedEvent) {
        self.chain.advance(event.at_ns / 1000);
        let place = |member: &MemberId| self.inside.iter().position(|m| m == member);
        match &event.what {
            BusEvent::Received { member, frame } => match place(member) {
                Some(i) => {
                    let format = Format {
                        extended: frame.is_extended(),
                        remote: frame.is_remote(),
                        fd: frame.is_fd(),
                    };
                    self.chain.receive(i, frame.id().value(), format, frame.data());
                }
                // A client whose controller is bus-off does not receive frames, like any CAN controller.
                None => {
                    let copies = self.carried.iter().flat_map(|(_, _, copies)| copies);
                    for (client, frame) in
                        self.client_of(*member).into_iter().flat_map(|c| copies.clone().map(move |f| (c, f)))
                    {
                        self.gateway.deliver_to(client, frame);
                    }
                }
            },
            BusEvent::Sent { member, frame } => {
                let board = place(member);
                if let (Some(i), Ok(protocol)) = (board, plain(frame)) {
                    self.chain.sent(i, &protocol);
                }
                // Frames of several members that are equal bit for bit are one frame on the wire (D-07).
                if !self.carried.as_ref().is_some_and(|(at, last, _)| (at, last) == (&event.at_ns, frame)) {
                    // Only frames of boards are changed by the faults here. The faults were already applied to frames
                    // of clients when the server received them.
                    let copies = if board.is_some() { through(&mut self.chain, frame) } else { vec![*frame] };
                    self.carried = Some((event.at_ns, *frame, copies));
                }
            }
            BusEvent::Failed { member, frame } => {
                if let (Some(i), Ok(frame)) = (place(member), plain(frame)) {
                    self.chain.not_sent(i, &frame);
                }
            }
            BusEvent::Error { error: BusError::Collision, frame, .. } => {
                let time_s = event.at_ns as f64 * 1e-9;
                let id = frame.id();
                (self.note)(format!(
                    "{time_s:.3} s: two members sent {id} at the same time with different data; both frames \
                     were destroyed (D-05)"
                ));
            }
            BusEvent::State { member, state } => self.is_in_state(*member, state.errors, event.at_ns),
            BusEvent::Error { .. } => {}
        }
    }

    fn client_of(&self, member: MemberId) -> Option<ClientId> {
        self.clients.iter().find(|(_, m)| **m == member).map(|(client, _)| *client)
    }

    /// Handles a change of a CAN controller's state. A client gets a message when its own controller leaves the bus and when this
    /// controller returns to the bus.
    fn is_in_state(&mut self, member: MemberId, state: ErrorState, at_ns: u64) {
        let off = state == ErrorState::BusOff;
        if let Some(client) = self.client_of(member)
            && if off { self.off.insert(client) } else { self.off.remove(&client) }
        {
            self.gateway.report_state(client, if off { state } else { ErrorState::Active });
        }
        if off {
            self.report_off(member, at_ns);
        }
    }

    /// Reports that a CAN controller has left the bus. The controller recovers from bus-off by itself. The server makes at most one report
    /// per second, because a bad wire causes bus-off repeatedly.
    fn report_off(&mut self, member: MemberId, at_ns: u64) {
        if self.off_reported_ns.is_some_and(|at| at_ns.saturating_sub(at) < 1_000_000_000) {
            return;
        }
        self.off_reported_ns = Some(at_ns);
        let client = self.client_of(member).map(|client| client.to_string());
        let who = match self.inside.iter().position(|m| *m == member) {
            Some(i) => format!("the board at position {}", i + 1),
            None => client.unwrap_or_else(|| "a client that has disconnected".into()),
        };
        let time_s = at_ns as f64 * 1e-9;
        (self.note)(format!(
            "{time_s:.3} s: {who} is bus-off; its controller recovers after 128 times 11 recessive bits"
        ));
    }

    fn received(&mut self, client: ClientId, event: ClientEvent) {
        let member = *self.clients.entry(client).or_insert_with(|| self.bus.join());
        match event {
            ClientEvent::Joined => {}
            ClientEvent::Frame(frame) => {
                for frame in through(&mut self.chain, &frame) {
                    if let Err(e) = self.bus.queue(member, frame) {
                        (self.note)(format!("{client}: {frame} is lost: {e}"));
                    }
                }
            }
            ClientEvent::Left => {
                self.leaving.push(member);
                self.clients.remove(&client);
                self.off.remove(&client);
            }
        }
    }

    /// Injects the fault that a line of text such as `kill 3` describes. The function reports the fault, or the error in the line, to the
    /// operator.
    pub fn fault(&mut self, line: &str) {
        if line.is_empty() {
            return;
        }
        match Fault::from_line(line) {
            Ok(fault) => {
                self.chain.inject(fault);
                (self.note)(format!("fault: {line}"));
            }
            Err(e) => (self.note)(format!("{e}; ucom help faults lists the faults")),
        }
    }
}

/// Applies the faults between the chain and its clients to a frame.
fn through(chain: &mut ChainSim, frame: &CanFrame) -> Vec<CanFrame> {
    let id = frame.id();
    chain.through(frame.data()).iter().filter_map(|data| CanFrame::classic(id, data).ok()).collect()
}

/// Converts a frame of a board to a frame of the simulated bus.
fn on_wire(frame: &Frame) -> Option<CanFrame> {
    CanFrame::classic(Id::standard(frame.id().into()).ok()?, frame.data()).ok()
}

/// Converts a frame of the simulated bus to a frame of a board.
fn plain(frame: &CanFrame) -> Result<Frame, ()> {
    let id = u16::try_from(frame.id().value()).map_err(|_| ())?;
    Frame::new(id, frame.data()).ok_or(())
}
