//! Vectors and poses for the tests of lines.
use std::f64::consts::PI;

use jtc_dynamics::{JOINTS, Pose};
use jtc_plan::kinematics::{Orientation, PoseError};

/// A point or a direction.
pub(crate) type Vec3 = [f64; 3];

pub(crate) fn sub(a: Vec3, b: Vec3) -> Vec3 {
    std::array::from_fn(|i| a[i] - b[i])
}

pub(crate) fn dot(a: Vec3, b: Vec3) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

pub(crate) fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(crate) fn norm(a: Vec3) -> f64 {
    dot(a, a).sqrt()
}

/// Returns `pose` moved by `shift` (m) and rotated about its own z, y and x axes by `turn` (rad).
pub(crate) fn moved(pose: &Pose, shift: Vec3, turn: Vec3) -> Pose {
    let by = Orientation::Rpy(turn).at([0.0; 3]).unwrap().rotation;
    let product = |i: usize, k: usize| (0..3).map(|j| pose.rotation[i][j] * by[j][k]).sum::<f64>();
    let rotation: [Vec3; 3] = std::array::from_fn(|i| std::array::from_fn(|k| product(i, k)));
    Pose { rotation, position: std::array::from_fn(|i| pose.position[i] + shift[i]) }
}

/// Position range of two turns for each joint.
pub(crate) const WIDE: [(f64, f64); JOINTS] = [(-2.0 * PI, 2.0 * PI); JOINTS];

/// Returns the number of the leg, the distance along this leg, and the error on the leg.
pub(crate) fn on_leg(error: PoseError) -> (usize, f64, PoseError) {
    match error {
        PoseError::Leg { leg, distance, source, .. } => (leg, distance, *source),
        other => panic!("{other}"),
    }
}
