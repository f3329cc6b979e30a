//! Tests of the measurements that the nodes take in a tick (J-63).
extern crate std;

use std::vec::Vec;

use super::*;

/// Speed of the joints in these tests, rad/s. In one tick, a joint moves by less than two steps of its encoder.
const SPEED: f64 = 0.15;
/// Resolution of the positions after the rounding on the bus and in the history, rad.
const ROUNDED: f64 = 2e-6;

/// Returns the answers of all nodes in this millisecond, at joints that move at [`SPEED`].
fn answers(ms: u32) -> Vec<Frame> {
    let report = |_| JointReport {
        state: NodeState::READY,
        position: SPEED * 1e-3 * f64::from(ms),
        velocity: SPEED,
        ..JointReport::default()
    };
    (0..JOINTS as u8)
        .map(|node| Answer::Joint { node, report: report(node) }.emit(SCALE))
        .chain([gripper(NodeState::READY)])
        .collect()
}

/// Returns nodes that have answered in each millisecond up to this one.
fn moving(ms: u32) -> Nodes {
    let mut nodes = ready();
    (0..=ms).for_each(|ms| tick(&mut nodes, &answers(ms), GOOD));
    nodes
}

fn close(found: f64, ms: f64) -> bool {
    (found - SPEED * 1e-3 * ms).abs() < ROUNDED
}

/// If an answer of a joint is missing, the controller predicts the position of this joint for the whole length of the
/// tick, including missed ticks. For the joints with an answer, it uses the measured positions.
#[test]
fn j63_a_joint_without_an_answer_moves_on_for_the_length_of_the_tick() {
    for missed_ticks in [0u16, 1, 3] {
        let mut nodes = moving(20);
        let ms = 21 + u32::from(missed_ticks);
        let mut bus = answers(ms);
        bus.remove(2);
        let inputs = Inputs { missed_ticks, ..inputs(&bus, GOOD) };
        nodes.take(&inputs, &Config::avena(), Goal::Ready, &Commanded::default());
        for j in 0..JOINTS {
            assert!(close(nodes.positions()[j], ms.into()), "{missed_ticks}, joint {}", j + 1);
            assert_eq!(nodes.node(j).fresh(), j != 2);
        }
        let silent = Inputs { bus: &[], ..inputs };
        nodes.take(&silent, &Config::avena(), Goal::Ready, &Commanded::default());
        let ms = ms + 1 + u32::from(missed_ticks);
        assert!(nodes.positions().iter().all(|&position| close(position, ms.into())), "{missed_ticks}");
    }
}

/// After evidence of late answers, a missing answer counts as outstanding only if its Move was sent and acknowledged.
/// The next answer is then one tick late.
#[test]
fn j63_only_a_move_that_was_sent_and_acknowledged_is_outstanding() {
    for (sent, acknowledged, late) in
        [(true, true, true), (true, false, false), (false, true, false), (false, false, false)]
    {
        let mut nodes = moving(20);
        let burst: Vec<Frame> = answers(21).into_iter().chain(answers(21)).collect();
        tick(&mut nodes, &burst, GOOD);
        nodes.sent_move = sent;
        tick(&mut nodes, &[], BusState { acknowledged, bus_off: false });
        nodes.sent_move = true;
        tick(&mut nodes, &answers(23), GOOD);
        // The controller extrapolates a late answer by one millisecond, in which the joint moves by 0.15 mrad. The
        // rate of the extrapolation is at most 0.2 rad/s above the reported velocity.
        let way = (nodes.positions()[0] - SPEED * 23e-3) / (SPEED * 1e-3);
        assert!((way - if late { 1.0 } else { 0.0 }).abs() < 0.3, "{sent} {acknowledged}: {way} ms");
        assert!(nodes.positions().iter().all(|position| *position == nodes.positions()[0]));
    }
}

/// If the set values of a joint restart with another velocity, the true motion of the joint does not change. The
/// prediction must therefore not change either.
#[test]
fn j63_a_restart_of_set_values_is_not_a_change_of_the_motion() {
    let mut nodes = moving(20);
    let mut commanded = Commanded::default();
    (0..JOINTS).for_each(|j| commanded.begin(j, 0.0, 0.25, 0));
    nodes.go_on_moving(&[true, false, false, true, false, false], &[0.25; JOINTS]);
    nodes.take(&inputs(&[], GOOD), &Config::avena(), Goal::Ready, &commanded);
    for (j, velocity) in nodes.velocities().iter().enumerate() {
        // For the other joints, the commanded velocity has increased by 0.25 rad/s.
        let expected = if j == 0 || j == 3 { SPEED } else { SPEED + 0.25 };
        assert!((velocity - expected).abs() < 1e-4, "joint {}: {velocity}", j + 1);
    }
}
