//! Rotation matrices, and the principal moments of a symmetric matrix. The precomputation and the kinematics use these 3×3 matrices.

use crate::trig::{sin_cos, sqrt};

/// A 3×3 matrix, row major.
pub(crate) type Mat3 = [[f64; 3]; 3];

/// Returns Rz(yaw)·Ry(pitch)·Rx(roll).
pub(crate) fn from_rpy(rpy: &[f64; 3]) -> Mat3 {
    from_sines_cosines(&rpy.map(sin_cos))
}

/// Like [`from_rpy`], but takes the sines and cosines of the angles.
pub(crate) fn from_sines_cosines(&[(sr, cr), (sp, cp), (sy, cy)]: &[(f64, f64); 3]) -> Mat3 {
    [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
}

pub(crate) fn transpose(m: &Mat3) -> Mat3 {
    let [[a, b, c], [d, e, f], [g, h, i]] = *m;
    [[a, d, g], [b, e, h], [c, f, i]]
}

#[inline(always)]
pub(crate) fn apply(m: &Mat3, v: &[f64; 3]) -> [f64; 3] {
    let row = |r: &[f64; 3]| r[0] * v[0] + r[1] * v[1] + r[2] * v[2];
    [row(&m[0]), row(&m[1]), row(&m[2])]
}

pub(crate) fn product(a: &Mat3, b: &Mat3) -> Mat3 {
    let columns = transpose(b);
    transpose(&[apply(a, &columns[0]), apply(a, &columns[1]), apply(a, &columns[2])])
}

/// Returns m·s·mᵀ.
pub(crate) fn congruent(m: &Mat3, s: &Mat3) -> Mat3 {
    product(&product(m, s), &transpose(m))
}

/// Returns the rotation about z with sine `s` and cosine `c` as a matrix.
pub(crate) fn about_z(s: f64, c: f64) -> Mat3 {
    [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]
}

/// Returns the rotation about x with sine `s` and cosine `c` as a matrix.
pub(crate) fn about_x(s: f64, c: f64) -> Mat3 {
    [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]
}

/// Returns `(x, y)` as a unit vector, or `(1, 0)` if the direction of the vector is undefined.
pub(crate) fn unit(x: f64, y: f64) -> (f64, f64) {
    let largest = x.abs().max(y.abs());
    if largest == 0.0 || !largest.is_finite() {
        return (1.0, 0.0);
    }
    let (x, y) = (x / largest, y / largest);
    let length = sqrt(x * x + y * y);
    (x / length, y / length)
}

/// Returns the eigenvalues of a symmetric matrix of finite numbers in ascending order (Jacobi rotations). The function does 8 sweeps, far
/// more than are necessary for convergence.
pub(crate) fn principal_moments(m: &Mat3) -> [f64; 3] {
    let [[mut xx, mut xy, mut xz], [_, mut yy, mut yz], [_, _, mut zz]] = *m;
    let scale = [xx, xy, xz, yy, yz, zz].iter().fold(0.0f64, |a, v| a.max(v.abs()));
    if scale == 0.0 {
        return [0.0; 3];
    }
    for v in [&mut xx, &mut xy, &mut xz, &mut yy, &mut yz, &mut zz] {
        *v /= scale;
    }
    for _ in 0..8 {
        (xx, yy, xy, xz, yz) = eliminate(xx, yy, xy, xz, yz);
        (xx, zz, xz, xy, yz) = eliminate(xx, zz, xz, xy, yz);
        (yy, zz, yz, xy, xz) = eliminate(yy, zz, yz, xy, xz);
    }
    let (low, high) = (xx.min(yy), xx.max(yy));
    [low.min(zz) * scale, low.max(high.min(zz)) * scale, high.max(zz) * scale]
}

/// Rotates in the plane of `a` and `b`, so that their off-diagonal element `ab` becomes zero. The elements `ac` and `bc` are rotated in the
/// same way.
fn eliminate(a: f64, b: f64, ab: f64, ac: f64, bc: f64) -> (f64, f64, f64, f64, f64) {
    let half = 0.5 * (b - a);
    let root = sqrt(half * half + ab * ab);
    if root == 0.0 {
        // The moments are equal within the precision of the square root, so any rotation is valid.
        return (a, b, 0.0, ac, bc);
    }
    // The tangent of the smaller of the two possible rotation angles.
    let t = ab / (half + root.copysign(half));
    let c = 1.0 / sqrt(1.0 + t * t);
    let s = t * c;
    (a - t * ab, b + t * ab, 0.0, c * ac - s * bc, s * ac + c * bc)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn without_a_direction_a_unit_vector_points_along_x() {
        for x in [0.0, -0.0, f64::INFINITY, f64::NAN] {
            assert_eq!(unit(x, 0.0 * x), (1.0, 0.0));
            assert_eq!(unit(0.0 * x, x), (1.0, 0.0));
        }
    }

    #[test]
    fn j06_a_ball_and_a_point_have_three_equal_moments() {
        for moment in [0.0, 1.0, -2.0] {
            let ball = [[moment, 0.0, 0.0], [0.0, moment, 0.0], [0.0, 0.0, moment]];
            assert_eq!(principal_moments(&ball), [moment; 3]);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

        #[test]
        fn a_unit_vector_keeps_the_direction_whatever_the_length(angle in -3.2..3.2f64, exponent in -300..300i32) {
            let length = 10f64.powi(exponent);
            let (x, y) = unit(length * angle.cos(), length * angle.sin());
            prop_assert!((x - angle.cos()).abs() < 4e-16 && (y - angle.sin()).abs() < 4e-16, "{x} {y}");
        }

        /// The rotation of a matrix does not change its principal moments. The test uses many units, and moments that
        /// are equal, zero or negative.
        #[test]
        fn principal_moments_are_those_before_a_turn(
            moments in prop::array::uniform3(prop_oneof![Just(0.0), Just(1.0), Just(-1.0), -2.0..2.0f64, -1e-9..1e-9f64]),
            rpy in prop::array::uniform3(prop_oneof![Just(0.0), Just(1e-9), Just(-1e-5), -3.2..3.2f64]),
            exponent in -120..120i32,
        ) {
            let unit = 10f64.powi(exponent);
            let [a, b, c] = moments.map(|moment| moment * unit);
            let turned = congruent(&from_rpy(&rpy), &[[a, 0.0, 0.0], [0.0, b, 0.0], [0.0, 0.0, c]]);
            let mut expected = [a, b, c];
            expected.sort_by(f64::total_cmp);
            for (got, wanted) in principal_moments(&turned).iter().zip(expected) {
                prop_assert!((got - wanted).abs() <= 4e-15 * unit, "{got} {wanted}");
            }
        }
    }
}
