#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod api;
pub mod jobs;
pub mod line;
pub mod log;
pub mod modbus;
pub mod owner;
pub mod record;
mod upload;
pub mod will;

pub use agent_kit::{access, serve, tls};
pub use line::{ClientId, Denied, Introduction, Lease, LineEvent, Policy, Role, SharedLine};
pub use owner::{ClientPort, Line, Owner};
