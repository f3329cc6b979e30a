//! Inverse kinematics in closed form, for two geometries that cover most arms.
//!
//! * **Spherical wrist**: the last three axes meet in a point (Pieper 1968), and two adjacent axes of the first three
//!   are parallel or meet. The first three joints move this point to its required position, and the last three joints
//!   set the orientation of the flange.
//! * **Three parallel axes**: the second, third and fourth axis are parallel, and the fifth meets the sixth, as in
//!   the arms of Universal Robots (Hawkins 2013). The first joint moves the intersection of axes 5 and 6 to its
//!   required coordinate along the parallel axes. The fifth and the sixth joint set the orientation of the flange,
//!   and the three parallel joints form a planar arm.
//!
//! All values are computed in the base frame from the axes at the joint positions 0 (product of exponentials,
//! Brockett 1984; decomposition by Elias and Wen, IK-Geo, 2022). Therefore the result does not depend on the choice
//! of joint frames.
use jtc_dynamics::JointVec;
use nalgebra::{Matrix3, Vector3};

use super::chain::{Axes, Frame, turn};
use super::subproblems::{across, turn_onto, turn_to_length, turn_to_value, turned};

/// Largest sine of an angle, and largest distance in m, that are treated as zero when the geometry of an arm is
/// determined. The value is above the rounding errors of a robot description. Solutions for the ideal geometry are
/// then refined with the actual geometry of the arm.
pub(crate) const EXACT: f64 = 1e-5;
/// Like [`EXACT`], for an arm whose calibration differs from its ideal geometry. For such an arm, the closed form
/// supplies good starting values for a search.
pub(crate) const NEAR: f64 = 0.02;

/// A geometry with a closed form.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Geometry {
    /// Spherical wrist, whose three axes meet in `centre` (m, at the joint positions 0).
    SphericalWrist { centre: Vector3<f64>, shoulder: Shoulder },
    /// Three parallel axes 2, 3 and 4, with axes 5 and 6 that meet in `centre` (m, at the joint positions 0).
    ThreeParallel { centre: Vector3<f64> },
}

/// Relation between two adjacent axes of the first three joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Shoulder {
    /// Axes 2 and 3 are parallel.
    UpperArmParallel,
    /// Axes 1 and 2 meet in a point.
    BaseMeets(Vector3<f64>),
    /// Axes 2 and 3 meet in a point.
    UpperArmMeets(Vector3<f64>),
    /// Axes 1 and 2 are parallel.
    BaseParallel,
}

impl Geometry {
    /// Returns the geometry of an arm, allowing deviations up to `tolerance`.
    pub(super) fn of(zero: &Axes, tolerance: f64) -> Option<Self> {
        let parallel = |a: usize, b: usize| zero.axis[a].cross(&zero.axis[b]).norm() < tolerance;
        if let Some(centre) = meeting(zero, 3, 4, tolerance)
            && across(&zero.axis[5], &(centre - zero.point[5])).norm() < tolerance
            && !parallel(4, 5)
        {
            let shoulder = if parallel(1, 2) {
                Some(Shoulder::UpperArmParallel)
            } else if let Some(point) = meeting(zero, 0, 1, tolerance) {
                Some(Shoulder::BaseMeets(point))
            } else if let Some(point) = meeting(zero, 1, 2, tolerance) {
                Some(Shoulder::UpperArmMeets(point))
            } else {
                parallel(0, 1).then_some(Shoulder::BaseParallel)
            };
            return shoulder.map(|shoulder| Self::SphericalWrist { centre, shoulder });
        }
        if parallel(1, 2) && parallel(1, 3) && !parallel(0, 1) && !parallel(3, 4) {
            return meeting(zero, 4, 5, tolerance).map(|centre| Self::ThreeParallel { centre });
        }
        None
    }

    /// Returns joint positions at which the flange is at `goal`, except for rounding and the deviations from the
    /// ideal geometry. There are at most eight solutions. The caller must check them, because at some of them the
    /// flange is not at the goal. A joint that the goal does not determine stays at `hint`.
    pub(super) fn solve(&self, zero: &Axes, goal: &Frame, hint: &JointVec) -> Vec<JointVec> {
        let rotation = goal.rotation * zero.flange.rotation.transpose();
        let motion = Motion { rotation, shift: goal.position - rotation * zero.flange.position };
        let mut found = Vec::new();
        match *self {
            Self::SphericalWrist { centre, shoulder } => {
                let target = motion.apply(&centre);
                for arm in shoulder.place(zero, &centre, &target, hint) {
                    wrist(zero, &arm, &rotation, hint, &mut found);
                }
            }
            Self::ThreeParallel { centre } => three_parallel(zero, &centre, &motion, hint, &mut found),
        }
        found
    }
}

/// Returns the point in which two axes meet, or `None` if they do not meet.
fn meeting(zero: &Axes, a: usize, b: usize, tolerance: f64) -> Option<Vector3<f64>> {
    let (u, v) = (zero.axis[a], zero.axis[b]);
    let normal = u.cross(&v);
    // The intersection of nearly parallel axes is undefined.
    if normal.norm() < 0.05 {
        return None;
    }
    let gap = zero.point[b] - zero.point[a];
    let square = normal.norm_squared();
    let (s, t) = (gap.cross(&v).dot(&normal) / square, gap.cross(&u).dot(&normal) / square);
    let (first, second) = (zero.point[a] + u * s, zero.point[b] + v * t);
    ((first - second).norm() < tolerance).then_some((first + second) * 0.5)
}

/// Rigid displacement x ↦ rotation·x + shift.
struct Motion {
    rotation: Matrix3<f64>,
    shift: Vector3<f64>,
}

impl Motion {
    fn apply(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * point + self.shift
    }
}

/// Returns `point` after a rotation about axis `j` by `angle`.
fn moved(zero: &Axes, j: usize, angle: f64, point: &Vector3<f64>) -> Vector3<f64> {
    zero.point[j] + turned(&zero.axis[j], angle, &(point - zero.point[j]))
}

impl Shoulder {
    /// Returns up to four solutions of the first three joints that move `centre` to `target`.
    ///
    /// Let y = E₃·centre and z = E₁⁻¹·target. Because E₂ maps y to z, y and z have equal coordinates along axis 2 and
    /// equal distances from each point of axis 2.
    fn place(
        &self,
        zero: &Axes,
        centre: &Vector3<f64>,
        target: &Vector3<f64>,
        hint: &JointVec,
    ) -> Vec<[f64; 3]> {
        let (h, p) = (&zero.axis, &zero.point);
        let (forearm, reach) = (centre - p[2], target - p[0]);
        // The coordinate of z along axis 2 determines joint 1, and the coordinate of y along axis 2 determines joint 3.
        // The two coordinates are in m, measured from the point on the axis of the joint.
        let first = |along: f64| {
            let found = turn_to_value(&h[1], &h[0], &reach, along - h[1].dot(&p[0]), -hint[0]);
            found.into_iter().map(|angle| -angle).collect::<Vec<_>>()
        };
        let third = |along: f64| turn_to_value(&h[1], &h[2], &forearm, along - h[1].dot(&p[2]), hint[2]);
        let y = |q3: f64| moved(zero, 2, q3, centre);
        let z = |q1: f64| moved(zero, 0, -q1, target);
        let mut pairs = Vec::new();
        let mut pair = |q1: f64, q3: f64| pairs.push((q1, q3));
        match self {
            Self::UpperArmParallel => {
                let offset = across(&h[1], &(p[2] - p[1]));
                for q1 in first(h[1].dot(centre)) {
                    let length = across(&h[1], &(z(q1) - p[1])).norm();
                    let arm = across(&h[1], &forearm);
                    turn_to_length(&offset, &h[2], &arm, length, hint[2]).iter().for_each(|&q3| pair(q1, q3));
                }
            }
            Self::BaseMeets(o) => {
                let length = (target - o).norm();
                for q3 in turn_to_length(&(p[2] - o), &h[2], &forearm, length, hint[2]) {
                    first(h[1].dot(&y(q3))).iter().for_each(|&q1| pair(q1, q3));
                }
            }
            Self::UpperArmMeets(o) => {
                let length = (centre - o).norm();
                for back in turn_to_length(&(p[0] - o), &h[0], &reach, length, -hint[0]) {
                    third(h[1].dot(&z(-back))).iter().for_each(|&q3| pair(-back, q3));
                }
            }
            Self::BaseParallel => {
                let offset = across(&h[1], &(p[0] - p[1]));
                for q3 in third(h[1].dot(target)) {
                    let length = across(&h[1], &(y(q3) - p[1])).norm();
                    let arm = across(&h[1], &reach);
                    turn_to_length(&offset, &h[0], &arm, length, -hint[0]).iter().for_each(|&q| pair(-q, q3));
                }
            }
        }
        let second = |(q1, q3)| [q1, turn_onto(&h[1], &(y(q3) - p[1]), &(z(q1) - p[1]), hint[1]), q3];
        pairs.into_iter().map(second).collect()
    }
}

/// Adds the two solutions of the last three joints. The two solutions differ by a flip of the wrist.
fn wrist(zero: &Axes, arm: &[f64; 3], rotation: &Matrix3<f64>, hint: &JointVec, found: &mut Vec<JointVec>) {
    let h = &zero.axis;
    let before = turn(&h[0], arm[0]) * turn(&h[1], arm[1]) * turn(&h[2], arm[2]);
    let rest = before.transpose() * rotation;
    for q5 in turn_to_value(&h[3], &h[4], &h[5], h[3].dot(&(rest * h[5])), hint[4]) {
        let fifth = turn(&h[4], q5);
        let q4 = turn_onto(&h[3], &(fifth * h[5]), &(rest * h[5]), hint[3]);
        let last = fifth.transpose() * turn(&h[3], q4).transpose() * rest;
        found.push([arm[0], arm[1], arm[2], q4, q5, angle_of(&last, &h[5])]);
    }
}

/// Returns the angle of `rotation`, which is a rotation about `axis`.
fn angle_of(rotation: &Matrix3<f64>, axis: &Vector3<f64>) -> f64 {
    let least = Vector3::ith(axis.iamin(), 1.0);
    let side = across(axis, &least);
    turn_onto(axis, &side, &(rotation * side), 0.0)
}

fn three_parallel(
    zero: &Axes,
    centre: &Vector3<f64>,
    goal: &Motion,
    hint: &JointVec,
    found: &mut Vec<JointVec>,
) {
    let (h, p) = (&zero.axis, &zero.point);
    let along = &h[1];
    // Joints 2, 3 and 4 do not change the coordinate of the centre along their parallel axes. Only joint 1 determines
    // this coordinate.
    let height = along.dot(&(centre - p[0]));
    for back in turn_to_value(along, &h[0], &(goal.apply(centre) - p[0]), height, -hint[0]) {
        let q1 = -back;
        let rest = turn(&h[0], back) * goal.rotation;
        // Joints 2, 3 and 4 do not change the angle between their parallel axes and axis 6, so only joint 5
        // determines this angle.
        for q5 in turn_to_value(along, &h[4], &h[5], along.dot(&(rest * h[5])), hint[4]) {
            let fifth = turn(&h[4], q5);
            let q6 = -turn_onto(&h[5], &(fifth.transpose() * along), &(rest.transpose() * along), -hint[5]);
            let unturned = moved(zero, 5, -q6, &moved(zero, 4, -q5, &p[3]));
            let elbow_to = moved(zero, 0, back, &goal.apply(&unturned));
            let planar = rest * turn(&h[5], q6).transpose() * fifth.transpose();
            let sum = angle_of(&planar, along);
            planar_arm(zero, &elbow_to, sum, hint, |q2, q3, q4| found.push([q1, q2, q3, q4, q5, q6]));
        }
    }
}

/// Solves joints 2, 3 and 4, whose axes are parallel. Axis 4 must reach the point `to`, and the sum of the three
/// rotations about axis 2 is `sum` (rad).
fn planar_arm(
    zero: &Axes,
    to: &Vector3<f64>,
    sum: f64,
    hint: &JointVec,
    mut found: impl FnMut(f64, f64, f64),
) {
    let (h, p) = (&zero.axis, &zero.point);
    let along = &h[1];
    let target = across(along, &(to - p[1]));
    let (offset, forearm) = (across(along, &(p[2] - p[1])), across(along, &(p[3] - p[2])));
    for q3 in turn_to_length(&offset, &h[2], &forearm, target.norm(), hint[2]) {
        let q2 = turn_onto(along, &(offset + turned(&h[2], q3, &forearm)), &target, hint[1]);
        let sign = |j: usize| along.dot(&h[j]).signum();
        found(q2, q3, sign(3) * (sum - q2 - sign(2) * q3));
    }
}
