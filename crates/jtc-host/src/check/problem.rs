//! Problem of a trajectory, with its kind, joint, first occurrence and worst occurrence.

use std::fmt;

use jtc_wire::Joint;
use serde::Serialize;

use super::kind::{HOLD_SHARE, ProblemKind};

/// Point or time of the path at which a problem occurs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Seen {
    /// Joint in which the problem occurs; `None` if the problem concerns the whole trajectory.
    pub joint: Option<Joint>,
    /// Index of the point, from 0. If `ms` > 0, the problem occurs between this point and the next point.
    pub point: usize,
    /// Time from `point` to the problem, ms.
    pub ms: f64,
    /// Time along the path at which the problem occurs, s.
    pub time_s: f64,
    /// Value that causes the problem, in the unit of the kind of problem.
    pub value: f64,
    /// Limit for the value. If positions, velocities or accelerations contradict each other, `limit` is the value of
    /// the other quantity.
    pub limit: f64,
}

/// Problems of one kind in one joint. Each jump is a separate problem.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Problem {
    /// Kind of the problem.
    pub kind: ProblemKind,
    /// Joint in which the problem occurs; `None` if the problem concerns the whole trajectory.
    pub joint: Option<Joint>,
    /// First occurrence of the problem along the path.
    pub first: Seen,
    /// Index (from 0) of the point at or before the worst occurrence.
    pub point: usize,
    /// Time from `point` to the worst occurrence, ms.
    pub ms: f64,
    /// Time of the worst occurrence along the path, s.
    pub time_s: f64,
    /// Worst value, in the unit of the kind of problem.
    pub value: f64,
    /// Limit for the value. If positions, velocities or accelerations contradict each other, `limit` is the value of
    /// the other quantity.
    pub limit: f64,
    /// Number of occurrences: milliseconds, points or steps, depending on the kind of problem.
    pub count: usize,
    /// `true` if the problem is only a warning: the trajectory can be executed, but the feed-forward torque is less accurate.
    pub warning: bool,
}

impl Problem {
    /// Returns the worst occurrence of the problem.
    pub(super) fn worst(&self) -> Seen {
        let Self { joint, point, ms, time_s, value, limit, .. } = *self;
        Seen { joint, point, ms, time_s, value, limit }
    }

    /// Returns a number for sorting the problems: the worst value relative to its limit. Without a limit, returns the
    /// absolute value. If positions, velocities or accelerations contradict each other, returns the difference.
    pub(super) fn excess(&self) -> f64 {
        match self.kind {
            ProblemKind::VelocityMismatch | ProblemKind::AccelerationMismatch => {
                (self.value - self.limit).abs()
            }
            _ if self.limit == 0.0 => self.value.abs(),
            _ if self.value.is_nan() => f64::INFINITY,
            _ => self.value.abs() / self.limit.abs(),
        }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.worst().words(self.kind))?;
        if self.count > 1 && self.kind != ProblemKind::HoldTorque {
            write!(f, "; {} times, first at point {}", self.count, self.first.point)?;
        }
        Ok(())
    }
}

impl Seen {
    /// Returns a text that describes this occurrence of the problem, with the value, limit, point and time.
    pub(super) fn words(&self, kind: ProblemKind) -> String {
        use ProblemKind::*;
        let Self { joint, point, ms, time_s, value, limit } = self;
        let (unit, words, next) = (kind.unit(), kind.words(), point + 1);
        let joint = joint.map_or(String::new(), |joint| format!("{joint}: "));
        let place = if *ms > 0.0 {
            format!("{ms} ms after point {point} ({time_s:.3} s)")
        } else {
            format!("at point {point} ({time_s:.3} s)")
        };
        let what = match kind {
            Empty | StepTime => words.to_owned(),
            TooManyPoints | TooManySegments => format!("{words}: {value}, at most {limit}"),
            SegmentPoints => format!("{words}: {value}, expected 1 to {limit}"),
            Jump => format!(
                "jump of {value:+.4} rad between points {point} and {next} ({time_s:.3} s; at most {limit:.4} rad in a step)"
            ),
            StartPose => format!("{value:+.4} rad away from the first point (tolerance {limit} rad)"),
            NoStop => format!(
                "a Stop {ms} ms after point {point} ({time_s:.3} s) needs {value:+.1} N·m to end in time, limit {limit} N·m"
            ),
            HoldTorque => {
                let most = limit.abs() / HOLD_SHARE;
                let (share, limit) = (100.0 * value.abs() / most, limit.abs());
                format!(
                    "rest at point {point} ({time_s:.3} s) needs {value:+.1} N·m, {share:.1} % of the torque limit ({most:.1} N·m), expected at \
                     most {:.0} % ({limit:.1} N·m); with more, encoder noise can make the arm fall later",
                    100.0 * HOLD_SHARE
                )
            }
            Position => {
                let excess = three_digits((value - limit).abs());
                format!("{words}: {value:+.4} {unit} ({excess} {unit} over the limit {limit}) {place}")
            }
            NotAtRest => format!("{words}: {value:+.4} {unit} {place}"),
            VelocityMismatch | AccelerationMismatch => format!(
                "{words}: {value:+.4} {unit} between points {point} and {next} ({time_s:.3} s), but the file has {limit:+.4} {unit}"
            ),
            _ => format!("{words}: {value:+.4} {unit} (limit {limit}) {place}"),
        };
        joint + &what
    }
}

/// Formats a number with three significant digits.
fn three_digits(value: f64) -> String {
    let before = if value > 0.0 { value.log10().floor() } else { 0.0 };
    // Seven decimals are finer than the resolution of any value in a serial frame.
    let decimals = (2.0 - before).clamp(0.0, 7.0) as usize;
    format!("{value:.decimals$}")
}
