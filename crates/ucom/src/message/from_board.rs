//! Messages that a board sends to the PC.

use super::to_board::{admin, package};
use super::{DecodeError, need};
use crate::admin::Admin;
use crate::buffer::BufferPackage;
use crate::error_code::ErrorCode;
use crate::frame::{Frame, Payload};
use crate::function::{Function, Sequence};
use crate::profile::Profile;
use crate::report::Report;

/// A message from a board to the PC.
///
/// A board sends DSP_INFO, the IO description and debug texts in several frames with the same identifier and without a frame number (G-15).
/// A receiver must therefore count these frames to know which part a frame carries. The parts of DSP_INFO, the IO description and debug
/// texts are returned as payloads, which can be decoded with [`BoardInfo::parse`](crate::BoardInfo::parse),
/// [`Dimensions::parse`](crate::Dimensions::parse) and [`StringAssembler`](crate::StringAssembler).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FromBoard {
    /// DSP_ERROR with the error code.
    Error(ErrorCode),
    /// DSP_INITACK with the sequence number that the board accepted. The identifier must also contain this
    /// sequence number (D-24).
    InitAck(u8),
    /// DSP_PROGFINISHED: the image is written and verified.
    ProgFinished,
    /// A part of DSP_INFO. DSP_INFO consists of 8 bytes with the values of [`BoardInfo`](crate::BoardInfo), followed by a string.
    Info(Payload),
    /// DSP_READY: the board has accepted the block of program data.
    Ready,
    /// MCA_DSP_SO: sensor outputs.
    So(BufferPackage),
    /// DSP_REPORT0..3: report that the board is present. In the identifier of a report, the sequence field is part of the flash id (D-07).
    Report(Report),
    /// MCA_DSP_READY: the application is ready.
    McaReady,
    /// A part of MCA_DUMP_IO_DESCRIPTION. The IO description consists of 6 bytes of dimensions, followed by strings.
    IoDescription(Payload),
    /// MCA_ADMIN_DATA with the flags of the board.
    Admin(Admin),
    /// A part of MCA_DEBUG_MSG, which contains a string.
    Debug(Payload),
    /// MCA_ALIVE of the board.
    Alive,
    /// MCA_DSP_CI: initial values of the controller inputs.
    Ci(BufferPackage),
}

impl FromBoard {
    /// Returns the function that carries the message.
    pub const fn function(&self) -> Function {
        match self {
            Self::Error(_) => Function::Error,
            Self::InitAck(_) => Function::InitAck,
            Self::ProgFinished => Function::ProgFinished,
            Self::Info(_) => Function::DspInfo,
            Self::Ready => Function::DspReady,
            Self::So(_) => Function::So,
            Self::Report(report) => report.function(),
            Self::McaReady => Function::McaReady,
            Self::IoDescription(_) => Function::DumpIo,
            Self::Admin(_) => Function::Admin,
            Self::Debug(_) => Function::Debug,
            Self::Alive => Function::Alive,
            Self::Ci(_) => Function::DspCi,
        }
    }

    /// Returns the frame that board `from` sends. A report contains its own sequence field, so `from` is ignored for
    /// reports.
    pub fn encode(&self, from: Sequence, profile: &Profile) -> Frame {
        let byte = |byte| Payload::of([byte, 0, 0, 0, 0, 0, 0, 0], 1);
        let (sequence, payload) = match *self {
            Self::Error(code) => (from, byte(code.number())),
            Self::InitAck(number) => (from, byte(number)),
            Self::Report(report) => (report.id_field, byte(report.ucom_id)),
            Self::So(package) | Self::Ci(package) => {
                (from, package.payload(profile.endian, profile.pd_short_last))
            }
            Self::Info(payload) | Self::IoDescription(payload) | Self::Debug(payload) => (from, payload),
            Self::Admin(admin) => (from, admin.payload()),
            Self::ProgFinished | Self::Ready | Self::McaReady | Self::Alive => (from, Payload::EMPTY),
        };
        Frame::of(self.function(), sequence, payload)
    }

    /// Decodes a frame to a message of a board. Returns the sequence field of the frame's identifier, and the message.
    pub fn decode(frame: &Frame, profile: &Profile) -> Result<(Sequence, Self), DecodeError> {
        let (function, from) = frame.address().map_err(DecodeError::Foreign)?;
        let empty = |message| need(frame, function, 0, profile).map(|_| message);
        let byte = || need(frame, function, 1, profile).map(|payload| payload.padded()[0]);
        let some = || {
            let len = frame.dlc();
            let short = DecodeError::TooShort { function, len, need: 1 };
            if len == 0 { Err(short) } else { Ok(frame.payload()) }
        };
        let message = match function {
            Function::Error => Self::Error(ErrorCode::from_number(byte()?)),
            Function::InitAck => Self::InitAck(byte()?),
            Function::ProgFinished => empty(Self::ProgFinished)?,
            Function::DspInfo => Self::Info(some()?),
            Function::DspReady => empty(Self::Ready)?,
            Function::So => Self::So(package(frame, function, profile)?),
            Function::Report0 | Function::Report1 | Function::Report2 | Function::Report3 => {
                let k = function.number() - Function::Report0.number();
                Self::Report(Report { k, id_field: from, ucom_id: byte()? })
            }
            Function::McaReady => empty(Self::McaReady)?,
            // A frame of MCA_DUMP_IO_DESCRIPTION without data is always the PC's request (D-12).
            Function::DumpIo if frame.dlc() > 0 => Self::IoDescription(some()?),
            Function::Admin => Self::Admin(admin(frame, profile)?),
            Function::Debug => Self::Debug(some()?),
            Function::Alive => empty(Self::Alive)?,
            Function::DspCi => Self::Ci(package(frame, function, profile)?),
            other => return Err(DecodeError::Direction(other)),
        };
        Ok((from, message))
    }
}
