//! A classic CAN bus in virtual time: deterministic, without threads and without a clock.

mod arbitration;
mod confinement;
mod event;
mod outcome;
mod wire;

use std::collections::VecDeque;
use std::time::Duration;

use crate::faulty::Line;
use crate::{CanFrame, ControllerState, FaultSchedule, FaultStats};
use arbitration::{Arbitration, Starter};
use confinement::{Counters, Recovery};
pub use event::{BusError, BusEvent, BusStats, MemberId, QueueError, TimedEvent};
pub use wire::classic_frame_bits;
use wire::{ERROR_FRAME, INTERMISSION, RECESSIVE_RUN, RECOVERIES, TO_ACKNOWLEDGE};

/// Largest number of queued frames per member.
const QUEUE: usize = 65_536;

/// A classic CAN bus in virtual time.
///
/// Frames take as long as on a real bus with this bit rate; stuff bits are counted exactly. The first frames of all
/// queues take part in arbitration as on a real bus. Members acknowledge frames, count errors, become error passive and
/// go bus-off according to ISO 11898-1. Two members that send the same identifier with different data at the same time
/// collide. Equal calls with equal seeds produce equal events.
///
/// ```
/// use can_link::{CanFrame, BusEvent, Id, TimedBus};
/// let mut bus = TimedBus::new(1_000_000, 1);
/// let (tool, board) = (bus.join(), bus.join());
/// bus.queue(tool, CanFrame::classic(Id::standard(0x281)?, &[])?)?;
/// while let Some(event) = bus.advance_to(1_000_000) {
///     // The current time is the time of the event. Frames queued here take part in arbitration from now on.
///     if let BusEvent::Received { member, frame } = event.what {
///         assert_eq!((member, frame.to_string()), (board, "281 #".to_owned()));
///     }
/// }
/// assert_eq!(bus.stats().frames, 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct TimedBus {
    bitrate: u32,
    now: u64,
    members: Vec<Member>,
    random: fastrand::Rng,
    disturbance: f64,
    /// Frame that is being transmitted on the bus.
    transfer: Option<Transfer>,
    /// Time at which the intermission ends and the bus is free, ns.
    free_from: u64,
    events: VecDeque<BusEvent>,
    stats: BusStats,
    recovers_by_itself: bool,
}

struct Member {
    /// Queue of frames that the member must send (first in, first out).
    queue: VecDeque<CanFrame>,
    /// Simulated faults of the frames that the member sends (before the queue), and of the frames that it receives
    /// from the bus.
    lines: Option<Box<(Line, Line)>>,
    counters: Counters,
    /// Earliest time at which the member can start a frame. An error passive member waits longer, so that other
    /// members can start first.
    may_start: u64,
    /// State of the recovery from bus-off; `None` if no recovery is in progress.
    recovery: Option<Recovery>,
    one_shot: bool,
    /// `true` if the frame on the bus was already removed from the queue, so that it is not sent again.
    last_try: bool,
    acknowledges: bool,
    left: bool,
}

impl Member {
    fn on_bus(&self) -> bool {
        !self.left && !self.counters.bus_off()
    }
}

struct Transfer {
    end: u64,
    arbitration: Arbitration,
    /// Error that ends the frame. Collisions are not stored in this field.
    error: Option<BusError>,
}

fn time(ns: u64) -> Duration {
    Duration::from_nanos(ns)
}

/// Converts a duration to ns; returns `None` if the duration is too long for a `u64`.
fn ns(time: Duration) -> Option<u64> {
    u64::try_from(time.as_nanos()).ok()
}

/// End of virtual time: nearly 300 years, ns.
const END_OF_TIME: u64 = u64::MAX / 2;

impl TimedBus {
    /// Creates a bus without members at time 0. `bitrate` is in bit/s; 0 is treated as 1. `seed` determines the
    /// disturbances.
    pub fn new(bitrate: u32, seed: u64) -> Self {
        Self {
            bitrate: bitrate.max(1),
            now: 0,
            members: Vec::new(),
            random: fastrand::Rng::with_seed(seed),
            disturbance: 0.0,
            transfer: None,
            free_from: 0,
            events: VecDeque::new(),
            stats: BusStats::default(),
            recovers_by_itself: false,
        }
    }

    /// Sets whether a controller begins its recovery as soon as it is bus-off. Linux (`restart-ms`) and many
    /// controllers can recover automatically in this way. Frames that are queued during the recovery wait. Without this
    /// setting, [`recover`](Self::recover) begins the recovery.
    pub fn set_recovers_by_itself(&mut self, recovers: bool) {
        self.recovers_by_itself = recovers;
    }

    /// Adds a member. The new member acknowledges frames, receives all frames that end after this call, and repeats a
    /// frame if sending fails.
    pub fn join(&mut self) -> MemberId {
        self.members.push(Member {
            queue: VecDeque::new(),
            lines: None,
            counters: Counters::default(),
            may_start: 0,
            recovery: None,
            one_shot: false,
            last_try: false,
            acknowledges: true,
            left: false,
        });
        MemberId(self.members.len() - 1)
    }

    /// Removes the member permanently, with its queued frames. A frame that the member is sending is cut off.
    pub fn leave(&mut self, member: MemberId) {
        let member = &mut self.members[member.0];
        member.queue.clear();
        member.lines = None;
        member.recovery = None;
        member.left = true;
    }

    /// Clears the member's queued frames and error counters, as a reset does. The member is on the bus again. A frame
    /// that is on the bus ends normally, but is not sent again.
    pub fn clear(&mut self, member: MemberId) {
        let sends = self.transfer.as_ref().is_some_and(|transfer| transfer.arbitration.involves(member));
        let number = member;
        let member = &mut self.members[number.0];
        member.queue.truncate(usize::from(sends));
        member.last_try = sends;
        self.restart(number);
    }

    /// Resets a member's counters to their values after power-up.
    fn restart(&mut self, number: MemberId) {
        let member = &mut self.members[number.0];
        member.recovery = None;
        let before = core::mem::take(&mut member.counters).state().errors;
        let state = member.counters.state();
        if state.errors != before {
            self.events.push_back(BusEvent::State { member: number, state });
        }
    }

    /// Sets whether a member drops a frame after one failure. Otherwise, the member repeats the frame.
    pub fn set_one_shot(&mut self, member: MemberId, one_shot: bool) {
        self.members[member.0].one_shot = one_shot;
    }

    /// Sets whether a member acknowledges received frames.
    pub fn set_acknowledges(&mut self, member: MemberId, acknowledges: bool) {
        self.members[member.0].acknowledges = acknowledges;
    }

    /// Sets simulated faults between a member and the bus, for example the faults of a gateway. The simulated faults
    /// of a member do not affect the bus itself.
    pub fn set_faults(&mut self, member: MemberId, schedule: FaultSchedule) {
        let mut seeds = fastrand::Rng::with_seed(schedule.seed);
        let send = Line::new(schedule.send, seeds.u64(..));
        let receive = Line::new(schedule.receive, seeds.u64(..));
        self.members[member.0].lines = Some(Box::new((send, receive)));
    }

    /// Returns the counters of the simulated faults, for frames sent by the member and for frames received by the
    /// member.
    pub fn fault_stats(&self, member: MemberId) -> (FaultStats, FaultStats) {
        let lines = self.members[member.0].lines.as_deref();
        lines.map_or_else(Default::default, |(send, receive)| (send.stats(), receive.stats()))
    }

    /// Sets the share of frames in which a bit is disturbed on the bus, 0 to 1. An error frame destroys such a frame.
    pub fn set_disturbance(&mut self, share: f64) {
        self.disturbance = share;
    }

    /// Adds a frame at the end of a member's queue.
    pub fn queue(&mut self, member: MemberId, frame: CanFrame) -> Result<(), QueueError> {
        let now = time(self.now);
        let member = &mut self.members[member.0];
        if frame.is_fd() {
            return Err(QueueError::NotClassic);
        }
        if member.left {
            return Err(QueueError::Left);
        }
        if member.counters.bus_off() && !self.recovers_by_itself {
            return Err(QueueError::BusOff);
        }
        let waiting = member.queue.len() + member.lines.as_ref().map_or(0, |lines| lines.0.len());
        if waiting >= QUEUE {
            return Err(QueueError::Full(waiting));
        }
        match &mut member.lines {
            Some(lines) => lines.0.put(now, frame),
            None => member.queue.push_back(frame),
        }
        Ok(())
    }

    /// Returns the number of frames in the member's queue, including a frame that is on the bus.
    pub fn pending(&self, member: MemberId) -> usize {
        self.members[member.0].queue.len()
    }

    /// Returns the state of the member's controller.
    pub fn state(&self, member: MemberId) -> ControllerState {
        self.members[member.0].counters.state()
    }

    /// Starts the recovery of a member that is bus-off. The member has recovered after 128 sequences of 11 recessive
    /// bits (ISO 11898-1). On an idle bus, this takes 1408 bit times.
    pub fn recover(&mut self, member: MemberId) {
        let recessive_from = self.transfer.is_none().then_some(self.now);
        let member = &mut self.members[member.0];
        if member.counters.bus_off() && member.recovery.is_none() {
            member.recovery = Some(Recovery { left: RECOVERIES, recessive_from });
        }
    }

    /// Returns the virtual time, ns.
    pub fn now_ns(&self) -> u64 {
        self.now
    }

    /// Returns the counters of the bus.
    pub fn stats(&self) -> BusStats {
        BusStats { now_ns: self.now, ..self.stats }
    }

    /// Returns the time of the next action of the bus, ns, if the caller makes no other call before this time. Not
    /// every action causes an event.
    pub fn next_ns(&self) -> Option<u64> {
        if !self.events.is_empty() {
            return Some(self.now);
        }
        let sequence = self.bits_ns(RECESSIVE_RUN);
        let lines = self.members.iter().filter_map(|member| member.lines.as_deref());
        let due =
            lines.flat_map(|(send, receive)| [send.next_due(), receive.next_due()]).flatten().filter_map(ns);
        let recoveries = self.members.iter().filter_map(|member| member.recovery.as_ref()?.due(sequence));
        let wire = match &self.transfer {
            Some(transfer) => Some(transfer.end),
            None => self.next_start(),
        };
        due.chain(recoveries).chain(wire).min().map(|at| at.max(self.now))
    }

    /// Advances to the next event, or to `at_ns` if no event occurs before. The caller must repeat the call until it
    /// returns `None`. After each returned event, the current time is the time of this event. Frames that the caller
    /// then queues take part in arbitration from this time on.
    pub fn advance_to(&mut self, at_ns: u64) -> Option<TimedEvent> {
        let at_ns = at_ns.min(END_OF_TIME);
        loop {
            if let Some(what) = self.events.pop_front() {
                return Some(TimedEvent { at_ns: self.now, what });
            }
            match self.next_ns() {
                Some(next) if next <= at_ns => {
                    self.now = next;
                    self.step();
                }
                _ => {
                    self.now = self.now.max(at_ns);
                    return None;
                }
            }
        }
    }

    fn bits_ns(&self, bits: u32) -> u64 {
        (u64::from(bits) * 1_000_000_000).div_ceil(u64::from(self.bitrate))
    }

    /// Returns the earliest time at which the bus is free and a member with a queued frame is allowed to start.
    fn next_start(&self) -> Option<u64> {
        let ready = |member: &Member| member.on_bus() && !member.queue.is_empty();
        let start = |member: &Member| member.may_start.max(self.free_from);
        self.members.iter().filter(|member| ready(member)).map(start).min()
    }

    /// Handles all actions of the bus that are due now.
    fn step(&mut self) {
        let now = time(self.now);
        if self.transfer.as_ref().is_some_and(|transfer| transfer.end <= self.now)
            && let Some(transfer) = self.transfer.take()
        {
            self.finish(transfer);
            self.wire_is_recessive();
        }
        let sequence = self.bits_ns(RECESSIVE_RUN);
        for number in 0..self.members.len() {
            let recovery = self.members[number].recovery.as_ref();
            if recovery.and_then(|recovery| recovery.due(sequence)).is_some_and(|due| due <= self.now) {
                self.restart(MemberId(number));
            }
            let member = &mut self.members[number];
            let off = !member.on_bus();
            let Some(lines) = &mut member.lines else { continue };
            while let Some(frame) = lines.0.take(now) {
                match off {
                    true => self.events.push_back(BusEvent::Failed { member: MemberId(number), frame }),
                    false => member.queue.push_back(frame),
                }
            }
            while let Some(frame) = lines.1.take(now) {
                self.events.push_back(BusEvent::Received { member: MemberId(number), frame });
            }
        }
        // The bus first returns the events of this time. Frames that members send as a reaction to these events then
        // take part in the next arbitration.
        if self.events.is_empty() && self.transfer.is_none() {
            self.start();
        }
    }

    /// Updates the members' recovery from bus-off when a frame has ended. The sequence of 11 recessive bits begins
    /// with the acknowledge delimiter or error delimiter of this frame, and ends when the bus is free.
    fn wire_is_recessive(&mut self) {
        let from = self.free_from.saturating_sub(self.bits_ns(RECESSIVE_RUN));
        for recovery in self.members.iter_mut().filter_map(|member| member.recovery.as_mut()) {
            recovery.recessive_from.get_or_insert(from);
        }
    }

    /// Updates the members' recovery from bus-off when a frame begins. A sequence of fewer than 11 recessive bits
    /// before the frame does not count.
    fn wire_is_taken(&mut self) {
        let (now, sequence) = (self.now, self.bits_ns(RECESSIVE_RUN));
        for recovery in self.members.iter_mut().filter_map(|member| member.recovery.as_mut()) {
            let Some(from) = recovery.recessive_from.take() else { continue };
            let seen = now.saturating_sub(from) / sequence.max(1);
            recovery.left = recovery.left.saturating_sub(u32::try_from(seen).unwrap_or(u32::MAX));
        }
    }

    fn start(&mut self) {
        let ready = |(number, member): (usize, &Member)| {
            let frame = *member.queue.front()?;
            let starts = member.on_bus() && member.may_start.max(self.free_from) <= self.now;
            starts.then_some(Starter { member: MemberId(number), frame, counters: member.counters })
        };
        let starters: Vec<_> = self.members.iter().enumerate().filter_map(ready).collect();
        let Some(arbitration) = Arbitration::of(&starters) else { return };
        // Random numbers are drawn for every frame, so that a fault of one frame does not change the faults of the
        // other frames.
        let (luck, place) = (self.random.f64(), self.random.f64());
        let (bits, error) = if arbitration.senders.is_empty() {
            (arbitration.bits + ERROR_FRAME, None)
        } else if luck < self.disturbance {
            ((place * f64::from(arbitration.bits)) as u32 + 1 + ERROR_FRAME, Some(BusError::Disturbed))
        } else if !self.acknowledged(&arbitration.senders) {
            (arbitration.bits + TO_ACKNOWLEDGE + ERROR_FRAME, Some(BusError::NotAcknowledged))
        } else {
            (classic_frame_bits(&arbitration.frame).unwrap_or(0) - INTERMISSION, None)
        };
        let end = self.now + self.bits_ns(bits);
        self.free_from = end + self.bits_ns(INTERMISSION);
        self.stats.busy_ns += self.free_from - self.now;
        self.transfer = Some(Transfer { end, arbitration, error });
        self.wire_is_taken();
    }

    /// Returns `true` if a member other than the senders acknowledges the frame.
    fn acknowledged(&self, senders: &[MemberId]) -> bool {
        let acknowledges = |(number, member): (usize, &Member)| {
            member.on_bus() && member.acknowledges && !senders.contains(&MemberId(number))
        };
        self.members.iter().enumerate().any(acknowledges)
    }
}
