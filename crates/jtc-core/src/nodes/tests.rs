//! Tests of the effect of one tick on a node in each state (J-14, J-16, J-20, J-21, J-23).
use jtc_bus::{Frame, GripperReport, Request, Target};

use super::*;
use crate::io::BusState;

mod absent;
mod bring_up;
mod frames;
mod measured;
mod missing;

const SCALE: Scale = Scale { velocity: 2.0 };
const GOOD: BusState = BusState { acknowledged: true, bus_off: false };

/// Returns the inputs of a tick that receives only these frames.
fn inputs(bus: &[Frame], bus_state: BusState) -> Inputs<'_> {
    Inputs { bus, bus_state, ..Inputs::QUIET }
}

fn tick(nodes: &mut Nodes, bus: &[Frame], bus_state: BusState) {
    nodes.take(&inputs(bus, bus_state), &Config::avena(), Goal::Ready, &Commanded::default());
}

/// Returns nodes that are all configured and ready. The controller has just sent a Move.
fn ready() -> Nodes {
    let mut nodes = Nodes::new(&Config::avena());
    for node in &mut nodes.nodes {
        *node = Node { seen: true, configured: true, valid: true, ..Node::default() };
        node.report.state = NodeState::READY;
    }
    nodes.sent_move = true;
    nodes
}

fn joint(node: u8, state: NodeState) -> Frame {
    Answer::Joint { node, report: JointReport { state, ..JointReport::default() } }.emit(SCALE)
}

fn gripper(state: NodeState) -> Frame {
    Answer::Gripper(GripperReport { state, ..GripperReport::default() }).emit(SCALE)
}

fn all(state: NodeState) -> [Frame; NODES] {
    core::array::from_fn(|n| if n == GRIPPER { gripper(state) } else { joint(n as u8, state) })
}

#[test]
fn j16_joints_may_be_enabled_when_they_were_slow_and_rested_for_long_enough() {
    let (config, mut nodes) = (Config::avena(), ready());
    let time = config.enable_still_ms;
    for (still, rest, may) in
        [(0, 0, false), (time - 1, 0, false), (time, 0, true), (time + 1, 0, true), (time, 1, false)]
    {
        (nodes.still_ms, nodes.rest_ms) = (still, rest);
        assert_eq!(nodes.may_enable(&config), may, "{still} ms, {rest} ms");
    }
}

/// The time for which the arm is almost at rest counts only while the positions of all joints are known.
#[test]
fn j16_an_arm_that_is_not_known_is_not_still() {
    let mut nodes = ready();
    (0..7).for_each(|_| tick(&mut nodes, &all(NodeState::READY), GOOD));
    assert_eq!(nodes.still_ms, 7);
    nodes.nodes[3].configured = false;
    nodes.nodes[3].valid = false;
    tick(&mut nodes, &all(NodeState::READY), GOOD);
    assert_eq!(nodes.still_ms, 0);
}

#[test]
fn j16_a_joint_that_leaves_operation_enable_or_does_not_reach_it_misbehaves() {
    let config = Config::avena();
    let watched = |enabled: bool, state: NodeState, wait: u32, still: u16, goal: Goal| {
        let mut nodes = ready();
        nodes.still_ms = still;
        let node = &mut nodes.nodes[2];
        (node.enabled, node.report.state, node.enable_wait) = (enabled, state, wait);
        nodes.watch(&config, goal);
        let node = nodes.node(2);
        (node.misbehaved, node.enabled, node.enable_wait)
    };
    let (most, still) = (config.enable_timeout_ms, config.enable_still_ms);
    assert_eq!(watched(false, NodeState::READY, 7, still, Goal::Enabled), (false, false, 8));
    assert_eq!(
        watched(false, NodeState::READY, 7, 0, Goal::Enabled),
        (false, false, 7),
        "nothing is asked for"
    );
    assert_eq!(watched(false, NodeState::READY, most - 1, still, Goal::Enabled), (false, false, most));
    assert_eq!(watched(false, NodeState::READY, most, still, Goal::Enabled), (true, false, 0));
    assert_eq!(watched(false, NodeState::ENABLED, 7, still, Goal::Enabled), (false, true, 0));
    assert_eq!(watched(true, NodeState::ENABLED, 0, 0, Goal::Enabled), (false, true, 0));
    assert_eq!(watched(true, NodeState::READY, 0, 0, Goal::Enabled), (true, false, 0));
    // If a joint has changed back to Init, the controller returns to Init (J-20). The check for joints that leave
    // OperationEnable (J-16) must not also report this joint as an error.
    assert_eq!(watched(true, NodeState::INIT, 0, 0, Goal::Enabled), (false, false, 0));
    for goal in [Goal::Ready, Goal::Down] {
        assert_eq!(watched(true, NodeState::READY, 7, still, goal), (false, false, 0), "it was asked to");
    }
    let mut nodes = ready();
    nodes.nodes[2].report.warnings = warning::POSITION_NOT_ACCURATE;
    nodes.nodes[3].report.warnings = !warning::POSITION_NOT_ACCURATE;
    nodes.watch(&config, Goal::Enabled);
    assert_eq!([2, 3].map(|n| nodes.node(n).misbehaved), [true, false]);
}

#[test]
fn j21_a_clear_is_for_the_nodes_in_its_mask_that_have_something_to_clear() {
    let cleared = |mask: u8, torque_off: bool, n: usize, change: fn(&mut Node)| {
        let mut nodes = ready();
        change(&mut nodes.nodes[n]);
        nodes.clear(mask, torque_off);
        core::array::from_fn::<bool, NODES, _>(|n| nodes.nodes[n].clear).iter().position(|&clear| clear)
    };
    assert_eq!(cleared(0x7F, true, 3, |_| {}), None);
    assert_eq!(cleared(0x7F, false, 3, |node| node.report.errors = 1), Some(3));
    assert_eq!(cleared(0x77, false, 3, |node| node.report.errors = 1), None);
    assert_eq!(cleared(0x08, true, 3, |node| node.report.mc_occurred = 1), Some(3));
    assert_eq!(
        cleared(0x7F, false, 3, |node| node.report.mc_occurred = 1),
        None,
        "no reason to drop the arm"
    );
    assert_eq!(cleared(0x7F, false, GRIPPER, |node| node.report.errors = 1), Some(GRIPPER));
    assert_eq!(cleared(0x7F, true, GRIPPER, |node| node.report.mc_occurred = 1), None);
}

#[test]
fn j20_a_node_that_falls_back_has_lost_its_configuration_and_does_not_count() {
    for (before, now, kept) in [
        (NodeState::READY, NodeState::READY, true),
        (NodeState::INIT, NodeState::INIT, true),
        (NodeState::INIT, NodeState::READY, true),
        (NodeState::START_TO_INIT, NodeState::INIT, true),
        (NodeState::INIT_TO_READY, NodeState::READY, true),
        (NodeState::READY, NodeState::INIT, false),
        (NodeState::ENABLED, NodeState::INIT, false),
        (NodeState::READY, NodeState::START_TO_INIT, false),
        (NodeState::INIT, NodeState::START, false),
        (NodeState::START, NodeState::START, false),
    ] {
        let mut nodes = ready();
        nodes.nodes[2].report.state = before;
        tick(&mut nodes, &[joint(2, now)], GOOD);
        let node = nodes.node(2);
        assert_eq!((node.configured, node.valid), (kept, kept), "{before} to {now}");
        assert!(nodes.node(1).valid);
    }
}

#[test]
fn j21_a_node_is_cleared_when_it_is_in_init_and_not_on_the_way_there() {
    for (now, clearing) in [
        (NodeState::INIT, false),
        (NodeState::START, false),
        (NodeState::START_TO_INIT, true),
        (NodeState::READY, true),
        (NodeState::FAULT, true),
    ] {
        let mut nodes = ready();
        (nodes.nodes[2].report.state, nodes.nodes[2].clear) = (NodeState::FAULT, true);
        tick(&mut nodes, &[joint(2, now)], GOOD);
        assert_eq!(nodes.clearing(), clearing, "{now}");
    }
}

#[test]
fn j16_a_configuration_accepted_in_this_tick_counts_from_the_next_answer() {
    let mut nodes = ready();
    (nodes.nodes[2].configured, nodes.nodes[2].valid) = (false, false);
    nodes.nodes[2].report.state = NodeState::INIT;
    let accepted = Answer::Mode { node: 2, accepted: true }.emit(SCALE);
    tick(&mut nodes, &[accepted, joint(2, NodeState::INIT)], GOOD);
    assert!(nodes.node(2).configured && !nodes.node(2).valid);
    tick(&mut nodes, &[joint(2, NodeState::INIT)], GOOD);
    assert!(nodes.node(2).valid);
    // A later refusal of a configuration does not cancel the earlier acceptance.
    tick(&mut nodes, &[Answer::Mode { node: 2, accepted: false }.emit(SCALE)], GOOD);
    assert!(nodes.node(2).configured && nodes.node(2).refused);
    // Frames of the node that arrive directly after its reset are ignored.
    nodes.nodes[2].restart(&Config::avena());
    tick(&mut nodes, &[accepted, joint(2, NodeState::READY)], GOOD);
    assert!(!nodes.node(2).configured && !nodes.node(2).seen);
}

/// A pump command ends when the gripper leaves OperationEnable or loses its configuration.
#[test]
fn j23_a_gripper_is_lost_when_it_leaves_what_it_was_in() {
    for (configured, before, now, lost) in [
        (true, NodeState::ENABLED, NodeState::ENABLED, false),
        (true, NodeState::ENABLED, NodeState::READY, true),
        (true, NodeState::ENABLED, NodeState::FAULT, true),
        (true, NodeState::READY, NodeState::READY, false),
        (true, NodeState::READY, NodeState::ENABLED, false),
        (true, NodeState::READY, NodeState::INIT, true),
        (false, NodeState::INIT, NodeState::INIT, false),
        (false, NodeState::START, NodeState::INIT, false),
    ] {
        let mut nodes = ready();
        (nodes.nodes[GRIPPER].configured, nodes.nodes[GRIPPER].report.state) = (configured, before);
        tick(&mut nodes, &[gripper(now)], GOOD);
        assert_eq!(nodes.gripper_lost(), lost, "{configured} {before} to {now}");
    }
}

#[test]
fn j16_a_node_is_an_error_by_its_state_its_errors_or_its_safety_line() {
    let faulty = |change: fn(&mut Node)| {
        let mut node = ready().nodes[0];
        change(&mut node);
        node.faulty()
    };
    assert!(!faulty(|_| {}));
    assert!(
        faulty(|node| node.report.state = NodeState::FAULT)
            && faulty(|node| node.report.state = NodeState::FAULT_REACTION)
    );
    assert!(faulty(|node| node.report.errors = 2) && faulty(|node| node.report.mc_current = 4));
    assert!(faulty(|node| node.report.warnings = warning::SAFETY_LINE));
    assert!(!faulty(|node| (node.report.warnings, node.valid) = (warning::SAFETY_LINE, false)));
    assert!(!faulty(|node| node.report.warnings = !warning::SAFETY_LINE), "other warnings are none");
    assert!(!faulty(|node| node.report.mc_occurred = 4), "that was before");
    assert!(!faulty(|node| (node.report.errors, node.seen) = (2, false)), "not seen since its reset");
}

#[test]
fn j21_an_error_that_is_being_cleared_counts_only_while_torque_is_on() {
    for (misbehaved, fault, clear, powered, error) in [
        (false, false, false, true, false),
        (false, false, true, true, false),
        (true, false, false, false, true),
        (true, false, true, true, true),
        (false, true, false, false, true),
        (false, true, false, true, true),
        (false, true, true, false, false),
        (false, true, true, true, true),
    ] {
        let mut nodes = ready();
        let node = &mut nodes.nodes[5];
        (node.misbehaved, node.clear, node.report.errors) = (misbehaved, clear, u8::from(fault));
        assert_eq!(nodes.external_error(powered), error, "{misbehaved} {fault} {clear} {powered}");
    }
    let mut nodes = ready();
    nodes.nodes[GRIPPER].report.state = NodeState::FAULT;
    assert!(!nodes.external_error(true), "a gripper never takes the arm's torque away");
}

#[test]
fn j20_the_word_of_missing_nodes_tells_what_keeps_the_controller_in_init() {
    let config = Config::avena();
    let word = |n: usize, change: fn(&mut Node)| {
        let mut nodes = ready();
        change(&mut nodes.nodes[n]);
        (nodes.init_word(&config), nodes.fallen_back(), nodes.all_ready(&config))
    };
    assert_eq!(word(3, |_| {}), (0, false, true));
    assert_eq!(word(3, |node| node.valid = false), (1 << 3, true, false));
    assert_eq!(word(3, |node| node.report.state = NodeState::INIT), (1 << 3, true, false));
    assert_eq!(word(3, |node| node.report.state = NodeState::ENABLED), (0, false, false));
    assert_eq!(word(3, |node| node.report.warnings = warning::POSITION_NOT_ACCURATE), (1 << 3, false, false));
    assert_eq!(word(3, |node| node.report.warnings = !warning::POSITION_NOT_ACCURATE), (0, false, true));
    assert_eq!(word(6, |node| node.report.warnings = 0xFF), (0, false, true), "a gripper knows no warnings");
    assert_eq!(word(6, |node| node.silent = 4), (0, false, true));
    assert_eq!(word(6, |node| node.silent = 5), (1 << 6, false, false));
    assert_eq!(word(6, |node| node.valid = false), (1 << 6, false, false));
    assert_eq!(
        word(6, |node| node.report.state = NodeState::ENABLED),
        (0, false, false),
        "its part is dropped here"
    );
}

#[test]
fn j16_a_joint_at_the_speed_limit_of_enabling_is_not_slow() {
    let moving = JointReport { state: NodeState::READY, velocity: 0.125, ..JointReport::default() };
    let bus: [Frame; JOINTS] =
        core::array::from_fn(|n| Answer::Joint { node: n as u8, report: moving }.emit(SCALE));
    let mut nodes = ready();
    tick(&mut nodes, &bus, GOOD);
    let speed = nodes.velocities()[0];
    assert!(speed > 0.12, "as the drives report it: {speed}");
    for (enable_speed_max, slow) in [(speed, false), (0.999 * speed, false), (1.001 * speed, true)] {
        let (config, mut nodes) = (Config { enable_speed_max, ..Config::avena() }, nodes.clone());
        let before = nodes.still_ms;
        nodes.take(&inputs(&bus, GOOD), &config, Goal::Ready, &Commanded::default());
        assert_eq!(nodes.still_ms, if slow { before + 1 } else { 0 }, "{enable_speed_max}");
    }
}

#[test]
fn j11_what_a_gripper_reports_is_known() {
    let mut nodes = ready();
    let report = GripperReport {
        state: NodeState::ENABLED,
        errors: 0x21,
        warnings: 0x42,
        pump: true,
        pressure1: false,
        pressure2: true,
    };
    tick(&mut nodes, &[Answer::Gripper(report).emit(SCALE)], GOOD);
    let found = nodes.node(GRIPPER).report;
    assert_eq!((found.state, found.errors, found.warnings), (NodeState::ENABLED, 0x21, 0x42));
    assert_eq!((nodes.pump, nodes.pressure), (true, [false, true]));
}
