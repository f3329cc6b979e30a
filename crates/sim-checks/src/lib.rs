#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod invariants;
pub mod lowering;
pub mod matrix;
pub mod soak;

pub use invariants::{Broken, Invariants, Violation};
