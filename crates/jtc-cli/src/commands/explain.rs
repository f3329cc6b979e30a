//! `jtc explain`: a page about a code.

use crate::args::ExplainArgs;
use crate::failure::Failure;
use crate::output::Output;

/// Prints the page, or the list.
pub fn explain(_args: &ExplainArgs, _out: &Output) -> Result<(), Failure> {
    Err(Failure::usage("not yet"))
}
