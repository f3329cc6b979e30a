//! Shared parts of the commands `jtc` and `ucom`: output, live views, keys, help pages, Ctrl-C, and test support.
#![forbid(unsafe_code)]

mod bar;
pub mod exit;
mod failure;
mod keys;
mod lines;
mod output;
pub mod output_file;
pub mod pages;
#[cfg(feature = "testing")]
pub mod reference;
mod screen;
mod signal;
mod size;
mod stdout;
#[cfg(feature = "testing")]
pub mod testing;
pub mod usage;
pub mod variables;
pub mod view;
mod within;

pub use bar::{Stderr, draws_bars};
pub use failure::error_object;
pub use host_kit::{Diagnose, ErrorKind, Failure};
pub use indicatif::ProgressBar;
pub use keys::{Key, Keys};
pub use lines::Lines;
pub use output::{Output, figure, table};
pub use output_file::OutputFile;
pub use screen::{Screen, restore_terminal};
pub use signal::Stop;
pub use size::size;
pub use stdout::stdout_is_stuck;
pub use within::print_within;
