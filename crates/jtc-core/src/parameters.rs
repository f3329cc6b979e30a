//! Parameters (model, gains and friction) that the host sends in addition to commands.
use jtc_dynamics::ArmModel;

use crate::JOINTS;

/// Gains of one joint (J-41).
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct PidGains {
    /// Gain of the position error, N·m/rad.
    pub kp: f64,
    /// Gain of the integral of the error, N·m/(rad·s).
    pub ki: f64,
    /// Gain of the derivative of the error, N·m·s/rad.
    pub kd: f64,
    /// Lower bound of the integral of the error, rad·s.
    pub int_min: f64,
    /// Upper bound of the integral of the error, rad·s.
    pub int_max: f64,
}

/// Friction table of one joint, in which each row belongs to a velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TableOf<T> {
    /// Velocities, rad/s, strictly increasing.
    pub velocity: [T; 20],
    /// Temperatures, °C, strictly increasing.
    pub temperature: [T; 20],
    /// Torques, N·m, `[velocity][temperature]`.
    pub torque: [[T; 20]; 20],
}

/// Friction compensation (J-42).
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant)]
pub enum Friction {
    /// Coefficients c0..c5 of each joint, in ascending order. With c4 = 0 the torque does not depend on the temperature.
    Polynomial([[f64; 6]; JOINTS]),
    /// A friction table for each joint.
    Table([TableOf<f32>; JOINTS]),
}

/// Parameters from the host, or the default parameters (section 7).
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    /// Kinematics and masses of the arm.
    pub model: ArmModel,
    /// Gains of each joint.
    pub pid: [PidGains; JOINTS],
    /// Friction compensation of each joint.
    pub friction: Friction,
}
