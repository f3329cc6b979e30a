//! Last will of a killed agent. The will is a small file that names the client whose policy applies. The file exists while the arm moves.
//! The next agent at the same port reads the file before it serves a client.
//!
//! A separate thread writes the file, so the disk does not delay a Stop or other frames.
mod apply;
mod file;
mod keeper;

pub use apply::{apply, read_host_timeout};
pub use file::{Found, Stored};
pub use keeper::{Keeper, Witness};
