//! Orientations in the forms that users write: quaternions, and roll, pitch and yaw.
use jtc_dynamics::Pose;
use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion};

use super::PoseError;
use super::chain::Frame;

/// Maximum deviation of the length of a quaternion from 1. A deviation of 0.001 permits values with few digits.
const UNIT: f64 = 1e-3;
/// Maximum deviation of the entries of RᵀR from the unit matrix.
const ROTATION: f64 = 1e-6;

/// Orientation of a flange pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Orientation {
    /// A unit quaternion x, y, z, w with the scalar last, as in ROS. A length between 0.999 and 1.001 is accepted, so
    /// values with few digits are sufficient.
    Quaternion([f64; 4]),
    /// Roll, pitch and yaw, rad, about the fixed axes x, y and z in this order: Rz(yaw)·Ry(pitch)·Rx(roll), as in a
    /// URDF.
    Rpy([f64; 3]),
}

impl Orientation {
    /// Returns the pose with this orientation at `position` (m, in the base frame).
    ///
    /// # Errors
    ///
    /// Returns [`PoseError::NotFinite`] for a value that is not finite. Returns [`PoseError::NotUnit`] for a quaternion whose length
    /// deviates from 1 by more than a thousandth.
    pub fn at(&self, position: [f64; 3]) -> Result<Pose, PoseError> {
        finite(&POSITION, &position)?;
        let rotation = match self {
            Self::Quaternion(parts) => {
                finite(&["quaternion x", "quaternion y", "quaternion z", "quaternion w"], parts)?;
                let [x, y, z, w] = *parts;
                let quaternion = Quaternion::new(w, x, y, z);
                let length = quaternion.norm();
                if (length - 1.0).abs() > UNIT {
                    return Err(PoseError::NotUnit { length });
                }
                UnitQuaternion::from_quaternion(quaternion).to_rotation_matrix()
            }
            Self::Rpy(angles) => {
                finite(&["roll", "pitch", "yaw"], angles)?;
                Rotation3::from_euler_angles(angles[0], angles[1], angles[2])
            }
        };
        Ok((&Frame { rotation: rotation.into_inner(), position: position.into() }).into())
    }
}

/// Returns the orientation of a pose as a unit quaternion x, y, z, w, with w ≥ 0.
pub fn quaternion_of(pose: &Pose) -> [f64; 4] {
    let rotation = Rotation3::from_matrix_unchecked(Frame::from(pose).rotation);
    let q = UnitQuaternion::from_rotation_matrix(&rotation);
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    [q.i, q.j, q.k, q.w].map(|part| sign * part)
}

/// Returns the orientation of a pose as roll, pitch and yaw, rad, with the pitch within ±π/2. At a pitch of ±π/2, only
/// the sum or the difference of roll and yaw is defined, and the returned roll is 0.
pub fn rpy_of(pose: &Pose) -> [f64; 3] {
    let r = &pose.rotation;
    let flat = r[2][1].hypot(r[2][2]);
    let pitch = (-r[2][0]).atan2(flat);
    if flat < 1e-9 {
        return [0.0, pitch, (-r[0][1]).atan2(r[1][1])];
    }
    [r[2][1].atan2(r[2][2]), pitch, r[1][0].atan2(r[0][0])]
}

const POSITION: [&str; 3] = ["position x", "position y", "position z"];

/// Checks a pose and returns it with an exact rotation matrix.
///
/// # Errors
///
/// Returns [`PoseError::NotFinite`] for a value that is not finite. Returns [`PoseError::NotRotation`] for a matrix that is not a rotation
/// matrix, except for rounding.
pub(crate) fn checked(pose: &Pose) -> Result<Frame, PoseError> {
    finite(&POSITION, &pose.position)?;
    finite(&["an entry of the rotation matrix"; 9], pose.rotation.as_flattened())?;
    let frame = Frame::from(pose);
    let deviation = (frame.rotation.tr_mul(&frame.rotation) - Matrix3::identity()).amax();
    if deviation > ROTATION {
        return Err(PoseError::NotRotation { deviation });
    }
    if frame.rotation.determinant() < 0.0 {
        return Err(PoseError::NotRotation { deviation: 2.0 });
    }
    // A single Newton step towards the nearest rotation matrix. The remaining deviation is about the square of the
    // previous deviation.
    let rotation =
        frame.rotation * (Matrix3::identity() * 3.0 - frame.rotation.tr_mul(&frame.rotation)) * 0.5;
    Ok(Frame { rotation, ..frame })
}

fn finite(names: &[&'static str], values: &[f64]) -> Result<(), PoseError> {
    match names.iter().zip(values).find(|(_, value)| !value.is_finite()) {
        Some((&what, &value)) => Err(PoseError::NotFinite { what, value }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const S: f64 = std::f64::consts::FRAC_1_SQRT_2;

    /// Returns the rows of Rz(yaw)·Ry(pitch)·Rx(roll), computed from the written-out formula.
    fn written_out([roll, pitch, yaw]: [f64; 3]) -> [[f64; 3]; 3] {
        let ((sr, cr), (sp, cp), (sy, cy)) = (roll.sin_cos(), pitch.sin_cos(), yaw.sin_cos());
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    }

    fn near(a: &[f64], b: &[f64]) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12)
    }

    /// A quarter turn about z maps x to y, about x maps y to z, and about y maps z to x.
    #[test]
    fn quarter_turns_are_those_of_the_conventions() {
        let quarter = std::f64::consts::FRAC_PI_2;
        let about_z = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
        let about_y = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]];
        let about_x = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]];
        for (rpy, quaternion, rotation) in [
            ([0.0, 0.0, quarter], [0.0, 0.0, S, S], about_z),
            ([0.0, quarter, 0.0], [0.0, S, 0.0, S], about_y),
            ([quarter, 0.0, 0.0], [S, 0.0, 0.0, S], about_x),
        ] {
            for given in [Orientation::Rpy(rpy), Orientation::Quaternion(quaternion)] {
                let pose = given.at([1.0, 2.0, 3.0]).unwrap();
                assert!(near(pose.rotation.as_flattened(), rotation.as_flattened()), "{given:?}: {pose:?}");
                assert_eq!(pose.position, [1.0, 2.0, 3.0]);
                assert!(near(&quaternion_of(&pose), &quaternion) && near(&rpy_of(&pose), &rpy), "{pose:?}");
            }
        }
    }

    #[test]
    fn what_is_no_orientation_is_refused_with_what_is_wrong() {
        let at = |orientation: Orientation| orientation.at([0.0; 3]);
        let long = at(Orientation::Quaternion([0.0, 0.0, 1.0, 1.0])).unwrap_err();
        assert_eq!(long, PoseError::NotUnit { length: 2f64.sqrt() });
        assert_eq!(long.to_string(), "the quaternion has the length 1.414214, expected 1");
        // Quaternions with three digits are sufficiently precise.
        at(Orientation::Quaternion([0.0, 0.0, 0.707, 0.707])).unwrap();
        let nan = at(Orientation::Rpy([0.0, f64::NAN, 0.0])).unwrap_err();
        assert!(matches!(nan, PoseError::NotFinite { what: "pitch", .. }), "{nan}");
        let far = Orientation::Rpy([0.0; 3]).at([0.0, 0.0, f64::INFINITY]).unwrap_err();
        assert_eq!(far, PoseError::NotFinite { what: "position z", value: f64::INFINITY });
        let mut mirror = at(Orientation::Rpy([0.0; 3])).unwrap();
        mirror.rotation[2][2] = -1.0;
        assert_eq!(checked(&mirror).unwrap_err(), PoseError::NotRotation { deviation: 2.0 });
        mirror.rotation[2][2] = 0.9;
        let PoseError::NotRotation { deviation } = checked(&mirror).unwrap_err() else { panic!() };
        assert!((deviation - 0.19).abs() < 1e-12);
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

        #[test]
        fn conversions_agree_and_return(rpy in (-3.1..3.1f64, -1.57..1.57f64, -3.1..3.1f64)) {
            let rpy = [rpy.0, rpy.1, rpy.2];
            let pose = Orientation::Rpy(rpy).at([0.1, 0.2, 0.3]).unwrap();
            prop_assert!(near(pose.rotation.as_flattened(), written_out(rpy).as_flattened()));
            let again = Orientation::Quaternion(quaternion_of(&pose)).at(pose.position).unwrap();
            prop_assert!(near(again.rotation.as_flattened(), pose.rotation.as_flattened()));
            prop_assert!(quaternion_of(&pose)[3] >= 0.0);
            prop_assert!(rpy_of(&pose).iter().zip(rpy).all(|(a, b)| (a - b).abs() < 1e-9));
        }

        /// If roll and yaw are ambiguous, the returned values describe the same orientation.
        #[test]
        fn upright_pitches_return_the_same_orientation(roll in -3.1..3.1f64, yaw in -3.1..3.1f64, up in any::<bool>()) {
            let pitch = if up { std::f64::consts::FRAC_PI_2 } else { -std::f64::consts::FRAC_PI_2 };
            let pose = Orientation::Rpy([roll, pitch, yaw]).at([0.0; 3]).unwrap();
            let again = Orientation::Rpy(rpy_of(&pose)).at([0.0; 3]).unwrap();
            prop_assert!(near(again.rotation.as_flattened(), pose.rotation.as_flattened()));
        }

        #[test]
        fn a_rounded_rotation_is_made_exact(rpy in prop::array::uniform3(-3.1..3.1f64)) {
            let exact = Orientation::Rpy(rpy).at([0.0; 3]).unwrap();
            let rounded = Pose { rotation: exact.rotation.map(|row| row.map(|v| (v * 1e7).round() / 1e7)), ..exact };
            let r = checked(&rounded).unwrap().rotation;
            prop_assert!((r.tr_mul(&r) - Matrix3::identity()).amax() < 1e-13);
            prop_assert!((r - Frame::from(&exact).rotation).amax() < 1e-7);
        }
    }
}
