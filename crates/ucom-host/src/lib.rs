#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod files;
pub mod master;
mod profile_file;
pub mod session;

pub use profile_file::{ProfileFile, ProfileFileError, profile_help};
