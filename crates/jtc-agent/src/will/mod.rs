//! Last will of a killed agent: a small file that names the client whose policy applies, kept while the arm moves. The
//! next agent at the same port reads it before it serves any client.
//!
//! A thread of its own writes the file, so neither a Stop nor the line waits for the disk.
mod apply;
mod file;
mod keeper;

pub use apply::{apply, read_host_timeout};
pub use file::{Found, Stored};
pub use keeper::{Keeper, Witness};
