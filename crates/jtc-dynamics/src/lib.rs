#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

mod chain;
mod forward;
mod inverse;
mod kinematics;
mod model;
mod rotation;
mod trig;
mod unroll;

use inverse::JointSinesCosines;

pub use kinematics::Pose;
pub use model::{ArmModel, Field, JOINTS, JointVec, Link, ModelError, Origin};
pub use trig::{SIN_COS_MAX, sin_cos};

/// A model made ready to compute with: all that does not depend on the joint positions is precomputed.
#[derive(Clone, Debug)]
pub struct Dynamics {
    chain: chain::Chain,
}

impl Dynamics {
    /// Prepares `model`; `gravity`: acceleration of gravity in the base frame, m/s².
    ///
    /// The model should have passed [`ArmModel::check`]; one that has not leads to useless numbers, never to
    /// a panic.
    pub fn new(model: &ArmModel, gravity: [f64; 3]) -> Self {
        Self { chain: chain::Chain::new(model, gravity) }
    }

    /// Joint torques (N·m) for positions (rad), velocities (rad/s) and accelerations (rad/s²); recursive
    /// Newton-Euler.
    pub fn inverse(&self, q: &JointVec, qd: &JointVec, qdd: &JointVec) -> JointVec {
        inverse::inverse(&self.chain, &JointSinesCosines::new(&self.chain, q), qd, qdd)
    }

    /// Joint torques that hold the arm still at `q`, N·m.
    pub fn gravity_torque(&self, q: &JointVec) -> JointVec {
        inverse::gravity_torque(&self.chain, &JointSinesCosines::new(&self.chain, q))
    }

    /// Joint torques that hold 1 kg at the origin of the flange still at `q`, without the arm itself, N·m: gravity through the
    /// transposed Jacobian of the flange.
    pub fn flange_torque(&self, q: &JointVec) -> JointVec {
        inverse::flange_torque(&self.chain, &JointSinesCosines::new(&self.chain, q))
    }

    /// Joint-space mass matrix, kg·m², symmetric, without rotors.
    pub fn mass_matrix(&self, q: &JointVec) -> [[f64; JOINTS]; JOINTS] {
        forward::mass_matrix(&self.chain, q)
    }

    /// Joint accelerations (rad/s²) under torques `tau` (N·m); `rotor` is added to the diagonal of the mass
    /// matrix (kg·m²).
    ///
    /// A joint without any inertia (its row of the mass matrix is lost in rounding) gets the acceleration 0.
    pub fn forward(&self, q: &JointVec, qd: &JointVec, tau: &JointVec, rotor: &JointVec) -> JointVec {
        forward::forward(&self.chain, q, qd, tau, rotor)
    }

    /// Poses of the six joint frames and of the flange in the base frame.
    pub fn forward_kinematics(&self, q: &JointVec) -> [Pose; 7] {
        kinematics::forward_kinematics(&self.chain, q)
    }
}
