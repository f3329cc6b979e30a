//! CAN frames that do not belong to the UCoM protocol.

use core::fmt;

/// Reasons why a frame does not belong to the UCoM protocol. Receivers count and show a foreign frame, but the frame has no effect (D-02).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Foreign {
    /// The frame has a 29-bit identifier.
    Extended,
    /// The frame is a remote frame.
    Remote,
    /// The frame is a CAN FD frame.
    Fd,
    /// Bit 5 of the identifier is set. Bit 5 is 0 in every identifier of this protocol (D-01).
    Bit5,
    /// The identifier contains a function number from 28 to 31, which the protocol does not define.
    NoFunction(u8),
    /// The identifier has more than 11 bits, or the frame has more than 8 data bytes.
    Malformed,
}

impl fmt::Display for Foreign {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Extended => f.write_str("29-bit identifier"),
            Self::Remote => f.write_str("remote frame"),
            Self::Fd => f.write_str("CAN FD frame"),
            Self::Bit5 => f.write_str("bit 5 of the identifier is set"),
            Self::NoFunction(number) => write!(f, "unknown function {number}"),
            Self::Malformed => f.write_str("identifier or data too long for classic CAN"),
        }
    }
}

impl core::error::Error for Foreign {}
