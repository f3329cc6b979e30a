//! Texts that describe the codes and error bits of the controller.

use host_kit::{Action, Next, next};
pub use jtc_bus::GRIPPER;
use jtc_bus::{NODES, NodeState, warning};
use jtc_wire::{
    ControllerState, DataStatus, FrameStatus, FrameType, Joint, Status, StopCause, can_flag, error,
};

/// Velocities at which a joint counts as at rest, rad/s (J-36).
const AT_REST_RAD_S: std::ops::RangeInclusive<f64> = -0.02..=0.02;

/// Returns the name of a node on the joint bus.
pub fn node(n: usize) -> String {
    Joint::from_index(n).map_or_else(|| "gripper".into(), |joint| joint.to_string())
}

/// Returns the name of a request as shown to the user.
pub fn request(request: FrameType) -> &'static str {
    match request {
        FrameType::ClearCurrentErrors => "clearing the current errors",
        FrameType::ClearOccurredErrors => "clearing the occurred errors",
        FrameType::JtcStatus => "the status",
        FrameType::Trajectory => "a segment of the trajectory",
        FrameType::FrictionTable => "the friction tables",
        FrameType::FrictionTableUseDefault => "the default friction tables",
        FrameType::PidParam => "the gains",
        FrameType::PidParamUseDefault => "the default gains",
        FrameType::ArmModel => "the arm model",
        FrameType::ArmModelUseDefault => "the default arm model",
        FrameType::TrajSetExecStatus => "executing, pausing or stopping the trajectory",
        FrameType::TeachingModeEnable => "switching teaching on",
        FrameType::TeachingModeDisable => "switching teaching off",
        FrameType::FrictionPolynomial => "the friction polynomial",
        FrameType::FrictionPolynomialUseDefault => "the default friction polynomial",
        FrameType::ResetCanDevices => "resetting nodes",
        FrameType::GripperControl => "switching the pump",
        FrameType::GetInfo | FrameType::Info => "reading the identity of the device",
        FrameType::GetSettings | FrameType::Settings => "reading the settings",
        FrameType::SetSettings => "changing the settings",
        FrameType::SetName => "naming the arm",
        FrameType::GetArm | FrameType::Arm => "reading the arm",
        FrameType::StoreArm => "storing the arm",
        FrameType::Disable => "taking the torque off",
        FrameType::Jog => "jogging",
        FrameType::GetLog | FrameType::Log => "reading the flight recorder",
        FrameType::ClearLog => "clearing the flight recorder",
        FrameType::GetPoints | FrameType::Points => "reading the trajectory",
    }
}

/// Returns the text for the data status of a frame.
pub fn data_status(code: DataStatus) -> &'static str {
    match code {
        DataStatus::Idle => "nothing",
        DataStatus::NoError => "accepted",
        DataStatus::StartPositionMismatch => "the arm is not at the start of the trajectory",
        refused => refused.name(),
    }
}

/// Returns the text for the reception status of a frame.
pub fn frame_status(code: FrameStatus) -> &'static str {
    match code {
        FrameStatus::Idle => "nothing",
        FrameStatus::NoError => "good",
        bad => bad.name(),
    }
}

fn list(bits: u32, names: &[&'static str]) -> Vec<&'static str> {
    names.iter().enumerate().filter(|(i, n)| bits >> i & 1 == 1 && !n.is_empty()).map(|(_, n)| *n).collect()
}

/// Returns the texts for an error word of the controller.
pub fn errors(word: u16) -> Vec<&'static str> {
    list(u32::from(word), &jtc_wire::words::JTC_ERRORS)
}

/// Returns the texts for an internal error word of a joint.
pub fn joint_errors(word: u16) -> Vec<&'static str> {
    list(u32::from(word), &jtc_wire::words::JOINT_INTERNAL)
}

/// Returns the texts for a fault byte of a drive's motor control.
pub fn motor_faults(byte: u8) -> Vec<&'static str> {
    list(u32::from(byte), &jtc_wire::words::MC_FAULTS)
}

/// Returns the texts for an error byte of a drive.
pub fn node_errors(byte: u8) -> Vec<&'static str> {
    list(u32::from(byte), &jtc_wire::words::NODE_ERRORS)
}

/// Returns the texts for a warning byte of a node.
pub fn node_warnings(byte: u8) -> Vec<&'static str> {
    list(u32::from(byte), &jtc_wire::words::NODE_WARNINGS)
}

/// Returns the texts for CAN flags.
pub fn can_flags(word: u32) -> Vec<String> {
    let mut all = Vec::new();
    if word & can_flag::TRANSMIT_TIMEOUT != 0 {
        all.push("no acknowledge on the joint bus".to_owned());
    }
    let silent = (0..NODES).filter(|n| word & can_flag::no_answer(*n) != 0);
    all.extend(silent.map(|n| format!("{} does not answer", node(n))));
    all
}

/// Returns `true` if a node does not answer. Joints are nodes 0 to 5, and the gripper is node 6.
pub fn is_silent(s: &Status, node: usize) -> bool {
    s.can_current & can_flag::no_answer(node) != 0
}

/// Returns `true` if the arm is under torque: the controller is in HoldPos, Operate or Teaching.
pub fn has_torque(s: &Status) -> bool {
    s.state.is_in(&[ControllerState::HoldPos, ControllerState::Operate, ControllerState::Teaching])
}

/// Returns `true` if joint `j` (from 0) is marked as absent. The function uses the state Start of its drive: while
/// the torque is on, only absent joints are in this state (J-20, J-53).
pub fn is_absent(s: &Status, j: usize) -> bool {
    has_torque(s) && s.joints.get(j).is_some_and(|joint| joint.state == NodeState::START)
}

/// Returns the joints that are marked as absent. The result is empty while the torque is off.
pub fn absent(s: &Status) -> Vec<Joint> {
    Joint::ALL.into_iter().filter(|joint| is_absent(s, joint.index())).collect()
}

/// Returns the names of joints, separated by commas.
pub fn joints(joints: &[Joint]) -> String {
    joints.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
}

/// Returns `true` if the drive of each joint is enabled. Absent joints are ignored.
pub fn is_held(s: &Status) -> bool {
    let enabled = |joint: &Joint| s.joints[joint.index()].state == NodeState::ENABLED;
    Joint::ALL.iter().all(|joint| enabled(joint) || is_absent(s, joint.index()))
}

/// Returns the fastest joint and its velocity (rad/s). Returns `None` if the arm is at rest.
pub fn moving_joint(s: &Status) -> Option<(Joint, f64)> {
    let fastest = Joint::ALL.into_iter().map(|joint| (joint, f64::from(s.joints[joint.index()].velocity)));
    fastest.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())).filter(|(_, speed)| !AT_REST_RAD_S.contains(speed))
}

/// Returns `true` if the controller waits until a node is ready.
pub fn is_awaited(s: &Status, node: usize) -> bool {
    nodes_in(s.node_init).any(|n| n == node)
}

/// Returns the names of the parameters for which the controller waits in Init: friction, PID gains, arm model.
pub fn missing_parameters(jtc_init: u8) -> Vec<&'static str> {
    list(u32::from(jtc_init), &jtc_wire::words::JTC_INIT)
}

/// Returns the numbers of the nodes whose bits are set in `mask`, starting with node 0.
pub fn nodes_in(mask: u8) -> impl Iterator<Item = usize> {
    (0..NODES).filter(move |n| mask >> n & 1 == 1)
}

/// Returns the names of the nodes whose bits are set in `mask`.
pub fn node_names(mask: u8) -> Vec<String> {
    nodes_in(mask).map(node).collect()
}

/// Returns all current errors of a status, the most specific first. The list begins with nodes that do not answer, the safety input, and
/// the errors of each joint and the gripper. The other error bits of the controller are consequences of these errors and are listed last.
pub fn causes(s: &Status) -> Vec<String> {
    let mut all = can_flags(s.can_current);
    all.extend(errors(s.errors & error::EMERGENCY_INPUT).into_iter().map(String::from));
    for (number, joint) in Joint::ALL.into_iter().zip(&s.joints) {
        // An active safety line switches off the torque of a drive. The safety-line bit is also set while a drive is
        // not configured, so it is ignored until then.
        let line_active = joint.warnings & warning::SAFETY_LINE != 0 && !is_awaited(s, number.index());
        let words = joint_errors(joint.internal)
            .into_iter()
            .chain(node_errors(joint.errors))
            .chain(motor_faults(joint.mc_current))
            .chain(line_active.then_some("safety line active"))
            .chain(joint.state.is_fault().then(|| joint.state.name()));
        all.extend(words.map(|w| format!("{number}: {w}")));
    }
    if let Some(g) = s.gripper {
        all.extend(node_errors(g.errors).into_iter().map(|w| format!("gripper: {w}")));
    }
    // During a held stop, the error word of the controller adds no information to the errors of the joints.
    let own = if s.is_held_stop() { 0 } else { s.errors & !error::EMERGENCY_INPUT };
    all.extend(errors(own).into_iter().map(String::from));
    all
}

/// Returns the causes of a held stop in one line.
pub fn held_stop(s: &Status) -> String {
    causes(s).join(", ")
}

/// Returns the reason for a held stop. If the device did not report the cause, returns the errors in the status.
pub fn why_held(s: &Status, cause: Option<&StopCause>) -> String {
    cause.map_or_else(|| held_stop(s), ToString::to_string)
}

/// Returns the warnings of the nodes. The safety line of a joint is not included, because [`causes`] treats it as an error.
pub fn warnings(s: &Status) -> Vec<String> {
    let joints = s.joints.iter().map(|joint| joint.warnings).chain(s.gripper.map(|g| g.warnings)).enumerate();
    let words = joints.flat_map(|(n, byte)| {
        let own = if n < s.joints.len() { byte & !warning::SAFETY_LINE } else { byte };
        node_warnings(own).into_iter().map(move |word| format!("{}: {word}", node(n)))
    });
    words.collect()
}

/// Returns all current errors of a status in one line.
pub fn errors_line(s: &Status) -> String {
    let all = causes(s);
    if all.is_empty() {
        format!("no error bit is set (state {}, trajectory {})", s.state, s.trajectory)
    } else if s.is_held_stop() {
        format!("held stop: {}", held_stop(s))
    } else {
        all.join(", ")
    }
}

/// Returns the joint errors that have occurred since `before`, in one line.
pub fn occurred_since(before: &[u16; 6], s: &Status) -> String {
    let joints = Joint::ALL.into_iter().zip(s.joints.iter().zip(before));
    let words = joints.flat_map(|(number, (joint, before))| {
        let new = joint_errors(joint.internal_occurred & !before);
        new.into_iter().map(move |word| format!("{number}: {word}"))
    });
    words.collect::<Vec<_>>().join(", ")
}

/// Returns the reason why the controller does not advance to the next state.
pub fn waiting_for(s: &Status) -> String {
    let head = format!("state {}, trajectory {}", s.state, s.trajectory);
    let mut missing: Vec<String> =
        missing_parameters(s.jtc_init).into_iter().map(|m| format!("{m} not given")).collect();
    if s.is_coming_up() {
        missing.extend(node_names(s.node_init).into_iter().map(|n| format!("{n} not ready")));
    }
    if s.errors != 0 {
        missing.push(errors_line(s));
    }
    if missing.is_empty() { head } else { format!("{head}; {}", missing.join(", ")) }
}

/// Returns the next steps after a held stop: first the action `cause`, which removes the cause, and then the command
/// that clears the held stop.
pub(crate) fn after_removing(cause: &str) -> Next {
    let then = next!(
        ", wait until the arm is at rest, then {}; until then the controller holds the arm and executes no motion",
        Clear
    );
    Next::from(cause.to_owned()).then(then)
}

/// Returns the next step for a controller with this status.
pub fn next_step(s: &Status) -> Next {
    if s.is_held_stop() && s.state == ControllerState::Teaching {
        next!("{}, then {}", TeachOff, Clear)
    } else if s.is_held_stop() {
        after_removing("remove the cause")
    } else if (s.errors != 0 || s.state == ControllerState::Error) && s.jtc_init != 0 {
        // The advice first names the complete command. For the alternative it names only the option `--defaults`.
        next!("{}, or ", RecoverWithArm)
            .then(Next::typed(Action::RecoverWithDefaults, "--defaults"))
            .then(" for the arm that is built into the controller")
    } else if s.errors != 0 || s.state == ControllerState::Error {
        Action::Recover.into()
    } else if s.jtc_init != 0 {
        next!("{}, or {} for the arm that is built into the controller", ParamsPush, UseDefaults)
    } else if s.is_coming_up() && s.node_init != 0 {
        next!("{} examines the nodes that are not ready", Doctor)
    } else if s.state == ControllerState::Teaching {
        Action::TeachOff.into()
    } else if s.is_executing() {
        next!("{} ends the motion", Stop)
    } else if s.state == ControllerState::HoldPos && !absent(s).is_empty() {
        let then = next!(
            " moves a joint that is present; {} ends the work on a bench while the torque is off",
            BenchPresent
        );
        Next::typed(Action::Jog, "jtc jog JOINT RATE").then(then)
    } else if s.state == ControllerState::HoldPos {
        next!("{} moves the arm", TrajRun)
    } else {
        next!("{} shows the progress", Monitor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cause is listed before its consequences. The safety-line bit of an unconfigured drive is ignored.
    #[test]
    fn the_most_particular_cause_stands_first() {
        let mut s = Status {
            state: ControllerState::Error.into(),
            errors: 0x89,
            can_current: 1 << 10,
            ..Status::default()
        };
        s.joints[3].mc_current = 0x40;
        s.joints[4].warnings = 8;
        let first = [
            "joint 3 does not answer",
            "emergency input",
            "joint 4: over-current",
            "joint 5: safety line active",
        ];
        assert_eq!(causes(&s)[..4], first);
        assert_eq!(causes(&s)[4..], ["external error", "external joints error"]);
        s.node_init = 1 << 4;
        assert!(
            !causes(&s).concat().contains("safety line") && !warnings(&s).concat().contains("safety line")
        );
    }
}
