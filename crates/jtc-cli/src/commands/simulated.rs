//! Simulated arm for `jtc sim` and `jtc serve --sim`, and the parameters of its controller.

use std::path::Path;

use cli_kit::{Failure, Output};
use jtc_host::Arm;
use jtc_sim::SimConfig;

use super::named_arm;

/// Returns the specified arm or the built-in arm, and the simulated world of this arm. Prints the names of missing parameters of the arm
/// file on stderr. `kept` is the image of the arm that the controller has stored. Without this image, the controller has stored the
/// specified arm if the arm file is complete.
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
    let mut config = SimConfig::new(arm.config(), &arm.parameters()).with_drive_torques(arm.drive_torque_max);
    if stored.is_some() {
        // Like a board, the simulated controller starts with the built-in settings, and then reads its arm from the
        // stored image.
        (config.controller, config.stored_arm) = (jtc_core::Config::avena(), stored);
    }
    Ok((arm, config))
}
