//! Exit codes. Scripts may rely on them.
use host_kit::ErrorKind;

/// A device reported an error.
pub const DEVICE: u8 = 1;
/// Wrong usage or unreadable input.
pub const USAGE: u8 = 2;
/// No connection to the device, or no answer.
pub const NO_LINK: u8 = 3;
/// Refused by a check; nothing was sent or moved.
pub const REFUSED: u8 = 4;
/// Fault during the operation.
pub const FAULT: u8 = 5;

/// Returns the exit code for a kind of failure.
pub const fn of(kind: ErrorKind) -> u8 {
    match kind {
        ErrorKind::Usage => USAGE,
        ErrorKind::Refused => REFUSED,
        ErrorKind::Device => DEVICE,
        ErrorKind::NoLink => NO_LINK,
        ErrorKind::Fault => FAULT,
    }
}
