//! Time for benchmarks: of the processor, by this thread alone.

use std::time::Duration;

/// Time that this thread has had of a processor. While another program has it, this clock stands; what other programs leave
/// in caches still slows the thread down, so that of many measurements the least is the nearest to the truth.
#[derive(Clone, Copy, Debug)]
pub struct CpuTime(Duration);

impl CpuTime {
    /// Now.
    #[cfg(unix)]
    pub fn now() -> Self {
        let now = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
        let (seconds, ns) = (u64::try_from(now.tv_sec), u32::try_from(now.tv_nsec));
        Self(Duration::new(seconds.unwrap_or_default(), ns.unwrap_or_default()))
    }

    /// Now: where threads have no clock of their own, the time of the day.
    #[cfg(not(unix))]
    pub fn now() -> Self {
        static BEGIN: std::sync::OnceLock<std::time::Instant> = std::sync::OnceLock::new();
        Self(BEGIN.get_or_init(std::time::Instant::now).elapsed())
    }

    /// Nanoseconds since then.
    pub fn elapsed_ns(self) -> f64 {
        Self::now().0.saturating_sub(self.0).as_secs_f64() * 1e9
    }
}

/// Nanoseconds of the shortest of `rounds` runs of `work`.
pub fn least_ns(rounds: usize, mut work: impl FnMut()) -> f64 {
    let mut least = f64::INFINITY;
    for _ in 0..rounds {
        let begin = CpuTime::now();
        work();
        least = least.min(begin.elapsed_ns());
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The least counts each round, and a thread that sleeps takes no time of the processor.
    #[test]
    fn work_takes_time_and_sleep_does_not() {
        let mut rounds = 0;
        let sleep = least_ns(3, || {
            rounds += 1;
            std::thread::sleep(Duration::from_millis(20));
        });
        assert_eq!(rounds, 3);
        let begin = CpuTime::now();
        while begin.elapsed_ns() < 1e6 {
            std::hint::black_box(0);
        }
        if cfg!(unix) {
            assert!(sleep < 10e6, "{sleep} ns");
        }
    }
}
