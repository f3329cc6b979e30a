//! Advice for the user after the check of a trajectory, with the next command.

use host_kit::{Action, Next};
use jtc_core::{POINTS_MAX, SEGMENT_POINTS_MAX, SEGMENTS_MAX};

use super::kind::ProblemKind;
use super::verdict::{Suspicion, Verdict};

impl Verdict {
    /// Returns the speed (% of the file's own speed) at which no value exceeds its limit. Returns `None` if a lower speed does not solve
    /// the problems. The speed is estimated from the worst values. To find the exact speed, use [`plan::at_speed`](crate::plan::at_speed)
    /// and check again.
    pub fn slower(&self, now_pct: f64) -> Option<f64> {
        use ProblemKind::*;
        let mut speed = 1.0f64;
        for p in self.refusals() {
            let over = (p.value / p.limit).abs();
            speed = speed.min(match p.kind {
                Velocity => 0.95 / over,
                // The value of this problem is the speed in one step between two points, but the joint may be faster
                // in another step. Therefore the peak velocity of the joint is also considered.
                PositionSpeed => {
                    let peak = p
                        .joint
                        .and_then(|j| self.joints.get(j.index()))
                        .map_or(0.0, |j| j.velocity_peak_rad_s);
                    0.95 / over.max(peak / p.limit.abs())
                }
                Acceleration => (0.9 / over).sqrt(),
                Torque | NoStop | VelocityScale | AccelerationScale | FrictionVelocity => 0.5,
                _ => return None,
            });
        }
        // The function does not return a speed below 1 %.
        (speed < 1.0).then(|| (now_pct * speed).floor()).filter(|&percent| percent >= 1.0)
    }

    /// Returns the next command or action that solves the problem. The text contains `FILE` instead of the name of the trajectory file.
    pub fn hint(&self) -> Next {
        self.hint_for("FILE", 100.0)
    }

    /// Returns the next command or action for a trajectory that was checked at `speed_pct` (% of its own speed). `file` is the file name
    /// that the user typed, including its options.
    pub fn hint_for(&self, file: &str, speed_pct: f64) -> Next {
        self.hint_with(file, speed_pct, self.slower(speed_pct))
    }

    /// Like [`Verdict::hint_for`], with the speed `passes` (% of the file's own speed) at which the trajectory passes the check. `passes`
    /// is `None` if no such speed is known.
    pub fn hint_with(&self, file: &str, speed_pct: f64, passes: Option<f64>) -> Next {
        let has = |kind| self.problems.iter().any(|p| p.kind == kind);
        let only = |kind| self.refusals().all(|p| p.kind == kind);
        let speed = if speed_pct == 100.0 { String::new() } else { format!(" --speed {speed_pct}") };
        if self.is_ok() {
            Next::typed(Action::TrajRun, format!("jtc traj run {file}{speed}"))
        } else if has(ProblemKind::TooManyPoints) {
            format!(
                "use at most {POINTS_MAX} points: use a longer step between points (up to 1000 ms), or run the trajectory in parts"
            )
            .into()
        } else if has(ProblemKind::SegmentPoints) || has(ProblemKind::TooManySegments) {
            let least = self.points.div_ceil(SEGMENTS_MAX).max(1);
            format!(
                "use `--points-per-segment` from {least} to {SEGMENT_POINTS_MAX}, so that these {} points fit into {SEGMENTS_MAX} segments; or omit \
                 it, then the program chooses the length",
                self.points
            )
            .into()
        } else if only(ProblemKind::StartPose) {
            Next::typed(Action::TrajRunWithApproach, format!("jtc traj run {file}{speed} --approach"))
                .then(" first moves the arm to the first point")
        } else if self.suspicion() == Suspicion::Degrees {
            "the positions look like degrees: all numbers of a trajectory are in rad, rad/s and rad/s² (90° = 1.5708)"
                .into()
        } else if has(ProblemKind::Jump) {
            "the file consists of pieces that do not meet: join the pieces with a move, or run each piece alone"
                .into()
        } else if has(ProblemKind::Position) || has(ProblemKind::PositionScale) {
            "positions do not change with the speed: correct the path, and check that all numbers are in rad"
                .into()
        } else if has(ProblemKind::HoldTorque) {
            "the torque at rest does not depend on the speed: begin, rest and end in poses that need less torque (less stretched out), or use a \
             lighter payload"
                .into()
        } else if let Some(percent) = passes {
            let load = if has(ProblemKind::NoStop) || has(ProblemKind::Torque) {
                ", or use a lighter payload"
            } else {
                ""
            };
            let command = format!("jtc traj check {file} --speed {percent}");
            Next::from(format!("lower the speed to {percent} %{load}: "))
                .then(Next::typed(Action::TrajRunSlower, command))
        } else {
            format!("correct the file; `jtc traj info {file}` shows its values").into()
        }
    }
}
