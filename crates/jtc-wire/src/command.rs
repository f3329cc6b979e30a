//! The commands of the host: the meaning of the frame of each type.
use crate::code::codes;
use crate::extension::{Name, Values};
use crate::floats::Floats;
use crate::frame::{FrameRef, FrameType};
use crate::response::DataStatus;
use crate::segment::Segment;

codes! {
    /// The command in TrajSetExecStatus.
    #[allow(missing_docs)]
    ExecCommand {
        Stop = 1, "stop";
        Pause = 2, "pause";
        Execute = 3, "execute";
    }
}

/// Bits of the nodes 0..6.
pub const ALL_NODES: u8 = 0x7F;

/// Meaning of a command, borrowed from the frame. The lengths are valid; the numbers in `Floats` are not checked yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command<'a> {
    /// Bit 0 of `jtc`; `nodes`: bits 0..6. The old frame of 6 bytes means the controller and all nodes.
    ClearCurrentErrors {
        /// Clear the controller's own errors.
        jtc: bool,
        /// Mask of nodes.
        nodes: u8,
    },
    /// Clear current and occurred errors.
    ClearOccurredErrors,
    /// Segment of a trajectory.
    Trajectory(Segment<'a>),
    /// 6 × (20 velocities, 20 temperatures, 400 torques).
    FrictionTable(Floats<'a>),
    /// Use the default table.
    FrictionTableUseDefault,
    /// 6 × (Kp, Ki, Kd, IntMin, IntMax).
    PidParam(Floats<'a>),
    /// Use the default gains.
    PidParamUseDefault,
    /// 7 × 6 joint origins, 7 × 13 links.
    ArmModel(Floats<'a>),
    /// Use the default model.
    ArmModelUseDefault,
    /// Command for the execution of the trajectory.
    TrajSetExecStatus(ExecCommand),
    /// Switch teaching on.
    TeachingModeEnable,
    /// Switch teaching off.
    TeachingModeDisable,
    /// 6 × 4 or 6 × 6 coefficients, highest index first.
    FrictionPolynomial(Floats<'a>),
    /// Use the default polynomial (also type 0x0E with 6 bytes).
    FrictionPolynomialUseDefault,
    /// Reset nodes.
    ResetCanDevices {
        /// Mask of the nodes, bits 0..6.
        nodes: u8,
    },
    /// Switch the pump.
    GripperControl {
        /// `true`: on.
        pump: bool,
    },
    /// Request for the identity of the device and of its firmware (J-52).
    GetInfo,
    /// Request for the settings from number `first` on, in the order of the device's table (J-53).
    GetSettings {
        /// Number of settings to skip.
        first: u16,
    },
    /// Settings to change, all of them or none (J-53).
    SetSettings(Values<'a>),
    /// The name of the arm (J-54).
    SetName(Name),
    /// A part of the arm image (J-54).
    GetArm {
        /// First requested byte of the image.
        offset: u16,
    },
    /// Store the arm in use, so that it is kept without power (J-54).
    StoreArm,
    /// Switch the torque off and return to Init (J-53).
    Disable,
    /// Jog with these joint velocities, rad/s (J-58).
    Jog(Floats<'a>),
    /// A page of the flight recorder's log (J-56).
    GetLog {
        /// Number of a block.
        block: u32,
        /// First requested byte of the block.
        offset: u16,
    },
    /// Clear the log of the flight recorder and start a new recording (J-56).
    ClearLog,
    /// Points of the trajectory in memory (J-56).
    GetPoints {
        /// Number of points to skip.
        first: u16,
    },
}

/// Positions of the parts of the short bodies, counted from the first byte of the body.
pub mod field {
    /// ClearCurrentErrors: bit 0 the controller itself.
    pub const CLEAR_JTC: usize = 0;
    /// ClearCurrentErrors: bits 0..6 the nodes.
    pub const CLEAR_NODES: usize = 1;
    /// TrajSetExecStatus: the command.
    pub const EXEC: usize = 0;
    /// ResetCanDevices: bits 0..6 the nodes.
    pub const RESET_NODES: usize = 0;
    /// GripperControl: pump 0 or 1.
    pub const PUMP: usize = 0;
    /// GetSettings, GetArm and GetPoints: number of the first item or byte, u16.
    pub const FROM: core::ops::Range<usize> = 0..2;
    /// GetLog: block, u32, and byte in it, u16.
    pub const LOG: core::ops::Range<usize> = 0..6;
}

impl<'a> Command<'a> {
    /// Parses a frame on the device. Returns `IncorrectValue` for an unknown [`ExecCommand`], for an invalid pump byte, and for a body that
    /// is too short for its type; [`crate::Receiver`] never returns such a body. Returns `NotAllowed` for a frame that only a device sends,
    /// such as JtcStatus.
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
            // Frames that a device sends: JtcStatus and the answers. Without this arm, the compiler would insert a trap for the unused
            // numbers between the types.
            _ => return Err(DataStatus::NotAllowed),
        })
    }

    /// Returns the type of the command's frame.
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
