//! Last will of a killed agent: a small file with the client whose policy applies. The file exists while the arm moves.
//! The next agent at the same port reads it before it serves any client.
//!
//! A separate thread writes the file, so neither a Stop nor the line waits for the disk.
mod apply;
mod file;
mod keeper;

pub use apply::{apply, read_host_timeout};
pub use file::{Found, Stored};
pub use keeper::{Keeper, Witness};
