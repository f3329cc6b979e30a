//! `jtc clear`, `gripper`, `recover`: short commands that change the state of the controller.

use std::sync::Arc;
use std::time::Duration;

use cli_kit::{ErrorKind, Failure, Output, Stop};
use host_kit::{Action, FrontEnd};
use jtc_host::arm::Arm;
use jtc_host::session::{RecoverParameters, RecoverStep};
use jtc_host::{CheckError, Error, ParametersError, labels};
use jtc_wire::ALL_NODES;
use serde_json::json;

use super::status;
use crate::args::{ClearArgs, GripperArgs, RecoverArgs, Switch};
use crate::limits;
use crate::operator::ended_at_once;
use crate::progress::Progress;

/// Time after which a request to clear errors has taken effect.
const EFFECT: Duration = Duration::from_millis(300);

/// Clears errors, and reports the errors that remain.
pub(super) fn clear(args: &ClearArgs, out: &Output) -> Result<(), Failure> {
    let mut session = args.link.session()?;
    if args.occurred {
        session.clear_occurred()?;
    }
    // The command waits until this request has taken effect, and then reports the errors that remain.
    session.clear_if_possible(true, ALL_NODES)?;
    let end = session.now() + EFFECT;
    let mut s = session.next_status()?;
    while session.now() < end {
        s = session.next_status()?;
    }
    out.result(&json!({ "cleared": s.errors == 0, "status": status::as_json(&s) }), || {
        if s.errors == 0 {
            format!("cleared; state {}", s.state.name())
        } else {
            let next = labels::next_step(&s).plain(FrontEnd::Command);
            format!("errors remain: {}\nnext: {next}", labels::errors_line(&s))
        }
    });
    if s.errors == 0 { Ok(()) } else { Err(Failure::shown(ErrorKind::Device)) }
}

/// Switches the vacuum pump of the gripper.
pub(super) fn gripper(args: &GripperArgs, out: &Output) -> Result<(), Failure> {
    let on = args.pump == Switch::On;
    args.link.session()?.gripper(on)?;
    out.result(&json!({ "pump": on }), || format!("pump {}", if on { "on" } else { "off" }));
    Ok(())
}

/// Recovers the controller to HoldPos.
pub(super) fn recover(args: &RecoverArgs, out: &Output) -> Result<(), Failure> {
    let progress = Progress::begin(out)?;
    let arm = args.arm.as_deref().map(Arm::load).transpose()?;
    if args.defaults && arm.is_some() {
        return Err(Failure::usage(
            "--arm and --defaults cannot be combined: each selects a set of parameters; nothing was sent",
        )
        .next("use only one of the two options"));
    }
    let parameters = match arm {
        Some(arm) => RecoverParameters::Arm {
            arm: Arc::new(arm),
            accept_device_limits: args.accept.accept_device_limits,
        },
        None if args.defaults => RecoverParameters::ControllerDefaults,
        None => RecoverParameters::None,
    };
    parameters.check()?;
    let its_out = *out;
    let stop = Stop::listen_with(move || {
        ended_at_once(
            its_out,
            "ended at once, during the recovery to HoldPos",
            "`jtc status` shows the state of the controller",
        )
    })?;
    let mut session = args.link.session()?;
    progress.watch(&mut session);
    let (mut steps, mut differences) = (Vec::new(), Vec::new());
    let done = session.recover_with(
        &parameters,
        || stop.asked(),
        |step| {
            out.note(step);
            if let RecoverStep::Differs(difference) = step {
                differences.push(difference.clone());
                return;
            }
            progress.event("step", json!({ "text": step.to_string() }));
            steps.push(step.to_string());
        },
    );
    let s = done.map_err(|e| match e {
        Error::Check(CheckError::DeviceLimits { arm, differences }) => {
            limits::refused(&arm, &differences, out)
        }
        Error::Cancelled => {
            let during = steps.last().map_or("start", String::as_str);
            Failure { message: format!("cancelled after the step: {during}"), ..Failure::of(&e) }
                .next("the recovery is incomplete: `jtc status`, then `jtc recover` again")
        }
        _ => not_itself(e),
    })?;
    let value = json!({ "steps": steps, "differences": differences, "status": status::as_json(&s) });
    out.result(&value, || format!("state {}: ready", s.state.name()));
    Ok(())
}

/// Returns the failure of a recovery. The hint does not suggest `jtc recover` again, because the user must first find the cause of the
/// error.
fn not_itself(e: Error) -> Failure {
    let failure = Failure::of(&e);
    let recovers = [Action::Recover, Action::RecoverWithArm, Action::RecoverWithDefaults];
    // If the controller lacks arm parameters, the hint suggests `jtc recover` with an option.
    if matches!(e, Error::Parameters(ParametersError::NoSource { .. }))
        || !recovers.iter().any(|action| failure.next.names(*action))
    {
        return failure;
    }
    failure.next(
        "the cause of the error remains: release the emergency stop, check power, cable and drive of the \
         named joint or gripper, then `jtc doctor`; `jtc explain CODE` explains each error",
    )
}
