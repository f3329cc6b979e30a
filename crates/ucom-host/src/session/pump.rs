//! Moves frames between the bus and the PC side. Received frames are delivered to the master before a wait of a
//! procedure can end, so that a frame that has arrived in time never causes a timeout. Sending frames and receiving
//! frames cannot block each other.

use std::time::Duration;

use ucom::{Foreign, Frame};

use super::error::SessionError;
use crate::master::Master;

/// Longest wait for a frame. The loop checks for Ctrl-C at this interval.
pub const LOOK: Duration = Duration::from_millis(50);
/// Limit of the frames that are delivered to the master before the due frames are sent. `LONGEST_US` limits the time
/// of the delivery, µs. With these limits, the PC continues to send heartbeats on a flooded bus.
const MOST_RECEIVED: usize = 2000;
const LONGEST_US: u64 = 50_000;
/// Limit of the frames that the PC sends before it handles received frames.
const MOST_SENT: usize = 64;
/// Age in µs above which the loop assumes that frames were delivered to the master, if the bus is flooded permanently.
/// [`Pump::flush`] also ends after this time.
const BEHIND_US: u64 = 1_000_000;

/// Interface to a bus with a clock.
pub trait Line {
    /// Returns the time in µs since an arbitrary start.
    fn now_us(&self) -> u64;
    /// Sends a frame.
    fn send(&mut self, frame: &Frame) -> Result<(), SessionError>;
    /// Returns the next received frame. The function waits at most `timeout`; it does not wait if `timeout` is zero.
    fn receive(&mut self, timeout: Duration) -> Result<Option<Result<Frame, Foreign>>, SessionError>;
}

/// State of the loop that moves frames.
#[derive(Debug, Default)]
pub struct Pump {
    /// Time up to which all received frames have been delivered to the master, µs.
    received_us: u64,
}

impl Pump {
    /// Waits for a frame until the next action of the master is due, at most `patience`. The function delivers all received frames, and
    /// then sends the due frames.
    pub fn turn(
        &mut self,
        master: &mut Master,
        line: &mut impl Line,
        patience: Duration,
    ) -> Result<(), SessionError> {
        let due = master.next_deadline().map_or(u64::MAX, |at| at.saturating_sub(line.now_us()));
        self.receive(master, line, patience.min(LOOK).min(Duration::from_micros(due)))?;
        self.send(master, line).map(drop)
    }

    /// Sends all queued frames.
    pub fn flush(&mut self, master: &mut Master, line: &mut impl Line) -> Result<(), SessionError> {
        let end = line.now_us() + BEHIND_US;
        while self.send(master, line)? && line.now_us() < end {}
        Ok(())
    }

    fn receive(
        &mut self,
        master: &mut Master,
        line: &mut impl Line,
        mut wait: Duration,
    ) -> Result<(), SessionError> {
        let mut first = None;
        for _ in 0..MOST_RECEIVED {
            let asked = line.now_us();
            match line.receive(wait)? {
                Some(frame) => {
                    let now = line.now_us();
                    master.handle(now, frame);
                    if now - *first.get_or_insert(now) > LONGEST_US {
                        break;
                    }
                }
                // No frame was waiting, so all frames that arrived before the time `asked` have been delivered.
                None if wait.is_zero() => {
                    self.received_us = asked;
                    return Ok(());
                }
                None => {}
            }
            wait = Duration::ZERO;
        }
        self.received_us = self.received_us.max(line.now_us().saturating_sub(BEHIND_US));
        Ok(())
    }

    /// Sends the frames that are due. The function returns `true` if more frames may be waiting.
    fn send(&mut self, master: &mut Master, line: &mut impl Line) -> Result<bool, SessionError> {
        for _ in 0..MOST_SENT {
            let Some(frame) = master.poll_behind(line.now_us(), self.received_us) else { return Ok(false) };
            line.send(&frame)?;
        }
        Ok(true)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use crate::master::{Event, Outcome, Request};
    use ucom::Profile;

    use super::*;

    /// Simulated bus with board 1, which answers PC_INFO within a millisecond. The process of the PC side sometimes loses the CPU.
    struct Bench {
        now: u64,
        /// Frames that will arrive at the PC, sorted by time.
        coming: VecDeque<(u64, Frame)>,
        /// Times in µs for which the process loses the CPU, before and after each access to the bus. Each of these times is used once.
        lost: VecDeque<u64>,
        /// Period of the frames that another node of the bus sends, µs.
        flood_us: Option<u64>,
        flooded_up_to: u64,
        sent: Vec<(u64, Frame)>,
    }

    fn frame(text: &str) -> Frame {
        text.parse().unwrap()
    }

    impl Bench {
        fn new(lost: impl IntoIterator<Item = u64>) -> Self {
            let (coming, sent) = (VecDeque::new(), Vec::new());
            Self { now: 0, coming, lost: lost.into_iter().collect(), flood_us: None, flooded_up_to: 0, sent }
        }

        fn lose(&mut self) {
            self.now += self.lost.pop_front().unwrap_or(0);
        }

        fn next_at(&self) -> Option<u64> {
            let flood = self.flood_us.map(|us| self.flooded_up_to + us);
            self.coming.front().map(|(at, _)| *at).into_iter().chain(flood).min()
        }

        fn times_of(&self, text: &str) -> Vec<u64> {
            self.sent.iter().filter(|(_, f)| *f == frame(text)).map(|(at, _)| *at).collect()
        }

        /// Runs a request until the procedure ends.
        fn run(&mut self, master: &mut Master, request: Request) -> Result<Outcome, crate::master::Error> {
            let mut pump = Pump::default();
            let id = master.start(self.now, request).unwrap();
            while self.now < 100_000_000 {
                pump.turn(master, self, LOOK).unwrap();
                while let Some(event) = master.take_event() {
                    if let Event::Done { id: done, result } = event
                        && done == id
                    {
                        return result;
                    }
                }
            }
            panic!("no end within 100 s");
        }
    }

    impl Line for Bench {
        fn now_us(&self) -> u64 {
            self.now
        }

        fn send(&mut self, sent: &Frame) -> Result<(), SessionError> {
            self.lose();
            self.now += 20;
            self.sent.push((self.now, *sent));
            if *sent == frame("201#") {
                let answer = ["141#2100011B34126E38", "141#0100", "141#68656164"];
                self.coming.extend((1..).zip(answer).map(|(i, f)| (self.now + 300 * i, frame(f))));
            }
            self.lose();
            Ok(())
        }

        fn receive(&mut self, timeout: Duration) -> Result<Option<Result<Frame, Foreign>>, SessionError> {
            self.lose();
            let end = self.now + timeout.as_micros() as u64;
            let next = self.next_at().filter(|at| *at <= end);
            self.now = next.map_or(end, |at| at.max(self.now)) + 5;
            let received = next.map(|at| {
                if self.coming.front().is_some_and(|(first, _)| *first == at) {
                    return Ok(self.coming.pop_front().unwrap().1);
                }
                self.flooded_up_to = at;
                Ok(frame("385#0000640065006600"))
            });
            self.lose();
            Ok(received)
        }
    }

    /// Returns a pseudo-random number of the generator splitmix64.
    fn random(seed: &mut u64) -> u64 {
        *seed = seed.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (*seed ^ (*seed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z ^ (z >> 27)
    }

    /// The process may lose the CPU at any point, for longer than an answer takes. A frame that arrived during that time must prevent a
    /// timeout.
    #[test]
    fn a_lost_cpu_is_no_silence() {
        let ask = |lost: Vec<u64>| {
            let mut bench = Bench::new(lost.clone());
            let result = bench.run(&mut Master::new(Profile::default()), Request::Info { board: 1 });
            let Ok(Outcome::Info(seen)) = result else { panic!("{lost:?}: {result:?}") };
            assert_eq!(seen.description.as_deref(), Some("head"), "{lost:?}");
            assert_eq!(bench.times_of("201#").len(), 1, "asked once: {lost:?}");
        };
        for at in 0..60 {
            ask((0..=at).map(|i| if i == at { 130_000 } else { 0 }).collect());
        }
        for seed in 0..2_000 {
            let mut state = seed;
            ask((0..60).map(|_| random(&mut state) % 4).map(|n| if n == 0 { 110_000 } else { 0 }).collect());
        }
    }

    /// D-50: heartbeats and timeouts continue on a bus that carries more frames than the PC can deliver to the master.
    #[test]
    fn d50_a_flood_does_not_stop_heartbeats() {
        let mut bench = Bench::new([]);
        // A frame arrives every 4 µs, but the PC needs 5 µs to receive a frame.
        bench.flood_us = Some(4);
        let mut master = Master::new(Profile::default());
        master.begin_session(0);
        let result = bench.run(&mut master, Request::Info { board: 9 });
        assert!(
            matches!(
                result,
                Err(crate::master::Error::Exchange(crate::master::ExchangeError::NoAnswer { board: 9, .. }))
            ),
            "{result:?}"
        );
        let alive = bench.times_of("680#");
        assert!(bench.now < 10_000_000, "{} µs", bench.now);
        assert!(alive.len() as u64 >= bench.now / 500_000, "{alive:?} up to {}", bench.now);
        assert!(alive.windows(2).all(|w| (400_000..600_000).contains(&(w[1] - w[0]))), "{alive:?}");
    }
}
