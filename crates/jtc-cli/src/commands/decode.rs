//! `jtc decode`: frames in hex or as raw bytes.

use crate::failure::Failure;
use crate::output::Output;

/// Decodes stdin.
pub fn decode(_out: &Output) -> Result<(), Failure> {
    Err(Failure::usage("not yet"))
}
