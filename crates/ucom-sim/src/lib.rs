//! A simulated chain of boards in virtual time and without any I/O.
//!
//! [`ChainConfig`] says which boards there are, [`Fault`]s what goes wrong, and [`ChainSim`] is the members of a bus that
//! the caller runs. Each board is the [`Node`](ucom::node::Node) that firmware uses, with flash, pins and an application
//! that moves some axes. The same seed and the same frames at the same times give the same answers.
//!
//! ```
//! use ucom_sim::{ChainConfig, ChainSim};
//! use ucom::{Format, Profile};
//!
//! let profile = Profile::default();
//! let chain = ChainConfig::head(&profile).with_boards(1, &profile).with_flash_ids(&[0x21]);
//! let mut sim = ChainSim::new(&chain, Vec::new(), 1, &profile);
//! sim.advance(250_000);
//! assert_eq!(sim.poll(0), None);
//! sim.hear(0, 0x281, Format::BUS, &[]);
//! assert_eq!(sim.poll(0), Some("0C1#01".parse()?));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

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
mod sim;
#[cfg(test)]
mod sim_tests;

pub use axis::AxisConfig;
pub use board::BoardState;
pub use fault::{FAULT_HELP, Fault, FaultError, FaultKind, Trigger};
pub use file::{BoardConfig, ChainConfig, ChainFileError, HEAD, help};
pub use sim::ChainSim;
