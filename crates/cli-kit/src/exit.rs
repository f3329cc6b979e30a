//! Exit codes: what scripts may rely on.

/// A device reported an error.
pub const DEVICE: u8 = 1;
/// Wrong usage or unreadable input.
pub const USAGE: u8 = 2;
/// No link to the device, or no answer.
pub const NO_LINK: u8 = 3;
/// Refused by a check; nothing was sent or moved.
pub const REFUSED: u8 = 4;
/// A fault while running.
pub const FAULT: u8 = 5;
