#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod decoder;
pub mod explain;
pub mod files;
pub mod master;
mod profile_file;
pub mod session;

pub use decoder::{Decoder, Described, date_text};
pub use profile_file::{ProfileFile, ProfileFileError, profile_help};
