//! Arm of a command: the arm file that the user has specified, or the built-in arm.

use std::path::Path;

use cli_kit::Output;
use jtc_host::arm::Arm;
use jtc_host::file::FileError;

use super::job::typed;

/// Loads the specified arm file, or the built-in arm.
pub(super) fn load(path: Option<&Path>) -> Result<Arm, FileError> {
    path.map_or_else(|| Ok(Arm::avena()), Arm::load)
}

/// Prints the names of the missing parameters of an arm file on stderr.
pub(super) fn note_warnings(arm: &Arm, out: &Output) {
    for warning in &arm.warnings {
        out.note(format!("note: {warning}"));
    }
}

/// Returns the arm file option in the form in which the user can add the option to a command. Returns an empty text for the
/// built-in arm.
pub(super) fn typed_option(path: Option<&Path>) -> String {
    path.map_or(String::new(), |path| format!(" --arm {}", typed(path)))
}
