//! What a frame of a host may do, and who may send it.
use jtc_wire::{Command, DataStatus, ExecCommand, FrameRef, FrameType, LOG_NO_BLOCK, Response};

/// What a frame of a host does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// It asks, and changes nothing: of anyone who was let in.
    Ask,
    /// Stop or Pause: of anyone who was let in, ahead of all else.
    Halt(ExecCommand),
    /// It may begin a motion that nobody wants any more after a Stop.
    Motion,
    /// It changes something else: of the one who commands.
    Command,
}

impl Class {
    /// The class of a frame.
    pub fn of(frame: FrameRef<'_>) -> Self {
        use FrameType::*;
        match frame.frame_type {
            GetInfo | GetSettings | GetArm | GetLog | GetPoints => Self::Ask,
            TrajSetExecStatus => match Command::parse(frame) {
                Ok(Command::TrajSetExecStatus(command @ (ExecCommand::Stop | ExecCommand::Pause))) => {
                    Self::Halt(command)
                }
                _ => Self::Motion,
            },
            Jog | TeachingModeEnable => Self::Motion,
            _ => Self::Command,
        }
    }

    /// Only the one who commands may send it.
    pub fn needs_lease(self) -> bool {
        matches!(self, Self::Motion | Self::Command)
    }
}

/// A whole good frame of a host, and what it does.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct HostFrame {
    pub bytes: Vec<u8>,
    pub frame_type: FrameType,
    pub class: Class,
}

impl HostFrame {
    /// `None` where the bytes are no such frame.
    pub fn parse(bytes: Vec<u8>) -> Option<Self> {
        let frame = FrameRef::new_checked(&bytes).filter(|frame| frame.frame_type.from_host())?;
        let (frame_type, class) = (frame.frame_type, Class::of(frame));
        Some(Self { bytes, frame_type, class })
    }

    /// It reads the log of the flight recorder, which records nothing meanwhile (J-56): not for everyone who may look.
    pub fn reads_log(&self) -> bool {
        let command = FrameRef::new_checked(&self.bytes).map(Command::parse);
        matches!(command, Some(Ok(Command::GetLog { block, .. })) if block != LOG_NO_BLOCK)
    }

    /// The frame that a device returns to it beside the record.
    pub fn returns(&self) -> Option<FrameType> {
        returned_by(self.frame_type)
    }

    /// The record of a frame that never gets to the device.
    pub fn refusal(&self) -> Response {
        Response::good(self.frame_type, DataStatus::NotAllowed, self.bytes.len() as u16)
    }
}

/// The arm may be another one behind it (J-51 to J-55).
pub(crate) fn may_change_the_arm(frame_type: FrameType) -> bool {
    use FrameType::*;
    matches!(
        frame_type,
        FrictionTable
            | FrictionTableUseDefault
            | FrictionPolynomial
            | FrictionPolynomialUseDefault
            | PidParam
            | PidParamUseDefault
            | ArmModel
            | ArmModelUseDefault
            | SetSettings
            | SetName
            | Disable
    )
}

/// The frame that a device returns to a request of this type beside the record.
pub(super) fn returned_by(request: FrameType) -> Option<FrameType> {
    match request {
        FrameType::GetInfo => Some(FrameType::Info),
        FrameType::GetSettings => Some(FrameType::Settings),
        FrameType::GetArm => Some(FrameType::Arm),
        FrameType::GetLog => Some(FrameType::Log),
        FrameType::GetPoints => Some(FrameType::Points),
        _ => None,
    }
}
