//! Exit codes of the commands. Scripts can rely on these codes.
use host_kit::ErrorKind;

/// A device reported an error.
pub const DEVICE: u8 = 1;
/// The usage is wrong, or the input is unreadable.
pub const USAGE: u8 = 2;
/// The command has no connection to the device, or the device does not answer.
pub const NO_LINK: u8 = 3;
/// A check rejected the command, which did not send or move anything.
pub const REFUSED: u8 = 4;
/// A fault occurred during the operation.
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
