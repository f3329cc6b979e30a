//! Bounds of the parameters that a host may send (J-06).
use jtc_dynamics::{ArmModel, Payload};
use jtc_wire::DataStatus;

use crate::config::limits::JointConfig;
use crate::friction;
use crate::parameters::{PidGains, TableOf};

/// Highest speed at which the friction of a joint has been measured, as a share of the velocity limit. At higher
/// speeds, a fitted friction curve can have any value.
const MEASURED: f64 = 0.5;
/// Number of speeds at which a friction polynomial is checked. A cubic changes only a little between two of these speeds.
const SPEEDS: u8 = 16;

/// Bounds of gains, masses and friction. Arms with the known drives have only values within these bounds. Values
/// outside the bounds could throw or drop the arm (J-06).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterBounds {
    /// Highest Kp, N·m/rad. The known drives use a Kp of at most 28 000.
    pub kp_max: f64,
    /// Highest Ki, N·m/(rad·s). The known drives use a Ki of at most 24 000.
    pub ki_max: f64,
    /// Highest Kd, N·m·s/rad. The known drives use a Kd of at most 300.
    pub kd_max: f64,
    /// Largest magnitude of IntMin and IntMax, rad·s. The known arms use magnitudes up to 120.
    pub integral_max: f64,
    /// Largest torque that the bounds of the integral may force on a joint at rest, as a share of its torque limit.
    /// If the bounds exclude an integral of zero, the integral always produces a torque.
    pub integral_bias_max: f64,
    /// Largest mass of a link, kg. A drive of 360 N·m, the full scale of the bus, can hold 50 kg only up to a distance of 0.73 m.
    pub link_mass_max: f64,
    /// Largest moment or product of inertia of a link, kg·m²: the moment of inertia of 50 kg at a distance of 1.4 m.
    pub link_inertia_max: f64,
    /// Largest friction torque of a joint at any speed, as a share of its torque limit. A friction polynomial is checked without its
    /// temperature factor. In the known arms, this share is at most 1.19.
    pub friction_max: f64,
    /// Like `friction_max`, but for speeds up to half of the velocity limit. In the known arms, this share is at most 0.82.
    pub slow_friction_max: f64,
    /// Largest friction torque that drives the joint instead of opposing its motion, as a share of the torque limit.
    /// The bound applies to speeds up to half of the velocity limit. Measurement noise can cause such a torque in the
    /// friction parameters.
    pub friction_reversed_max: f64,
    /// Largest friction torque at standstill, as a share of the torque limit.
    pub rest_friction_max: f64,
}

/// Parameter that is out of its bounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutOfBounds {
    /// Name of the parameter, with its unit.
    pub what: &'static str,
    /// Velocity at which a friction torque is out of bounds, rad/s. The velocity is `None` for other parameters.
    pub velocity: Option<f64>,
    /// The value that is out of bounds.
    pub value: f64,
    /// Lowest value that is allowed.
    pub low: f64,
    /// Highest value that is allowed.
    pub high: f64,
}

impl OutOfBounds {
    /// Checks that `value` is within `low..=high`. The comparison also rejects NaN.
    fn unless_within(what: &'static str, value: f64, low: f64, high: f64) -> Result<(), Self> {
        if value >= low && value <= high {
            Ok(())
        } else {
            Err(Self { what, velocity: None, value, low, high })
        }
    }
}

impl From<OutOfBounds> for DataStatus {
    fn from(_: OutOfBounds) -> Self {
        Self::IncorrectValue
    }
}

impl ParameterBounds {
    /// Returns the bounds for the known drives.
    pub const fn known_drives() -> Self {
        Self {
            kp_max: 50_000.0,
            ki_max: 50_000.0,
            kd_max: 500.0,
            integral_max: 1_000.0,
            integral_bias_max: 0.25,
            link_mass_max: 50.0,
            link_inertia_max: 100.0,
            friction_max: 1.5,
            slow_friction_max: 1.0,
            friction_reversed_max: 0.05,
            rest_friction_max: 0.25,
        }
    }

    /// Checks the gains of a joint.
    pub fn check_gains(&self, gains: &PidGains, joint: &JointConfig) -> Result<(), OutOfBounds> {
        let PidGains { kp, ki, kd, int_min, int_max } = *gains;
        let within = OutOfBounds::unless_within;
        within("Kp (N·m/rad)", kp, 0.0, self.kp_max)?;
        within("Ki (N·m/(rad·s))", ki, 0.0, self.ki_max)?;
        within("Kd (N·m·s/rad)", kd, 0.0, self.kd_max)?;
        within("IntMin (rad·s)", int_min, -self.integral_max, int_max)?;
        within("IntMax (rad·s)", int_max, int_min, self.integral_max)?;
        // `least` is the magnitude of the allowed integral that is nearest to zero.
        let least = int_min.max(0.0) - int_max.min(0.0);
        within(
            "torque that the bounds of the integral force on a joint at rest (N·m)",
            ki * least,
            0.0,
            self.integral_bias_max * joint.torque_max,
        )
    }

    /// Checks the masses and inertias of a model that has already passed the check for physical consistency.
    pub fn check_masses(&self, model: &ArmModel) -> Result<(), OutOfBounds> {
        for link in &model.links {
            OutOfBounds::unless_within("mass of a link (kg)", link.mass, 0.0, self.link_mass_max)?;
            let most = self.link_inertia_max;
            for &inertia in &link.inertia {
                OutOfBounds::unless_within("inertia of a link (kg·m²)", inertia, -most, most)?;
            }
        }
        Ok(())
    }

    /// Checks the mass and inertia of a payload. The bounds for a link also apply to a payload.
    pub fn check_payload(&self, payload: &Payload) -> Result<(), OutOfBounds> {
        OutOfBounds::unless_within("mass of the payload (kg)", payload.mass, 0.0, self.link_mass_max)?;
        let most = self.link_inertia_max;
        payload
            .inertia
            .iter()
            .try_for_each(|&i| OutOfBounds::unless_within("inertia of the payload (kg·m²)", i, -most, most))
    }

    /// Checks the torque (N·m) that compensates the friction of a joint at a velocity (rad/s).
    fn check_friction(&self, torque: f64, velocity: f64, joint: &JointConfig) -> Result<(), OutOfBounds> {
        let speed = velocity.abs();
        let (low, high) = if speed == 0.0 {
            (-self.rest_friction_max, self.rest_friction_max)
        } else if speed <= MEASURED * joint.velocity_max {
            (-self.friction_reversed_max, self.slow_friction_max)
        } else {
            (-self.friction_max, self.friction_max)
        };
        // For both directions, `along` is positive if the torque opposes the motion.
        let along = if velocity < 0.0 { -torque } else { torque };
        OutOfBounds::unless_within(
            "friction torque (N·m)",
            along,
            low * joint.torque_max,
            high * joint.torque_max,
        )
        .map_err(|e| OutOfBounds { velocity: Some(velocity), ..e })
    }

    /// Checks a friction polynomial over the speed range of the joint. The temperature factor has separate bounds (J-42).
    pub fn check_polynomial(&self, coefficients: &[f64; 6], joint: &JointConfig) -> Result<(), OutOfBounds> {
        let [c0, c1, c2, c3, ..] = *coefficients;
        let without_temperature = [c0, c1, c2, c3, 0.0, 0.0];
        let step = joint.velocity_max / f64::from(SPEEDS);
        // Arms often move slowly, so the first speed step is divided into `SPEEDS` smaller steps.
        let slow = (1..SPEEDS).map(|k| step * f64::from(k) / f64::from(SPEEDS));
        slow.chain((1..=SPEEDS).map(|k| step * f64::from(k))).try_for_each(|v| {
            // The sign of the speed is smoothed around standstill, so the torque at standstill is zero.
            self.check_friction(friction::polynomial(&without_temperature, v, 0.0, v), v, joint)
        })
    }

    /// Checks a friction table at the velocities of its rows, and at standstill.
    pub fn check_table(&self, table: &TableOf<f32>, joint: &JointConfig) -> Result<(), OutOfBounds> {
        for (&velocity, row) in table.velocity.iter().zip(&table.torque) {
            for &torque in row {
                // The torque at standstill is checked after the other rows, because most tables contain no row for standstill.
                if velocity != 0.0 {
                    self.check_friction(torque.into(), velocity.into(), joint)?;
                }
            }
        }
        for &temperature in &table.temperature {
            // A path passes through standstill, so the controller cannot use a table without standstill for any path (J-36).
            if let Some(torque) = friction::table(table, 0.0, temperature.into()) {
                self.check_friction(torque, 0.0, joint)?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
