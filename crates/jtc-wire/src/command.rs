//! Commands of the host. A command is the decoded form of a host frame.
use crate::code::codes;
use crate::extension::{Name, Values};
use crate::floats::Floats;
use crate::frame::{FrameRef, FrameType};
use crate::response::DataStatus;
use crate::segment::Segment;

codes! {
    /// Command in a TrajSetExecStatus frame.
    #[allow(missing_docs)]
    ExecCommand {
        Stop = 1, "stop";
        Pause = 2, "pause";
        Execute = 3, "execute";
    }
}

/// Bits of the nodes 0..6.
pub const ALL_NODES: u8 = 0x7F;

/// A command of the host, which borrows the bytes of its frame. The lengths are valid. The numbers in `Floats` are not checked yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command<'a> {
    /// Command to clear current errors. In the frame, bit 0 of the first mask selects the controller, and bits 0..6 of
    /// the second mask select the nodes. The old frame of 6 bytes selects the controller and all nodes.
    ClearCurrentErrors {
        /// `true` to clear the errors of the controller itself.
        jtc: bool,
        /// Mask of the nodes, bits 0..6.
        nodes: u8,
    },
    /// Command to clear the current and occurred errors.
    ClearOccurredErrors,
    /// Segment of a trajectory.
    Trajectory(Segment<'a>),
    /// Friction table with 20 velocities, 20 temperatures and 400 torques for each of 6 joints.
    FrictionTable(Floats<'a>),
    /// Command to use the default friction table.
    FrictionTableUseDefault,
    /// Gains Kp, Ki, Kd, IntMin and IntMax of each of 6 joints.
    PidParam(Floats<'a>),
    /// Command to use the default gains.
    PidParamUseDefault,
    /// Arm model with 7 joint origins (6 numbers each) and 7 links (13 numbers each).
    ArmModel(Floats<'a>),
    /// Command to use the default arm model.
    ArmModelUseDefault,
    /// Command for the execution of the trajectory.
    TrajSetExecStatus(ExecCommand),
    /// Command to switch teaching on.
    TeachingModeEnable,
    /// Command to switch teaching off.
    TeachingModeDisable,
    /// Friction polynomial with 4 or 6 coefficients for each of 6 joints, highest index first.
    FrictionPolynomial(Floats<'a>),
    /// Command to use the default friction polynomial (also a frame of type 0x0E with 6 bytes).
    FrictionPolynomialUseDefault,
    /// Command to reset nodes.
    ResetCanDevices {
        /// Mask of the nodes, bits 0..6.
        nodes: u8,
    },
    /// Command to switch the pump.
    GripperControl {
        /// `true` to switch the pump on.
        pump: bool,
    },
    /// Request for the identity of the device and of its firmware (J-52).
    GetInfo,
    /// Request for the settings, beginning at number `first`, in the order of the table of the device (J-53).
    GetSettings {
        /// Number of settings to skip.
        first: u16,
    },
    /// Request to change settings, either all or none (J-53).
    SetSettings(Values<'a>),
    /// Command that sets the name of the arm (J-54).
    SetName(Name),
    /// Request for a part of the arm image (J-54).
    GetArm {
        /// First requested byte of the image.
        offset: u16,
    },
    /// Command to store the active arm in non-volatile memory (J-54).
    StoreArm,
    /// Command to switch the torque off and return to Init (J-53).
    Disable,
    /// Command to jog with these joint velocities, rad/s (J-58).
    Jog(Floats<'a>),
    /// Request for a page of the flight recorder's log (J-56).
    GetLog {
        /// Number of the block.
        block: u32,
        /// First requested byte of the block.
        offset: u16,
    },
    /// Command to clear the log of the flight recorder and start a new recording (J-56).
    ClearLog,
    /// Request for points of the trajectory in the memory of the device (J-56).
    GetPoints {
        /// Number of points to skip.
        first: u16,
    },
}

/// Positions of the fields in short frame bodies, counted from the first byte of the body.
pub mod field {
    /// Field of ClearCurrentErrors in which bit 0 selects the controller itself.
    pub const CLEAR_JTC: usize = 0;
    /// Field of ClearCurrentErrors in which bits 0..6 select the nodes.
    pub const CLEAR_NODES: usize = 1;
    /// Field of TrajSetExecStatus with the command.
    pub const EXEC: usize = 0;
    /// Field of ResetCanDevices in which bits 0..6 select the nodes.
    pub const RESET_NODES: usize = 0;
    /// Field of GripperControl with the state of the pump, 0 or 1.
    pub const PUMP: usize = 0;
    /// Field of GetSettings, GetArm and GetPoints with the number of the first item or byte, u16.
    pub const FROM: core::ops::Range<usize> = 0..2;
    /// Fields of GetLog with the number of the block, u32, and the position of the byte in the block, u16.
    pub const LOG: core::ops::Range<usize> = 0..6;
}

impl<'a> Command<'a> {
    /// Parses a frame that a device has received. Returns `IncorrectValue` for an unknown [`ExecCommand`], for an invalid pump byte, and
    /// for a body that is too short for the frame type. [`crate::Receiver`] never returns such a body. Returns `NotAllowed` for a frame
    /// that only a device sends, such as JtcStatus.
    pub fn parse(frame: FrameRef<'a>) -> Result<Self, DataStatus> {
        let body = frame.body();
        let byte = |i: usize| body.get(i).copied().ok_or(DataStatus::IncorrectValue);
        let from = || {
            let bytes = body.get(field::FROM).and_then(|b| b.first_chunk());
            bytes.map(|b| u16::from_be_bytes(*b)).ok_or(DataStatus::IncorrectValue)
        };
        let floats = || {
            let counts = frame.frame_type.float_counts();
            let fits = counts.iter().any(|count| 4 * count == body.len());
            fits.then_some(Floats(body)).ok_or(DataStatus::IncorrectValue)
        };
        Ok(match frame.frame_type {
            FrameType::ClearCurrentErrors if body.is_empty() => {
                Self::ClearCurrentErrors { jtc: true, nodes: ALL_NODES }
            }
            FrameType::ClearCurrentErrors => Self::ClearCurrentErrors {
                jtc: byte(field::CLEAR_JTC)? & 1 != 0,
                nodes: byte(field::CLEAR_NODES)? & ALL_NODES,
            },
            FrameType::ClearOccurredErrors => Self::ClearOccurredErrors,
            FrameType::Trajectory => {
                Self::Trajectory(Segment::parse(body).ok_or(DataStatus::IncorrectValue)?)
            }
            FrameType::FrictionTable => Self::FrictionTable(floats()?),
            FrameType::FrictionTableUseDefault => Self::FrictionTableUseDefault,
            FrameType::PidParam => Self::PidParam(floats()?),
            FrameType::PidParamUseDefault => Self::PidParamUseDefault,
            FrameType::ArmModel => Self::ArmModel(floats()?),
            FrameType::ArmModelUseDefault => Self::ArmModelUseDefault,
            FrameType::TrajSetExecStatus => Self::TrajSetExecStatus(
                ExecCommand::from_byte(byte(field::EXEC)?).ok_or(DataStatus::IncorrectValue)?,
            ),
            FrameType::TeachingModeEnable => Self::TeachingModeEnable,
            FrameType::TeachingModeDisable => Self::TeachingModeDisable,
            FrameType::FrictionPolynomial if body.is_empty() => Self::FrictionPolynomialUseDefault,
            FrameType::FrictionPolynomial => Self::FrictionPolynomial(floats()?),
            FrameType::FrictionPolynomialUseDefault => Self::FrictionPolynomialUseDefault,
            FrameType::ResetCanDevices => {
                Self::ResetCanDevices { nodes: byte(field::RESET_NODES)? & ALL_NODES }
            }
            FrameType::GripperControl => match byte(field::PUMP)? {
                0 => Self::GripperControl { pump: false },
                1 => Self::GripperControl { pump: true },
                _ => return Err(DataStatus::IncorrectValue),
            },
            FrameType::GetInfo => Self::GetInfo,
            FrameType::GetSettings => Self::GetSettings { first: from()? },
            FrameType::SetSettings => {
                Self::SetSettings(Values::parse(body).ok_or(DataStatus::IncorrectValue)?)
            }
            FrameType::SetName => Self::SetName(Name::parse(body).ok_or(DataStatus::IncorrectValue)?),
            FrameType::GetArm => Self::GetArm { offset: from()? },
            FrameType::StoreArm => Self::StoreArm,
            FrameType::Disable => Self::Disable,
            FrameType::Jog => Self::Jog(floats()?),
            FrameType::GetLog => {
                let bytes = body.get(field::LOG).and_then(|b| b.first_chunk());
                let [a, b, c, d, e, f] = *bytes.ok_or(DataStatus::IncorrectValue)?;
                Self::GetLog { block: u32::from_be_bytes([a, b, c, d]), offset: u16::from_be_bytes([e, f]) }
            }
            FrameType::ClearLog => Self::ClearLog,
            FrameType::GetPoints => Self::GetPoints { first: from()? },
            // Only a device sends JtcStatus and the answers. Without this match arm, the compiler would insert a trap for the unused
            // numbers between the types.
            _ => return Err(DataStatus::NotAllowed),
        })
    }

    /// Returns the type of the frame that carries the command.
    pub const fn frame_type(&self) -> FrameType {
        match self {
            Self::ClearCurrentErrors { .. } => FrameType::ClearCurrentErrors,
            Self::ClearOccurredErrors => FrameType::ClearOccurredErrors,
            Self::Trajectory(_) => FrameType::Trajectory,
            Self::FrictionTable(_) => FrameType::FrictionTable,
            Self::FrictionTableUseDefault => FrameType::FrictionTableUseDefault,
            Self::PidParam(_) => FrameType::PidParam,
            Self::PidParamUseDefault => FrameType::PidParamUseDefault,
            Self::ArmModel(_) => FrameType::ArmModel,
            Self::ArmModelUseDefault => FrameType::ArmModelUseDefault,
            Self::TrajSetExecStatus(_) => FrameType::TrajSetExecStatus,
            Self::TeachingModeEnable => FrameType::TeachingModeEnable,
            Self::TeachingModeDisable => FrameType::TeachingModeDisable,
            Self::FrictionPolynomial(_) => FrameType::FrictionPolynomial,
            Self::FrictionPolynomialUseDefault => FrameType::FrictionPolynomialUseDefault,
            Self::ResetCanDevices { .. } => FrameType::ResetCanDevices,
            Self::GripperControl { .. } => FrameType::GripperControl,
            Self::GetInfo => FrameType::GetInfo,
            Self::GetSettings { .. } => FrameType::GetSettings,
            Self::SetSettings(_) => FrameType::SetSettings,
            Self::SetName(_) => FrameType::SetName,
            Self::GetArm { .. } => FrameType::GetArm,
            Self::StoreArm => FrameType::StoreArm,
            Self::Disable => FrameType::Disable,
            Self::Jog(_) => FrameType::Jog,
            Self::GetLog { .. } => FrameType::GetLog,
            Self::ClearLog => FrameType::ClearLog,
            Self::GetPoints { .. } => FrameType::GetPoints,
        }
    }
}
