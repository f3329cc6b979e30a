//! Update of the firmware of boards. An update consists of two cycles of blocks of 64 bytes. With the default plan, the first cycle checks
//! the image, and the second cycle writes the image. At the end, the update checks the program of the board with PC_INFO (D-40 to D-46).

mod board;
mod group;
pub(crate) mod procedure;
mod session;
mod transfer;
