//! Checks that the drives hold an arm in every pose, and that the torque limits of the arm are in the right unit.

use host_kit::Severity;
use jtc_core::JOINTS;
use jtc_wire::Joint;

use super::{ArmFinding, Holding};
use crate::arm::Arm;
use crate::arm::statics::{Worst, worst_gravity};

/// If the gravity torque exceeds this share of the torque limit, the check warns that little torque is left for
/// motions.
const LITTLE_LEFT: f64 = 0.8;
/// Ratio of the greatest torque limit to the greatest gravity torque. Above this ratio, the limits probably have a
/// wrong unit.
const FAR_ABOVE: f64 = 15.0;

impl Arm {
    pub(super) fn find_holding(&self, findings: &mut Vec<ArmFinding>) -> Vec<Holding> {
        let config = self.config();
        let worst = worst_gravity(&self.model, config.gravity, &self.ranges());
        let holding: Vec<Holding> = Joint::ALL
            .into_iter()
            .zip(worst.iter().zip(&self.joints))
            .map(|(joint, (w, limits))| {
                let Worst { torque: torque_nm, pose: pose_rad } = *w;
                Holding { joint, torque_nm, limit_nm: limits.torque_max, pose_rad }
            })
            .collect();
        for h in holding.iter().filter(|h| h.torque_nm > LITTLE_LEFT * h.limit_nm) {
            let share = 100.0 * h.torque_nm / h.limit_nm;
            let what = format!(
                "{}: gravity needs {:.1} N·m of {} N·m ({share:.0} %) at q = {}",
                self.titled(h.joint),
                h.torque_nm,
                h.limit_nm,
                pose(&h.pose_rad)
            );
            let (why, next) = if share > 100.0 {
                (
                    "the drive cannot hold the arm in this pose",
                    "narrow the position range, correct the torque limit to that of the drive, or use a lighter arm",
                )
            } else {
                (
                    "little torque remains for motion",
                    "move slowly near this pose; jtc traj check computes the torque of each motion",
                )
            };
            let mut found = ArmFinding::new(Severity::Warning, "holding", what).because(why).next(next);
            found.pose_rad = Some(h.pose_rad);
            findings.push(found.of(h.joint, "torque_max_nm").measured(h.torque_nm, h.limit_nm, "N·m"));
        }
        let share = |h: &Holding| h.torque_nm / h.limit_nm;
        if let Some(most) = holding.iter().max_by(|a, b| share(a).total_cmp(&share(b)))
            && share(most) <= LITTLE_LEFT
        {
            let what = format!(
                "the drives hold the arm in every pose; {} needs the largest share, {:.1} N·m of {} N·m ({:.0} %)",
                self.titled(most.joint),
                most.torque_nm,
                most.limit_nm,
                100.0 * share(most)
            );
            findings.push(ArmFinding::new(Severity::Good, "holding", what));
        }
        self.find_unit(&holding, findings);
        holding
    }

    /// Finds torque limits far above the gravity torques, for example limits in kg·cm or placeholder values.
    fn find_unit(&self, holding: &[Holding], findings: &mut Vec<ArmFinding>) {
        let most = |of: fn(&Holding) -> f64| holding.iter().map(of).fold(0.0, f64::max);
        let (torque, limit) = (most(|h| h.torque_nm), most(|h| h.limit_nm));
        if torque > 0.0 && limit > FAR_ABOVE * torque {
            let what =
                format!("torque limits up to {limit} N·m, but gravity needs only {torque:.2} N·m at most");
            let mut found = ArmFinding::new(Severity::Warning, "unit", what)
                .because(
                    "limits in another unit than N·m (10 kg·cm are 1 N·m), or placeholder numbers",
                )
                .next("take torque_max_nm from the data sheet of the drives: this limit protects arm and people");
            found.name = Some("torque_max_nm");
            findings.push(found.measured(limit, torque, "N·m"));
        }
    }
}

fn pose(q: &[f64; JOINTS]) -> String {
    let each = q.map(|v| format!("{:.2}", if v.abs() < 0.005 { 0.0 } else { v }));
    format!("({}) rad", each.join(", "))
}
