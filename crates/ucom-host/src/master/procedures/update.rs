//! Firmware update. The image is sent twice in blocks of 64 bytes. The first cycle checks the image, and the second cycle writes it. At the
//! end, the program of the board is checked with PC_INFO (D-40 to D-46).

mod board;
mod group;
pub(crate) mod procedure;
mod session;
mod transfer;
