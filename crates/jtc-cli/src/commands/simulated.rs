//! Simulated arm, for `jtc sim` and `jtc serve --sim`, and its controller's parameters.

use std::path::Path;

use cli_kit::{Failure, Output};
use jtc_host::Arm;
use jtc_sim::SimConfig;

use super::named_arm;

/// Returns the given arm, or the built-in arm, and its simulated world. Prints missing parameters of the arm file on
/// stderr. The controller has stored the image `kept`. Without it, the controller has stored the given arm, if its file
/// is complete.
pub(super) fn simulated(
    path: Option<&Path>,
    kept: Option<Vec<u8>>,
    out: &Output,
) -> Result<(Arm, SimConfig), Failure> {
    let arm = named_arm::load(path)?;
    named_arm::note_warnings(&arm, out);
    if arm.friction().is_none() {
        out.note("note: the arm file gives no friction: the simulator uses the friction of the default arm");
    }
    if arm.rotors_given.contains(&false) {
        out.note(
            "note: the arm file does not give every rotor inertia: the simulator uses 0 for the missing ones",
        );
    }
    let stored = match (kept, path) {
        (None, Some(path)) => arm.image().map_err(|e| Failure::usage(format!("{}: {e}", path.display())))?,
        (kept, _) => kept,
    };
    let mut config = SimConfig::new(arm.config(), &arm.parameters());
    if stored.is_some() {
        // The controller gets its arm in the same way as a board: from its memory, and from frames.
        (config.controller, config.stored_arm) = (jtc_core::Config::avena(), stored);
    }
    Ok((arm, config))
}
