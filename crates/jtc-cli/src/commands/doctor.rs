//! `jtc doctor`: what is wrong, and the next command.

use crate::args::LinkArgs;
use crate::failure::Failure;
use crate::output::Output;

/// Looks at link, bus and set-up.
pub fn doctor(_link: &LinkArgs, _out: &Output) -> Result<(), Failure> {
    Err(Failure::usage("not yet"))
}
