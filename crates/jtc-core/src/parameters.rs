//! Parameters that the host sends besides commands: model, gains and friction.
use jtc_dynamics::ArmModel;

use crate::JOINTS;

/// Gains of one joint (J-41).
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct PidGains {
    /// N·m/rad.
    pub kp: f64,
    /// N·m/(rad·s).
    pub ki: f64,
    /// N·m·s/rad.
    pub kd: f64,
    /// Lower bound of the integral of the error, rad·s.
    pub int_min: f64,
    /// Upper bound of the integral of the error, rad·s.
    pub int_max: f64,
}

/// Friction table of one joint: rows are velocities.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TableOf<T> {
    /// rad/s, strictly increasing.
    pub velocity: [T; 20],
    /// °C, strictly increasing.
    pub temperature: [T; 20],
    /// N·m, `[velocity][temperature]`.
    pub torque: [[T; 20]; 20],
}

/// Friction compensation (J-42).
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant)]
pub enum Friction {
    /// c0..c5 per joint, ascending; c4 = 0 means no temperature factor.
    Polynomial([[f64; 6]; JOINTS]),
    /// A table for each joint.
    Table([TableOf<f32>; JOINTS]),
}

/// Parameters from the host, or the defaults (section 7).
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    /// Kinematics and masses.
    pub model: ArmModel,
    /// Per joint.
    pub pid: [PidGains; JOINTS],
    /// Friction compensation.
    pub friction: Friction,
}
