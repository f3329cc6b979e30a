//! Torque margin of a plan: the share of each torque limit that the motion does not use. This reserve is for masses
//! and friction that the model does not contain.
//!
//! A plan keeps the torque of the arm model, including friction, below (100 % − margin) of each torque limit. The
//! plan respects this reduced limit at its lowest bearing temperature and at the usual bearing temperature.
//!
//! Another rule applies in a pose in which gravity and breakaway friction alone need nearly the whole reduced limit,
//! or more ([`ArmDynamics::usable_torque`]). In such a pose, the available torque is the whole limit minus gravity
//! and friction. The motion may use a quarter of the available torque, but at least 2 % of the whole limit. Therefore
//! the arm can reach and leave every pose that it can hold. [`Verdict::margin`](crate::check::Verdict::margin)
//! contains the torque margin of a motion.

use jtc_core::JOINTS;
use jtc_plan::{ArmDynamics, Limits, State};
use jtc_wire::Joint;

use super::PlanError;
use crate::check::Verdict;
use crate::trajectory::Trajectory;

/// Default torque margin, % of each torque limit.
pub const MARGIN_PCT: f64 = 15.0;
/// Largest valid torque margin, % of each torque limit.
pub const MARGIN_PCT_MAX: f64 = 100.0 * jtc_plan::MARGIN_MAX;
/// Difference (% of the limit) between the requested and the actual torque margin up to which no note is needed. If
/// the difference is larger, a note reports the actual margin.
const SHORT_PCT: f64 = 0.1;
/// Relative rounding error up to which a torque counts as within the limit.
const ROUNDING: f64 = 1e-9;

/// Parses a torque margin, % of each torque limit.
///
/// # Errors
///
/// Returns an error text if `text` is not a number from 0 to [`MARGIN_PCT_MAX`].
pub fn margin_of(text: &str) -> Result<f64, String> {
    let Ok(percent) = text.trim().parse::<f64>() else {
        return Err(format!(
            "not a number, expected 0 to {MARGIN_PCT_MAX} (% of each torque limit), by default {MARGIN_PCT}"
        ));
    };
    margin_in_range(percent).map(|()| percent).map_err(|error| error.to_string())
}

/// Checks that a torque margin, % of each torque limit, is within 0 to [`MARGIN_PCT_MAX`].
///
/// # Errors
///
/// Returns [`PlanError::Margin`] if the value is out of range.
pub fn margin_in_range(percent: f64) -> Result<(), PlanError> {
    if (0.0..=MARGIN_PCT_MAX).contains(&percent) { Ok(()) } else { Err(PlanError::Margin { percent }) }
}

/// Excess of a joint torque over the limit that the torque margin allows.
pub(super) struct Excess {
    /// Joint whose torque is too high.
    pub joint: Joint,
    /// Slow-down factor that the motion needs to respect the torque margin.
    pub stretch: f64,
}

/// Returns a note if the torque margin is smaller than requested because of gravity.
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
        "the torque margin of {} is {:.1} % instead of {margin_pct} %: holding the arm needs {hold:.1} of its {:.1} N·m at {:.3} s",
        left.joint, left.percent, left.limit_nm, left.time_s
    ))
}

/// Checks the torque margin of `limits` at each millisecond of the trajectory, with the values that the controller computes. Returns the
/// joint that needs the slowest motion, or `None` if all joints respect the torque margin.
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
            // `still` is the part of the torque that a slower motion does not reduce: the gravity torque and nearly
            // all of the friction torque.
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
