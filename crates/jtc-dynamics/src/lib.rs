//! Arm model, kinematics and dynamics of a six-axis arm.
#![no_std]
#![forbid(unsafe_code)]

/// Number of actuated joints.
pub const JOINTS: usize = 6;

/// One value per joint, base to wrist.
pub type JointVec = [f64; JOINTS];

/// A frame placed in its parent as URDF does: translate by `xyz` (m), then rotate by
/// Rz(yaw)·Ry(pitch)·Rx(roll) (rad).
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Origin {
    /// Translation in the parent frame, m.
    pub xyz: [f64; 3],
    /// Roll, pitch, yaw, rad.
    pub rpy: [f64; 3],
}

/// A rigid link: mass, centre of mass and inertia about it.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Link {
    /// Centre of mass (xyz) and orientation of the inertia frame (rpy) in the link frame.
    pub origin: Origin,
    /// Ixx, Ixy, Ixz, Iyy, Iyz, Izz about the centre of mass in the frame of `origin`, kg·m².
    pub inertia: [f64; 6],
    /// Mass, kg.
    pub mass: f64,
}

/// The arm as rule J-40 and the ArmModel frame describe it.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct ArmModel {
    /// Joint i places link i+1 on link i; joint 6 is the fixed flange.
    pub joints: [Origin; 7],
    /// Link 0 is the base.
    pub links: [Link; 7],
}

/// Why a model is not physical (J-06).
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum ModelError {
    /// A number is NaN or infinite.
    NotFinite,
}

impl ArmModel {
    /// Physical checks of rule J-06.
    pub fn check(&self) -> Result<(), ModelError> {
        unimplemented!()
    }
}

/// A pose in the base frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Rotation matrix, row major: columns are the frame's axes in the base frame.
    pub rotation: [[f64; 3]; 3],
    /// Origin in the base frame, m.
    pub position: [f64; 3],
}

/// A model made ready to compute with: all that does not depend on the joint positions is precomputed.
#[derive(Clone, Debug)]
pub struct Dynamics {}

impl Dynamics {
    /// `gravity`: acceleration of gravity in the base frame, m/s².
    pub fn new(_model: &ArmModel, _gravity: [f64; 3]) -> Self {
        unimplemented!()
    }
    /// Joint torques (N·m) for positions (rad), velocities (rad/s) and accelerations (rad/s²); recursive Newton-Euler.
    pub fn inverse(&self, _q: &JointVec, _qd: &JointVec, _qdd: &JointVec) -> JointVec {
        unimplemented!()
    }
    /// Joint torques that hold the arm still at `q`, N·m.
    pub fn gravity_torque(&self, _q: &JointVec) -> JointVec {
        unimplemented!()
    }
    /// Joint-space mass matrix, kg·m², symmetric, without rotors.
    pub fn mass_matrix(&self, _q: &JointVec) -> [[f64; JOINTS]; JOINTS] {
        unimplemented!()
    }
    /// Joint accelerations (rad/s²) under torques `tau` (N·m); `rotor` is added to the diagonal of the mass matrix (kg·m²).
    pub fn forward(&self, _q: &JointVec, _qd: &JointVec, _tau: &JointVec, _rotor: &JointVec) -> JointVec {
        unimplemented!()
    }
    /// Poses of the six joint frames and of the flange in the base frame.
    pub fn forward_kinematics(&self, _q: &JointVec) -> [Pose; 7] {
        unimplemented!()
    }
}
