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
mod payload;
mod rotation;
mod trig;
mod unroll;

use inverse::JointSinesCosines;

pub use kinematics::Pose;
pub use model::{ArmModel, Field, JOINTS, JointVec, Link, ModelError, Origin};
pub use payload::{LinkInertias, Payload, PayloadError};
pub use trig::{SIN_COS_MAX, sin_cos, sqrt};

/// An arm prepared for kinematics and dynamics: values that do not depend on the joint positions are precomputed.
///
/// The functions of this type never return an error and never panic. For a NaN, an infinite argument or a position whose magnitude is above
/// [`SIN_COS_MAX`] the results are not valid, and usually NaN.
#[derive(Clone, Debug)]
pub struct Dynamics {
    chain: chain::Chain,
}

impl Dynamics {
    /// Prepares `model`. `gravity` is the acceleration of gravity in the base frame, m/s²; (0, 0, −9.81) for an upright arm.
    ///
    /// The model must have passed [`ArmModel::check`], otherwise the results are not valid.
    pub fn new(model: &ArmModel, gravity: [f64; 3]) -> Self {
        Self::with_payload(model, gravity, &Payload::default())
    }

    /// Like [`Dynamics::new`], with a `payload` at the flange, as if it were a part of the last link (J-60). The payload must have passed
    /// [`Payload::check`]. The result of [`Dynamics::flange_torque`] does not include the payload.
    pub fn with_payload(model: &ArmModel, gravity: [f64; 3], payload: &Payload) -> Self {
        Self { chain: chain::Chain::new(model, gravity, payload) }
    }

    /// Returns the masses and inertias of the arm and its payload.
    pub fn inertias(&self) -> LinkInertias {
        LinkInertias(self.chain.base_parameters)
    }

    /// Sets the masses and inertias for all later calls. `inertias` must come from an arm with the same joints.
    #[inline(always)]
    pub fn set_inertias(&mut self, inertias: &LinkInertias) {
        self.chain.base_parameters = inertias.0;
    }

    /// Returns the joint torques (N·m) for positions `q` (rad), velocities `qd` (rad/s) and accelerations `qdd` (rad/s²), without friction
    /// and rotors (recursive Newton-Euler).
    pub fn inverse(&self, q: &JointVec, qd: &JointVec, qdd: &JointVec) -> JointVec {
        inverse::inverse(&self.chain, q, qd, qdd)
    }

    /// Returns the joint torques (N·m) that hold the arm at rest at the positions `q` (rad).
    pub fn gravity_torque(&self, q: &JointVec) -> JointVec {
        inverse::gravity_torque(&self.chain, &JointSinesCosines::new(&self.chain, q))
    }

    /// Returns the joint torques (N·m) that hold 1 kg at the origin of the flange at rest at the positions `q` (rad), without the weight of
    /// the arm itself. The torques are the gravity force on 1 kg multiplied by the transposed Jacobian of the flange.
    pub fn flange_torque(&self, q: &JointVec) -> JointVec {
        inverse::flange_torque(&self.chain, &JointSinesCosines::new(&self.chain, q))
    }

    /// Returns the joint-space mass matrix (kg·m²) at the positions `q` (rad). The mass matrix is symmetric and does not contain the rotor
    /// inertias (composite-rigid-body algorithm).
    pub fn mass_matrix(&self, q: &JointVec) -> [[f64; JOINTS]; JOINTS] {
        forward::mass_matrix(&self.chain, q)
    }

    /// Returns the inertia (kg·m²) that acts on each joint at the positions `q` (rad) while all other joints are free to move. A torque on
    /// this joint alone accelerates this inertia, which is the smallest possible value. `rotor` has the same meaning as in
    /// [`Dynamics::forward`]. The felt inertia is infinite for a joint without inertia.
    pub fn felt_inertia(&self, q: &JointVec, rotor: &JointVec) -> JointVec {
        forward::felt_inertia(&self.chain, q, rotor)
    }

    /// Like [`Dynamics::felt_inertia`], but returns the inertia of one joint only. `joint` is an index from 0.
    #[inline(never)]
    pub fn felt_inertia_of(&self, q: &JointVec, rotor: &JointVec, joint: usize) -> f64 {
        forward::felt_inertia_of(&self.chain, q, rotor, joint)
    }

    /// Returns the joint accelerations (rad/s²) at positions `q` (rad) and velocities `qd` (rad/s) under torques `tau` (N·m). `rotor`
    /// contains the inertias of the rotors about their joint axes (kg·m²), which are added to the diagonal of the mass matrix.
    ///
    /// A joint without inertia, whose pivot is zero or a rounding error, has the acceleration 0.
    pub fn forward(&self, q: &JointVec, qd: &JointVec, tau: &JointVec, rotor: &JointVec) -> JointVec {
        forward::forward(&self.chain, q, qd, tau, rotor)
    }

    /// Returns the speed of the origin of the flange (m/s) at positions `q` (rad) and velocities `qd` (rad/s).
    #[inline(never)]
    pub fn flange_speed(&self, q: &JointVec, qd: &JointVec) -> f64 {
        kinematics::flange_speed(&self.chain, q, qd)
    }

    /// Returns the poses, in the base frame (m), of the joint frames from base to wrist and of the flange, at the positions `q` (rad). Each
    /// joint frame is the joint frame of the model after the rotation of that joint.
    pub fn forward_kinematics(&self, q: &JointVec) -> [Pose; 7] {
        kinematics::forward_kinematics(&self.chain, q)
    }
}
