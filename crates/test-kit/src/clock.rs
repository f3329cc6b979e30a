//! Clock for benchmarks. The clock measures only the processor time of the current thread.

use std::time::Duration;

/// Processor time of the current thread. The clock stops while the processor runs another program. Other programs still
/// slow the thread down because they fill the caches, so the minimum of many measurements is nearest to the true time.
#[derive(Clone, Copy, Debug)]
pub struct CpuTime(Duration);

impl CpuTime {
    /// Returns the present processor time.
    #[cfg(unix)]
    pub fn now() -> Self {
        let now = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
        let (seconds, ns) = (u64::try_from(now.tv_sec), u32::try_from(now.tv_nsec));
        Self(Duration::new(seconds.unwrap_or_default(), ns.unwrap_or_default()))
    }

    /// Returns the present time. On systems without a clock per thread, this is a monotonic clock of the computer.
    #[cfg(not(unix))]
    pub fn now() -> Self {
        static BEGIN: std::sync::OnceLock<std::time::Instant> = std::sync::OnceLock::new();
        Self(BEGIN.get_or_init(std::time::Instant::now).elapsed())
    }

    /// Returns the processor time since this time, ns.
    pub fn elapsed_ns(self) -> f64 {
        Self::now().0.saturating_sub(self.0).as_secs_f64() * 1e9
    }
}

/// Returns the duration, in nanoseconds, of the shortest of `rounds` runs of `work`.
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

    /// The function must return the minimum, and a sleeping thread must use no processor time.
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
