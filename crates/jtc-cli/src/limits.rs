//! What of an arm file a controller does not use: listed, and refused where it matters.

use cli_kit::{ErrorKind, Failure, Output};
use jtc_host::arm::{Arm, Difference, NOT_CARRIED};
use serde_json::json;

/// Returns the settings of `arm` that the controller uses otherwise; where there are any, they must have been accepted. They are
/// listed either way.
pub fn accept(arm: &Arm, accepted: bool, out: &Output) -> Result<Vec<Difference>, Failure> {
    let differences = arm.device_differences();
    if differences.is_empty() {
        return Ok(differences);
    }
    if accepted {
        for difference in &differences {
            out.note(format!("warning: {difference}"));
        }
        return Ok(differences);
    }
    let message = format!(
        "{}: {} of this arm cannot be given to the controller, which uses its own; nothing was sent",
        arm.name,
        if differences.len() == 1 { "1 value".to_owned() } else { format!("{} values", differences.len()) }
    );
    let hint = format!(
        "no frame carries {NOT_CARRIED}. Build the firmware for this arm, or, where the controller's values are safe for it, add \
         --accept-device-limits"
    );
    if out.is_json() {
        let error = Failure::new(ErrorKind::Refused, "device-limits", &message).hint(&hint).to_json();
        out.result(&json!({ "outcome": "refused", "differences": differences, "error": error }), String::new);
    }
    out.note(format!("jtc: {message}"));
    for difference in &differences {
        out.note(format!("     {difference}"));
    }
    out.note(format!("     {hint}"));
    Err(Failure::printed(ErrorKind::Refused))
}
