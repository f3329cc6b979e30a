//! `jtc arm push`, `pull`, `diff`: write, read and compare the arm of a controller.

use std::path::Path;

use cli_kit::{ErrorKind, Failure, Output, OutputFile, table};
use jtc_core::Config;
use jtc_host::arm::{Arm, Difference};
use jtc_host::session::{ArmPart, PushReport};
use jtc_host::{Error, LinkError, Session};
use serde_json::json;

use super::super::info::hash;
use super::super::{named_arm, params};
use crate::args::{AcceptArgs, LinkArgs, OverwriteArgs};
use crate::limits;
use crate::link::LinkPort;

/// Sends all parameters of the arm in a file to the controller.
pub(super) fn push(
    file: &Path,
    store: bool,
    accept: AcceptArgs,
    link: &LinkArgs,
    out: &Output,
) -> Result<(), Failure> {
    let arm = Arm::load(file)?;
    named_arm::note_warnings(&arm, out);
    let set = arm.parameter_set();
    if !set.missing().is_empty() {
        let message = format!(
            "{}: values missing in the file: {}; nothing was sent",
            arm.name,
            set.missing().join(", ")
        );
        return Err(Failure::usage(message).next(
            "list the missing values with `jtc arm check FILE`, or get starting values for a URDF with `jtc \
             arm import`",
        ));
    }
    set.check()?;
    arm.check_gains()?;
    let mut session = link.session()?;
    if session.info()?.is_none() {
        return without_extensions(&mut session, &arm, store, accept, out);
    }
    let report = |part: ArmPart<'_>| match part {
        ArmPart::Settings(count) => out.note(format!("{count} settings")),
        ArmPart::Name => out.note("name of the arm"),
        ArmPart::Parameter(report) => out.note(sent(report)),
    };
    let (pushed, stored) = if store {
        session.push_and_store_arm(&arm, report).map(|(pushed, number)| (pushed, Some(number)))
    } else {
        session.push_arm(&arm, report).map(|pushed| (pushed, None))
    }
    .map_err(|e| refused(e, &arm))?;
    let tried = params::await_trial(&mut session, out)?;
    let now = arm.hash().ok().flatten().unwrap_or_default();
    let value = json!({
        "arm": arm.name, "hash": hash(now), "parts": pushed, "gains_tried": tried,
        "stored_number": stored, "differences": [],
    });
    out.result(&value, || {
        let line =
            format!("the controller has arm {}, hash {}: read back without differences", arm.name, hash(now));
        match stored {
            None => format!(
                "{line}\nnext: jtc arm push --store stores it in the controller for the next power-on"
            ),
            Some(number) => format!(
                "{line}\nstored, number {number}; the controller is in Init\nnext: jtc recover --defaults \
                 activates the stored arm"
            ),
        }
    });
    Ok(())
}

/// Describes a parameter that was sent to the controller.
fn sent(p: &PushReport) -> String {
    format!("{}: {} bytes, {:.2} s", p.parameter.name(), p.bytes, p.time_s)
}

/// Returns the failure if the controller rejected a setting. If the arm has torque, the hint says that settings can
/// change only without torque.
fn refused(error: Error, arm: &Arm) -> Failure {
    let failure = Failure::of(&error);
    match error {
        Error::Link(LinkError::Refused { request: jtc_wire::FrameType::SetSettings, code, .. }) => match code
        {
            jtc_wire::DataStatus::NotAllowed => failure.next(
                "settings can change only without torque: `jtc disable` (an arm without brakes falls), then \
                 push again; nothing was changed",
            ),
            _ => failure.next("find the value with `jtc arm check FILE`; nothing was changed"),
        },
        Error::Extension(_) => failure,
        _ => Failure { message: format!("{}: {}", arm.name, failure.message), ..failure },
    }
}

/// Sends the parameters to a controller without extensions, which accepts only friction, gains and model.
fn without_extensions(
    session: &mut Session<LinkPort>,
    arm: &Arm,
    store: bool,
    accept: AcceptArgs,
    out: &Output,
) -> Result<(), Failure> {
    if store {
        let message = "this controller has no extensions and cannot store an arm; nothing was sent";
        return Err(
            Failure::new(ErrorKind::Refused, "no-extension", message).next("push the arm without --store")
        );
    }
    let differences = limits::accept(arm, &Config::avena(), accept.accept_device_limits, out)?;
    let pushed = session.push(&arm.parameter_set(), |p| out.note(sent(p)))?;
    let value = json!({
        "arm": arm.name, "hash": null, "parts": pushed, "stored_number": null, "differences": differences,
    });
    out.result(&value, || {
        format!("friction, gains and model of {} were sent; this controller cannot report them", arm.name)
    });
    Ok(())
}

/// Reads the arm of the controller and writes the arm to a file.
pub(super) fn pull(
    file: &Path,
    overwrite: OverwriteArgs,
    link: &LinkArgs,
    out: &Output,
) -> Result<(), Failure> {
    let target = OutputFile::open(file, overwrite.overwrite, &[])?;
    let arm = link.session()?.device_arm()?;
    let name = target.name();
    target.write(arm.to_toml())?;
    let now = hash(arm.hash().ok().flatten().unwrap_or_default());
    out.result(&json!({ "file": name, "arm": arm.name, "hash": now }), || {
        format!("{name}: arm {}, hash {now}\nnext: jtc arm show {name}", arm.name)
    });
    Ok(())
}

/// Lists the differences between the arm file and the arm of the controller.
pub(super) fn diff(file: &Path, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let arm = Arm::load(file)?;
    let mut session = link.session()?;
    let (differences, known) = match session.info()? {
        Some(_) => (arm.differences(&session.device_arm()?), true),
        None => (arm.device_differences(&Config::avena()), false),
    };
    let equal = differences.is_empty();
    out.result(&json!({ "equal": equal, "differences": differences, "complete": known }), || {
        let mut text = if equal {
            format!("no differences: the controller has arm {}", arm.name)
        } else {
            format!("{}\n{}", limits::values_differ(differences.len()), as_table(&differences))
        };
        if !known {
            text += "\nthis controller has no extensions: only its built-in settings were compared; \
                    friction, gains and model cannot be read";
        }
        text.trim_end().to_owned()
    });
    if equal { Ok(()) } else { Err(Failure::shown(ErrorKind::Refused)) }
}

fn as_table(differences: &[Difference]) -> String {
    let rows: Vec<Vec<String>> = differences
        .iter()
        .map(|d| {
            let joint = d.joint.map_or(String::new(), |joint| joint.to_string());
            vec![joint, d.name.clone(), d.file.to_string(), d.device.to_string(), d.unit.to_owned()]
        })
        .collect();
    table(&["", "value", ">file", ">controller", ""], &rows)
}
