//! Error codes of DSP_ERROR, with the meaning for the board and the reaction of the PC.

use core::fmt;

/// Declares the published error codes. Each error code has a number, a name, one sentence for its meaning and one sentence for the reaction
/// of the PC.
macro_rules! error_codes {
    ($($(#[$doc:meta])* $code:ident = $number:literal, $name:literal: $meaning:literal, $reaction:literal;)+) => {
        /// Error code in DSP_ERROR.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum ErrorCode {
            $($(#[$doc])* $code,)+
            /// Error code that is not in the published list. Such a code is shown as a number and never discarded.
            Unknown(u8),
        }

        impl ErrorCode {
            /// Error codes of the published list.
            pub const ALL: [Self; [$($number),+].len()] = [$(Self::$code),+];

            /// Returns the error code with this number.
            pub const fn from_number(number: u8) -> Self {
                match number {
                    $($number => Self::$code,)+
                    other => Self::Unknown(other),
                }
            }

            /// Returns the number that frames contain for the error code.
            pub const fn number(self) -> u8 {
                match self {
                    $(Self::$code => $number,)+
                    Self::Unknown(number) => number,
                }
            }

            /// Returns the published name of the error code.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$code => $name,)+
                    Self::Unknown(_) => "unknown error",
                }
            }

            /// Returns the meaning of the error code as one sentence.
            pub const fn meaning(self) -> &'static str {
                match self {
                    $(Self::$code => $meaning,)+
                    Self::Unknown(_) => "The published list does not have this code.",
                }
            }

            /// Returns the recommended reaction of the PC as one sentence.
            pub const fn reaction(self) -> &'static str {
                match self {
                    $(Self::$code => $reaction,)+
                    Self::Unknown(_) => {
                        "Send the image again. After three failed attempts the hardware is faulty."
                    }
                }
            }
        }
    };
}

error_codes! {
    /// 1: the image does not have the checksum of its header.
    Checksum = 1, "DSP_ERROR_CHECKSUM":
        "The checksum of the received or written image differs from the checksum in its header.",
        "Send the image again. Stop after three attempts.";
    /// 2: the memory area is disabled or protected.
    MemProtected = 2, "DSP_ERROR_MEM_PROTECTED":
        "Programming is not enabled, the image lies outside the application area, or it is for another board.",
        "Check board and image. Sending the image again does not help.";
    /// 3: erasing, writing or verifying the flash failed.
    Flash = 3, "DSP_ERROR_FLASH":
        "The board could not erase, write or verify its flash memory.",
        "Send the image again. After three failed attempts the hardware is faulty.";
    /// 4: program data arrived while the block buffer was in use.
    Overrun = 4, "DSP_ERROR_OVERRUN":
        "Program data arrived while the board was still busy with the previous block.",
        "Send the image again with a larger prog.frame_gap_us.";
    /// 5: the data header is invalid, or an offset is at or beyond the end of the buffer.
    Data = 5, "DSP_ERROR_DATA":
        "The header of the image is invalid, or controller inputs or parameters were sent beyond the last one.",
        "In an update, check the image header. Otherwise compare dimensions and endian of the profile.";
    /// 6: the board could not send frames.
    CanTransmit = 6, "DSP_ERROR_CAN_TRANSMIT":
        "The board could not send its frames for a while.",
        "Check cable, termination and bus load.";
    /// 7: a message was too short or had a wrong length.
    CanReceive = 7, "DSP_ERROR_CAN_RECEIVE":
        "A message was too short or had a wrong length.",
        "Another profile may fit this board: see `ucom probe`.";
    /// 8: the receive buffer of the CAN controller overflowed.
    CanOverrun = 8, "DSP_ERROR_CAN_OVERRUN":
        "The receive buffer of the board's CAN controller overran: frames were lost.",
        "Send the image again with a larger prog.frame_gap_us.";
    /// 9: the board has not acknowledged the previous PC_INIT yet.
    Reinit = 9, "DSP_ERROR_REINIT":
        "The board received a number before it had sent the acknowledgement of the previous number.",
        "Wait 100 ms, send PC_INFO, then continue.";
    /// 10: a programming cycle was interrupted, came in the wrong order or differed from the first cycle.
    ExloadCycle = 10, "DSP_ERROR_EXLOAD_CYCLE":
        "The transfer paused too long, was out of order, or the second cycle differed from the first.",
        "Send the image again. Stop after three attempts.";
    /// 11: the board has no valid application to start.
    AutostartForbidden = 11, "DSP_ERROR_AUTOSTART_FORBIDDEN":
        "There is no valid application to start.",
        "Program the board first: `ucom update`.";
}

/// Prints number and name of the error code, such as `5 DSP_ERROR_DATA` or `42 unknown error`.
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
