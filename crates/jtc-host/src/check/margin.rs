//! Margin between the torque of a trajectory and the torque limits.

use std::fmt;

use jtc_wire::Joint;
use serde::Serialize;

use super::Verdict;

/// Torque margin below which a check warns, % of the limit. With a smaller margin, the torque may reach the limit if the arm has 10 % more
/// mass and 20 % more friction than its model.
pub const MARGIN_LOW_PCT: f64 = 10.0;

/// Smallest share of a torque limit that a motion leaves unused, with the place on the path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TorqueMargin {
    /// Margin, % of the limit; negative if the torque is above the limit.
    pub percent: f64,
    /// Joint with the smallest margin.
    pub joint: Joint,
    /// Time from the start, s.
    pub time_s: f64,
    /// Torque of the arm model at this time, N·m.
    pub torque_nm: f64,
    /// Torque limit, N·m.
    pub limit_nm: f64,
    /// Bearing temperature for which the friction was computed, °C. Of the checked temperatures, this is the temperature with the greater
    /// torque.
    pub temperature_c: f64,
}

impl TorqueMargin {
    /// Returns `true` if the margin is below [`MARGIN_LOW_PCT`].
    pub fn is_low(&self) -> bool {
        self.percent < MARGIN_LOW_PCT
    }

    /// Returns a warning if the margin is low.
    pub fn warning(&self) -> Option<String> {
        self.is_low().then(|| {
            format!(
                "torque margin {:.1} % is below {MARGIN_LOW_PCT} %: if the arm is heavier or has more friction than its model, {} reaches its limit \
                 and slows the motion; use a lower speed, or plan with a larger margin",
                self.percent, self.joint
            )
        })
    }
}

impl fmt::Display for TorqueMargin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { percent, joint, time_s, torque_nm, limit_nm, temperature_c } = self;
        write!(
            f,
            "torque margin {percent:.1} %: {joint} at {time_s:.3} s, {:.1} of {limit_nm:.1} N·m with bearings at {temperature_c} °C",
            torque_nm.abs()
        )
    }
}

impl Verdict {
    /// Updates the margin with the torque of a joint, computed for a bearing temperature (°C) and a millisecond of the
    /// path.
    pub(super) fn take_margin(
        &mut self,
        joint: Joint,
        (point, ms): (usize, f64),
        (torque_nm, temperature_c): (f64, f64),
        limit_nm: f64,
    ) {
        let percent = 100.0 * (1.0 - torque_nm.abs() / limit_nm);
        if !percent.is_nan() && self.margin.is_none_or(|margin| percent < margin.percent) {
            let time_s = (point as f64 * f64::from(self.step_ms) + ms) * 1e-3;
            self.margin = Some(TorqueMargin { percent, joint, time_s, torque_nm, limit_nm, temperature_c });
        }
    }

    /// Returns the verdict with the smaller margin, either the present margin or `other`. Both margins must belong to the same trajectory.
    pub(crate) fn or_less(mut self, other: Option<TorqueMargin>) -> Self {
        if let Some(other) = other
            && self.margin.is_none_or(|margin| other.percent < margin.percent)
        {
            self.margin = Some(other);
        }
        self
    }
}
