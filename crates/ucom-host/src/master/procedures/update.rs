//! Firmware update. The image is sent twice in blocks of 64 bytes. The first cycle checks the image, and the second cycle writes it. At the
//! end, the board's answer is read back (D-40 to D-46).

mod board;
mod group;
pub(crate) mod procedure;
mod session;
mod transfer;
