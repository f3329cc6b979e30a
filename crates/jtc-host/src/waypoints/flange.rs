//! Flange poses in files. The ten possible values are: three for the position, four for a quaternion, and three for the
//! angles roll, pitch and yaw.

use jtc_plan::kinematics::Orientation;

use super::Target;

/// Names of the values: a position (m), a quaternion, and roll, pitch and yaw (rad).
pub(super) const NAMES: [&str; 10] = ["x", "y", "z", "qx", "qy", "qz", "qw", "roll", "pitch", "yaw"];
/// Indices of the angles in [`NAMES`].
pub(super) const ANGLES: std::ops::Range<usize> = 7..10;

/// Returns the flange pose for these values. Returns `None` if all values are missing. If `point` is set, the orientation may be missing.
///
/// # Errors
///
/// Returns an error message if a value is missing or occurs twice.
pub(super) fn target(given: &[Option<f64>; NAMES.len()], point: bool) -> Result<Option<Target>, String> {
    let [x, y, z, qx, qy, qz, qw, roll, pitch, yaw] = *given;
    if given.iter().all(Option::is_none) {
        return Ok(None);
    }
    let missing = |part: &[usize]| {
        let name = part.iter().find(|i| given[**i].is_none()).map_or("", |i| NAMES[*i]);
        format!(
            "{name} is missing: a pose of the flange has x, y, z and either qx, qy, qz, qw or roll, pitch, yaw"
        )
    };
    let any = |part: &[usize]| part.iter().any(|i| given[*i].is_some());
    let (Some(x), Some(y), Some(z)) = (x, y, z) else { return Err(missing(&[0, 1, 2])) };
    let orientation = match (any(&[3, 4, 5, 6]), any(&[7, 8, 9])) {
        (true, true) => {
            return Err("both a quaternion and roll, pitch, yaw, expected only one of them".into());
        }
        (true, false) => match (qx, qy, qz, qw) {
            (Some(qx), Some(qy), Some(qz), Some(qw)) => Orientation::Quaternion([qx, qy, qz, qw]),
            _ => return Err(missing(&[3, 4, 5, 6])),
        },
        (false, false) if point => Orientation::Rpy([0.0; 3]),
        (false, _) => match (roll, pitch, yaw) {
            (Some(roll), Some(pitch), Some(yaw)) => Orientation::Rpy([roll, pitch, yaw]),
            _ => return Err(missing(&[7, 8, 9])),
        },
    };
    Ok(Some(Target::Flange([x, y, z], orientation)))
}
