#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod finding;
mod kind;
#[cfg(feature = "mcap")]
pub mod mcap;
mod whole;

pub use finding::{Finding, Findings, Severity};
pub use kind::ErrorKind;
pub use whole::write_whole;
