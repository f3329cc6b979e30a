//! The torque margin of a plan: what it leaves of each torque limit for what the model does not know.
//!
//! A plan keeps the torque of the model, friction included, below (100 % − margin) of each limit. The smallest bearing temperature of
//! the plan and the usual one both count. Where gravity and the friction of the first movement alone leave less of a limit, the motion
//! may use a quarter of what they leave, and 2 % of the limit at least ([`ArmDynamics::usable_torque`]): a pose that can be held can be reached and left.
//! [`Verdict::margin`](crate::check::Verdict::margin) reports what a motion leaves.

use jtc_core::JOINTS;
use jtc_plan::{ArmDynamics, Limits, State};
use jtc_wire::Joint;

use super::PlanError;
use crate::check::Verdict;
use crate::trajectory::Trajectory;

/// Default torque margin, % of each limit.
pub const MARGIN_PCT: f64 = 15.0;
/// Largest torque margin, % of each limit.
pub const MARGIN_PCT_MAX: f64 = 100.0 * jtc_plan::MARGIN_MAX;
/// By how much less than asked for, % of the limit, a margin has a note.
const SHORT_PCT: f64 = 0.1;
/// Rounding that is no excess, as a share of the torque.
const ROUNDING: f64 = 1e-9;

/// Reads a torque margin, % of each limit.
///
/// # Errors
///
/// The reason in words, for text that is not a number and numbers outside 0 to [`MARGIN_PCT_MAX`].
pub fn margin_of(text: &str) -> Result<f64, String> {
    let Ok(percent) = text.trim().parse::<f64>() else {
        return Err(format!(
            "not a number, expected 0 to {MARGIN_PCT_MAX} (% of each torque limit), by default {MARGIN_PCT}"
        ));
    };
    margin_in_range(percent).map(|()| percent).map_err(|error| error.to_string())
}

/// Checks that a torque margin, % of each limit, is within 0 to [`MARGIN_PCT_MAX`].
///
/// # Errors
///
/// [`PlanError::Margin`].
pub fn margin_in_range(percent: f64) -> Result<(), PlanError> {
    if (0.0..=MARGIN_PCT_MAX).contains(&percent) { Ok(()) } else { Err(PlanError::Margin { percent }) }
}

/// A joint whose torque is above what the margin of its plan leaves.
pub(super) struct Excess {
    /// The joint.
    pub joint: Joint,
    /// Factor of the time with which the torque suffices.
    pub stretch: f64,
}

/// A note on a margin that is smaller than the one that was asked for, because of what gravity takes.
pub(super) fn note(
    verdict: &Verdict,
    margin_pct: f64,
    trajectory: &Trajectory,
    arm: &ArmDynamics,
) -> Option<String> {
    let left = verdict.margin.filter(|left| left.percent < margin_pct - SHORT_PCT)?;
    let at = trajectory.at_ms((1e3 * left.time_s).round() as u32)?;
    let hold = arm.holding(&at.position)[left.joint.index()].abs();
    Some(format!(
        "the torque margin of {} is {:.1} % instead of {margin_pct} %: holding the arm takes {hold:.1} of its {:.1} N·m at {:.3} s",
        left.joint, left.percent, left.limit_nm, left.time_s
    ))
}

/// Returns the joint that needs the slowest motion to keep the margin of `limits`, at each millisecond of the trajectory as the controller
/// computes it; `None` where all joints keep it.
pub(super) fn excess(trajectory: &Trajectory, limits: &Limits, arm: &ArmDynamics) -> Option<Excess> {
    let mut worst = None::<Excess>;
    let end = (trajectory.duration_s() * 1e3).round() as u32;
    for at in (0..=end).filter_map(|ms| trajectory.at_ms(ms)) {
        let state = State { position: at.position, velocity: at.velocity, acceleration: at.acceleration };
        let torque = arm.torque(&state);
        let least = |j: usize| (1.0 - limits.margin[j]) * limits.torque[j];
        if (0..JOINTS).all(|j| torque[j].abs() <= least(j)) {
            continue;
        }
        let hold = arm.holding(&state.position);
        let slow = arm.torque(&State { acceleration: [0.0; JOINTS], ..state });
        for joint in Joint::ALL {
            let j = joint.index();
            let usable = arm.usable_torque(limits, j, hold[j]);
            if torque[j].abs() <= usable * (1.0 + ROUNDING) {
                continue;
            }
            // What a slower motion does not change: gravity, and nearly all of the friction.
            let still = (slow[j] * torque[j].signum()).min(torque[j].abs());
            let (needed, left) = (torque[j].abs() - still, usable - still);
            let stretch = if left > 0.0 { (needed / left).sqrt() } else { f64::INFINITY };
            if worst.as_ref().is_none_or(|worst| stretch > worst.stretch) {
                worst = Some(Excess { joint, stretch });
            }
        }
    }
    worst
}
