//! Model of the arm as six axes in space, with forward kinematics, the Jacobian and its rate.
use jtc_dynamics::{ArmModel, Dynamics, JOINTS, JointVec, Pose};
use nalgebra::{Matrix3, Matrix6, Rotation3, UnitQuaternion, Vector3, Vector6};

/// A pose of the flange, in the base frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Frame {
    pub rotation: Matrix3<f64>,
    /// Position, m.
    pub position: Vector3<f64>,
}

impl From<&Pose> for Frame {
    fn from(pose: &Pose) -> Self {
        let r = &pose.rotation;
        Self { rotation: Matrix3::from_fn(|i, k| r[i][k]), position: pose.position.into() }
    }
}

impl From<&Frame> for Pose {
    fn from(frame: &Frame) -> Self {
        let rotation = std::array::from_fn(|i| std::array::from_fn(|k| frame.rotation[(i, k)]));
        Self { rotation, position: frame.position.into() }
    }
}

/// Returns the rotation about `axis`, a unit vector, by `angle` rad.
pub(crate) fn turn(axis: &Vector3<f64>, angle: f64) -> Matrix3<f64> {
    exponential(&(axis * angle))
}

/// Returns the rotation with this rotation vector (rad).
pub(crate) fn exponential(vector: &Vector3<f64>) -> Matrix3<f64> {
    Rotation3::new(*vector).into_inner()
}

/// Returns the rotation vector (rad) of a rotation, with a length of at most π.
pub(crate) fn logarithm(rotation: &Matrix3<f64>) -> Vector3<f64> {
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*rotation)).scaled_axis()
}

/// Axes of an arm at given joint positions.
#[derive(Clone, Debug)]
pub(crate) struct Chain {
    dynamics: Dynamics,
    /// Divisor of lengths in the Jacobian and in residuals, m. The value is the length of the stretched arm from its
    /// first axis to the flange.
    pub length: f64,
    /// Axes at the joint positions 0. The closed forms use these axes.
    pub zero: Axes,
}

/// Axes and flange at given joint positions, in the base frame.
#[derive(Clone, Debug)]
pub(crate) struct Axes {
    /// Directions of the axes, as unit vectors.
    pub axis: [Vector3<f64>; JOINTS],
    /// A point on each axis, m.
    pub point: [Vector3<f64>; JOINTS],
    pub flange: Frame,
}

impl Chain {
    pub(super) fn new(model: &ArmModel) -> Self {
        let dynamics = Dynamics::new(model, [0.0; 3]);
        let zero = axes(&dynamics, &[0.0; JOINTS]);
        let lengths = model.joints[1..].iter().map(|joint| Vector3::from(joint.xyz).norm());
        let length: f64 = lengths.sum();
        Self { dynamics, length: if length > 0.0 { length } else { 1.0 }, zero }
    }

    pub(super) fn at(&self, q: &JointVec) -> Axes {
        axes(&self.dynamics, q)
    }

    pub(super) fn flange(&self, q: &JointVec) -> Pose {
        self.dynamics.forward_kinematics(q)[JOINTS]
    }

    /// Returns the residual from `axes` to `goal` in the base frame. The first part is the translation divided by
    /// [`Chain::length`], and the second part is the rotation vector (rad).
    pub(super) fn residual(&self, goal: &Frame, axes: &Axes) -> Vector6<f64> {
        let shift = (goal.position - axes.flange.position) / self.length;
        let turn = logarithm(&(goal.rotation * axes.flange.rotation.transpose()));
        Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
    }

    /// Returns the geometric Jacobian of the flange with translations divided by [`Chain::length`]. The division makes
    /// the singular values comparable.
    pub(super) fn scaled_jacobian(&self, axes: &Axes) -> Matrix6<f64> {
        let mut jacobian = axes.jacobian();
        jacobian.fixed_rows_mut::<3>(0).scale_mut(1.0 / self.length);
        jacobian
    }
}

fn axes(dynamics: &Dynamics, q: &JointVec) -> Axes {
    let poses = dynamics.forward_kinematics(q);
    Axes {
        axis: std::array::from_fn(|j| Vector3::from(poses[j].rotation.map(|row| row[2]))),
        point: std::array::from_fn(|j| poses[j].position.into()),
        flange: (&poses[JOINTS]).into(),
    }
}

impl Axes {
    /// Returns the geometric Jacobian of the flange in the base frame, first for translation (m/rad) and then for
    /// rotation (rad/rad).
    pub(super) fn jacobian(&self) -> Matrix6<f64> {
        let mut jacobian = Matrix6::zeros();
        for j in 0..JOINTS {
            let shift = self.axis[j].cross(&(self.flange.position - self.point[j]));
            jacobian.fixed_view_mut::<3, 1>(0, j).copy_from(&shift);
            jacobian.fixed_view_mut::<3, 1>(3, j).copy_from(&self.axis[j]);
        }
        jacobian
    }

    /// Returns the rate of change of the Jacobian while the joints move with the velocity `qd`.
    pub(super) fn jacobian_rate(&self, qd: &Vector6<f64>) -> Matrix6<f64> {
        let mut rate = Matrix6::zeros();
        let flange = self.jacobian().fixed_rows::<3>(0) * qd;
        let mut spin = Vector3::zeros();
        for j in 0..JOINTS {
            // Velocity of the point on axis `j`, caused by the joints before this axis.
            let moved = (0..j).map(|k| self.axis[k].cross(&(self.point[j] - self.point[k])) * qd[k]);
            let speed = moved.fold(Vector3::zeros(), |sum, v| sum + v);
            let turned = spin.cross(&self.axis[j]);
            let shift =
                turned.cross(&(self.flange.position - self.point[j])) + self.axis[j].cross(&(flange - speed));
            rate.fixed_view_mut::<3, 1>(0, j).copy_from(&shift);
            rate.fixed_view_mut::<3, 1>(3, j).copy_from(&turned);
            spin += self.axis[j] * qd[j];
        }
        rate
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kinematics::test_arms;
    use proptest::prelude::*;

    /// Returns central differences of the frame per unit of the parameter, for translation and rotation.
    fn difference(before: &Frame, after: &Frame, step: f64) -> Vector6<f64> {
        let shift = (after.position - before.position) / (2.0 * step);
        let turn = logarithm(&(after.rotation * before.rotation.transpose())) / (2.0 * step);
        Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(100) })]

        #[test]
        fn the_jacobian_and_its_rate_are_the_differences_of_the_forward_kinematics(
            q in prop::array::uniform6(-3.0..3.0f64), qd in prop::array::uniform6(-1.0..1.0f64)
        ) {
            for model in test_arms::all() {
                let chain = Chain::new(&model);
                let along = |s: f64| chain.at(&std::array::from_fn(|j| q[j] + s * qd[j]));
                let (step, velocity) = (1e-5, Vector6::from(qd));
                let twist = difference(&along(-step).flange, &along(step).flange, step);
                prop_assert!((along(0.0).jacobian() * velocity - twist).amax() < 1e-8);
                let rate = (along(step).jacobian() - along(-step).jacobian()) / (2.0 * step);
                prop_assert!((along(0.0).jacobian_rate(&velocity) - rate).amax() < 1e-8);
            }
        }

        #[test]
        fn a_rotation_vector_is_that_of_its_rotation(vector in prop::array::uniform3(-1.8..1.8f64)) {
            let vector = Vector3::from(vector);
            prop_assert!((logarithm(&exponential(&vector)) - vector).amax() < 1e-12);
        }
    }
}
