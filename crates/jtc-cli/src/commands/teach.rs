//! `jtc teach`: moving the arm by hand, and recording it.

use serde_json::json;

use crate::args::{LinkArgs, TeachCommand};
use crate::failure::Failure;
use crate::output::Output;

/// Does one of the family.
pub fn teach(command: &TeachCommand, out: &Output) -> Result<(), Failure> {
    match command {
        TeachCommand::On(link) => switch(link, true, out),
        TeachCommand::Off(link) => switch(link, false, out),
        TeachCommand::Record { .. } => Err(Failure::usage("not yet")),
    }
}

fn switch(link: &LinkArgs, on: bool, out: &Output) -> Result<(), Failure> {
    link.session()?.teach(on)?;
    out.result(&json!({ "teaching": on }), || {
        if on { "teaching on: the arm can be moved by hand".into() } else { "teaching off: the arm holds its pose".into() }
    });
    Ok(())
}
