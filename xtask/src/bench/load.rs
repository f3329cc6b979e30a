//! Load of the computer by other programs. If this load is too high, `cargo xtask bench` does not judge the
//! measurements.
use std::time::Instant;

/// Largest share of one processor that other programs may use while the command judges figures.
pub(super) const OTHERS_MAX: f64 = 0.1;

/// Processor times from which the load by other programs is computed.
pub(super) struct Load {
    began: Instant,
    /// Processor times, s, of all programs, and of this program with its child processes. `None` if the operating
    /// system does not report the times.
    busy: Option<(f64, f64)>,
}

impl Load {
    pub(super) fn now() -> Self {
        Self { began: Instant::now(), busy: busy() }
    }

    /// Returns the share of one processor that other programs have used since the first measurement.
    pub(super) fn others(&self) -> Option<f64> {
        let ((all_before, own_before), (all, own)) = (self.busy?, busy()?);
        let others = (all - all_before) - (own - own_before);
        Some(others.max(0.0) / self.began.elapsed().as_secs_f64())
    }
}

/// Returns the processor time of all programs, and the processor time of this program with its child processes, s
/// (proc_stat(5) and proc_pid_stat(5)).
fn busy() -> Option<(f64, f64)> {
    /// Number of clock ticks per second in the files of /proc.
    const USER_HZ: f64 = 100.0;
    let sum = |fields: &[&str]| fields.iter().map(|field| field.parse::<f64>().ok()).sum::<Option<f64>>();
    let all = std::fs::read_to_string("/proc/stat").ok()?;
    let all: Vec<&str> = all.lines().next()?.split_whitespace().collect();
    // The sum includes the processor times of all fields except the idle times: user, nice, system, irq, softirq and
    // steal.
    let all = sum(all.get(1..4)?)? + sum(all.get(6..9)?)?;
    let own = std::fs::read_to_string("/proc/self/stat").ok()?;
    // Fields 14 to 17 of the line are utime, stime, cutime and cstime. The code counts the fields after the program
    // name, because the name may contain spaces.
    let own: Vec<&str> = own.rsplit_once(')')?.1.split_whitespace().collect();
    let own = sum(own.get(11..15)?)?;
    Some((all / USER_HZ, own / USER_HZ))
}
