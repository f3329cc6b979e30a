//! `jtc reset`: restarts nodes of the joint bus. On the command line, joints are counted from 1.

use cli_kit::{Failure, Output};
use jtc_host::labels;
use jtc_host::session::reset_takes_torque;
use jtc_wire::Joint;
use serde_json::json;

use crate::args::ResetArgs;
use crate::ask::confirm;

/// Bit mask of all joints and the gripper.
const ALL: u8 = 0x7F;
/// Bit of the gripper in the bit mask.
const GRIPPER: u8 = 1 << 6;
/// Resets the specified nodes. If the controller holds the arm, the user must confirm the reset. Rejects a reset of a joint while
/// the arm moves.
pub(super) fn reset(args: &ResetArgs, out: &Output) -> Result<(), Failure> {
    let nodes = nodes(args)?;
    let reset = labels::node_names(nodes);
    let names = reset.join(", ");
    let mut session = args.link.session()?;
    let state = session.fresh_status()?.state;
    if reset_takes_torque(nodes, state)? && !args.yes {
        let question =
            format!("the arm has torque ({}), and a reset of {names} can remove it: the arm may fall", state);
        confirm(&question, "--yes")?;
    }
    session.reset(nodes)?;
    out.result(&json!({ "reset": reset }), || format!("reset: {names}"));
    Ok(())
}

/// Returns the bit mask of the specified nodes. Bits 0..5 are joints 1..6, and bit 6 is the gripper.
fn nodes(args: &ResetArgs) -> Result<u8, Failure> {
    if let Some(mask) = &args.mask {
        return Err(of_mask(mask));
    }
    let joints = args.joints.iter().fold(0, |mask, joint| mask | 1 << (joint - 1));
    let nodes = if args.all { ALL } else { joints | if args.gripper { GRIPPER } else { 0 } };
    if nodes == 0 {
        return Err(Failure::usage("no node selected; nothing was sent")
            .next("select nodes with `jtc reset --joints 1,3` (counted from 1), `--gripper`, or `--all`"));
    }
    Ok(nodes)
}

/// Returns the failure if the argument is a bit mask. In older versions the argument was a bit mask, and the value 3 meant joints 1
/// and 2.
fn of_mask(text: &str) -> Failure {
    let value = match text.strip_prefix("0x").or(text.strip_prefix("0X")) {
        Some(hex) => u8::from_str_radix(hex, 16).ok(),
        None => text.parse().ok(),
    };
    let failure = Failure::usage(format!(
        "\"{text}\" does not select nodes: expected --joints, --gripper or --all; nothing was sent"
    ));
    let Some(mask) = value.filter(|mask| *mask != 0 && mask & !ALL == 0) else {
        return failure
            .next("select nodes with `jtc reset --joints 1,3` (counted from 1), `--gripper`, or `--all`");
    };
    let joints: Vec<String> = Joint::ALL
        .into_iter()
        .filter(|joint| mask >> joint.index() & 1 == 1)
        .map(|joint| joint.number().to_string())
        .collect();
    let mut options = Vec::new();
    if !joints.is_empty() {
        options.push(format!("--joints {}", joints.join(",")));
    }
    if mask & GRIPPER != 0 {
        options.push("--gripper".to_owned());
    }
    let as_mask = format!("`jtc reset {}` resets the nodes of the bit mask {text}", options.join(" "));
    match text.parse::<u8>() {
        Ok(joint @ 1..=6) => {
            failure.next(format!("`jtc reset --joints {joint}` resets joint {joint}; {as_mask}"))
        }
        _ => failure.next(as_mask),
    }
}

#[cfg(test)]
mod tests {
    use cli_kit::ErrorKind;

    use super::*;

    #[test]
    fn a_bare_mask_is_refused_with_both_things_that_it_may_mean() {
        let failure = of_mask("3");
        assert_eq!(failure.kind, ErrorKind::Usage);
        assert!(
            failure.next.to_string().contains("`jtc reset --joints 3` resets joint 3"),
            "{}",
            failure.next
        );
        assert!(failure.next.to_string().contains("`jtc reset --joints 1,2`"), "{}", failure.next);
        assert!(of_mask("0x44").next.to_string().contains("--joints 3 --gripper"));
        assert!(
            of_mask("0x80").next.to_string().contains("--all")
                && of_mask("elbow").next.to_string().contains("--all")
        );
    }
}
