//! Arm of a command: the named one, or the built-in one.

use std::path::Path;

use cli_kit::Output;
use jtc_host::arm::Arm;
use jtc_host::file::FileError;

use super::job::typed;

/// Loads the named arm, or the built-in one.
pub fn load(path: Option<&Path>) -> Result<Arm, FileError> {
    path.map_or_else(|| Ok(Arm::avena()), Arm::load)
}

/// Prints the missing parameters of an arm file to stderr.
pub fn note_warnings(arm: &Arm, out: &Output) {
    for warning in &arm.warnings {
        out.note(format!("note: {warning}"));
    }
}

/// Returns the option that names the arm, as typed after other words; empty without a named arm.
pub fn typed_option(path: Option<&Path>) -> String {
    path.map_or(String::new(), |path| format!(" --arm {}", typed(path)))
}
