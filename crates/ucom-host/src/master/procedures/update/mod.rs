//! Firmware update: the image twice in blocks of 64 bytes, checked first, written then, read back last (D-40 to D-46).

mod board;
mod group;
pub(crate) mod procedure;
mod session;
mod transfer;
