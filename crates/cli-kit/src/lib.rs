//! What the commands `jtc` and `ucom` share: how they speak, make their pages, hear Ctrl-C, and are tried by tests.
#![forbid(unsafe_code)]

pub mod exit;
mod output;
pub mod pages;
mod signal;
#[cfg(feature = "trial")]
pub mod trial;
pub mod usage;

pub use indicatif::ProgressBar;
pub use output::{Output, figure, table};
pub use signal::Stop;
