//! A bus with simulated faults, derived from a seed: loss, corruption, delay, duplication and reordering.

use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use crate::{CanBus, CanError, CanFrame, ControllerState};

/// Faults of the frames in one direction. Probabilities are per frame, from 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FaultConfig {
    /// Probability that a frame is lost.
    pub loss: f64,
    /// Probability that one bit of the payload is inverted.
    pub corruption: f64,
    /// Probability that a frame arrives twice.
    pub duplication: f64,
    /// Probability that a frame is delayed so that later frames overtake it.
    pub reordering: f64,
    /// Delay of a frame that later frames overtake, s.
    pub reordering_hold_s: f64,
    /// Shortest delay of every frame, s; this delay does not change the order.
    pub delay_min_s: f64,
    /// Longest delay of a frame, s.
    pub delay_max_s: f64,
}

/// Faults of both directions of one member.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FaultSchedule {
    /// Seed of the faults; equal seeds and frames produce equal faults.
    pub seed: u64,
    /// Faults of frames that the member sends.
    pub send: FaultConfig,
    /// Faults of frames that the member receives.
    pub receive: FaultConfig,
}

/// Counters of the faults.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FaultStats {
    /// Number of frames that entered the simulated line.
    pub frames: u64,
    /// Number of lost frames.
    pub lost: u64,
    /// Number of corrupted frames.
    pub corrupted: u64,
    /// Number of duplicated frames.
    pub doubled: u64,
    /// Number of frames delayed by reordering.
    pub reordered: u64,
}

/// Frames in transit in one direction.
pub(crate) struct Line {
    faults: FaultConfig,
    random: fastrand::Rng,
    /// Frames in transit and their delivery times, earliest first. Frames with equal delivery times stay in the order
    /// in which they were added.
    under_way: Vec<(Duration, CanFrame)>,
    /// Delivery time of the last frame that was not selected for reordering. Such frames do not overtake each other.
    last_due: Duration,
    stats: FaultStats,
}

/// Converts a setting in seconds to a duration; an invalid setting means no delay.
fn seconds(value: f64) -> Duration {
    Duration::try_from_secs_f64(value).unwrap_or_default()
}

impl Line {
    pub(crate) fn new(faults: FaultConfig, seed: u64) -> Self {
        let random = fastrand::Rng::with_seed(seed);
        Self { faults, random, under_way: Vec::new(), last_due: Duration::ZERO, stats: FaultStats::default() }
    }

    /// Adds a frame. Draws the same number of random values for every frame, in the same order. A change of one fault
    /// setting (such as `loss`) therefore does not change the other simulated faults.
    pub(crate) fn put(&mut self, now: Duration, mut frame: CanFrame) {
        let FaultConfig { loss, corruption, duplication, reordering, .. } = self.faults;
        let [lose, corrupt, double, hold] =
            [loss, corruption, duplication, reordering].map(|share| self.random.f64() < share);
        let (place, jitter) = (self.random.f64(), self.random.f64());
        self.stats.frames += 1;
        if lose {
            self.stats.lost += 1;
            return;
        }
        if corrupt && !frame.data().is_empty() {
            let bit = (place * (frame.data().len() * 8) as f64) as usize;
            frame.data_mut()[bit / 8] ^= 1 << (bit % 8);
            self.stats.corrupted += 1;
        }
        let (shortest, longest) = (seconds(self.faults.delay_min_s), seconds(self.faults.delay_max_s));
        let spread = longest.saturating_sub(shortest).mul_f64(jitter);
        let mut due = now.saturating_add(shortest).saturating_add(spread).max(self.last_due);
        if hold {
            due = due.saturating_add(seconds(self.faults.reordering_hold_s));
            self.stats.reordered += 1;
        } else {
            self.last_due = due;
        }
        self.insert(due, frame);
        if double {
            self.insert(due, frame);
            self.stats.doubled += 1;
        }
    }

    fn insert(&mut self, due: Duration, frame: CanFrame) {
        let at = self.under_way.partition_point(|(other, _)| *other <= due);
        self.under_way.insert(at, (due, frame));
    }

    pub(crate) fn take(&mut self, now: Duration) -> Option<CanFrame> {
        let (due, frame) = *self.under_way.first()?;
        (due <= now).then(|| {
            self.under_way.remove(0);
            frame
        })
    }

    pub(crate) fn next_due(&self) -> Option<Duration> {
        self.under_way.first().map(|(due, _)| *due)
    }

    /// Returns the number of frames that are in transit.
    pub(crate) fn len(&self) -> usize {
        self.under_way.len()
    }

    pub(crate) fn stats(&self) -> FaultStats {
        self.stats
    }
}

/// A bus with simulated faults of the frames to and from this member.
///
/// ```
/// use can_link::{FaultConfig, Faulty, FaultSchedule, VirtualBus};
/// let schedule = FaultSchedule { seed: 1, receive: FaultConfig { loss: 0.01, ..FaultConfig::default() }, ..FaultSchedule::default() };
/// let bus = Faulty::new(VirtualBus::join("lossy"), schedule);
/// ```
///
/// Frames in transit to other members are delivered while this member sends or receives.
pub struct Faulty<B> {
    bus: B,
    out: Line,
    received: Line,
    clock: Box<dyn FnMut() -> Duration + Send>,
}

impl<B: CanBus> Faulty<B> {
    /// Creates the bus with real-time delays.
    pub fn new(bus: B, schedule: FaultSchedule) -> Self {
        let start = Instant::now();
        Self::with_clock(bus, schedule, move || start.elapsed())
    }

    /// Creates the bus with delays that are measured by the caller's clock, which must not run backwards. With a
    /// clock in virtual time, the delays are repeatable.
    pub fn with_clock(
        bus: B,
        schedule: FaultSchedule,
        clock: impl FnMut() -> Duration + Send + 'static,
    ) -> Self {
        let mut seeds = fastrand::Rng::with_seed(schedule.seed);
        let out = Line::new(schedule.send, seeds.u64(..));
        let received = Line::new(schedule.receive, seeds.u64(..));
        Self { bus, out, received, clock: Box::new(clock) }
    }

    /// Returns the fault counters of the received frames.
    pub fn received_stats(&self) -> FaultStats {
        self.received.stats
    }

    /// Returns the underlying bus; frames that are still in transit are lost.
    pub fn into_inner(self) -> B {
        self.bus
    }

    fn send_due(&mut self, now: Duration) -> Result<(), CanError> {
        while let Some(frame) = self.out.take(now) {
            self.bus.send(&frame)?;
        }
        Ok(())
    }
}

impl<B: CanBus> CanBus for Faulty<B> {
    fn carries(&self, frame: &CanFrame) -> Result<(), CanError> {
        self.bus.carries(frame)
    }

    fn send(&mut self, frame: &CanFrame) -> Result<(), CanError> {
        let now = (self.clock)();
        self.out.put(now, *frame);
        self.send_due(now)
    }

    fn receive(&mut self, timeout: Duration) -> Result<Option<CanFrame>, CanError> {
        let start = (self.clock)();
        // The loop also adds up its own waiting time, because a virtual clock does not necessarily advance during a
        // wait.
        let mut waited = Duration::ZERO;
        loop {
            let now = (self.clock)();
            self.send_due(now)?;
            // All frames that have already arrived enter the simulated line before the first frame is returned,
            // because the line sorts them by delivery time.
            while let Some(frame) = self.bus.receive(Duration::ZERO)? {
                self.received.put(now, frame);
            }
            if let Some(frame) = self.received.take(now) {
                return Ok(Some(frame));
            }
            let left = timeout.saturating_sub(now.saturating_sub(start).max(waited));
            if left.is_zero() {
                return Ok(None);
            }
            let due = [self.received.next_due(), self.out.next_due()].into_iter().flatten().min();
            let until_due = due.map_or(left, |due| due.saturating_sub(now));
            let wait = left.min(until_due).max(Duration::from_micros(50));
            match self.bus.receive(wait)? {
                Some(frame) => {
                    let now = (self.clock)();
                    self.received.put(now, frame);
                }
                None => waited += wait,
            }
        }
    }

    fn state(&mut self) -> ControllerState {
        self.bus.state()
    }

    fn times_bus_off(&self) -> u64 {
        self.bus.times_bus_off()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Id, VirtualBus, VirtualHub};
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU64, Ordering};

    /// A test bench with a clock in ms. Only the test advances this clock.
    struct Bench {
        faulty: Faulty<VirtualBus>,
        peer: VirtualBus,
        now_ms: Arc<AtomicU64>,
    }

    fn bench(send: FaultConfig, receive: FaultConfig, seed: u64) -> Bench {
        let hub = VirtualHub::new();
        let now_ms = Arc::new(AtomicU64::new(0));
        let clock = Arc::clone(&now_ms);
        let faulty = Faulty::with_clock(hub.join(), FaultSchedule { seed, send, receive }, move || {
            Duration::from_millis(clock.load(Ordering::Relaxed))
        });
        Bench { faulty, peer: hub.join(), now_ms }
    }

    fn frame(number: u32) -> CanFrame {
        CanFrame::classic(Id::standard(0x100).unwrap(), &number.to_be_bytes()).unwrap()
    }

    fn numbers(bus: &mut impl CanBus) -> Vec<u32> {
        std::iter::from_fn(|| bus.receive(Duration::ZERO).unwrap())
            .map(|frame| u32::from_be_bytes(frame.data().try_into().unwrap()))
            .collect()
    }

    #[test]
    fn without_faults_it_is_the_bus() {
        let mut bench = bench(FaultConfig::default(), FaultConfig::default(), 1);
        for number in 0..100 {
            bench.faulty.send(&frame(number)).unwrap();
            bench.peer.send(&frame(number)).unwrap();
        }
        let all: Vec<u32> = (0..100).collect();
        assert_eq!(numbers(&mut bench.peer), all);
        assert_eq!(numbers(&mut bench.faulty), all);
        assert_eq!(bench.faulty.receive(Duration::from_millis(1)).unwrap(), None);
    }

    #[test]
    fn faults_come_as_often_as_asked_for() {
        let receive = FaultConfig { loss: 0.1, corruption: 0.2, duplication: 0.3, ..FaultConfig::default() };
        let mut bench = bench(FaultConfig::default(), receive, 2);
        let mut received = Vec::new();
        for number in 0..4000 {
            bench.peer.send(&frame(number)).unwrap();
            received.extend(numbers(&mut bench.faulty));
        }
        let stats = bench.faulty.received_stats();
        assert_eq!(stats.frames, 4000);
        assert_eq!(received.len() as u64, 4000 - stats.lost + stats.doubled);
        // Each count divided by 4000 must be close to its expected share. The standard deviation of this quotient is
        // less than 0.008, so the tolerance of 0.05 is at least six standard deviations.
        for (count, share) in [(stats.lost, 0.1), (stats.corrupted, 0.18), (stats.doubled, 0.27)] {
            assert!((count as f64 / 4000.0 - share).abs() < 0.05, "{stats:?}");
        }
    }

    #[test]
    fn corruption_turns_exactly_one_bit() {
        let send = FaultConfig { corruption: 1.0, ..FaultConfig::default() };
        let mut bench = bench(send, FaultConfig::default(), 3);
        for number in 0..500 {
            bench.faulty.send(&frame(number)).unwrap();
            assert_eq!((numbers(&mut bench.peer)[0] ^ number).count_ones(), 1);
        }
        // An empty frame contains no bit that can be corrupted.
        let empty = CanFrame::classic(Id::standard(1).unwrap(), &[]).unwrap();
        bench.faulty.send(&empty).unwrap();
        assert_eq!(bench.peer.receive(Duration::ZERO).unwrap(), Some(empty));
    }

    #[test]
    fn delays_keep_the_order() {
        let send = FaultConfig { delay_min_s: 0.002, delay_max_s: 0.010, ..FaultConfig::default() };
        let mut bench = bench(send, FaultConfig::default(), 4);
        for number in 0..20 {
            bench.faulty.send(&frame(number)).unwrap();
        }
        bench.now_ms.store(1, Ordering::Relaxed);
        assert_eq!(numbers(&mut bench.faulty), []);
        assert_eq!(numbers(&mut bench.peer), [], "the shortest delay is 2 ms");
        bench.now_ms.store(10, Ordering::Relaxed);
        assert_eq!(numbers(&mut bench.faulty), []);
        assert_eq!(numbers(&mut bench.peer), (0..20).collect::<Vec<_>>());
    }

    #[test]
    fn reordered_frames_are_overtaken() {
        let receive = FaultConfig { reordering: 0.3, reordering_hold_s: 0.005, ..FaultConfig::default() };
        let mut bench = bench(FaultConfig::default(), receive, 5);
        for number in 0..100 {
            bench.peer.send(&frame(number)).unwrap();
        }
        let mut received = numbers(&mut bench.faulty);
        let first = received.len();
        bench.now_ms.store(5, Ordering::Relaxed);
        received.extend(numbers(&mut bench.faulty));
        assert_eq!(bench.faulty.received_stats().reordered as usize, 100 - first);
        assert!((40..100).contains(&first) && !received.is_sorted());
        received.sort();
        assert_eq!(received, (0..100).collect::<Vec<_>>());
    }

    #[test]
    fn the_same_seed_gives_the_same_faults() {
        let faults = FaultConfig {
            loss: 0.2,
            corruption: 0.2,
            duplication: 0.2,
            reordering: 0.2,
            reordering_hold_s: 0.003,
            delay_min_s: 0.001,
            delay_max_s: 0.004,
        };
        let run = |seed| {
            let mut bench = bench(faults, faults, seed);
            let mut received = Vec::new();
            for number in 0..300 {
                bench.now_ms.store(number.into(), Ordering::Relaxed);
                bench.faulty.send(&frame(number)).unwrap();
                bench.peer.send(&frame(number)).unwrap();
                received.push((numbers(&mut bench.faulty), numbers(&mut bench.peer)));
            }
            received
        };
        assert_eq!(run(7), run(7));
        assert_ne!(run(7), run(8));
    }

    #[test]
    fn invalid_numbers_in_the_schedule_is_no_panic() {
        for bad in [f64::NAN, f64::INFINITY, -1.0, 1.8e19, f64::MAX] {
            let faults = FaultConfig {
                loss: 0.0,
                corruption: bad,
                duplication: bad,
                reordering: bad,
                reordering_hold_s: bad,
                delay_min_s: bad,
                delay_max_s: bad,
            };
            let mut bench = bench(faults, faults, 9);
            bench.faulty.send(&frame(1)).unwrap();
            bench.peer.send(&frame(1)).unwrap();
            assert!(numbers(&mut bench.faulty).len() <= 2);
        }
    }
}
