//! Firmware update. The image is sent twice in blocks of 64 bytes: first it is checked, then written. At the end it is read back (D-40 to
//! D-46).

mod board;
mod group;
pub(crate) mod procedure;
mod session;
mod transfer;
