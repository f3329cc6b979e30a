//! Serial line to the host. Both directions have the same baud rate. Faults are possible only in the direction to the
//! device.
use std::collections::VecDeque;

/// Picoseconds per microsecond. With this resolution, the duration of a byte at any usual bit rate is accurate enough
/// for simulations of several days.
const PS_PER_US: u64 = 1_000_000;

/// A direction of the serial line.
#[derive(Clone, Debug)]
pub struct Line {
    /// Duration of a byte (10 bits), ps; 0 if transmission takes no time.
    byte_ps: u64,
    queue: VecDeque<u8>,
    /// Time at which the first byte of the queue has arrived, ps.
    front_ps: u64,
    /// Number of bytes that have arrived at the receiver.
    pub carried: u64,
}

impl Line {
    /// Creates one direction of a line with `baud` bit/s, 8N1. If `baud` is `None`, bytes arrive without delay.
    pub fn new(baud: Option<u32>) -> Self {
        let byte_ps = baud.map_or(0, |rate| 10_000_000_000_000 / u64::from(rate.max(1)));
        Self { byte_ps, queue: VecDeque::new(), front_ps: 0, carried: 0 }
    }

    /// Adds bytes to the line at `now_us`, after the bytes that are already on the line.
    pub fn write(&mut self, now_us: u64, bytes: &[u8]) {
        if self.queue.is_empty() {
            // The line is empty, so the transmitter is idle. The first new byte arrives one byte duration after
            // `now_us`.
            self.front_ps = now_us * PS_PER_US + self.byte_ps;
        }
        self.queue.extend(bytes);
    }

    /// Moves at most `most` bytes that have arrived by `now_us` into `out`.
    pub fn arrived(&mut self, now_us: u64, most: usize, out: &mut Vec<u8>) {
        let now_ps = now_us * PS_PER_US;
        if self.queue.is_empty() || self.front_ps > now_ps {
            return;
        }
        let by_time = match (now_ps - self.front_ps).checked_div(self.byte_ps) {
            Some(more) => usize::try_from(more + 1).unwrap_or(usize::MAX),
            None => usize::MAX,
        };
        let count = self.queue.len().min(by_time).min(most);
        out.extend(self.queue.drain(..count));
        self.front_ps += self.byte_ps * count as u64;
        self.carried += count as u64;
    }

    /// Returns the number of bytes that have not arrived yet.
    pub fn pending(&self) -> usize {
        self.queue.len()
    }

    /// Returns `true` if the line is empty.
    pub fn is_idle(&self) -> bool {
        self.queue.is_empty()
    }

    /// Drops all bytes on the line.
    pub fn clear(&mut self) {
        self.queue.clear();
    }
}

/// Current faults of a line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LineFault {
    /// Share of bytes that are lost, 0..1.
    pub lost: f64,
    /// Share of bytes with a flipped bit, 0..1.
    pub flipped: f64,
    /// `true` if bytes are delayed until the fault ends.
    pub held: bool,
}

impl LineFault {
    /// Applies the fault to `bytes`. `rng` selects the affected bytes.
    pub fn apply(&self, bytes: &mut Vec<u8>, rng: &mut fastrand::Rng) {
        if self.lost > 0.0 {
            bytes.retain(|_| rng.f64() >= self.lost);
        }
        if self.flipped > 0.0 {
            for byte in bytes {
                if rng.f64() < self.flipped {
                    *byte ^= 1 << rng.u8(0..8);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn take(line: &mut Line, now_us: u64) -> usize {
        let mut out = Vec::new();
        line.arrived(now_us, usize::MAX, &mut out);
        out.len()
    }

    #[test]
    fn j01_bytes_leave_at_a_tenth_of_the_baud_rate() {
        for baud in [115_200, 921_600, 3_000_000, 15_000_000] {
            let mut line = Line::new(Some(baud));
            line.write(0, &vec![7; baud as usize]);
            assert_eq!(take(&mut line, 0), 0);
            let mut sum = 0;
            for ms in 1..=1000 {
                sum += take(&mut line, ms * 1000);
            }
            let expected = baud as usize / 10;
            assert!(sum.abs_diff(expected) <= 2, "{baud} Bd carried {sum} of {expected} bytes in a second");
        }
    }

    #[test]
    fn an_idle_line_does_not_save_up_time() {
        let mut line = Line::new(Some(115_200));
        line.write(0, &[1]);
        assert_eq!(take(&mut line, 1000), 1);
        line.write(50_000, &[1, 2]);
        assert_eq!(take(&mut line, 50_086), 0);
        assert_eq!(take(&mut line, 50_087), 1);
        assert_eq!(take(&mut line, 51_000), 1);
        assert!(line.is_idle());
    }

    #[test]
    fn faults_of_the_line_repeat_with_their_seed() {
        let fault = LineFault { lost: 0.1, flipped: 0.2, held: false };
        let run = |seed| {
            let mut bytes: Vec<u8> = (0..200).collect();
            fault.apply(&mut bytes, &mut fastrand::Rng::with_seed(seed));
            bytes
        };
        assert_eq!(run(5), run(5));
        assert_ne!(run(5), run(6));
        assert!(run(5).len() < 200);
    }
}
