//! Limits of a motion.
use jtc_core::Config;
use jtc_wire::Joint;

use crate::{JOINTS, JointVec, LimitKind, PlanError};

/// Minimum time in which a joint reaches its highest acceleration from an acceleration of 0, s. The jerk limit of
/// [`Limits::of`] is computed from this time.
pub const JERK_TIME: f64 = 0.1;

/// Largest share of a torque limit that can be reserved as a margin.
pub const MARGIN_MAX: f64 = 0.5;

/// Limits for planning a motion, per joint from base to wrist.
#[derive(Clone, Debug, PartialEq)]
pub struct Limits {
    /// Lowest and highest position, rad.
    pub position: [(f64, f64); JOINTS],
    /// Highest speed, rad/s.
    pub velocity: JointVec,
    /// Highest acceleration, rad/s².
    pub acceleration: JointVec,
    /// Highest jerk, rad/s³; infinite without a limit.
    pub jerk: JointVec,
    /// Highest torque, N·m. The planner uses this limit only with an [`crate::ArmDynamics`].
    pub torque: JointVec,
    /// Share of the torque limit that is reserved as a margin, from 0 to [`MARGIN_MAX`] (see
    /// [`crate::ArmDynamics::usable_torque`]).
    pub margin: JointVec,
}

impl Limits {
    /// Returns the limits of an arm (J-43). The configuration of an arm has no jerk limit, so the jerk limit is the
    /// highest acceleration divided by [`JERK_TIME`].
    pub fn of(config: &Config) -> Self {
        let of = |value: fn(&jtc_core::JointConfig) -> f64| config.joints.each_ref().map(value);
        let acceleration = of(|j| j.acceleration_max);
        Self {
            position: std::array::from_fn(|j| config.position_range(j)),
            velocity: of(|j| j.velocity_max),
            acceleration,
            jerk: acceleration.map(|a| a / JERK_TIME),
            torque: of(|j| j.torque_max),
            margin: [0.0; JOINTS],
        }
    }

    /// Returns the limits with this share of each torque limit reserved as a margin.
    pub fn with_margin(self, share: f64) -> Self {
        Self { margin: [share; JOINTS], ..self }
    }

    /// Returns the limits for a share of the speed. The velocity is multiplied by `share`, the acceleration by its
    /// square, and the jerk by its cube. If these three limits determine the duration of a motion, the duration is
    /// multiplied by 1/`share`. Positions, torques and the torque margin stay unchanged.
    pub fn at_speed(&self, share: f64) -> Self {
        Self {
            velocity: self.velocity.map(|v| v * share),
            acceleration: self.acceleration.map(|a| a * share * share),
            jerk: self.jerk.map(|j| j * share * share * share),
            ..self.clone()
        }
    }

    /// Returns these limits without a jerk limit.
    pub fn without_jerk(self) -> Self {
        Self { jerk: [f64::INFINITY; JOINTS], ..self }
    }

    /// Returns `true` if any joint has a jerk limit.
    pub fn has_jerk(&self) -> bool {
        self.jerk.iter().any(|j| j.is_finite())
    }

    /// Checks that a motion is possible within the limits.
    ///
    /// # Errors
    ///
    /// Returns [`PlanError::Limit`] for the first limit that is not a positive number (only the jerk limit may be infinite). Returns
    /// [`PlanError::Range`] for an empty position range. Returns [`PlanError::Margin`] for a torque margin that is out of range.
    pub fn check(&self) -> Result<(), PlanError> {
        for joint in Joint::ALL {
            let j = joint.index();
            let (min, max) = self.position[j];
            if !(min.is_finite() && max.is_finite() && min < max) {
                return Err(PlanError::Range { joint, min, max });
            }
            for (limit, value, finite) in [
                (LimitKind::Velocity, self.velocity[j], true),
                (LimitKind::Acceleration, self.acceleration[j], true),
                (LimitKind::Jerk, self.jerk[j], false),
                (LimitKind::Torque, self.torque[j], true),
            ] {
                let positive = value > 0.0 && (value.is_finite() || !finite);
                // Smaller limits are rejected, because their squares and cubes would be lost in rounding errors.
                if !positive || value < 1e-9 || (value > 1e9 && value.is_finite()) {
                    return Err(PlanError::Limit { joint, limit, value });
                }
            }
            let share = self.margin[j];
            if !(0.0..=MARGIN_MAX).contains(&share) {
                return Err(PlanError::Margin { joint, share });
            }
        }
        Ok(())
    }

    /// Checks that `position` is within the limits. The error contains `waypoint`, which is counted from 1.
    pub(crate) fn holds(&self, position: &JointVec, waypoint: usize) -> Result<(), PlanError> {
        for joint in Joint::ALL {
            let (value, (min, max)) = (position[joint.index()], self.position[joint.index()]);
            if !value.is_finite() {
                return Err(PlanError::NotFinite { waypoint, joint, value });
            }
            if !(min..=max).contains(&value) {
                return Err(PlanError::Position { waypoint, joint, value, min, max });
            }
        }
        Ok(())
    }
}
