//! `jtc status`, and the text and JSON of a status for all commands that show a status.

use cli_kit::{Failure, Output, figure, table};
use host_kit::FrontEnd;
use jtc_host::held_stop::{self, HeldStop};
use jtc_host::labels::{self, GRIPPER};
use jtc_host::sample::is_measured;
use jtc_wire::{Joint, NodeState, Reactions, Status};
use serde_json::{Value, json};

use crate::args::LinkArgs;

/// Prints one status.
pub(super) fn status(link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let mut session = link.session()?;
    let status = session.fresh_status()?;
    let reactions = if status.is_held_stop() { session.reactions() } else { None };
    let stop = reactions.as_ref().and_then(HeldStop::last);
    let mut value = as_json(&status);
    value["held_stop"] = json!(stop);
    if let Some((cause, _)) = reactions.as_ref().and_then(|reactions| reactions.stop.as_ref()) {
        value["next"] = held_stop::next_step(&status, Some(cause)).plain(FrontEnd::Command).into();
    }
    out.result(&value, || text(&status, reactions.as_ref()));
    Ok(())
}

/// Returns a status as JSON. The names of the JSON fields contain the units.
pub(super) fn as_json(s: &Status) -> Value {
    let joints: Vec<Value> = Joint::ALL
        .into_iter()
        .zip(&s.joints)
        .map(|(joint, j)| {
            let i = joint.index();
            let measured = is_measured(s, i);
            json!({
                "joint": joint.number(),
                "state": joint_state(s, i),
                "fsm": j.state.code(),
                "position_rad": measured.then_some(j.position + 0.0),
                "velocity_rad_s": measured.then_some(j.velocity + 0.0),
                "torque_nm": measured.then_some(j.torque + 0.0),
                "temperature_c": measured.then_some(j.temperature),
                "internal_errors": labels::joint_errors(j.internal),
                "internal_errors_occurred": labels::joint_errors(j.internal_occurred),
                "node_errors": labels::node_errors(j.errors),
                "warnings": labels::node_warnings(j.warnings),
                "motor_faults": labels::motor_faults(j.mc_current),
                "motor_faults_occurred": labels::motor_faults(j.mc_occurred),
            })
        })
        .collect();
    let gripper = s.gripper.map(|g| {
        json!({
            "state": gripper_state(s),
            "fsm": g.state.code(),
            "pump": gripper_answers(s).then_some(g.pump != 0),
            "pressure1": gripper_answers(s).then_some(g.pressure1 != 0),
            "pressure2": gripper_answers(s).then_some(g.pressure2 != 0),
            "node_errors": labels::node_errors(g.errors),
            "warnings": labels::node_warnings(g.warnings),
        })
    });
    json!({
        "state": s.state.name(),
        "fsm": s.state.byte(),
        "trajectory": s.trajectory.name(),
        "tes": s.trajectory.byte(),
        "point": s.point,
        "time_s": f64::from(s.point) * 1e-3,
        "errors": labels::errors(s.errors),
        "error_word": s.errors,
        "errors_occurred": labels::errors(s.occurred),
        "occurred_word": s.occurred,
        "missing_parameters": labels::missing_parameters(s.jtc_init),
        "missing_nodes": labels::node_names(s.node_init),
        "friction": if s.friction_type == 0 { "polynomial" } else { "table" },
        "can_flags": labels::can_flags(s.can_current),
        "can_flags_occurred": labels::can_flags(s.can_occurred),
        "joints": joints,
        "gripper": gripper,
        "next": labels::next_step(s).plain(FrontEnd::Command),
    })
}

/// Returns the state of joint `j` (from 0). The result is the last state that the joint has sent, unless the joint does not answer.
pub(super) fn joint_state(s: &Status, j: usize) -> &'static str {
    let state = s.joints[j].state;
    // A joint that is not ready may answer without measured values. An enabled joint without measured values does not
    // answer.
    let silent = !is_measured(s, j) && (labels::is_silent(s, j) || state == NodeState::ENABLED);
    if labels::is_absent(s, j) {
        "absent"
    } else if silent {
        "does not answer"
    } else {
        state.name()
    }
}

/// Returns `true` if the gripper has sent the pump and vacuum values of the status.
pub(super) fn gripper_answers(s: &Status) -> bool {
    !labels::is_silent(s, GRIPPER)
}

/// Returns the state of the gripper. The result is the last state that the gripper has sent, unless the gripper does not answer.
pub(super) fn gripper_state(s: &Status) -> &'static str {
    match s.gripper {
        Some(g) if gripper_answers(s) => g.state.name(),
        _ => "does not answer",
    }
}

/// Formats a status as text. The text contains the cause of a held stop if the controller reports the cause.
fn text(s: &Status, reactions: Option<&Reactions>) -> String {
    let stop = reactions.filter(|_| s.is_held_stop()).and_then(|reactions| reactions.stop.as_ref());
    let mut text = format!(
        "state {}   trajectory {}   point {} ({:.3} s)   friction {}\n",
        s.state.name(),
        s.trajectory.name(),
        s.point,
        f64::from(s.point) * 1e-3,
        if s.friction_type == 0 { "polynomial" } else { "table" },
    );
    let rows: Vec<Vec<String>> = Joint::ALL
        .into_iter()
        .zip(&s.joints)
        .map(|(joint, j)| {
            let i = joint.index();
            let figure = |value: f32, digits| {
                if is_measured(s, i) { figure(value.into(), digits) } else { "-".into() }
            };
            vec![
                joint.to_string(),
                joint_state(s, i).into(),
                figure(j.position, 4),
                figure(j.velocity, 4),
                figure(j.torque, 2),
                figure(j.temperature.into(), 0),
            ]
        })
        .collect();
    text += &table(&["", "state", ">position rad", ">velocity rad/s", ">torque N·m", ">°C"], &rows);
    if let Some(g) = s.gripper {
        let is = |level| if level != 0 { "reached" } else { "not reached" };
        text += &if gripper_answers(s) {
            format!(
                "gripper   {}   pump {}   vacuum 1 {}, 2 {}\n",
                gripper_state(s),
                if g.pump != 0 { "on" } else { "off" },
                is(g.pressure1),
                is(g.pressure2),
            )
        } else {
            format!("gripper   {}\n", gripper_state(s))
        };
    }
    if let Some((cause, ago_ms)) = stop {
        text += &format!("held stop: {}\n", HeldStop::new(cause, *ago_ms).line());
    } else if s.errors != 0 {
        text += &format!("errors: {}\n", labels::errors_line(s));
    }
    if s.is_coming_up() {
        text += &format!("{}\n", labels::waiting_for(s));
    }
    let next = held_stop::next_step(s, stop.map(|(cause, _)| cause));
    text += &format!("next: {}\n", next.plain(FrontEnd::Command));
    text
}

#[cfg(test)]
mod tests {
    use jtc_wire::{ControllerState, StopCause, StopKind};

    use super::*;

    #[test]
    fn j69_a_held_stop_has_its_cause_and_age() {
        let mut s = Status {
            state: ControllerState::HoldPos.into(),
            errors: jtc_wire::error::INTERNAL_JOINTS,
            ..Status::default()
        };
        s.joints[1].internal = jtc_wire::joint_error::TORQUE;
        let cause = StopCause { kind: StopKind::Push, joint: 2, value: 61.5, limit: 54.0 };
        let reactions = Reactions { stop: Some((cause, 12_300)), ..Reactions::default() };
        let told = text(&s, Some(&reactions));
        assert!(told.contains(&format!("held stop: {cause}; 12 s ago\n")), "{told}");
        assert!(told.contains("next: remove what pushes the joint"), "{told}");
        let untold = text(&s, None);
        assert!(untold.contains("errors: held stop: joint 2: torque over limit\n"), "{untold}");
        // If the errors of the status were cleared, the text does not contain the held stop.
        assert!(!text(&Status { errors: 0, ..s }, Some(&reactions)).contains("held stop"));
    }

    #[test]
    fn a_joint_that_does_not_answer_is_at_no_position() {
        let mut s = Status {
            state: ControllerState::Error.into(),
            errors: 0x20,
            can_current: 1 << 10,
            ..Status::default()
        };
        for joint in &mut s.joints {
            joint.state = NodeState::ENABLED;
        }
        s.joints[1].position = 0.5;
        let json = as_json(&s);
        assert_eq!(json["joints"][2]["state"], "does not answer");
        assert!(json["joints"][2]["position_rad"].is_null() && json["joints"][2]["torque_nm"].is_null());
        assert_eq!(json["joints"][1]["position_rad"], 0.5);
        assert_eq!(json["joints"][0]["position_rad"], 0.0);
        let text = text(&s, None);
        let row = text.lines().find(|line| line.starts_with("joint 3")).unwrap();
        assert!(row.contains("does not answer") && !row.contains("0.0"), "{row}");
    }
}
