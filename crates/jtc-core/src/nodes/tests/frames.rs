//! Tests of the requests to nodes, and of the frame that each tick sends (J-12, J-16, J-20, J-23).
use super::*;

#[test]
fn j16_j20_what_a_node_is_asked_for() {
    use Target::{Enable, Init, NoChange, Ready};
    let asked = |goal, state, configured, refused| {
        let mut node = Node { seen: true, configured, refused, ..Node::default() };
        node.report.state = state;
        node.request(goal)
    };
    for (state, unconfigured, configured) in [
        (NodeState::START, [Init, NoChange, NoChange], [Init, NoChange, NoChange]),
        (NodeState::START_TO_INIT, [NoChange, Enable, Ready], [Ready, Enable, Ready]),
        (NodeState::INIT, [NoChange, NoChange, NoChange], [Ready, NoChange, Ready]),
        (NodeState::INIT_TO_READY, [NoChange, Enable, Ready], [Ready, Enable, Ready]),
        (NodeState::READY, [NoChange, Enable, NoChange], [NoChange, Enable, NoChange]),
        (NodeState::ENABLED, [Ready, NoChange, Ready], [Ready, NoChange, Ready]),
        (NodeState::FAULT, [NoChange; 3], [NoChange; 3]),
    ] {
        for refused in [false, true] {
            for (expected, is_configured) in [(unconfigured, false), (configured, true)] {
                let mut expected = expected;
                if refused && !is_configured && state == NodeState::READY {
                    // The node accepts its configuration only in Init.
                    expected[0] = Init;
                }
                let got = [Goal::Ready, Goal::Enabled, Goal::Down]
                    .map(|goal| asked(goal, state, is_configured, refused));
                assert_eq!(got, expected, "in {state}, configured {is_configured}, refused {refused}");
            }
        }
        let mut node = Node { seen: true, clear: true, ..Node::default() };
        node.report.state = state;
        for goal in [Goal::Ready, Goal::Enabled, Goal::Down] {
            // A drive ignores a request for Init while it is enabled.
            assert_eq!(node.request(goal), if state == NodeState::ENABLED { Ready } else { Init });
            assert_eq!(Node { seen: false, ..node }.request(goal), NoChange);
        }
    }
}

#[test]
fn j20_a_node_is_configured_in_init_and_ready_once() {
    for state in [
        NodeState::START,
        NodeState::INIT,
        NodeState::START_TO_INIT,
        NodeState::READY,
        NodeState::ENABLED,
        NodeState::FAULT,
    ] {
        let mut node = Node { seen: true, ..Node::default() };
        node.report.state = state;
        assert_eq!(
            node.wants_configuration(),
            matches!(state, NodeState::INIT | NodeState::READY),
            "{state}"
        );
        assert!(!Node { configured: true, ..node }.wants_configuration());
        assert!(!Node { clear: true, ..node }.wants_configuration());
        assert!(!Node { seen: false, ..node }.wants_configuration());
    }
}

/// Kind of the frame that a tick sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sent {
    Move,
    Mode,
    ControllerState,
    Reset,
    ResetAll,
}

/// Returns the kind of the frame that ready nodes get after `change` has modified them. `moves` is the number of Moves since the last frame
/// of another kind.
fn sent(goal: Goal, moves: u8, change: impl FnOnce(&mut Nodes)) -> Sent {
    let (config, mut nodes) = (Config::avena(), ready());
    nodes.moves = moves;
    change(&mut nodes);
    let frame = nodes.frame(&config, goal, [0.0; JOINTS], false, false);
    match Request::parse(&frame).unwrap() {
        Request::Move { .. } => Sent::Move,
        Request::ChangeMode { .. } => Sent::Mode,
        Request::ChangeFsm { .. } => Sent::ControllerState,
        Request::Reset(_) => Sent::Reset,
        Request::ResetAll => Sent::ResetAll,
    }
}

/// Puts node `n` into Init without a configuration.
fn waits(nodes: &mut Nodes, n: usize) {
    (nodes.nodes[n].configured, nodes.nodes[n].valid, nodes.nodes[n].report.state) =
        (false, false, NodeState::INIT);
}

#[test]
fn j12_at_most_one_tick_of_four_sends_another_frame_than_move() {
    for moves in 0..6 {
        let frame = if moves < 3 { Sent::Move } else { Sent::Mode };
        assert_eq!(sent(Goal::Ready, moves, |nodes| waits(nodes, 2)), frame, "{moves}");
    }
    assert_eq!(sent(Goal::Ready, 3, |_| ()), Sent::Move, "nobody is in want of anything");
    assert_eq!(sent(Goal::Ready, 3, |nodes| nodes.reset(0x04)), Sent::Reset);
    assert_eq!(sent(Goal::Ready, 3, |nodes| nodes.reset(0x7F)), Sent::ResetAll);
}

/// If the arm has no gripper, the controller neither resets nor clears the gripper node.
#[test]
fn j20_j23_an_absent_gripper_is_neither_reset_nor_cleared() {
    for (gripper, mask, frame) in [
        (true, 0x7F, Sent::ResetAll),
        (true, 0x3F, Sent::Reset),
        (true, 0x40, Sent::Reset),
        (false, 0x7F, Sent::ResetAll),
        (false, 0x3F, Sent::ResetAll),
        (false, 0x40, Sent::Move),
    ] {
        let found = sent(Goal::Ready, 3, |nodes| {
            nodes.gripper = gripper;
            nodes.reset(mask);
        });
        assert_eq!(found, frame, "{gripper} {mask:#x}");
        let mut nodes = ready();
        (nodes.gripper, nodes.nodes[GRIPPER].report.errors) = (gripper, 1);
        nodes.clear(mask, true);
        assert_eq!(nodes.nodes[GRIPPER].clear, gripper && mask != 0x3F, "{gripper} {mask:#x}");
    }
}

/// While the torque is on, at most one of twenty ticks sends a frame that only the gripper needs.
#[test]
fn j23_a_gripper_is_brought_up_on_the_side() {
    let (wait, many) = (|nodes: &mut Nodes| waits(nodes, GRIPPER), 19);
    assert_eq!(sent(Goal::Ready, 3, wait), Sent::Mode);
    assert_eq!(
        sent(Goal::Enabled, 3, |nodes| {
            nodes.nodes.iter_mut().take(JOINTS).for_each(|node| node.report.state = NodeState::ENABLED);
            wait(nodes);
        }),
        Sent::Move
    );
    assert_eq!(
        sent(Goal::Enabled, many, |nodes| {
            nodes.nodes.iter_mut().take(JOINTS).for_each(|node| node.report.state = NodeState::ENABLED);
            wait(nodes);
        }),
        Sent::Mode
    );
    assert_eq!(sent(Goal::Down, many, wait), Sent::Move, "nothing is configured in Error");
    let silent = |nodes: &mut Nodes| {
        waits(nodes, GRIPPER);
        nodes.nodes[GRIPPER].silent = 5;
    };
    assert_eq!(sent(Goal::Ready, many, silent), Sent::Move, "it is not there to be configured");
    // A frame that enables a joint is sent at once, without a wait of twenty ticks.
    let still = |nodes: &mut Nodes| nodes.still_ms = Config::avena().enable_still_ms;
    assert_eq!(sent(Goal::Enabled, 3, still), Sent::ControllerState);
    assert_eq!(sent(Goal::Enabled, 3, |_| ()), Sent::Move, "J-16: the arm falls");
}

/// Configuration frames and changes of state alternate. An enabled node refuses a configuration, so the controller
/// first disables the nodes that are enabled.
#[test]
fn j20_nodes_that_are_enabled_are_disabled_before_others_are_configured() {
    for (state, seen, configured_last, frame) in [
        (NodeState::ENABLED, true, false, Sent::ControllerState),
        (NodeState::ENABLED, true, true, Sent::ControllerState),
        // The change of this node from Init to Ready can wait.
        (NodeState::INIT, true, false, Sent::Mode),
        (NodeState::INIT, true, true, Sent::ControllerState),
        // After the restart of a node, its earlier reports are not valid.
        (NodeState::ENABLED, false, false, Sent::Mode),
        (NodeState::ENABLED, false, true, Sent::Mode),
    ] {
        let found = sent(Goal::Ready, 3, |nodes| {
            waits(nodes, 2);
            nodes.configured_last = configured_last;
            (nodes.nodes[3].report.state, nodes.nodes[3].seen) = (state, seen);
        });
        assert_eq!(found, frame, "{state} {seen} {configured_last}");
    }
}

/// If no change of state is due, one configuration frame can directly follow another. A node that must stay enabled
/// does not delay the configuration of another node.
#[test]
fn j20_configurations_and_changes_of_state_take_turns() {
    let enabling = |nodes: &mut Nodes| {
        nodes.nodes.iter_mut().take(JOINTS).for_each(|node| node.report.state = NodeState::ENABLED);
        nodes.nodes[4].report.state = NodeState::READY;
        nodes.still_ms = Config::avena().enable_still_ms;
        waits(nodes, GRIPPER);
    };
    for (configured_last, alone, with_a_change) in
        [(false, Sent::Mode, Sent::Mode), (true, Sent::Mode, Sent::ControllerState)]
    {
        let found = sent(Goal::Ready, 3, |nodes| {
            waits(nodes, 2);
            nodes.configured_last = configured_last;
        });
        assert_eq!(found, alone, "{configured_last}");
        let found = sent(Goal::Enabled, 19, |nodes| {
            enabling(nodes);
            nodes.configured_last = configured_last;
        });
        assert_eq!(found, with_a_change, "{configured_last}");
    }
}

/// Returns the state that the next frame requests from the gripper. The gripper is in `state`, and the joints are in
/// the state that belongs to `goal`. Returns `NoChange` if the frame contains no request for the gripper.
fn gripper_asked(config: &Config, goal: Goal, state: NodeState, configured: bool, clear: bool) -> Target {
    let mut nodes = ready();
    if goal == Goal::Enabled {
        nodes.nodes.iter_mut().for_each(|node| node.report.state = NodeState::ENABLED);
    }
    let gripper = &mut nodes.nodes[GRIPPER];
    (gripper.report.state, gripper.configured, gripper.clear) = (state, configured, clear);
    (nodes.moves, nodes.configured_last) = (19, true);
    match Request::parse(&nodes.frame(config, goal, [0.0; JOINTS], false, false)).unwrap() {
        Request::ChangeFsm { target } => target[GRIPPER],
        _ => Target::NoChange,
    }
}

/// A gripper that is configured to keep its workpiece (column `keeps`) does not change its state while the arm has no
/// torque, unless the gripper itself is cleared.
#[test]
fn j23_what_a_gripper_is_asked_for() {
    use Target::{Enable, Init, NoChange, Ready};
    for (goal, state, configured, clear, drops, keeps) in [
        (Goal::Enabled, NodeState::ENABLED, true, false, NoChange, NoChange),
        (Goal::Down, NodeState::ENABLED, true, false, Ready, NoChange),
        (Goal::Ready, NodeState::ENABLED, true, false, Ready, NoChange),
        (Goal::Down, NodeState::ENABLED, true, true, Ready, Ready),
        (Goal::Ready, NodeState::ENABLED, true, true, Ready, Ready),
        // The gripper is enabled, but it has lost its configuration. The gripper accepts a new configuration only in Ready.
        (Goal::Enabled, NodeState::ENABLED, false, false, Ready, Ready),
        (Goal::Enabled, NodeState::READY, true, false, Enable, Enable),
        (Goal::Enabled, NodeState::READY, false, false, NoChange, NoChange),
        (Goal::Enabled, NodeState::START, false, false, Init, Init),
        (Goal::Enabled, NodeState::INIT, true, false, Ready, Ready),
        // In Error, the controller does not bring any node up.
        (Goal::Ready, NodeState::START, false, false, Init, Init),
        (Goal::Down, NodeState::START, false, false, NoChange, NoChange),
    ] {
        for (pump_off_on_error, expected) in [(true, drops), (false, keeps)] {
            let config = Config { pump_off_on_error, ..Config::avena() };
            let found = gripper_asked(&config, goal, state, configured, clear);
            assert_eq!(found, expected, "{goal:?} {state} {configured} {clear} {pump_off_on_error}");
        }
    }
}
