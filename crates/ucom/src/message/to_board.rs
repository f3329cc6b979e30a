//! Messages that the PC sends to boards.

use super::{DecodeError, need};
use crate::admin::Admin;
use crate::buffer::BufferPackage;
use crate::frame::{Frame, Payload};
use crate::function::{Function, Sequence};
use crate::profile::Profile;

/// A message from the PC to one board, or to all boards by broadcast.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ToBoard {
    /// PC_RESET: resets the board and deletes its number.
    Reset,
    /// PC_XRESET: special reset before an update.
    XReset,
    /// PC_SETSTATUS: `(old & ~mask) | value` (D-22).
    SetStatus {
        /// Bits of the status byte that are cleared first.
        mask: u8,
        /// Bits of the status byte that are set afterwards, including bits outside the mask.
        value: u8,
    },
    /// PC_INFO: requests DSP_INFO.
    Info,
    /// PC_REPORT: requests a report of one board or of all boards.
    Report,
    /// PC_INIT: the identifier contains the new number of the board.
    Init,
    /// PC_PROG: 8 bytes of program data, one eighth of a block.
    Prog([u8; 8]),
    /// PC_START: starts the application.
    Start,
    /// MCA_PC_CI: sets controller inputs.
    Ci(BufferPackage),
    /// MCA_PC_PAR: sets parameters.
    Par(BufferPackage),
    /// MCA_PC_START: starts the control loop.
    McaStart,
    /// MCA_DUMP_IO_DESCRIPTION without data: requests the IO description.
    DumpIo,
    /// MCA_DUMP_CI: requests the initial values of the controller inputs.
    DumpCi,
    /// MCA_ADMIN_DATA: sets the flags of the board.
    Admin(Admin),
    /// MCA_ALIVE: heartbeat of the PC.
    Alive,
}

impl ToBoard {
    /// Returns the function that carries the message.
    pub const fn function(&self) -> Function {
        match self {
            Self::Reset => Function::Reset,
            Self::XReset => Function::XReset,
            Self::SetStatus { .. } => Function::SetStatus,
            Self::Info => Function::Info,
            Self::Report => Function::AskReport,
            Self::Init => Function::Init,
            Self::Prog(_) => Function::Prog,
            Self::Start => Function::Start,
            Self::Ci(_) => Function::Ci,
            Self::Par(_) => Function::Par,
            Self::McaStart => Function::McaStart,
            Self::DumpIo => Function::DumpIo,
            Self::DumpCi => Function::DumpCi,
            Self::Admin(_) => Function::Admin,
            Self::Alive => Function::Alive,
        }
    }

    /// Returns the frame that carries the message to a board.
    pub fn encode(&self, to: Sequence, profile: &Profile) -> Frame {
        let payload = match *self {
            Self::SetStatus { mask, value } => Payload::of([mask, value, 0, 0, 0, 0, 0, 0], 2),
            Self::Prog(data) => Payload::of(data, 8),
            Self::Ci(package) | Self::Par(package) => package.payload(profile.endian, profile.pd_short_last),
            Self::Admin(admin) => admin.payload(),
            _ => Payload::EMPTY,
        };
        Frame::of(self.function(), to, payload)
    }

    /// Decodes a frame to a message of the PC. Returns the destination of the frame and the message.
    pub fn decode(frame: &Frame, profile: &Profile) -> Result<(Sequence, Self), DecodeError> {
        let (function, to) = frame.address().map_err(DecodeError::Foreign)?;
        let empty = |message| need(frame, function, 0, profile).map(|_| message);
        let message = match function {
            Function::Reset => empty(Self::Reset)?,
            Function::XReset => empty(Self::XReset)?,
            Function::SetStatus => {
                let [mask, value, ..] = need(frame, function, 2, profile)?.padded();
                Self::SetStatus { mask, value }
            }
            Function::Info => empty(Self::Info)?,
            Function::AskReport => empty(Self::Report)?,
            Function::Init => empty(Self::Init)?,
            Function::Prog => Self::Prog(need(frame, function, 8, profile)?.padded()),
            Function::Start => empty(Self::Start)?,
            Function::Ci => Self::Ci(package(frame, function, profile)?),
            Function::Par => Self::Par(package(frame, function, profile)?),
            Function::McaStart => empty(Self::McaStart)?,
            // A frame of MCA_DUMP_IO_DESCRIPTION with data is always a board's answer (D-12).
            Function::DumpIo if frame.dlc() == 0 => Self::DumpIo,
            Function::DumpCi => empty(Self::DumpCi)?,
            Function::Admin => Self::Admin(admin(frame, profile)?),
            Function::Alive => empty(Self::Alive)?,
            other => return Err(DecodeError::Direction(other)),
        };
        Ok((to, message))
    }
}

/// Decodes the four flags of MCA_ADMIN_DATA.
pub(super) fn admin(frame: &Frame, profile: &Profile) -> Result<Admin, DecodeError> {
    let [run, active, debug, global, ..] = need(frame, Function::Admin, 4, profile)?.padded();
    Admin::from_bytes([run, active, debug, global]).ok_or(DecodeError::Value(Function::Admin))
}

/// Decodes a buffer package of 4, 6 or 8 bytes.
pub(super) fn package(
    frame: &Frame,
    function: Function,
    profile: &Profile,
) -> Result<BufferPackage, DecodeError> {
    let len = frame.dlc();
    if len < 4 {
        return Err(DecodeError::TooShort { function, len, need: 4 });
    }
    BufferPackage::parse(&frame.payload(), profile.endian).ok_or(DecodeError::Length { function, len })
}
