//! Error codes of DSP_ERROR: what a board means and what a PC does about it.

use core::fmt;

/// Code in DSP_ERROR.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ErrorCode {
    /// 1: the image does not have the checksum of its header.
    Checksum,
    /// 2: memory area disabled or protected.
    MemProtected,
    /// 3: erasing, writing or verifying flash failed.
    Flash,
    /// 4: program data came while the block buffer was in use.
    Overrun,
    /// 5: invalid data header; or an offset at or beyond the dimension.
    Data,
    /// 6: frames could not be sent.
    CanTransmit,
    /// 7: a message was too short or had a wrong length.
    CanReceive,
    /// 8: the receive buffer of the CAN controller overran.
    CanOverrun,
    /// 9: the previous PC_INIT was not acknowledged yet.
    Reinit,
    /// 10: a cycle broke off, came out of turn or differed from the first.
    ExloadCycle,
    /// 11: no valid application to start.
    AutostartForbidden,
    /// A code that the published list does not have; shown as a number, never dropped.
    Unknown(u8),
}

impl ErrorCode {
    /// The codes of the published list.
    pub const ALL: [Self; 11] = [
        Self::Checksum,
        Self::MemProtected,
        Self::Flash,
        Self::Overrun,
        Self::Data,
        Self::CanTransmit,
        Self::CanReceive,
        Self::CanOverrun,
        Self::Reinit,
        Self::ExloadCycle,
        Self::AutostartForbidden,
    ];

    /// The code of a number.
    pub const fn from_number(number: u8) -> Self {
        match number {
            1..=11 => Self::ALL[number as usize - 1],
            other => Self::Unknown(other),
        }
    }

    /// The number on the wire.
    pub const fn number(self) -> u8 {
        match self {
            Self::Checksum => 1,
            Self::MemProtected => 2,
            Self::Flash => 3,
            Self::Overrun => 4,
            Self::Data => 5,
            Self::CanTransmit => 6,
            Self::CanReceive => 7,
            Self::CanOverrun => 8,
            Self::Reinit => 9,
            Self::ExloadCycle => 10,
            Self::AutostartForbidden => 11,
            Self::Unknown(number) => number,
        }
    }

    /// The published name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Checksum => "DSP_ERROR_CHECKSUM",
            Self::MemProtected => "DSP_ERROR_MEM_PROTECTED",
            Self::Flash => "DSP_ERROR_FLASH",
            Self::Overrun => "DSP_ERROR_OVERRUN",
            Self::Data => "DSP_ERROR_DATA",
            Self::CanTransmit => "DSP_ERROR_CAN_TRANSMIT",
            Self::CanReceive => "DSP_ERROR_CAN_RECEIVE",
            Self::CanOverrun => "DSP_ERROR_CAN_OVERRUN",
            Self::Reinit => "DSP_ERROR_REINIT",
            Self::ExloadCycle => "DSP_ERROR_EXLOAD_CYCLE",
            Self::AutostartForbidden => "DSP_ERROR_AUTOSTART_FORBIDDEN",
            Self::Unknown(_) => "unknown error",
        }
    }

    /// What the board means, one sentence.
    pub const fn meaning(self) -> &'static str {
        match self {
            Self::Checksum => "The image arrived or was written with another checksum than its header names.",
            Self::MemProtected => {
                "Programming is not enabled, the image lies outside the application area, or it is for another board."
            }
            Self::Flash => "The board could not erase, write or verify its flash memory.",
            Self::Overrun => "Program data came while the board was still busy with the block before.",
            Self::Data => {
                "The header of the image is invalid; or controller inputs or parameters were sent beyond the last one."
            }
            Self::CanTransmit => "The board could not send its frames for a while.",
            Self::CanReceive => "A message was too short or had a wrong length.",
            Self::CanOverrun => "The receive buffer of the board's CAN controller overran: frames were lost.",
            Self::Reinit => {
                "A number was given while the acknowledgement of the one before had not left the board."
            }
            Self::ExloadCycle => {
                "The transfer paused too long, came out of turn, or the second cycle differed from the first."
            }
            Self::AutostartForbidden => "There is no valid application to start.",
            Self::Unknown(_) => "The published list does not have this code.",
        }
    }

    /// What to do, one sentence.
    pub const fn reaction(self) -> &'static str {
        match self {
            Self::Checksum | Self::ExloadCycle => "Send the image again; three attempts in all.",
            Self::MemProtected => "Check board and image: repeating does not help.",
            Self::Flash | Self::Unknown(_) => {
                "Send the image again; after three attempts the hardware is at fault."
            }
            Self::Overrun | Self::CanOverrun => "Send the image again with a larger prog.frame_gap_us.",
            Self::Data => {
                "In an update: the image's header is wrong. Else: compare the profile's dimensions and endian."
            }
            Self::CanTransmit => "Look at cable, termination and bus load.",
            Self::CanReceive => "Another profile may fit this board: see `ucom probe`.",
            Self::Reinit => "Wait 100 ms, ask with PC_INFO, go on.",
            Self::AutostartForbidden => "Program the board first: `ucom update`.",
        }
    }
}

/// `5 DSP_ERROR_DATA`, `42 unknown error`.
impl fmt::Display for ErrorCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.number(), self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn every_number_survives() {
        for number in 0..=255 {
            assert_eq!(ErrorCode::from_number(number).number(), number);
        }
        assert_eq!(ErrorCode::from_number(0x2A), ErrorCode::Unknown(42));
        assert_eq!(ErrorCode::from_number(42).to_string(), "42 unknown error");
        assert_eq!(ErrorCode::from_number(11).name(), "DSP_ERROR_AUTOSTART_FORBIDDEN");
    }
}
