//! Delay of answers to the controller. The delay models a controller that reads its receiver at irregular times.
use std::collections::VecDeque;

use jtc_bus::Frame;

/// Model that delays the answers of each millisecond by a random number of ticks.
#[derive(Clone, Debug)]
pub struct Jitter {
    /// Longest delay, ticks.
    pub most_ms: u8,
    rng: fastrand::Rng,
    now: u64,
    /// Delayed answers, oldest first, each with the tick in which it arrives.
    waiting: VecDeque<(u64, Vec<Frame>)>,
}

impl Jitter {
    /// Creates the model without a delay. A value of [`most_ms`](Self::most_ms) above 0 adds a delay.
    pub fn new(seed: u64) -> Self {
        let rng = fastrand::Rng::with_seed(seed ^ 0x6A69_7474);
        Self { most_ms: 0, rng, now: 0, waiting: VecDeque::new() }
    }

    /// Processes a tick. The frames in `received` from index `first` on have arrived in this millisecond. The
    /// function removes these frames, and adds the frames whose delay has ended.
    pub fn delay(&mut self, received: &mut Vec<Frame>, first: usize) {
        self.now += 1;
        if self.most_ms == 0 && self.waiting.is_empty() {
            return;
        }
        let late = self.rng.u8(0..=self.most_ms);
        // An answer must not overtake an older answer.
        let last = self.waiting.back().map_or(0, |(due, _)| *due);
        self.waiting.push_back(((self.now + u64::from(late)).max(last), received.split_off(first)));
        while self.waiting.front().is_some_and(|(due, _)| *due <= self.now) {
            received.extend(self.waiting.pop_front().into_iter().flat_map(|(_, frames)| frames));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All answers must arrive in order and within the maximum delay. Each possible delay must occur.
    #[test]
    fn answers_are_late_but_none_is_lost_or_overtaken() {
        for most_ms in 0..=3u8 {
            let mut jitter = Jitter { most_ms, ..Jitter::new(1) };
            let (mut seen, mut delays) = (Vec::new(), [0; 4]);
            for tick in 0..1_000u16 {
                let mut received = vec![Frame::new(0x200, &tick.to_be_bytes()).expect("it fits")];
                jitter.delay(&mut received, 0);
                for frame in received {
                    let sent = u16::from_be_bytes([frame.data()[0], frame.data()[1]]);
                    delays[usize::from(tick - sent)] += 1;
                    seen.push(sent);
                }
            }
            assert!(seen.iter().copied().eq(0..seen.len() as u16) && seen.len() >= 997);
            let most = usize::from(most_ms);
            assert!(delays[..=most].iter().all(|&n| n > 50) && delays[most + 1..].iter().all(|&n| n == 0));
        }
    }
}
