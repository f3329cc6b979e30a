//! A bus inside this process.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, Instant};

use crate::{CanBus, CanError, CanFrame, ControllerState, ErrorState};

/// Maximum number of frames in the receive queue of a member.
const QUEUE: usize = 4096;

/// Default time for which a sender waits for a member whose queue is full.
const TIMEOUT: Duration = Duration::from_millis(100);

/// A bus without a name, which members join through this handle.
///
/// ```
/// use std::time::Duration;
/// use can_link::{CanBus, CanFrame, Id, VirtualHub};
/// let hub = VirtualHub::new();
/// let (mut a, mut b) = (hub.join(), hub.join());
/// a.send(&CanFrame::classic(Id::standard(5)?, &[1])?)?;
/// assert!(b.receive(Duration::ZERO)?.is_some());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Default)]
pub struct VirtualHub {
    shared: Arc<Shared>,
}

struct Shared {
    timeout: Duration,
    state: Mutex<State>,
    /// Condition variable that is notified after an entry is added to or removed from a queue.
    changed: Condvar,
}

impl Default for Shared {
    fn default() -> Self {
        Self { timeout: TIMEOUT, state: Mutex::default(), changed: Condvar::new() }
    }
}

#[derive(Default)]
struct State {
    next_member: u64,
    members: BTreeMap<u64, Member>,
}

/// An entry in the receive queue of a member. Entries are in the order of arrival.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Received {
    /// A frame of another member.
    Frame(CanFrame),
    /// Error state of the member's own controller.
    State(ErrorState),
}

struct Member {
    waiting: VecDeque<Received>,
    /// Maximum number of frames in the queue.
    limit: usize,
    /// `true` if no sender waits for the member. This applies to every guest. The value `true` also applies to a member
    /// for which a sender has waited without success, until the member takes an entry again.
    stalled: bool,
    /// `true` if no sender ever waits for the member.
    guest: bool,
    /// `true` while the member ignores all frames.
    deaf: bool,
    missed: u64,
}

impl Member {
    const ORDINARY: Self =
        Self { waiting: VecDeque::new(), limit: QUEUE, stalled: false, guest: false, deaf: false, missed: 0 };

    fn full(&self) -> bool {
        self.waiting.len() >= self.limit
    }

    fn deliver(&mut self, frame: &CanFrame) {
        if self.deaf {
            return;
        }
        if self.full() {
            self.stalled = true;
            self.missed += 1;
        } else {
            self.waiting.push_back(Received::Frame(*frame));
        }
    }

    /// Adds a state to the queue. States are rare, so they are never dropped.
    fn becomes(&mut self, state: ErrorState) {
        if !self.deaf {
            self.waiting.push_back(Received::State(state));
        }
    }
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, State> {
        // While the lock is held, no code runs that can panic.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait<'a>(&self, state: MutexGuard<'a, State>, for_at_most: Duration) -> MutexGuard<'a, State> {
        self.changed.wait_timeout(state, for_at_most).unwrap_or_else(PoisonError::into_inner).0
    }
}

impl VirtualHub {
    /// Creates a bus without members.
    pub fn new() -> Self {
        Self::default()
    }

    /// Creates a bus on which a sender waits up to `timeout` (default: 100 ms) for a member whose queue of 4096 frames
    /// is full. A member that takes no frame for that time misses frames until it takes a frame again. A slow member
    /// therefore does not block the bus for the other members.
    pub fn with_timeout(timeout: Duration) -> Self {
        Self { shared: Arc::new(Shared { timeout, ..Shared::default() }) }
    }

    /// Adds a member, which receives all frames that are sent after this call.
    pub fn join(&self) -> VirtualBus {
        self.add(Member::ORDINARY)
    }

    /// Adds a member for which senders never wait. The member misses frames if more than `limit` frames are in its
    /// queue. The member receives no frames until `set_deaf(false)` is called.
    pub(crate) fn join_as_guest(&self, limit: usize) -> VirtualBus {
        self.add(Member { limit, stalled: true, guest: true, deaf: true, ..Member::ORDINARY })
    }

    fn add(&self, member: Member) -> VirtualBus {
        let mut state = self.shared.state();
        let number = state.next_member;
        state.next_member += 1;
        state.members.insert(number, member);
        let membership = Membership { shared: Arc::clone(&self.shared), number };
        VirtualBus { membership: Arc::new(membership) }
    }

    /// Delivers a frame to one member without waiting for it.
    pub(crate) fn deliver_to(&self, frame: &CanFrame, number: u64) {
        if let Some(member) = self.shared.state().members.get_mut(&number) {
            member.deliver(frame);
        }
        self.shared.changed.notify_all();
    }

    /// Adds the state of a member's own controller to the member's queue, in order with the frames.
    pub(crate) fn report_state(&self, state: ErrorState, number: u64) {
        if let Some(member) = self.shared.state().members.get_mut(&number) {
            member.becomes(state);
        }
        self.shared.changed.notify_all();
    }

    /// Delivers a frame to all members except one, without waiting for any member.
    pub(crate) fn deliver(&self, frame: &CanFrame, except: Option<u64>) {
        let mut state = self.shared.state();
        for (number, member) in &mut state.members {
            if Some(*number) != except {
                member.deliver(frame);
            }
        }
        drop(state);
        self.shared.changed.notify_all();
    }
}

/// All named buses that have members.
static NAMED: Mutex<BTreeMap<String, Weak<Shared>>> = Mutex::new(BTreeMap::new());

/// A member of a bus inside this process.
pub struct VirtualBus {
    membership: Arc<Membership>,
}

/// Membership of a bus. The member leaves the bus when its last handle is dropped.
struct Membership {
    shared: Arc<Shared>,
    number: u64,
}

impl VirtualBus {
    /// Joins the bus with this name, which exists as long as it has members.
    pub fn join(name: &str) -> Self {
        let mut named = NAMED.lock().unwrap_or_else(PoisonError::into_inner);
        named.retain(|_, bus| bus.strong_count() > 0);
        let shared = named.get(name).and_then(Weak::upgrade).unwrap_or_default();
        named.insert(name.to_owned(), Arc::downgrade(&shared));
        VirtualHub { shared }.join()
    }

    /// Returns the number of frames that this member missed because it did not read these frames in time.
    pub fn missed(&self) -> u64 {
        self.shared().state().members.get(&self.number()).map_or(0, |member| member.missed)
    }

    fn shared(&self) -> &Shared {
        &self.membership.shared
    }

    /// Returns the number of this member in its hub.
    pub(crate) fn number(&self) -> u64 {
        self.membership.number
    }

    /// Returns a second handle of this member, for another thread.
    pub(crate) fn second_handle(&self) -> Self {
        Self { membership: Arc::clone(&self.membership) }
    }

    /// Stops or starts receiving. When the member stops receiving, the frames in its queue are dropped.
    pub(crate) fn set_deaf(&self, deaf: bool) {
        if let Some(member) = self.shared().state().members.get_mut(&self.number()) {
            member.deaf = deaf;
            if deaf {
                member.waiting.clear();
            }
        }
    }

    /// Removes the member from the bus, for all handles of the member.
    pub(crate) fn leave(&self) {
        self.shared().state().members.remove(&self.number());
        self.shared().changed.notify_all();
    }

    /// Waits for frames and states, and moves at most `most` entries to `received`. Returns `false` if the member has
    /// left the bus.
    pub(crate) fn take_some(&self, most: usize, timeout: Duration, received: &mut Vec<Received>) -> bool {
        let mut state = self.shared().state();
        let deadline = Instant::now() + timeout;
        loop {
            let Some(member) = state.members.get_mut(&self.number()) else { return false };
            if !member.waiting.is_empty() {
                let count = member.waiting.len().min(most);
                received.extend(member.waiting.drain(..count));
                member.stalled = member.guest;
                self.shared().changed.notify_all();
                return true;
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return true;
            }
            state = self.shared().wait(state, left);
        }
    }
}

impl CanBus for VirtualBus {
    fn send(&mut self, frame: &CanFrame) -> Result<(), CanError> {
        let shared = self.shared();
        let give_up = Instant::now().checked_add(shared.timeout);
        let mut state = shared.state();
        // The sender waits for the slowest member before any member gets the frame. All members therefore receive
        // frames in the same order.
        loop {
            let blocks = |(number, member): (&u64, &Member)| {
                *number != self.number() && member.full() && !member.stalled && !member.deaf
            };
            let blocked = state.members.iter().any(blocks);
            let left = give_up.map_or(TIMEOUT, |end| end.saturating_duration_since(Instant::now()));
            if !blocked || left.is_zero() {
                break;
            }
            state = shared.wait(state, left);
        }
        for (number, member) in &mut state.members {
            if *number != self.number() {
                member.deliver(frame);
            }
        }
        shared.changed.notify_all();
        Ok(())
    }

    fn receive(&mut self, timeout: Duration) -> Result<Option<CanFrame>, CanError> {
        // If the clock cannot represent the end of the timeout, the wait has no limit.
        let deadline = Instant::now().checked_add(timeout);
        let shared = self.shared();
        let mut state = shared.state();
        loop {
            if let Some(member) = state.members.get_mut(&self.number())
                && let Some(received) = member.waiting.pop_front()
            {
                member.stalled = member.guest;
                shared.changed.notify_all();
                match received {
                    Received::Frame(frame) => return Ok(Some(frame)),
                    // Only guests of a server receive states, and the server reads them with `take_some`.
                    Received::State(_) => continue,
                }
            }
            let left = deadline.map_or(timeout, |end| end.saturating_duration_since(Instant::now()));
            if left.is_zero() {
                return Ok(None);
            }
            state = shared.wait(state, left);
        }
    }

    /// Returns the state error active with counters of 0, because a bus inside a process has no transmission errors.
    fn state(&mut self) -> ControllerState {
        ControllerState::of_counters(0, 0)
    }
}

impl Drop for Membership {
    fn drop(&mut self) {
        self.shared.state().members.remove(&self.number);
        self.shared.changed.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Id;

    fn frame(number: u32) -> CanFrame {
        CanFrame::classic(Id::standard(0x100).unwrap(), &number.to_be_bytes()).unwrap()
    }

    fn take(bus: &mut VirtualBus) -> Option<CanFrame> {
        bus.receive(Duration::ZERO).unwrap()
    }

    #[test]
    fn all_others_hear_a_frame_once_and_in_order() {
        let hub = VirtualHub::new();
        let (mut a, mut b, mut c) = (hub.join(), hub.join(), hub.join());
        a.send(&frame(1)).unwrap();
        b.send(&frame(2)).unwrap();
        assert_eq!((take(&mut a), take(&mut a)), (Some(frame(2)), None));
        assert_eq!((take(&mut b), take(&mut b)), (Some(frame(1)), None));
        assert_eq!((take(&mut c), take(&mut c)), (Some(frame(1)), Some(frame(2))));
        assert_eq!(take(&mut c), None);
    }

    #[test]
    fn names_are_separate_buses_that_end_with_their_members() {
        let mut a = VirtualBus::join("names: a");
        let mut b = VirtualBus::join("names: b");
        let mut also_a = VirtualBus::join("names: a");
        a.send(&frame(1)).unwrap();
        assert_eq!(take(&mut b), None);
        drop(a);
        assert_eq!(take(&mut also_a), Some(frame(1)), "what was sent stays on the bus");
        drop(also_a);
        assert_eq!(take(&mut VirtualBus::join("names: a")), None);
    }

    #[test]
    fn a_member_that_takes_nothing_misses_frames_and_stops_nobody() {
        let hub = VirtualHub::with_timeout(Duration::ZERO);
        let (mut a, mut sleeper) = (hub.join(), hub.join());
        let count = QUEUE as u32 + 50;
        for number in 0..count {
            a.send(&frame(number)).unwrap();
        }
        assert_eq!(sleeper.missed(), 50);
        for number in 0..QUEUE as u32 {
            assert_eq!(take(&mut sleeper), Some(frame(number)));
        }
        assert_eq!(take(&mut sleeper), None);
        a.send(&frame(7)).unwrap();
        assert_eq!(take(&mut sleeper), Some(frame(7)));
    }

    #[test]
    fn a_slow_member_in_another_thread_misses_nothing() {
        let hub = VirtualHub::with_timeout(Duration::MAX);
        let (mut a, mut slow) = (hub.join(), hub.join());
        let count = 5 * QUEUE as u32;
        let received = std::thread::spawn(move || {
            let next = |_| slow.receive(Duration::MAX).unwrap().unwrap();
            let frames: Vec<_> = (0..count).map(next).collect();
            (frames, slow.missed())
        });
        for number in 0..count {
            a.send(&frame(number)).unwrap();
        }
        let (frames, missed) = received.join().unwrap();
        assert_eq!(missed, 0);
        assert!(frames.into_iter().eq((0..count).map(frame)));
    }

    #[test]
    fn endless_timeouts_are_no_overflow() {
        let hub = VirtualHub::new();
        let (mut a, mut b) = (hub.join(), hub.join());
        a.send(&frame(1)).unwrap();
        assert_eq!(b.receive(Duration::MAX).unwrap(), Some(frame(1)));
    }
}
