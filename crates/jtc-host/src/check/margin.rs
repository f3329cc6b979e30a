//! Margin between the torque of a trajectory and the torque limits.

use std::fmt;

use jtc_wire::Joint;
use serde::Serialize;

use super::Verdict;

/// Torque margin below which a check warns, % of the limit. If the margin is smaller, an arm with 10 % more mass and 20 % more friction
/// than its model may reach the torque limit.
pub const MARGIN_LOW_PCT: f64 = 10.0;

/// Torque margin of a motion: the smallest share of a torque limit that the motion leaves unused, with the time at
/// which this occurs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TorqueMargin {
    /// Torque margin, % of the torque limit; negative if the torque is above the limit.
    pub percent: f64,
    /// Joint with the smallest margin.
    pub joint: Joint,
    /// Time from the start of the motion to the smallest margin, s.
    pub time_s: f64,
    /// Torque of the arm model at the time of the smallest margin, N·m.
    pub torque_nm: f64,
    /// Torque limit of the joint, N·m.
    pub limit_nm: f64,
    /// Bearing temperature for which the friction was computed, °C. The check computes the torque for two temperatures. This field contains
    /// the temperature with the greater torque.
    pub temperature_c: f64,
}

impl TorqueMargin {
    /// Returns `true` if the torque margin is below [`MARGIN_LOW_PCT`].
    pub fn is_low(&self) -> bool {
        self.percent < MARGIN_LOW_PCT
    }

    /// Returns a warning if the torque margin is low.
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
    /// Updates the smallest torque margin with the torque of one joint at one millisecond of the path. The torque was
    /// computed for the given bearing temperature (°C).
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

    /// Returns the verdict with the smaller of two torque margins: its own and `other`. Both must belong to the same
    /// trajectory.
    pub(crate) fn or_less(mut self, other: Option<TorqueMargin>) -> Self {
        if let Some(other) = other
            && self.margin.is_none_or(|margin| other.percent < margin.percent)
        {
            self.margin = Some(other);
        }
        self
    }
}
