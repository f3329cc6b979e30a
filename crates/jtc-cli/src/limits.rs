//! Parameters of an arm file that a controller does not use. The command lists these parameters and rejects them unless the user accepts
//! them.

use cli_kit::{ErrorKind, Failure, Output, error_object};
use host_kit::next;
use jtc_core::Config;
use jtc_host::CheckError;
use jtc_host::arm::{Arm, Difference};
use serde_json::json;

/// Returns the settings of `arm` that differ from the settings of the controller, and prints a warning for each difference. Returns an
/// error unless the user has accepted the differences.
pub(crate) fn accept(
    arm: &Arm,
    device: &Config,
    accepted: bool,
    out: &Output,
) -> Result<Vec<Difference>, Failure> {
    let differences = arm.device_differences(device);
    if !differences.is_empty() && !accepted {
        return Err(refused(&arm.name, &differences, out));
    }
    Ok(warned(differences, out))
}

/// Prints the settings of an arm that differ from the settings of the controller, and returns the failure.
pub(crate) fn refused(arm: &str, differences: &[Difference], out: &Output) -> Failure {
    let error = CheckError::DeviceLimits { arm: arm.to_owned(), differences: differences.to_vec() };
    let message = format!(
        "{arm}: {} of this arm cannot be sent to the controller, which uses its own; nothing was sent",
        values(differences.len())
    );
    listed(&Failure { message, ..Failure::of(&error) }, differences, out)
}

/// Like [`accept`], but compares all parameters of `arm` with `has`, the arm of the controller (J-55).
pub(crate) fn same_arm(
    arm: &Arm,
    has: &Arm,
    accepted: bool,
    out: &Output,
) -> Result<Vec<Difference>, Failure> {
    let differences = arm.differences(has);
    if differences.is_empty() || accepted {
        return Ok(warned(differences, out));
    }
    let message = format!(
        "{}: the controller has another arm, {}: {}",
        arm.name,
        has.name,
        values_differ(differences.len())
    );
    let failure = Failure::new(ErrorKind::Refused, "other-arm", message).next(next!(
        "{} sends this arm to the controller; `jtc arm pull -o FILE` reads the controller's arm, which is \
         used without --arm",
        ArmPush
    ));
    Err(listed(&failure, &differences, out))
}

fn values(count: usize) -> String {
    if count == 1 { "1 value".into() } else { format!("{count} values") }
}

/// Returns a text with the number of values that differ.
pub(crate) fn values_differ(count: usize) -> String {
    format!("{} {}", values(count), if count == 1 { "differs" } else { "differ" })
}

fn warned(differences: Vec<Difference>, out: &Output) -> Vec<Difference> {
    differences.iter().for_each(|difference| out.note(format!("warning: {difference}")));
    differences
}

/// Prints a failure and the differences that caused it. The returned failure is marked as already printed.
fn listed(failure: &Failure, differences: &[Difference], out: &Output) -> Failure {
    if out.is_json() {
        let error = error_object(failure);
        out.result(&json!({ "outcome": "refused", "differences": differences, "error": error }), String::new);
    }
    out.note(format!("jtc: {}", failure.message));
    for difference in differences {
        out.note(format!("     {difference}"));
    }
    out.note(format!("     {}", failure.next));
    Failure::shown(ErrorKind::Refused)
}
