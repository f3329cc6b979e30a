//! Tests of Moves without an answer, without a plausible answer, and without an acknowledgement (J-14, J-35, J-63).
extern crate std;

use super::*;

#[test]
fn j14_only_moves_that_were_sent_count_and_each_for_the_bus_or_for_a_node() {
    let lost = BusState { acknowledged: false, bus_off: false };
    // During bus-off, nodes cannot answer, even if an earlier frame was acknowledged.
    let off = BusState { acknowledged: true, bus_off: true };
    for (state, sent_move, unacknowledged, silent) in [
        (GOOD, true, 0, 1),
        (GOOD, false, 0, 0),
        (lost, true, 1, 0),
        (lost, false, 0, 0),
        (off, true, 1, 0),
        (off, false, 0, 0),
    ] {
        let mut nodes = ready();
        nodes.sent_move = sent_move;
        // While a node is starting, its answers do not count as missing.
        nodes.nodes[4].boot_left = 100;
        tick(&mut nodes, &[], state);
        assert_eq!(nodes.unacknowledged, unacknowledged, "{state:?} {sent_move}");
        for (n, node) in nodes.nodes.iter().enumerate() {
            assert_eq!(node.silent, if n == 4 { 0 } else { silent }, "{state:?} {sent_move}, node {n}");
        }
        // A node that answers has completed its start.
        nodes.sent_move = true;
        tick(&mut nodes, &all(NodeState::READY), GOOD);
        assert_eq!((nodes.unacknowledged, nodes.nodes[4].boot_left), (0, 0));
        assert!(nodes.nodes.iter().all(|node| node.silent == 0));
    }
    let mut booting = ready();
    booting.nodes.iter_mut().for_each(|node| node.boot_left = 100);
    tick(&mut booting, &[], lost);
    assert_eq!(booting.unacknowledged, 0, "nobody is there to acknowledge");
}

/// If no node acknowledges a Move, no answer can arrive. Until the transmit timeout, the controller predicts the
/// motion of each joint whose position is known, and counts a missing answer in each tick.
#[test]
fn j63_a_move_without_acknowledge_counts_for_the_joints_whose_position_is_known() {
    let lost = BusState { acknowledged: false, bus_off: false };
    for (unacknowledged, sent_move, valid, before, missed) in [
        (0, true, true, 0, 1),
        (3, true, true, 0, 1),
        // In this tick, the controller raises the transmit timeout for all joints. The count of missing answers of
        // the joint starts again at zero.
        (4, true, true, 0, 0),
        (4, true, true, 3, 0),
        (2, false, true, 3, 3),
        (2, true, false, 0, 0),
    ] {
        let mut nodes = ready();
        (nodes.unacknowledged, nodes.sent_move, nodes.nodes[1].valid) = (unacknowledged, sent_move, valid);
        nodes.nodes[1].missed = before;
        tick(&mut nodes, &[], lost);
        let node = nodes.node(1);
        assert_eq!((node.missed, node.silent), (missed, 0), "{unacknowledged} {sent_move} {valid} {before}");
    }
    // A gripper has no position that could be wrong. Missing acknowledgements therefore never mark the gripper as
    // misbehaved.
    let mut nodes = ready();
    (nodes.unacknowledged, nodes.nodes[GRIPPER].missed) = (1, 4);
    tick(&mut nodes, &[], lost);
    assert!(!nodes.node(GRIPPER).misbehaved);
}

/// If two answers of a joint arrive in one tick, the first answer was late. The controller must not treat the
/// distance between the two answers as a motion within one tick. If a single answer arrives on time in the next tick,
/// it must not cause a step either.
#[test]
fn j63_the_second_answer_of_a_tick_makes_no_step() {
    let mut nodes = ready();
    tick(&mut nodes, &all(NodeState::READY), GOOD);
    let answer = |position: f64| {
        let report = JointReport { state: NodeState::READY, position, ..JointReport::default() };
        Answer::Joint { node: 2, report }.emit(SCALE)
    };
    let mut bus: std::vec::Vec<Frame> = all(NodeState::READY).into();
    bus[2] = answer(0.001);
    tick(&mut nodes, &bus, GOOD);
    let before = nodes.positions()[2];
    // The second answer of this tick is 1 mrad away from the expected position of the joint.
    bus.push(answer(0.003));
    tick(&mut nodes, &bus, GOOD);
    let carried = nodes.positions()[2] - before;
    assert!(carried < 0.5e-3, "{carried} rad in a tick");
    assert!((nodes.node(2).report.position - 0.003).abs() < 1e-6, "the last one counts");
    bus.pop();
    bus[2] = answer(0.004);
    let before = nodes.positions()[2];
    tick(&mut nodes, &bus, GOOD);
    let step = nodes.positions()[2] - before;
    assert!(step.abs() < 0.1e-3, "{step} rad");
    // The offsets fade, so the used position reaches the position in the answers.
    for _ in 0..250 {
        tick(&mut nodes, &bus, GOOD);
    }
    assert!((nodes.positions()[2] - 0.004).abs() < 1e-4, "{} rad", nodes.positions()[2]);
}

#[test]
fn j35_answers_that_no_joint_can_have_given_are_its_error_after_five() {
    let mut nodes = ready();
    tick(&mut nodes, &all(NodeState::READY), GOOD);
    let far = JointReport { state: NodeState::READY, position: 1.0, ..JointReport::default() };
    for ms in 1..=5 {
        let mut bus = all(NodeState::READY);
        bus[2] = Answer::Joint { node: 2, report: far }.emit(SCALE);
        tick(&mut nodes, &bus, GOOD);
        assert_eq!(nodes.node(2).misbehaved, ms == 5, "after {ms}");
        assert!(!nodes.node(2).fresh() && nodes.node(1).fresh() && nodes.node(2).silent == 0);
    }
    // An answer is also checked if no Move has requested it.
    let mut nodes_without = ready();
    tick(&mut nodes_without, &all(NodeState::READY), GOOD);
    nodes_without.sent_move = false;
    let mut bus = all(NodeState::READY);
    bus[2] = Answer::Joint { node: 2, report: far }.emit(SCALE);
    tick(&mut nodes_without, &bus, GOOD);
    assert_eq!((nodes_without.node(2).missed, nodes_without.node(1).missed), (1, 0));
    // After five unusable answers, the controller uses the next answer without a correction.
    let mut bus = all(NodeState::READY);
    bus[2] = Answer::Joint { node: 2, report: far }.emit(SCALE);
    tick(&mut nodes, &bus, GOOD);
    assert!(nodes.node(2).fresh() && !nodes.node(2).misbehaved);
    assert!((nodes.positions()[2] - 1.0).abs() < 1e-6);
}

#[test]
fn j14_five_moves_are_a_timeout_of_a_joint_and_a_flag_of_the_gripper() {
    let config = Config::avena();
    let mut nodes = ready();
    nodes.nodes[GRIPPER].report.state = NodeState::ENABLED;
    for ms in 1..=6u8 {
        let answers = [0, 1, 3, 4, 5].map(|n| joint(n, NodeState::READY));
        tick(&mut nodes, &answers, GOOD);
        let (flags, shown) = if ms < 5 { (0, 0) } else { (1 << (8 + 2), GRIPPER_FLAG) };
        assert_eq!(nodes.can_flags(&inputs(&[], GOOD), &config), flags, "after {ms}");
        assert_eq!(nodes.gripper_flags(&config), shown, "after {ms}");
        assert_eq!(nodes.nodes[2].configured, ms < 5, "it may have lost its supply");
        assert!(nodes.nodes[GRIPPER].configured, "it is enabled: its state will show it");
    }
    assert_eq!(nodes.can_flags(&inputs(&[], BusState { bus_off: true, ..GOOD }), &config) & 1, 1);
    let absent = Nodes::new(&Config { gripper: false, ..Config::avena() });
    assert_eq!(absent.gripper_flags(&config), 0, "none is expected");
}

/// A node that did not answer may have lost its supply, so its configuration counts as lost. Only an enabled gripper
/// keeps its configuration, because its state shows later whether it has lost its supply.
#[test]
fn j14_a_node_that_was_silent_has_lost_its_configuration_unless_it_is_an_enabled_gripper() {
    for (n, state, kept) in [
        (GRIPPER, NodeState::ENABLED, true),
        (GRIPPER, NodeState::READY, false),
        (2, NodeState::ENABLED, false),
        (2, NodeState::READY, false),
    ] {
        let mut nodes = ready();
        nodes.nodes[n].report.state = state;
        nodes.nodes[n].silent = 4;
        let answers = all(NodeState::READY);
        let others: [Frame; NODES - 1] = core::array::from_fn(|i| answers[i + usize::from(i >= n)]);
        tick(&mut nodes, &others, GOOD);
        assert_eq!(nodes.nodes[n].configured, kept, "node {n} in {state}");
    }
}

#[test]
fn j14_five_moves_without_acknowledge_are_a_transmit_timeout() {
    for (unacknowledged, bus_off, flag) in
        [(0, false, 0), (4, false, 0), (5, false, 1), (6, false, 1), (0, true, 1)]
    {
        let mut nodes = ready();
        nodes.unacknowledged = unacknowledged;
        let state = BusState { acknowledged: false, bus_off };
        assert_eq!(
            nodes.can_flags(&inputs(&[], state), &Config::avena()),
            flag,
            "{unacknowledged} {bus_off}"
        );
    }
}
