//! Simulation of a chain: boards, init wires and faults.

use super::board::{Board, BoardState};
use super::fault::{Fault, FaultKind, Trigger};
use super::file::ChainConfig;
use std::collections::BTreeMap;
use ucom::profile::Profile;
use ucom::{Format, Frame, Sequence, ToBoard};

/// Period of the frames that another PC sends, µs.
const MASTER_US: u64 = 250_000;
/// Period of the frames of another protocol, µs.
const FOREIGN_US: u64 = 40_000;

/// Boards of a chain and the other senders on their bus. All boards and other senders are members of a bus that the caller simulates.
///
/// Bus member 0 is the first board. The last member is not a board: it sends all frames that faults add to the bus. The caller calls
/// [`advance`](Self::advance), then [`poll`](Self::poll) for each member, and puts the frame of the member on the bus. The caller reports
/// the result to the member with [`sent`](Self::sent) or [`not_sent`](Self::not_sent). Then the caller passes the frame to the other
/// members with [`receive`](Self::receive).
pub struct ChainSim {
    boards: Vec<Board>,
    profile: Profile,
    now_us: u64,
    random: u64,
    /// Faults that have not begun yet.
    waiting: Vec<Fault>,
    /// Active faults, each with the time at which it ends.
    holding: Vec<(u64, Fault)>,
    /// Number of frames that were on the bus, by identifier; needed for faults that a frame triggers.
    seen: BTreeMap<u16, u64>,
    /// `true` if the init wire after the board is broken.
    broken: Vec<bool>,
    /// Members whose queued frames are void because their CAN controllers were reset.
    void: Vec<usize>,
    lost: f64,
    corrupted: f64,
    doubled: f64,
    disturbed: f64,
    master_at: Option<u64>,
    foreign_at: Option<u64>,
}

impl ChainSim {
    /// Creates a chain of boards at power-up. `profile` defines the frames that another PC sends with the fault
    /// `foreign-master`.
    pub fn new(config: &ChainConfig, faults: Vec<Fault>, seed: u64, profile: &Profile) -> Self {
        let board = |(i, board)| Board::new(board, i == 0, seed.wrapping_mul(31).wrapping_add(i as u64));
        let boards: Vec<Board> = config.boards.iter().enumerate().map(board).collect();
        let mut sim = Self {
            broken: vec![false; boards.len()],
            boards,
            profile: *profile,
            now_us: 0,
            // The state of the xorshift generator must not start at 0.
            random: seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1,
            waiting: faults,
            holding: Vec::new(),
            seen: BTreeMap::new(),
            void: Vec::new(),
            lost: 0.0,
            corrupted: 0.0,
            doubled: 0.0,
            disturbed: 0.0,
            master_at: None,
            foreign_at: None,
        };
        sim.faults();
        sim
    }

    /// Returns the number of bus members, which is the number of boards plus one.
    pub fn members(&self) -> usize {
        self.boards.len() + 1
    }

    /// Returns the states of the boards.
    pub fn boards(&self) -> impl Iterator<Item = BoardState> {
        self.boards.iter().map(Board::state)
    }

    /// Returns a status that no board can have, with the position of the board. Such a status shows an error in the code of the node
    /// (section 4.1).
    pub fn violation(&self) -> Option<(usize, &'static str)> {
        self.boards.iter().enumerate().find_map(|(i, board)| Some((i, board.violation?)))
    }

    /// Returns the time of the next event of the chain in µs. A time in the past means that the event is due at once.
    pub fn next_due_us(&self) -> u64 {
        let boards = self.boards.iter().map(Board::next_us);
        let begin = self.waiting.iter().filter_map(|fault| match fault.trigger {
            Trigger::At(at) => Some(at),
            Trigger::Frame { .. } => None,
        });
        let end = self.holding.iter().map(|(end, _)| *end);
        let others = [self.master_at, self.foreign_at].into_iter().flatten();
        boards.chain(begin).chain(end).chain(others).min().unwrap_or(u64::MAX)
    }

    /// Sets the current time of the chain, which never moves backwards. The function returns the members whose queues on the bus must be
    /// emptied.
    pub fn advance(&mut self, now_us: u64) -> Vec<usize> {
        self.now_us = self.now_us.max(now_us);
        self.faults();
        self.wires();
        std::mem::take(&mut self.void)
    }

    /// Returns the next frame of a bus member, if the member has a frame to send now.
    pub fn poll(&mut self, member: usize) -> Option<Frame> {
        match self.boards.get_mut(member) {
            Some(board) if board.next_us() > self.now_us => None,
            Some(board) => board.poll(self.now_us),
            None => self.others(),
        }
    }

    /// Reports to a bus member that its frame was on the bus.
    pub fn sent(&mut self, member: usize, frame: &Frame) {
        match self.boards.get_mut(member) {
            Some(board) => board.sent(self.now_us, frame),
            None => self.count(frame),
        }
    }

    /// Reports to a bus member that its CAN controller discarded a frame.
    pub fn not_sent(&mut self, member: usize, frame: &Frame) {
        if let Some(board) = self.boards.get_mut(member) {
            board.not_sent(self.now_us, frame);
        }
    }

    /// Passes a frame of any format to a bus member.
    pub fn receive(&mut self, member: usize, id: u32, format: Format, data: &[u8]) {
        if let Some(board) = self.boards.get_mut(member) {
            board.receive(self.now_us, id, format, data);
        } else if let (Ok(id), true) = (u16::try_from(id), format == Format::BUS)
            && let Some(frame) = Frame::new(id, data)
        {
            // The last bus member receives every frame of the other members exactly once. Therefore this member counts the frames that
            // trigger faults.
            self.count(&frame);
        }
    }

    /// Returns `true` if a bus member is active on the bus. A board without power does not even acknowledge frames of other bus members.
    pub fn is_powered(&self, member: usize) -> bool {
        self.boards.get(member).is_none_or(|board| !board.unpowered)
    }

    /// Begins a fault now, or when the trigger of the fault occurs. The time of a trigger is measured from the time of this call.
    pub fn inject(&mut self, mut fault: Fault) {
        match &mut fault.trigger {
            Trigger::At(at) => *at += self.now_us,
            Trigger::Frame { id, count } => *count += self.seen.get(id).copied().unwrap_or(0),
        }
        self.waiting.push(fault);
    }

    /// Applies the faults `lost`, `corrupted` and `doubled` to data between the chain and its clients. The function returns zero, one or
    /// two copies of the data.
    pub fn through(&mut self, data: &[u8]) -> Vec<Vec<u8>> {
        // Each call uses the same number of random values, so that the setting of one fault does not change the
        // effect of other faults.
        let [lost, corrupted, doubled, place] = [self.chance(), self.chance(), self.chance(), self.chance()];
        if lost < self.lost {
            return Vec::new();
        }
        let mut data = data.to_vec();
        let bit = (place * (data.len() * 8) as f64) as usize;
        if corrupted < self.corrupted
            && let Some(byte) = data.get_mut(bit / 8)
        {
            *byte ^= 1 << (bit % 8);
        }
        let times = if doubled < self.doubled { 2 } else { 1 };
        vec![data; times]
    }

    /// Returns the share of frames that the bus must destroy on the wire, 0 to 1. The bus that the caller simulates destroys these frames.
    pub fn disturbance(&self) -> f64 {
        self.disturbed
    }

    fn count(&mut self, frame: &Frame) {
        *self.seen.entry(frame.id()).or_default() += 1;
        if self.waiting.iter().any(|fault| matches!(fault.trigger, Trigger::Frame { .. })) {
            self.faults();
        }
    }

    /// Sets the levels of the init pins along the chain.
    fn wires(&mut self) {
        for i in 1..self.boards.len() {
            let level = self.boards[i - 1].outgoing() && !self.broken[i - 1];
            self.boards[i].set_incoming(self.now_us, level);
        }
    }

    /// Gives a board the number of the previous board in the chain, if the previous board has a number.
    fn share_number(&mut self, i: usize) {
        let number = self.boards.get(i.wrapping_sub(1)).and_then(|before| before.state().number);
        if let (Some(number), Some(board)) = (number.and_then(Sequence::new), self.boards.get_mut(i)) {
            board.take_number(self.now_us, number);
        }
    }

    /// Returns a random number that is at least 0 and below 1.
    fn chance(&mut self) -> f64 {
        // The generator is xorshift64 (Marsaglia 2003).
        self.random ^= self.random << 13;
        self.random ^= self.random >> 7;
        self.random ^= self.random << 17;
        (self.random >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Returns the next frame of the other PC or of the other protocol.
    fn others(&mut self) -> Option<Frame> {
        if self.master_at.is_some_and(|at| at <= self.now_us) {
            self.master_at = Some(self.now_us + MASTER_US);
            let alive = (self.now_us / MASTER_US).is_multiple_of(2);
            let (message, to) = match alive {
                true => (ToBoard::Alive, self.profile.unnumbered()),
                false => (ToBoard::Info, Sequence::MAX),
            };
            return Some(message.encode(to, &self.profile));
        }
        if self.foreign_at.is_some_and(|at| at <= self.now_us) {
            self.foreign_at = Some(self.now_us + FOREIGN_US);
            let beat = (self.now_us / FOREIGN_US) as u32;
            // Alternates between two identifiers that this protocol does not use: one with bit 5 set, and one with
            // function 31.
            return Frame::new(if beat.is_multiple_of(2) { 0x3A5 } else { 0x7C3 }, &beat.to_le_bytes());
        }
        None
    }

    /// Begins and ends the faults that are due.
    fn faults(&mut self) {
        let (now, seen) = (self.now_us, &self.seen);
        let due = |fault: &Fault| match fault.trigger {
            Trigger::At(at) => at <= now,
            Trigger::Frame { id, count } => seen.get(&id).is_some_and(|n| *n >= count),
        };
        let (begin, waiting): (Vec<Fault>, Vec<Fault>) = self.waiting.drain(..).partition(due);
        self.waiting = waiting;
        let (end, holding): (Vec<_>, Vec<_>) = self.holding.drain(..).partition(|(end, _)| *end <= now);
        self.holding = holding;
        for (_, fault) in end {
            self.set(fault, false);
        }
        for fault in begin {
            self.set(fault, true);
            if let Some(duration) = fault.duration_us {
                self.holding.push((now + duration, fault));
            }
        }
    }

    fn set(&mut self, fault: Fault, on: bool) {
        let now = self.now_us;
        let share = |share: f64| if on { share } else { 0.0 };
        match fault.kind {
            FaultKind::Lost(s) => self.lost = share(s),
            FaultKind::Corrupted(s) => self.corrupted = share(s),
            FaultKind::Doubled(s) => self.doubled = share(s),
            FaultKind::Disturbed(s) => self.disturbed = share(s),
            FaultKind::CompetingMaster => self.master_at = on.then_some(now),
            FaultKind::ForeignFrames => self.foreign_at = on.then_some(now),
            kind => {
                let i = fault.board.wrapping_sub(1);
                let (Some(board), Some(broken)) = (self.boards.get_mut(i), self.broken.get_mut(i)) else {
                    return;
                };
                match kind {
                    FaultKind::PowerLoss => {
                        board.power(now, !on);
                        self.void.push(i);
                    }
                    FaultKind::Silent => board.silent = on,
                    FaultKind::Deaf => board.deaf = on,
                    FaultKind::AckHeld => board.ack_held = on,
                    FaultKind::FlashBroken => board.break_flash(on),
                    FaultKind::WireBroken => *broken = on,
                    FaultKind::SameNumber => self.share_number(i),
                    _ => {
                        board.crash(now);
                        self.void.push(i);
                    }
                }
            }
        }
    }
}
