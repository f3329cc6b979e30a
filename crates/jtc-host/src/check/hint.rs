//! What helps after a verdict: the next command, in words.

use super::verdict::{ProblemKind, Verdict};

impl Verdict {
    /// The speed (%) at which nothing would be too fast any more; `None` where speed is not what is wrong.
    fn slower(&self) -> Option<f64> {
        use ProblemKind::*;
        let mut speed = 1.0f64;
        for p in self.refusals() {
            let over = (p.value / p.limit).abs();
            speed = speed.min(match p.kind {
                Velocity => 0.95 / over,
                // Seen at a place between two points, which need not be the fastest one.
                PositionSpeed => {
                    let peak =
                        p.joint.and_then(|j| self.joints.get(j - 1)).map_or(0.0, |j| j.velocity_peak_rad_s);
                    0.95 / over.max(peak / p.limit.abs())
                }
                Acceleration => (0.9 / over).sqrt(),
                Torque | NoStop | VelocityScale | AccelerationScale | FrictionVelocity => 0.5,
                _ => return None,
            });
        }
        // Slower than 1 % is no motion any more.
        (speed < 1.0).then(|| (100.0 * speed).floor()).filter(|&percent| percent >= 1.0)
    }

    /// Positions far outside of what a joint can have, which would be usual ones were they divided by 57.3.
    fn seems_degrees(&self) -> bool {
        let turn = std::f64::consts::TAU;
        let far = self.joints.iter().map(|j| j.position_max_rad.max(-j.position_min_rad)).fold(0.0, f64::max);
        far > turn && far <= turn.to_degrees()
    }

    /// The next command or act that helps.
    pub fn hint(&self) -> String {
        let has = |kind| self.problems.iter().any(|p| p.kind == kind);
        let only = |kind| self.refusals().all(|p| p.kind == kind);
        if self.is_ok() {
            "`jtc traj run FILE`".into()
        } else if only(ProblemKind::StartPose) {
            "`jtc traj run FILE --approach` moves the arm to the first point before".into()
        } else if self.seems_degrees() {
            "the positions look like degrees: all numbers of a trajectory are in rad, rad/s and rad/s² (90° = 1.5708)"
                .into()
        } else if has(ProblemKind::Jump) {
            "the file was put together from pieces that do not meet: join them with a move, or run each alone"
                .into()
        } else if has(ProblemKind::Position) || has(ProblemKind::PositionScale) {
            "positions do not change with the speed: correct the path (are all numbers in rad?)".into()
        } else if has(ProblemKind::HoldTorque) {
            "the speed does not change what standing still takes: begin, rest and end in poses that take less (less stretched out), \
             or with a lighter payload in the arm model"
                .into()
        } else if let Some(percent) = self.slower() {
            let load = if has(ProblemKind::NoStop) || has(ProblemKind::Torque) {
                ", or with a lighter payload in the arm model"
            } else {
                ""
            };
            format!("`--speed PCT` runs it slower{load}: `jtc traj check FILE --speed {percent}`")
        } else {
            "correct the file; `jtc traj info FILE` shows its figures".into()
        }
    }
}
