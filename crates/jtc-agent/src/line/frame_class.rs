//! Classes of host frames: the effect that a frame may have, and the clients that may send it.
use jtc_wire::{Command, DataStatus, ExecCommand, FrameRef, FrameType, LOG_NO_BLOCK, Response};

/// Effect of a host frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameClass {
    /// The frame only reads data of the controller. Every client may send a frame of this class.
    Ask,
    /// The frame is a Stop or a Pause. Every client may send a frame of this class, and it overtakes all other
    /// frames.
    Halt(ExecCommand),
    /// The frame may begin a motion. The frame is refused if the client requested the motion before the last Stop.
    Motion,
    /// The frame changes a state of the controller without a motion. Only the lease holder may send a frame of this
    /// class.
    Command,
}

impl FrameClass {
    /// Returns the class of a frame.
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

    /// Returns true if only the lease holder may send the frame.
    pub fn needs_lease(self) -> bool {
        matches!(self, Self::Motion | Self::Command)
    }
}

/// Complete valid host frame, and its class.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct HostFrame {
    pub bytes: Vec<u8>,
    pub frame_type: FrameType,
    pub class: FrameClass,
}

impl HostFrame {
    /// Parses the bytes of a frame; returns `None` if they are not a valid host frame.
    pub(super) fn parse(bytes: Vec<u8>) -> Option<Self> {
        let frame = FrameRef::new_checked(&bytes).filter(|frame| frame.frame_type.from_host())?;
        let (frame_type, class) = (frame.frame_type, FrameClass::of(frame));
        Some(Self { bytes, frame_type, class })
    }

    /// Returns true if the frame reads the log of the flight recorder. Viewers may not send this frame, because the
    /// flight recorder does not record while its log is read (J-56).
    pub(super) fn reads_log(&self) -> bool {
        let command = FrameRef::new_checked(&self.bytes).map(Command::parse);
        matches!(command, Some(Ok(Command::GetLog { block, .. })) if block != LOG_NO_BLOCK)
    }

    /// Returns the type of the frame that the controller sends in addition to the response record.
    pub(super) fn returns(&self) -> Option<FrameType> {
        returned_by(self.frame_type)
    }

    /// Returns the response record for a frame that the agent refuses.
    pub(super) fn refusal(&self) -> Response {
        Response::good(self.frame_type, DataStatus::NotAllowed, self.bytes.len() as u16)
    }
}

/// Returns true if the frame may change the controller's arm (J-51 to J-55).
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

/// Returns the type of the frame that the controller sends as the answer to this request, in addition to the response
/// record.
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
