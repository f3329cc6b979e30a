//! The arm that a command is for: the one that was named, or the built-in one.

use std::path::Path;

use cli_kit::Output;
use jtc_host::arm::Arm;
use jtc_host::file::FileError;

use super::job::typed;

/// The arm that was named, or the built-in one.
pub fn load(path: Option<&Path>) -> Result<Arm, FileError> {
    path.map_or_else(|| Ok(Arm::avena()), Arm::load)
}

/// What the file of an arm leaves open goes to stderr.
pub fn note_warnings(arm: &Arm, out: &Output) {
    for warning in &arm.warnings {
        out.note(format!("note: {warning}"));
    }
}

/// The option that names it, as it is typed behind other words; empty where none was named.
pub fn typed_option(path: Option<&Path>) -> String {
    path.map_or(String::new(), |path| format!(" --arm {}", typed(path)))
}
