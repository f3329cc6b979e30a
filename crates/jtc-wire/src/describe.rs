//! Text of a frame in one line, as in a network sniffer. The format `{:#}` also shows all numbers of the frame.
use core::fmt::{Display, Formatter, Result};

use crate::command::Command;
use crate::encode_error::FloatName;
use crate::extension::Answer;
use crate::floats::Floats;
use crate::frame::{FrameRef, FrameType, HEADER, field};
use crate::segment::Segment;
use crate::status::Status;
use crate::words::{self, Bits};

/// Text of any bytes. The text describes the frame, which may be of either direction, or the reason why the bytes are not a frame.
///
/// ```
/// use jtc_wire::Described;
/// let text = Described(&[0x9B, 0x0B, 0x00, 0x07, 0x03, 0x7D, 0x9E]).to_string();
/// assert_eq!(text, "TrajSetExecStatus: execute");
/// let text = Described(&[0x9B, 0x0C, 0x00, 0x06, 0xCD, 0x28]).to_string();
/// assert_eq!(text, "TeachingModeEnable of 6 bytes: CRC is CD28, should be CD27");
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Described<'a>(pub &'a [u8]);

impl Display for Described<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        match FrameRef::new_checked(self.0) {
            Some(frame) => frame.fmt(f),
            None => wrong(self.0, f),
        }
    }
}

fn wrong(bytes: &[u8], f: &mut Formatter<'_>) -> Result {
    let Some((&[header, kind, high, low], rest)) = bytes.split_first_chunk::<4>() else {
        return write!(f, "{} bytes, too few for a frame", bytes.len());
    };
    if header != HEADER {
        return write!(f, "{} bytes that begin with {header:02X} instead of {HEADER:02X}", bytes.len());
    }
    let Some(kind) = FrameType::from_byte(kind) else {
        return write!(f, "frame of unknown type {kind:02X}, {} bytes", bytes.len());
    };
    let n = usize::from(u16::from_be_bytes([high, low]));
    if !kind.can_have(n) {
        return write!(f, "{kind} with an invalid length field, {n}; {} bytes", bytes.len());
    }
    let (covered, crc) = bytes.split_at(bytes.len() - field::CRC_LEN.min(rest.len()));
    match crc {
        [high, low] if bytes.len() == n => {
            let (is, should) = (u16::from_be_bytes([*high, *low]), crate::crc16(covered));
            write!(f, "{kind} of {n} bytes: CRC is {is:04X}, should be {should:04X}")
        }
        _ => write!(f, "{kind}: {} bytes of {n}", bytes.len()),
    }
}

impl Display for FrameRef<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        if self.frame_type == FrameType::JtcStatus {
            return match Status::parse(self.bytes) {
                Some(status) => status.fmt(f),
                None => f.write_str("JtcStatus with invalid content"),
            };
        }
        if let Some(answer) = Answer::parse(*self) {
            return answer.fmt(f);
        }
        match Command::parse(*self) {
            Ok(command) => {
                command.fmt(f)?;
                // A host may also send this command as an empty frame of another type. The text then shows this type.
                if self.frame_type != command.frame_type() {
                    write!(f, " (sent as an empty {})", self.frame_type)?;
                }
                Ok(())
            }
            Err(data) => write!(f, "{}: {data}", self.frame_type),
        }
    }
}

impl Display for Segment<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let Self { trajectory, segment, segments, step_time, .. } = self;
        write!(f, "trajectory {trajectory}, segment {segment} of {segments}, ")?;
        write!(f, "{} points, {step_time} ms apart", self.len())?;
        if f.alternate() {
            for (i, point) in self.points().enumerate() {
                write!(f, "\n  {i:4} rad {}", Row(&point.position_rad()))?;
                write!(f, " rad/s {}", Row(&point.velocity_rad_s()))?;
                write!(f, " rad/s² {}", Row(&point.acceleration_rad_s2()))?;
            }
        }
        Ok(())
    }
}

struct Row<'a>(&'a [f64]);

impl Display for Row<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        self.0
            .iter()
            .enumerate()
            .try_for_each(|(i, value)| write!(f, "{}{value:.4}", if i > 0 { " " } else { "" }))
    }
}

impl Display for Command<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let kind = self.frame_type();
        f.write_str(kind.name())?;
        match *self {
            Self::ClearCurrentErrors { jtc, nodes } => {
                let own = if jtc { "the controller's own, " } else { "" };
                write!(f, ": {own}nodes: {}", Bits(nodes.into(), &words::NODES))
            }
            Self::Trajectory(segment) => {
                f.write_str(": ")?;
                segment.fmt(f)
            }
            Self::PidParam(values) | Self::ArmModel(values) => list(kind, values, f),
            Self::FrictionTable(values) => {
                let ends = |from, to| (values.get(from).unwrap_or(0.0), values.get(to).unwrap_or(0.0));
                let (velocity, temperature) = (ends(0, 19), ends(20, 39));
                write!(f, ": joint 1 {}..{} rad/s, ", velocity.0, velocity.1)?;
                write!(f, "{}..{} °C", temperature.0, temperature.1)?;
                if f.alternate() { list(kind, values, f) } else { Ok(()) }
            }
            Self::FrictionPolynomial(values) => polynomial(values, f),
            Self::TrajSetExecStatus(command) => write!(f, ": {command}"),
            Self::ResetCanDevices { nodes } => write!(f, ": {}", Bits(nodes.into(), &words::NODES)),
            Self::GripperControl { pump } => write!(f, ": pump {}", if pump { "on" } else { "off" }),
            Self::GetSettings { first } => write!(f, ": from value {first} on"),
            Self::SetSettings(values) => write!(f, ": {values}"),
            Self::SetName(name) => write!(f, ": {name}"),
            Self::GetArm { offset } => write!(f, ": from byte {offset} on"),
            Self::GetLog { block, offset } => write!(f, ": block {block} from byte {offset} on"),
            Self::GetPoints { first } => write!(f, ": from point {first} on"),
            Self::Jog(values) => {
                f.write_str(": rad/s")?;
                values.iter().try_for_each(|value| write!(f, " {value}"))
            }
            Self::ClearOccurredErrors
            | Self::FrictionTableUseDefault
            | Self::PidParamUseDefault
            | Self::ArmModelUseDefault
            | Self::TeachingModeEnable
            | Self::TeachingModeDisable
            | Self::FrictionPolynomialUseDefault
            | Self::GetInfo
            | Self::StoreArm
            | Self::ClearLog
            | Self::Disable => Ok(()),
        }
    }
}

fn list(kind: FrameType, values: Floats<'_>, f: &mut Formatter<'_>) -> Result {
    if !f.alternate() {
        return write!(f, ": {} numbers", values.len());
    }
    values.iter().enumerate().try_for_each(|(i, value)| write!(f, "\n  {} = {value}", FloatName(kind, i)))
}

fn polynomial(values: Floats<'_>, f: &mut Formatter<'_>) -> Result {
    let each = values.len() / crate::JOINTS;
    write!(f, ": {each} coefficients a joint")?;
    if f.alternate() && each > 0 {
        for (i, value) in values.iter().enumerate() {
            let (joint, index) = (1 + i / each, each - 1 - i % each);
            write!(f, "\n  joint {joint} c{index} = {value}")?;
        }
    }
    Ok(())
}

impl Display for Status {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        write!(f, "JtcStatus: {}, trajectory {}, point {}", self.state, self.trajectory, self.point)?;
        if let Some(response) = self.response() {
            write!(f, "; record: {response}")?;
        }
        let mut lists = Lists { f };
        lists.add("errors", self.errors.into(), &words::JTC_ERRORS)?;
        lists.add("missing", self.jtc_init.into(), &words::JTC_INIT)?;
        lists.add("not ready", self.node_init.into(), &words::NODES)?;
        lists.add("CAN", self.can_current, &words::CAN_FLAGS)?;
        let f = lists.f;
        if f.alternate() {
            write!(f, "\n  occurred: {}", Bits(self.occurred.into(), &words::JTC_ERRORS))?;
            write!(f, "\n  friction: {}", words::friction_type(self.friction_type))?;
            write!(f, "\n  CAN occurred: {}", Bits(self.can_occurred, &words::CAN_FLAGS))?;
            for (j, joint) in self.joints.iter().enumerate() {
                write!(f, "\n  joint {}: {joint}", j + 1)?;
            }
            if let Some(gripper) = &self.gripper {
                write!(f, "\n  gripper: {gripper}")?;
            }
        }
        Ok(())
    }
}

/// Writer for the names of the set bits of words. The writer omits words without set bits.
struct Lists<'a, 'b> {
    f: &'a mut Formatter<'b>,
}

impl Lists<'_, '_> {
    fn add(&mut self, name: &str, word: u32, names: &[&str]) -> Result {
        if word == 0 {
            return Ok(());
        }
        write!(self.f, "; {name}: {}", Bits(word, names))
    }
}

impl Display for crate::JointStatus {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        write!(f, "{}, {:.6} rad, {:.6} rad/s, ", self.state.name(), self.position, self.velocity)?;
        write!(f, "{:.3} N·m, {} °C", self.torque, self.temperature)?;
        let mut lists = Lists { f };
        lists.add("found by the controller", self.internal.into(), &words::JOINT_INTERNAL)?;
        lists.add("occurred", self.internal_occurred.into(), &words::JOINT_INTERNAL)?;
        lists.add("motor control", self.mc_current.into(), &words::MC_FAULTS)?;
        lists.add("motor control occurred", self.mc_occurred.into(), &words::MC_FAULTS)?;
        lists.add("errors", self.errors.into(), &words::NODE_ERRORS)?;
        lists.add("warnings", self.warnings.into(), &words::NODE_WARNINGS)
    }
}

impl Display for crate::GripperStatus {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let pump = if self.pump == 0 { "off" } else { "on" };
        write!(f, "{}, pump {pump}, ", self.state.name())?;
        let level = |reached: u8| if reached == 0 { "not reached" } else { "reached" };
        write!(f, "pressure 1 {}, pressure 2 {}", level(self.pressure1), level(self.pressure2))?;
        let mut lists = Lists { f };
        lists.add("errors", self.errors.into(), &words::NODE_ERRORS)?;
        lists.add("warnings", self.warnings.into(), &words::NODE_WARNINGS)
    }
}

/// Part of a recorded byte stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Piece<'a> {
    /// Valid frame from the host or from the device.
    Frame(FrameRef<'a>),
    /// Bytes between valid frames. The bytes are invalid frames, noise, or a frame that is incomplete at the end of the capture.
    Other(&'a [u8]),
}

/// Returns the frames of a whole capture and the bytes between the frames, in order. The capture contains no times, so a gap does
/// not end a frame.
///
/// ```
/// use jtc_wire::{Piece, fixed, pieces};
/// let capture = [&[0x00, 0x9B][..], &fixed::STOP, &fixed::PUMP_ON].concat();
/// let found: Vec<_> = pieces(&capture).map(|piece| match piece {
///     Piece::Frame(frame) => frame.to_string(),
///     Piece::Other(bytes) => format!("{} other bytes", bytes.len()),
/// }).collect();
/// assert_eq!(found, ["2 other bytes", "TrajSetExecStatus: stop", "GripperControl: pump on"]);
/// ```
pub fn pieces(capture: &[u8]) -> Pieces<'_> {
    Pieces { rest: capture }
}

/// Iterator of [`pieces`].
#[derive(Clone, Debug)]
pub struct Pieces<'a> {
    rest: &'a [u8],
}

impl<'a> Iterator for Pieces<'a> {
    type Item = Piece<'a>;

    fn next(&mut self) -> Option<Piece<'a>> {
        if let Some(frame) = frame_at(self.rest) {
            self.rest = &self.rest[frame.bytes.len()..];
            return Some(Piece::Frame(frame));
        }
        let others = (0..self.rest.len()).position(|at| frame_at(&self.rest[at..]).is_some());
        let (other, rest) = self.rest.split_at(others.unwrap_or(self.rest.len()));
        self.rest = rest;
        (!other.is_empty()).then_some(Piece::Other(other))
    }
}

/// Returns the valid frame at the start of `bytes`.
fn frame_at(bytes: &[u8]) -> Option<FrameRef<'_>> {
    let &[_, _, high, low] = bytes.first_chunk()?;
    let n = usize::from(u16::from_be_bytes([high, low]));
    FrameRef::new_checked(bytes.get(..n)?)
}
