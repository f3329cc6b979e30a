//! Last will of an agent, for the case that the agent is killed. The last will is a small file with the name of the client whose policy
//! applies to the motion. The file exists while the arm moves or a motion is expected. The next agent at the same port reads the file
//! before it serves a client.
//!
//! A separate thread writes the file, so the disk does not delay a Stop or other frames.
mod apply;
mod file;
mod keeper;

pub use apply::{apply, read_host_timeout};
pub use file::{Found, Stored};
pub use keeper::{Keeper, Witness};
