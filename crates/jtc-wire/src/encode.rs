//! Encoders that write the host's frames into the caller's buffer. The encoders check and scale numbers; they never wrap or clip a number.
use crate::command::Command;
use crate::crc16;
use crate::encode_error::{Channel, EncodeError, OutOfScale};
use crate::extension::SettingValue;
use crate::fixed;
use crate::floats::Floats;
use crate::frame::{
    FRAME_MIN, FRAME_POINTS_MAX, FrameType, HEADER, JOINTS, POINT_LEN, TRAJECTORY_OVERHEAD,
    field as frame_field,
};
use crate::layout::{SET_VALUES_MAX, VALUE_LEN};
use crate::segment::{RAW_FULL_SCALE, RawPoint, Segment, field};

impl RawPoint {
    /// Converts values in rad, rad/s and rad/s² to the nearest point that the wire format can represent. Returns an error if a number is
    /// outside the scale or NaN.
    pub fn from_si(
        position: &[f64; JOINTS],
        velocity: &[f64; JOINTS],
        acceleration: &[f64; JOINTS],
    ) -> Result<Self, OutOfScale> {
        let channel = |channel: Channel, values: &[f64; JOINTS]| {
            let limit = channel.scale();
            let mut raw = [0; JOINTS];
            for (joint, (to, &value)) in raw.iter_mut().zip(values).enumerate() {
                // The condition `value.abs() > limit` would be false for NaN.
                if !(-limit..=limit).contains(&value) {
                    return Err(OutOfScale { joint, channel, value, limit });
                }
                let exact = value * RAW_FULL_SCALE / limit;
                // The cast truncates towards zero, so the code adds one half to round to the nearest integer.
                *to = (exact + 0.5f64.copysign(exact)) as i16;
            }
            Ok(raw)
        };
        Ok(Self {
            position: channel(Channel::Position, position)?,
            velocity: channel(Channel::Velocity, velocity)?,
            acceleration: channel(Channel::Acceleration, acceleration)?,
        })
    }
}

/// Writes the header and the length for `n` bytes, calls `body`, and writes the CRC.
fn frame(
    out: &mut [u8],
    frame_type: FrameType,
    n: usize,
    body: impl FnOnce(&mut [u8]) -> Result<(), EncodeError>,
) -> Result<usize, EncodeError> {
    let given = out.len();
    let out = out.get_mut(..n).ok_or(EncodeError::BufferTooShort { needed: n, given })?;
    out[frame_field::HEADER] = HEADER;
    out[frame_field::TYPE] = frame_type as u8;
    out[frame_field::LENGTH].copy_from_slice(&(n as u16).to_be_bytes());
    body(&mut out[frame_field::body(n)])?;
    let (all, crc) = out.split_at_mut(n - frame_field::CRC_LEN);
    crc.copy_from_slice(&crc16(all).to_be_bytes());
    Ok(n)
}

/// Writes a Trajectory frame and returns the length of the frame. After an error, the content of the buffer is invalid.
pub fn trajectory(
    out: &mut [u8],
    (number, segment, segments): (u16, u16, u16),
    step_time_ms: u16,
    points: impl IntoIterator<Item = RawPoint>,
) -> Result<usize, EncodeError> {
    let given = out.len();
    let mut count = 0;
    for point in points {
        if count == FRAME_POINTS_MAX {
            return Err(EncodeError::TooManyPoints { points: count + 1, limit: FRAME_POINTS_MAX });
        }
        let at = frame_field::BODY + field::POINTS + count * POINT_LEN;
        count += 1;
        let needed = TRAJECTORY_OVERHEAD + count * POINT_LEN;
        let to = out.get_mut(at..at + POINT_LEN).ok_or(EncodeError::BufferTooShort { needed, given })?;
        to.copy_from_slice(&point.emit());
    }
    frame(out, FrameType::Trajectory, TRAJECTORY_OVERHEAD + count * POINT_LEN, |body| {
        body[field::TRAJECTORY].copy_from_slice(&number.to_be_bytes());
        body[field::SEGMENT].copy_from_slice(&segment.to_be_bytes());
        body[field::SEGMENTS].copy_from_slice(&segments.to_be_bytes());
        body[field::STEP_TIME].copy_from_slice(&step_time_ms.to_be_bytes());
        Ok(())
    })
}

/// Writes a frame of floats in the order of the wire format, and returns its length. The frame is FrictionTable, PidParam, ArmModel,
/// FrictionPolynomial or Jog.
pub fn floats(
    out: &mut [u8],
    frame_type: FrameType,
    values: impl IntoIterator<Item = f64>,
) -> Result<usize, EncodeError> {
    let given = out.len();
    let mut count = 0;
    for (index, value) in values.into_iter().enumerate() {
        let single = value as f32;
        if !single.is_finite() {
            return Err(EncodeError::NotFinite { frame_type, index, value });
        }
        let at = frame_field::BODY + 4 * index;
        count = index + 1;
        let to = out.get_mut(at..at + 4).ok_or(EncodeError::BufferTooShort { needed: at + 4 + 2, given })?;
        to.copy_from_slice(&single.to_be_bytes());
    }
    check_count(frame_type, count)?;
    frame(out, frame_type, 4 * count + 6, |_| Ok(()))
}

fn check_count(frame_type: FrameType, count: usize) -> Result<(), EncodeError> {
    let fits = frame_type.float_counts().contains(&count);
    fits.then_some(()).ok_or(EncodeError::WrongCount { frame_type, count })
}

/// Writes a PidParam frame with Kp, Ki, Kd, IntMin and IntMax of each joint (the last two in rad·s).
pub fn pid_param(out: &mut [u8], gains: &[[f64; 5]; JOINTS]) -> Result<usize, EncodeError> {
    floats(out, FrameType::PidParam, gains.as_flattened().iter().copied())
}

/// Writes an ArmModel frame. The frame contains the joint origins (x, y, z in m, roll, pitch, yaw in rad), followed by the links (an
/// origin, Ixx Ixy Ixz Iyy Iyz Izz in kg·m², mass in kg).
pub fn arm_model(
    out: &mut [u8],
    joints: &[[f64; 6]; 7],
    links: &[[f64; 13]; 7],
) -> Result<usize, EncodeError> {
    let values = joints.as_flattened().iter().chain(links.as_flattened());
    floats(out, FrameType::ArmModel, values.copied())
}

/// Writes a FrictionPolynomial frame. `coefficients` contains 4 or 6 coefficients per joint, beginning with c0. In the frame, the
/// coefficient with the highest index is first.
pub fn friction_polynomial<const N: usize>(
    out: &mut [u8],
    coefficients: &[[f64; N]; JOINTS],
) -> Result<usize, EncodeError> {
    const { assert!(N == 4 || N == 6, "a friction polynomial has 4 or 6 coefficients") }
    let values = coefficients.iter().flat_map(|joint| joint.iter().rev());
    floats(out, FrameType::FrictionPolynomial, values.copied())
}

/// Friction torque of one joint as a function of velocity and temperature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrictionTable<'a> {
    /// Velocities of the rows, rad/s, strictly increasing.
    pub velocity: &'a [f32; 20],
    /// Temperatures of the columns, °C, strictly increasing.
    pub temperature: &'a [f32; 20],
    /// Torques, N·m, with one row per velocity.
    pub torque: &'a [[f32; 20]; 20],
}

/// Writes a FrictionTable frame.
pub fn friction_table(out: &mut [u8], tables: &[FrictionTable<'_>; JOINTS]) -> Result<usize, EncodeError> {
    let values = tables
        .iter()
        .flat_map(|table| table.velocity.iter().chain(table.temperature).chain(table.torque.as_flattened()));
    floats(out, FrameType::FrictionTable, values.map(|value| f64::from(*value)))
}

fn raw_floats(out: &mut [u8], frame_type: FrameType, floats: Floats<'_>) -> Result<usize, EncodeError> {
    check_count(frame_type, floats.len())?;
    frame(out, frame_type, 4 * floats.len() + 6, |body| {
        body.copy_from_slice(floats.as_bytes());
        Ok(())
    })
}

impl Command<'_> {
    /// Writes the frame of the command and returns the length of the frame. The floats of the command are copied unchanged.
    pub fn emit(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        let mut fixed = |bytes: &[u8]| {
            let given = out.len();
            let to = out.get_mut(..bytes.len());
            to.ok_or(EncodeError::BufferTooShort { needed: bytes.len(), given })?.copy_from_slice(bytes);
            Ok(bytes.len())
        };
        match *self {
            Self::ClearCurrentErrors { jtc, nodes } => fixed(&fixed::clear_current_errors(jtc, nodes)),
            Self::Trajectory(s) => segment(out, s),
            Self::FrictionTable(values)
            | Self::PidParam(values)
            | Self::ArmModel(values)
            | Self::FrictionPolynomial(values)
            | Self::Jog(values) => raw_floats(out, self.frame_type(), values),
            Self::TrajSetExecStatus(command) => fixed(&fixed::exec(command)),
            Self::ResetCanDevices { nodes } => fixed(&fixed::reset_can_devices(nodes)),
            Self::GripperControl { pump } => fixed(&fixed::gripper_control(pump)),
            Self::GetSettings { first } => fixed(&fixed::get_settings(first)),
            Self::SetSettings(values) => set_settings(out, values.iter()),
            Self::SetName(name) => fixed(&fixed::set_name(&name)),
            Self::GetArm { offset } => fixed(&fixed::get_arm(offset)),
            Self::GetLog { block, offset } => fixed(&fixed::get_log(block, offset)),
            Self::GetPoints { first } => fixed(&fixed::get_points(first)),
            Self::ClearOccurredErrors
            | Self::FrictionTableUseDefault
            | Self::PidParamUseDefault
            | Self::ArmModelUseDefault
            | Self::TeachingModeEnable
            | Self::TeachingModeDisable
            | Self::FrictionPolynomialUseDefault
            | Self::GetInfo
            | Self::StoreArm
            | Self::Disable
            | Self::ClearLog => fixed(&fixed::empty(self.frame_type())),
        }
    }
}

/// Writes a SetSettings frame and returns the length of the frame.
pub fn set_settings(
    out: &mut [u8],
    values: impl IntoIterator<Item = SettingValue>,
) -> Result<usize, EncodeError> {
    let given = out.len();
    let mut count = 0;
    for value in values {
        if count == SET_VALUES_MAX {
            return Err(EncodeError::WrongCount { frame_type: FrameType::SetSettings, count: count + 1 });
        }
        let at = frame_field::BODY + VALUE_LEN * count;
        count += 1;
        let needed = at + VALUE_LEN + frame_field::CRC_LEN;
        let to = out.get_mut(at..at + VALUE_LEN).ok_or(EncodeError::BufferTooShort { needed, given })?;
        to.copy_from_slice(&value.emit());
    }
    if count == 0 {
        return Err(EncodeError::WrongCount { frame_type: FrameType::SetSettings, count });
    }
    frame(out, FrameType::SetSettings, FRAME_MIN + VALUE_LEN * count, |_| Ok(()))
}

fn segment(out: &mut [u8], s: Segment<'_>) -> Result<usize, EncodeError> {
    trajectory(out, (s.trajectory, s.segment, s.segments), s.step_time, s.points())
}
