//! A bus inside this process.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, Instant};

use crate::{CanBus, CanError, CanFrame};

/// Frames that wait for a member at most.
const QUEUE: usize = 4096;

/// How long a sender waits for a member whose queue is full, if nothing else is asked for.
const PATIENCE: Duration = Duration::from_millis(100);

/// A bus without a name, to be joined by whoever holds it.
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
    patience: Duration,
    state: Mutex<State>,
    /// Something was put into or taken from a queue.
    changed: Condvar,
}

impl Default for Shared {
    fn default() -> Self {
        Self { patience: PATIENCE, state: Mutex::default(), changed: Condvar::new() }
    }
}

#[derive(Default)]
struct State {
    next_member: u64,
    members: BTreeMap<u64, Member>,
}

#[derive(Default)]
struct Member {
    waiting: VecDeque<CanFrame>,
    /// It let a sender wait in vain and has taken nothing since.
    stalled: bool,
    missed: u64,
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, State> {
        // No code that can panic runs while the lock is held.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait<'a>(&self, state: MutexGuard<'a, State>, for_at_most: Duration) -> MutexGuard<'a, State> {
        self.changed.wait_timeout(state, for_at_most).unwrap_or_else(PoisonError::into_inner).0
    }
}

impl VirtualHub {
    /// A bus without members.
    pub fn new() -> Self {
        Self::default()
    }

    /// A bus where a sender waits so long for a member whose queue of 4096 frames is full (else 100 ms). A
    /// member that takes nothing for so long misses frames from then on until it takes one: it must not stop
    /// the bus for the others.
    pub fn with_patience(patience: Duration) -> Self {
        Self { shared: Arc::new(Shared { patience, ..Shared::default() }) }
    }

    /// A new member; it hears what is sent from now on.
    pub fn join(&self) -> VirtualBus {
        let mut state = self.shared.state();
        let number = state.next_member;
        state.next_member += 1;
        state.members.insert(number, Member::default());
        VirtualBus { shared: Arc::clone(&self.shared), number }
    }
}

/// Named buses that have members.
static NAMED: Mutex<BTreeMap<String, Weak<Shared>>> = Mutex::new(BTreeMap::new());

/// A member of a bus inside this process.
pub struct VirtualBus {
    shared: Arc<Shared>,
    number: u64,
}

impl VirtualBus {
    /// Joins the bus of a name, which exists as long as it has members.
    pub fn join(name: &str) -> Self {
        let mut named = NAMED.lock().unwrap_or_else(PoisonError::into_inner);
        named.retain(|_, bus| bus.strong_count() > 0);
        let shared = named.get(name).and_then(Weak::upgrade).unwrap_or_default();
        named.insert(name.to_owned(), Arc::downgrade(&shared));
        VirtualHub { shared }.join()
    }

    /// Frames this member missed because it did not take them.
    pub fn missed(&self) -> u64 {
        self.shared.state().members.get(&self.number).map_or(0, |member| member.missed)
    }
}

impl CanBus for VirtualBus {
    fn send(&mut self, frame: &CanFrame) -> Result<(), CanError> {
        let give_up = Instant::now().checked_add(self.shared.patience);
        let mut state = self.shared.state();
        let full = |member: &Member| member.waiting.len() >= QUEUE;
        // Waiting for the slowest before anyone gets the frame keeps one order for all.
        loop {
            let blocked = state.members.iter().any(|(n, m)| *n != self.number && full(m) && !m.stalled);
            let left = give_up.map_or(PATIENCE, |end| end.saturating_duration_since(Instant::now()));
            if !blocked || left.is_zero() {
                break;
            }
            state = self.shared.wait(state, left);
        }
        for (number, member) in &mut state.members {
            if *number == self.number {
                continue;
            }
            if full(member) {
                member.stalled = true;
                member.missed += 1;
            } else {
                member.waiting.push_back(*frame);
            }
        }
        self.shared.changed.notify_all();
        Ok(())
    }

    fn receive(&mut self, timeout: Duration) -> Result<Option<CanFrame>, CanError> {
        // A timeout beyond the clock's range is as good as none.
        let deadline = Instant::now().checked_add(timeout);
        let mut state = self.shared.state();
        loop {
            if let Some(member) = state.members.get_mut(&self.number)
                && let Some(frame) = member.waiting.pop_front()
            {
                member.stalled = false;
                self.shared.changed.notify_all();
                return Ok(Some(frame));
            }
            let left = deadline.map_or(timeout, |end| end.saturating_duration_since(Instant::now()));
            if left.is_zero() {
                return Ok(None);
            }
            state = self.shared.wait(state, left);
        }
    }
}

impl Drop for VirtualBus {
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
        let hub = VirtualHub::with_patience(Duration::ZERO);
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
        let hub = VirtualHub::with_patience(Duration::MAX);
        let (mut a, mut slow) = (hub.join(), hub.join());
        let count = 5 * QUEUE as u32;
        let heard = std::thread::spawn(move || {
            let next = |_| slow.receive(Duration::MAX).unwrap().unwrap();
            let frames: Vec<_> = (0..count).map(next).collect();
            (frames, slow.missed())
        });
        for number in 0..count {
            a.send(&frame(number)).unwrap();
        }
        let (frames, missed) = heard.join().unwrap();
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
