#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod atomic_write;
mod clock;
mod diagnosis;
mod facts;
mod failure;
mod finding;
mod kind;
#[cfg(feature = "mcap")]
pub mod mcap;
mod next;
pub mod owner;
mod suggest;
mod user_folder;
mod visible;

pub use atomic_write::write_atomically;
pub use clock::unix_time;
pub use diagnosis::{Diagnose, Diagnosis};
pub use facts::{Facts, HeldStopFacts};
pub use failure::Failure;
pub use finding::{Finding, Findings, Severity};
pub use kind::ErrorKind;
pub use next::{Action, FrontEnd, Next};
pub use suggest::{nearest, similarity};
pub use user_folder::user_folder;
pub use visible::{is_hidden, visible, visible_in_line};
