//! Forward kinematics: poses of the joint frames and of the flange.

use crate::chain::Chain;
use crate::model::JointVec;
use crate::rotation::{Mat3, apply};
use crate::trig::{sin_cos, sqrt};

/// A pose in the base frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Rotation matrix, row major. The columns of this matrix are the axes of the frame, expressed in the base frame.
    pub rotation: [[f64; 3]; 3],
    /// Origin of the frame in the base frame, m.
    pub position: [f64; 3],
}

pub(crate) fn forward_kinematics(chain: &Chain, q: &JointVec) -> [Pose; 7] {
    let mut pose = Pose { rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], position: [0.0; 3] };
    let mut poses = [pose; 7];
    for (k, (out, place)) in poses.iter_mut().zip(&chain.placements).enumerate() {
        let step = apply(&pose.rotation, &place.xyz);
        for (x, d) in pose.position.iter_mut().zip(step) {
            *x += d;
        }
        // The seventh frame is the flange, which has no joint.
        let (s, c) = q.get(k).map_or((0.0, 1.0), |&q| sin_cos(q));
        pose.rotation = pose.rotation.map(|row| {
            let r = row_product(&row, &place.rotation);
            [c * r[0] + s * r[1], c * r[1] - s * r[0], r[2]]
        });
        *out = pose;
    }
    poses
}

/// Returns the speed of the flange, m/s, at joint velocities `qd` (rad/s).
pub(crate) fn flange_speed(chain: &Chain, q: &JointVec, qd: &JointVec) -> f64 {
    // Velocity of the origin and angular velocity, each expressed in the current frame.
    let (mut v, mut w) = ([0.0; 3], [0.0; 3]);
    for (k, place) in chain.placements.iter().enumerate() {
        let [x, y, z] = place.xyz;
        let reach = [v[0] + w[1] * z - w[2] * y, v[1] + w[2] * x - w[0] * z, v[2] + w[0] * y - w[1] * x];
        // The seventh frame is the flange, whose rotation does not affect the speed.
        let (Some(&q), Some(&qd)) = (q.get(k), qd.get(k)) else { return sqrt(dot(&reach, &reach)) };
        let (s, c) = sin_cos(q);
        let back = |u: [f64; 3]| {
            let r = row_product(&u, &place.rotation);
            [c * r[0] + s * r[1], c * r[1] - s * r[0], r[2]]
        };
        (v, w) = (back(reach), back(w));
        w[2] += qd;
    }
    sqrt(dot(&v, &v))
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Returns the product of one row of a rotation matrix and another rotation matrix.
fn row_product(row: &[f64; 3], m: &Mat3) -> [f64; 3] {
    let column = |k: usize| row[0] * m[0][k] + row[1] * m[1][k] + row[2] * m[2][k];
    [column(0), column(1), column(2)]
}
