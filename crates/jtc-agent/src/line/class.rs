//! What a frame of a host may do, and who may send it.
use jtc_wire::{Command, DataStatus, ExecCommand, FrameRef, FrameType, Response};

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

/// The record of a frame that never gets to the device.
pub(super) fn refusal(frame: &[u8]) -> Response {
    let kind = frame.get(1).copied().and_then(FrameType::from_byte).unwrap_or(FrameType::JtcStatus);
    Response::good(kind, DataStatus::NotAllowed, frame.len() as u16)
}
