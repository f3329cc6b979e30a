#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod clock;
mod diagnosis;
mod facts;
mod failure;
mod finding;
mod kind;
mod likeness;
#[cfg(feature = "mcap")]
pub mod mcap;
mod next;
pub mod owner;
mod user_folder;
mod whole;

pub use clock::unix_time;
pub use diagnosis::{Diagnose, Diagnosis};
pub use facts::{Facts, HeldStopFacts};
pub use failure::Failure;
pub use finding::{Finding, Findings, Severity};
pub use kind::ErrorKind;
pub use likeness::{likeness, nearest};
pub use next::{Action, FrontEnd, Next};
pub use user_folder::user_folder;
pub use whole::write_whole;
