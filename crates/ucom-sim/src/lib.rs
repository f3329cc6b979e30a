#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod application;
mod axis;
mod board;
mod fault;
mod file;
#[cfg(feature = "fuzzing")]
#[doc(hidden)]
pub mod fuzzing;
pub mod memory;
mod model;
mod server;
mod sim;
#[cfg(test)]
mod sim_tests;
mod texts;

pub use axis::AxisConfig;
pub use board::BoardState;
pub use fault::{FAULT_HELP, Fault, FaultError, FaultKind, Trigger};
pub use file::{BoardConfig, ChainConfig, ChainFileError, HEAD, help};
pub use server::ChainServer;
pub use sim::ChainSim;
pub use texts::Texts;
