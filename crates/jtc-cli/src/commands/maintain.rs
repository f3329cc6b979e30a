//! `jtc clear`, `reset`, `gripper`, `recover`: short commands that change the controller's state.

use std::time::Duration;

use cli_kit::Output;
use jtc_host::arm::Arm;
use jtc_host::words;
use serde_json::json;

use super::status;
use crate::args::{ClearArgs, GripperArgs, RecoverArgs, ResetArgs, Switch};
use crate::failure::Failure;

/// All joints and the gripper.
const ALL_NODES: u8 = 0x7F;
/// A clear takes effect within some statuses.
const EFFECT: Duration = Duration::from_millis(300);

/// Clears errors, and says what is left of them.
pub fn clear(args: &ClearArgs, out: &Output) -> Result<(), Failure> {
    let mut session = args.link.session()?;
    if args.occurred {
        session.clear_occurred()?;
    }
    session.clear(true, ALL_NODES)?;
    let end = session.now() + EFFECT;
    let mut s = session.next_status()?;
    while session.now() < end {
        s = session.next_status()?;
    }
    out.result(&json!({ "cleared": s.errors == 0, "status": status::as_json(&s) }), || {
        if s.errors == 0 {
            format!("cleared; state {}", words::state(s.fsm))
        } else {
            format!("still there: {}\nnext: jtc recover", words::errors_line(&s))
        }
    });
    if s.errors == 0 { Ok(()) } else { Err(Failure::printed(1)) }
}

/// Resets the nodes of a mask.
pub fn reset(args: &ResetArgs, out: &Output) -> Result<(), Failure> {
    args.link.session()?.reset(args.mask)?;
    let nodes = words::missing_nodes(args.mask);
    out.result(&json!({ "reset": nodes }), || format!("reset: {}", nodes.join(", ")));
    Ok(())
}

/// Switches the pump.
pub fn gripper(args: &GripperArgs, out: &Output) -> Result<(), Failure> {
    let on = args.pump == Switch::On;
    args.link.session()?.gripper(on)?;
    out.result(&json!({ "pump": on }), || format!("pump {}", if on { "on" } else { "off" }));
    Ok(())
}

/// Leads the controller back to HoldPos.
pub fn recover(args: &RecoverArgs, out: &Output) -> Result<(), Failure> {
    let arm = args.arm.as_deref().map(Arm::load).transpose()?;
    let parameters = arm.map(|a| a.parameter_set());
    let mut session = args.link.session()?;
    let mut steps = Vec::new();
    let done = session.recover(parameters.as_ref(), |step| {
        out.note(step);
        steps.push(step.to_string());
    });
    let s = done?;
    out.result(&json!({ "steps": steps, "status": status::as_json(&s) }), || {
        format!("state {}: ready", words::state(s.fsm))
    });
    Ok(())
}
