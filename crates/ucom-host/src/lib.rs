//! The PC's side of UCoM, without any I/O: what a command, a GUI or a script would otherwise write again.
//!
//! [`master`] runs the procedures on a chain of boards (numbering, updates, parameters, supervision, doctor, probe, conformance),
//! [`files`] reads and writes what they need (images, inventories, tables of signals, recordings, signal databases), and
//! [`ProfileFile`] the profile that both go by.
#![forbid(unsafe_code)]

pub mod files;
pub mod master;
mod profile_file;

pub use profile_file::{ProfileFile, ProfileFileError, profile_help};
