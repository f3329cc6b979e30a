//! Test bus in memory and in virtual time. The master is on one side of the bus; simulated boards or a table of
//! answers are on the other side. A test can set faults for the frames between the two sides.

use ucom::node::{Node, NodeConfig, Record};
use ucom::{Frame, Profile};
use ucom_host::master::{Event, Master, Outcome, ProcedureId, Request, frame_bits};
use ucom_sim::memory::{MemoryApplication, MemoryFlash, MemoryStore, WirePins};

pub(super) use super::exit::Exit;
pub(super) use super::script::Script;

/// Microseconds in a millisecond.
pub(super) const MS: u64 = 1000;

/// Simulated bus member other than the master.
pub(super) trait Member {
    fn poll(&mut self, now: u64) -> Option<Frame>;
    fn sent(&mut self, now: u64, frame: &Frame);
    fn receive(&mut self, now: u64, frame: &Frame);
    fn deadline(&self) -> u64;
    /// Returns the board that this member simulates, if it simulates a board.
    fn board(&mut self) -> Option<&mut TestNode> {
        None
    }
}

pub(super) type TestNode = Node<MemoryFlash, WirePins, MemoryStore, MemoryApplication>;

impl Member for TestNode {
    fn poll(&mut self, now: u64) -> Option<Frame> {
        Node::poll(self, now)
    }
    fn sent(&mut self, now: u64, frame: &Frame) {
        Node::sent(self, now, frame);
    }
    fn receive(&mut self, now: u64, frame: &Frame) {
        Node::receive(self, now, frame);
    }
    fn deadline(&self) -> u64 {
        self.next_deadline()
    }
    fn board(&mut self) -> Option<&mut TestNode> {
        Some(self)
    }
}

pub(super) fn frame(text: &str) -> Frame {
    text.parse().unwrap_or_else(|e| panic!("{text}: {e}"))
}

/// Fault of one frame during its transmission on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fault {
    Lost,
    Doubled,
    /// The frame arrives after the next frame.
    Swapped,
    /// The frame is delayed by the given time in milliseconds.
    Delayed(u64),
    /// A data bit of the frame is wrong, or a bit of the identifier if the frame has no data.
    Corrupted(u8),
}

/// Sender of a frame on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum From {
    Master,
    Member(usize),
}

pub(super) struct Bench {
    pub master: Master,
    pub members: Vec<Box<dyn Member>>,
    pub now: u64,
    /// Every frame that was put on the bus, with the time at which its transmission was complete.
    pub log: Vec<(u64, From, Frame)>,
    pub events: Vec<(u64, Event)>,
    /// Number of the frame that has a fault, and the kind of the fault.
    pub fault: Option<(usize, Fault)>,
    /// Frames to lose: the beginning of the frame's text, and the number of frames that are lost. A text begins with
    /// `<` for a frame of the master, and with `>` for a frame of a board.
    pub lose: Vec<(&'static str, u32)>,
    /// Bus members that are disconnected. A disconnected member receives no frames, and none of its frames arrives.
    pub cut: Vec<usize>,
    pending_master: Option<Frame>,
    pending: Vec<Option<Frame>>,
    held: Option<(From, Frame)>,
    delayed: Vec<(u64, From, Frame)>,
    /// `true` if the driver of the master does nothing, as after the tool was killed.
    pub dead: bool,
}

impl Bench {
    pub(super) fn new(profile: Profile, members: Vec<Box<dyn Member>>) -> Self {
        let pending = members.iter().map(|_| None).collect();
        Self {
            master: Master::new(profile),
            members,
            now: 0,
            log: Vec::new(),
            events: Vec::new(),
            fault: None,
            lose: Vec::new(),
            cut: Vec::new(),
            pending_master: None,
            pending,
            held: None,
            delayed: Vec::new(),
            dead: false,
        }
    }

    /// Adds a member to the test bus.
    pub(super) fn join(&mut self, member: Box<dyn Member>) {
        self.members.push(member);
        self.pending.push(None);
    }

    pub(super) fn script(script: Script) -> Self {
        Self::new(Profile::default(), vec![Box::new(script)])
    }

    /// Creates a bus with a chain of boards of the crate `ucom`, each with an application.
    pub(super) fn chain(flash_ids: &[u16]) -> Self {
        Self::chain_with(flash_ids, Profile::default())
    }

    pub(super) fn chain_with(flash_ids: &[u16], profile: Profile) -> Self {
        let mut pins = WirePins::chain(flash_ids.len());
        let boards =
            flash_ids.iter().map(|flash| Box::new(node(*flash, pins.remove(0), profile)) as Box<dyn Member>);
        Self::new(profile, boards.collect())
    }

    /// Transfers one frame over the bus, or advances the time by a step; returns `false` if no event occurs before `limit`.
    fn step(&mut self, limit: u64) -> bool {
        self.deliver_delayed();
        if self.pending_master.is_none() && !self.dead {
            self.pending_master = self.master.poll(self.now);
        }
        self.drain();
        for (i, member) in self.members.iter_mut().enumerate() {
            if self.pending[i].is_none() {
                self.pending[i] = member.poll(self.now);
            }
        }
        let masters = self.pending_master.map(|f| (f.id(), From::Master));
        let others =
            self.pending.iter().enumerate().filter_map(|(i, f)| f.map(|f| (f.id(), From::Member(i))));
        if let Some((_, from)) = masters.into_iter().chain(others).min_by_key(|(id, _)| *id) {
            self.transmit(from);
            return true;
        }
        let mut next = self.members.iter().map(|m| m.deadline()).min().unwrap_or(u64::MAX);
        if !self.dead {
            next = next.min(self.master.next_deadline().unwrap_or(u64::MAX));
        }
        next = next.min(self.delayed.iter().map(|(at, ..)| *at).min().unwrap_or(u64::MAX));
        if self.now >= limit {
            return false;
        }
        self.now = next.max(self.now + 1).min(limit);
        true
    }

    fn transmit(&mut self, from: From) {
        let frame = match from {
            From::Master => self.pending_master.take(),
            From::Member(i) => self.pending[i].take(),
        };
        let frame = frame.unwrap();
        self.now += frame_bits(frame.dlc());
        if let From::Member(i) = from {
            self.members[i].sent(self.now, &frame);
        }
        let number = self.log.len();
        self.log.push((self.now, from, frame));
        let text = format!("{} {frame}", if from == From::Master { '<' } else { '>' });
        let lose = self.lose.iter_mut().find(|(start, left)| *left > 0 && text.starts_with(*start));
        let lost = lose.map(|(_, left)| *left -= 1).map(|()| Fault::Lost);
        let fault = lost.or(self.fault.filter(|(at, _)| *at == number).map(|(_, fault)| fault));
        match fault {
            Some(Fault::Lost) => {}
            Some(Fault::Doubled) => {
                self.deliver(from, frame);
                self.deliver(from, frame);
            }
            Some(Fault::Swapped) => {
                self.held = Some((from, frame));
                return;
            }
            Some(Fault::Delayed(ms)) => self.delayed.push((self.now + ms * MS, from, frame)),
            Some(Fault::Corrupted(bit)) => self.deliver(from, corrupted(&frame, bit)),
            None => self.deliver(from, frame),
        }
        if let Some((from, frame)) = self.held.take() {
            self.deliver(from, frame);
        }
    }

    fn deliver_delayed(&mut self) {
        let now = self.now;
        let due: Vec<_> = self.delayed.iter().filter(|(at, ..)| *at <= now).copied().collect();
        self.delayed.retain(|(at, ..)| *at > now);
        due.into_iter().for_each(|(_, from, frame)| self.deliver(from, frame));
    }

    fn deliver(&mut self, from: From, frame: Frame) {
        for (i, member) in self.members.iter_mut().enumerate() {
            if from != From::Member(i) && !self.cut.contains(&i) {
                member.receive(self.now, &frame);
            }
        }
        let silent = matches!(from, From::Member(i) if self.cut.contains(&i));
        if from != From::Master && !self.dead && !silent {
            self.master.handle(self.now, frame.address().map(|_| frame));
        }
        self.drain();
    }

    fn drain(&mut self) {
        while let Some(event) = self.master.take_event() {
            self.events.push((self.now, event));
        }
    }

    /// Advances the virtual time by `ms` milliseconds.
    pub(super) fn run(&mut self, ms: u64) {
        let until = self.now + ms * MS;
        while self.now < until && self.step(until) {}
    }

    /// Advances the virtual time until `done` returns `true`.
    pub(super) fn until(&mut self, done: impl Fn(&Self) -> bool) {
        while !done(self) {
            self.run(1);
        }
    }

    /// Starts a procedure and waits until it ends. The function panics if the procedure takes more than `limit_s`
    /// seconds of virtual time.
    pub(super) fn go(&mut self, request: Request, limit_s: u64) -> Result<Outcome, ucom_host::master::Error> {
        let id = self.master.start(self.now, request).expect("nothing else is under way");
        self.wait(id, limit_s)
    }

    pub(super) fn wait(
        &mut self,
        id: ProcedureId,
        limit_s: u64,
    ) -> Result<Outcome, ucom_host::master::Error> {
        let limit = self.now + limit_s * 1000 * MS;
        let seen = self.events.len();
        loop {
            let done = self.events[seen.min(self.events.len())..].iter().find_map(|(_, e)| match e {
                Event::Done { id: which, result } if *which == id => Some(result.clone()),
                _ => None,
            });
            if let Some(result) = done {
                return result;
            }
            assert!(
                self.step(limit),
                "still busy after {limit_s} s of virtual time (fault {:?})",
                self.fault
            );
        }
    }

    /// Returns the frames that the master sent, as text.
    pub(super) fn sent(&self) -> Vec<String> {
        self.log.iter().filter(|(_, from, _)| *from == From::Master).map(|(.., f)| f.to_string()).collect()
    }

    /// Returns the times at which the master sent this frame.
    pub(super) fn times_of(&self, text: &str) -> Vec<u64> {
        let wanted = frame(text);
        self.log
            .iter()
            .filter(|(_, from, f)| *from == From::Master && *f == wanted)
            .map(|(at, ..)| *at)
            .collect()
    }

    pub(super) fn count(&self, text: &str) -> usize {
        self.times_of(text).len()
    }

    /// Returns the number of frames, from any sender, that begin with `start`.
    pub(super) fn beginning(&self, start: &str) -> usize {
        self.log.iter().filter(|(.., f)| f.to_string().starts_with(start)).count()
    }

    pub(super) fn board(&mut self, i: usize) -> &mut TestNode {
        self.members[i].board().expect("a board")
    }
}

/// Returns the frame with one wrong bit. On a real bus, such a frame can come from a gateway that computes a new
/// checksum.
fn corrupted(frame: &Frame, bit: u8) -> Frame {
    if frame.dlc() == 0 {
        return Frame::new(frame.id() ^ 1 << (bit % 11), &[]).unwrap();
    }
    let mut data = frame.data().to_vec();
    let place = usize::from(bit) % (8 * data.len());
    data[place / 8] ^= 1 << (place % 8);
    Frame::new(frame.id(), &data).unwrap()
}

/// Input names of the boards of the golden chain.
pub(super) const CI: [&str; 2] = ["target velocity", "current limit"];
pub(super) const SO: [&str; 4] = ["pos_soll", "pos_ist", "current", "temperature"];
pub(super) const PAR: [&str; 3] = ["P", "I", "D"];

/// Program ID and date of the program on every board of the test bus.
pub(super) const OLD: (u16, u16) = (0x1234, 0x386E);

pub(super) fn node(flash: u16, pins: WirePins, profile: Profile) -> TestNode {
    let mut memory = MemoryFlash::default();
    let image = [0x55; 64];
    memory.install(Record { program_id: OLD.0, date: OLD.1, address: 0, words: 32 }, &image);
    let store = MemoryStore { autostart: false, description: b"UCoM2 head pan".to_vec() };
    let mut application = MemoryApplication::new("head pan control", &CI, &SO, &PAR);
    application.initial_ci = vec![7, 9];
    let config = NodeConfig { profile, seed: u32::from(flash) + 1, ..NodeConfig::new(flash) };
    Node::new(config, memory, pins, store, application, 0)
}

/// Returns the golden image: byte i is (37·i + 11) mod 256.
pub(super) fn image(len: usize) -> Vec<u8> {
    (0..len).map(|i| (37 * i + 11) as u8).collect()
}
