//! Functions that create the frames from the host to the controller. Each frame has its own buffer. The crate `jtc-wire` defines the layout
//! of the frames.

use jtc_core::{Friction, JOINTS, PidGains};
use jtc_dynamics::{ArmModel, Origin};
use jtc_wire::{EncodeError, FRAME_MAX, FrictionTable, RawPoint, TRAJECTORY_OVERHEAD};

/// Writes a frame of at most `room` bytes.
fn written(
    room: usize,
    write: impl FnOnce(&mut [u8]) -> Result<usize, EncodeError>,
) -> Result<Vec<u8>, EncodeError> {
    let mut bytes = vec![0; room];
    let n = write(&mut bytes)?;
    bytes.truncate(n);
    Ok(bytes)
}

/// Returns the frame that contains a segment of a trajectory.
///
/// # Errors
///
/// Returns an error for a count or a number that the frame cannot represent.
pub fn segment(
    trajectory: u16,
    segment: u16,
    segments: u16,
    step_ms: u16,
    points: &[RawPoint],
) -> Result<Vec<u8>, EncodeError> {
    let room = (TRAJECTORY_OVERHEAD + points.len() * jtc_wire::POINT_LEN).min(FRAME_MAX);
    written(room, |out| {
        jtc_wire::trajectory(out, (trajectory, segment, segments), step_ms, points.iter().copied())
    })
}

/// Returns the frame that contains the gains of all joints.
///
/// # Errors
///
/// Returns an error for a gain that is not a finite 32-bit float.
pub fn pid(gains: &[PidGains; JOINTS]) -> Result<Vec<u8>, EncodeError> {
    let gains = gains.map(|g| [g.kp, g.ki, g.kd, g.int_min, g.int_max]);
    written(FRAME_MAX, |out| jtc_wire::pid_param(out, &gains))
}

/// Returns the frame that contains the kinematics and masses of an arm model.
///
/// # Errors
///
/// Returns an error for a number that is not a finite 32-bit float.
pub fn arm_model(model: &ArmModel) -> Result<Vec<u8>, EncodeError> {
    let (joints, links) = model_rows(model);
    written(FRAME_MAX, |out| jtc_wire::arm_model(out, &joints, &links))
}

/// Returns the numbers of a model in the order of its frame: the origins of six joints and the flange, and the seven links.
pub(crate) fn model_rows(model: &ArmModel) -> ([[f64; 6]; JOINTS + 1], [[f64; 13]; JOINTS + 1]) {
    let origin = |o: &Origin| [o.xyz[0], o.xyz[1], o.xyz[2], o.rpy[0], o.rpy[1], o.rpy[2]];
    let joints = model.joints.map(|j| origin(&j));
    let links = model.links.map(|l| {
        let mut numbers = [0.0; 13];
        numbers[..6].copy_from_slice(&origin(&l.origin));
        numbers[6..12].copy_from_slice(&l.inertia);
        numbers[12] = l.mass;
        numbers
    });
    (joints, links)
}

/// Returns the frame that contains the friction compensation: the polynomial (six coefficients) or the tables.
///
/// # Errors
///
/// Returns an error for a number that is not a finite 32-bit float.
pub fn friction(friction: &Friction) -> Result<Vec<u8>, EncodeError> {
    written(FRAME_MAX, |out| match friction {
        Friction::Polynomial(coefficients) => jtc_wire::friction_polynomial(out, coefficients),
        Friction::Table(tables) => {
            let tables = tables.each_ref().map(|t| FrictionTable {
                velocity: &t.velocity,
                temperature: &t.temperature,
                torque: &t.torque,
            });
            jtc_wire::friction_table(out, &tables)
        }
    })
}
