//! Firmware update: the image is sent twice in blocks of 64 bytes, first checked, then written, and read back at the end (D-40 to D-46).

mod board;
mod group;
pub(crate) mod procedure;
mod session;
mod transfer;
