//! Load of the machine: is it quiet enough for a verdict on the measurements?
use std::time::Instant;

/// Most of one processor that other programs may take while figures are judged.
pub const OTHERS_MAX: f64 = 0.1;

/// Processor times, to measure the load by other programs.
pub struct Load {
    began: Instant,
    /// Seconds of all programs, and of this one with its child processes, if the system reports them.
    busy: Option<(f64, f64)>,
}

impl Load {
    pub fn now() -> Self {
        Self { began: Instant::now(), busy: busy() }
    }

    /// Share of one processor that other programs have had since then.
    pub fn others(&self) -> Option<f64> {
        let ((all_before, own_before), (all, own)) = (self.busy?, busy()?);
        let others = (all - all_before) - (own - own_before);
        Some(others.max(0.0) / self.began.elapsed().as_secs_f64())
    }
}

/// Seconds that processors have worked: for all programs, and for this one and its children (proc_stat(5) and proc_pid_stat(5)).
fn busy() -> Option<(f64, f64)> {
    /// Clock ticks in a second.
    const USER_HZ: f64 = 100.0;
    let sum = |fields: &[&str]| fields.iter().map(|field| field.parse::<f64>().ok()).sum::<Option<f64>>();
    let all = std::fs::read_to_string("/proc/stat").ok()?;
    let all: Vec<&str> = all.lines().next()?.split_whitespace().collect();
    // user, nice, system; irq, softirq, steal: all but the idle ones.
    let all = sum(all.get(1..4)?)? + sum(all.get(6..9)?)?;
    let own = std::fs::read_to_string("/proc/self/stat").ok()?;
    // After the name, which may hold blanks: utime, stime, cutime and cstime are fields 14 to 17 of the line.
    let own: Vec<&str> = own.rsplit_once(')')?.1.split_whitespace().collect();
    let own = sum(own.get(11..15)?)?;
    Some((all / USER_HZ, own / USER_HZ))
}
