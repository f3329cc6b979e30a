//! Functions that solve one equation of a closed form for a rotation angle (the subproblems of Paden and Kahan).
//!
//! If the geometry does not determine the angle, as in singular poses, each function returns its argument `hint`. The
//! arm can differ slightly from the ideal geometry. Therefore, for a target that is slightly out of reach, the
//! functions use the nearest reachable target. The caller refines the result, and drops a result that does not reach
//! the goal.
use nalgebra::Vector3;

use super::chain::turn;

/// Share of the vector's length below which the component perpendicular to the axis consists mainly of rounding
/// errors. The angle is then not determined.
const FREE: f64 = 1e-9;
/// Largest excess of a target over the largest reachable value, as a share of the vectors' lengths.
const SLACK: f64 = 1e-3;

/// Returns the angle of a rotation about `axis` that turns `from` to the direction of `to`, in the plane perpendicular
/// to the axis.
pub(crate) fn turn_onto(axis: &Vector3<f64>, from: &Vector3<f64>, to: &Vector3<f64>, hint: f64) -> f64 {
    let (a, b) = (across(axis, from), across(axis, to));
    if a.norm() <= FREE * from.norm() || b.norm() <= FREE * to.norm() {
        return hint;
    }
    axis.dot(&a.cross(&b)).atan2(a.dot(&b))
}

/// Returns the component of a vector perpendicular to an axis.
pub(crate) fn across(axis: &Vector3<f64>, vector: &Vector3<f64>) -> Vector3<f64> {
    vector - axis * axis.dot(vector)
}

/// Returns the angles, at most two, at which `direction`·R(axis, angle)·`vector` = `value`.
pub(crate) fn turn_to_value(
    direction: &Vector3<f64>,
    axis: &Vector3<f64>,
    vector: &Vector3<f64>,
    value: f64,
    hint: f64,
) -> Vec<f64> {
    let (cosine, sine) = (direction.dot(&across(axis, vector)), direction.dot(&axis.cross(vector)));
    let rest = value - direction.dot(axis) * axis.dot(vector);
    let scale = direction.norm() * vector.norm();
    let amplitude = cosine.hypot(sine);
    if rest.abs() > amplitude + SLACK * scale {
        return Vec::new();
    }
    if amplitude <= FREE * scale {
        return vec![hint];
    }
    let middle = sine.atan2(cosine);
    if rest.abs() >= amplitude {
        return vec![if rest > 0.0 { middle } else { middle + std::f64::consts::PI }];
    }
    let half = (rest / amplitude).acos();
    vec![middle - half, middle + half]
}

/// Returns the angles, at most two, at which `offset` + R(axis, angle)·`arm` has the length `length`.
pub(crate) fn turn_to_length(
    offset: &Vector3<f64>,
    axis: &Vector3<f64>,
    arm: &Vector3<f64>,
    length: f64,
    hint: f64,
) -> Vec<f64> {
    let value = 0.5 * (length * length - offset.norm_squared() - arm.norm_squared());
    turn_to_value(offset, axis, arm, value, hint)
}

/// Returns `vector` after a rotation about `axis` by `angle`.
pub(crate) fn turned(axis: &Vector3<f64>, angle: f64, vector: &Vector3<f64>) -> Vector3<f64> {
    turn(axis, angle) * vector
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vector() -> impl Strategy<Value = Vector3<f64>> {
        prop::array::uniform3(-1.0..1.0f64)
            .prop_map(Vector3::from)
            .prop_filter("a direction", |v| v.norm() > 0.1)
    }

    fn same(a: f64, b: f64) -> bool {
        ((a - b).sin().abs() < 1e-6) && (a - b).cos() > 0.0
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

        #[test]
        fn the_angle_of_a_rotation_is_found(
            axis in vector(), from in vector(), offset in vector(), angle in -3.1..3.1f64, hint in -3.1..3.1f64
        ) {
            let axis = axis.normalize();
            prop_assume!(axis.cross(&from).norm() > 1e-3 && axis.cross(&offset).norm() > 1e-3);
            let to = turned(&axis, angle, &from);
            prop_assert!(same(turn_onto(&axis, &from, &to, hint), angle));
            let values = turn_to_value(&offset, &axis, &from, offset.dot(&to), hint);
            prop_assert!(values.len() <= 2 && values.iter().any(|&found| same(found, angle)));
            for found in values {
                prop_assert!((offset.dot(&turned(&axis, found, &from)) - offset.dot(&to)).abs() < 1e-12);
            }
            let length = (offset + to).norm();
            let lengths = turn_to_length(&offset, &axis, &from, length, hint);
            prop_assert!(lengths.iter().any(|&found| same(found, angle)));
            for found in lengths {
                prop_assert!(((offset + turned(&axis, found, &from)).norm() - length).abs() < 1e-9);
            }
        }

        #[test]
        fn a_free_angle_is_the_hint_and_a_target_too_far_has_none(axis in vector(), angle in -3.1..3.1f64) {
            let axis = axis.normalize();
            prop_assert_eq!(turn_onto(&axis, &axis, &axis, angle), angle);
            prop_assert_eq!(turn_to_value(&axis, &axis, &axis, 1.0, angle), vec![angle]);
            prop_assert!(turn_to_value(&axis, &axis, &axis, 1.1, angle).is_empty());
            let side = across(&axis, &Vector3::new(axis.y, axis.z, -axis.x)) + axis;
            prop_assert!(turn_to_value(&side, &axis, &side, side.norm_squared() * 1.1, angle).is_empty());
        }
    }
}
