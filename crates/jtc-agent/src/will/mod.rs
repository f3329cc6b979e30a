//! An agent that is killed leaves whose policy is to act on what moves: a small file, as long as something does, which the next agent at the
//! same port reads before it serves anyone.
//!
//! It is written by a thread of its own: neither a Stop nor the line waits for the disk.
mod apply;
mod file;
mod keeper;

pub use apply::{apply, read_host_timeout};
pub use file::{Found, Stored};
pub use keeper::{Keeper, Witness};
