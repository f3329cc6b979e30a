//! What of an arm file a controller does not use: listed, and refused where it matters.

use cli_kit::{ErrorKind, Failure, Output, error_object};
use host_kit::Next;
use jtc_core::Config;
use jtc_host::arm::{Arm, Difference, NOT_CARRIED};
use serde_json::json;

/// Returns the settings of `arm` that the controller uses otherwise; where there are any, they must have been accepted. They are
/// listed either way.
pub fn accept(arm: &Arm, device: &Config, accepted: bool, out: &Output) -> Result<Vec<Difference>, Failure> {
    let differences = arm.device_differences(device);
    let hint = format!(
        "a controller with extensions takes the whole arm by `jtc arm push FILE`; for others no frame carries {NOT_CARRIED}: \
         they belong into the firmware"
    );
    let message = |count| {
        format!(
            "{}: {} of this arm cannot be given to the controller, which uses its own; nothing was sent",
            arm.name,
            values(count)
        )
    };
    listed(differences, accepted, ("device-limits", message, hint.into()), out)
}

/// The same for all numbers of an arm that a controller `has` (J-55).
pub fn same_arm(arm: &Arm, has: &Arm, accepted: bool, out: &Output) -> Result<Vec<Difference>, Failure> {
    let hint = "`jtc arm push FILE` gives the controller this arm, `jtc arm pull -o FILE` reads the one that it has, which counts \
                where --arm is left out";
    let message = |count| {
        format!("{}: the controller has another arm, {}: {}", arm.name, has.name, values_differ(count))
    };
    listed(arm.differences(has), accepted, ("other-arm", message, hint.into()), out)
}

fn values(count: usize) -> String {
    if count == 1 { "1 value".into() } else { format!("{count} values") }
}

/// So many values differ, in words.
pub fn values_differ(count: usize) -> String {
    format!("{} {}", values(count), if count == 1 { "differs" } else { "differ" })
}

/// Lists differences; an error, with its code, message and hint, where there are any that nobody has accepted.
fn listed(
    differences: Vec<Difference>,
    accepted: bool,
    (code, message, hint): (&'static str, impl Fn(usize) -> String, Next),
    out: &Output,
) -> Result<Vec<Difference>, Failure> {
    if differences.is_empty() {
        return Ok(differences);
    }
    if accepted {
        for difference in &differences {
            out.note(format!("warning: {difference}"));
        }
        return Ok(differences);
    }
    let message = message(differences.len());
    if out.is_json() {
        let error = error_object(&Failure::new(ErrorKind::Refused, code, &message).next(hint.clone()));
        out.result(&json!({ "outcome": "refused", "differences": differences, "error": error }), String::new);
    }
    out.note(format!("jtc: {message}"));
    for difference in &differences {
        out.note(format!("     {difference}"));
    }
    out.note(format!("     {hint}"));
    Err(Failure::shown(ErrorKind::Refused))
}
