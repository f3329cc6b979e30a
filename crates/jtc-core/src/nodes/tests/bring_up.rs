//! Tests of the requests to a drive, and of their diagram in docs/protocol-jtc.md.
extern crate std;
use std::format;
use std::string::String;
use std::vec::Vec;

use super::*;
use crate::docs_check::is_in_the_protocol;

/// States of a drive, each with the request that leads to the state and the name of the state. The list does not include states that the
/// drive leaves after some time without a request.
const STATES: [(NodeState, Target, &str); 5] = [
    (NodeState::START, Target::NoChange, "Start"),
    (NodeState::INIT, Target::Init, "Init"),
    (NodeState::READY, Target::Ready, "ReadyToOperate"),
    (NodeState::ENABLED, Target::Enable, "OperationEnable"),
    (NodeState::FAULT, Target::NoChange, "Fault"),
];
const GOALS: [(Goal, &str); 3] =
    [(Goal::Ready, "in Init"), (Goal::Enabled, "with torque"), (Goal::Down, "in Error")];
/// Cases of the configuration of a node: flags for accepted and refused, and the name of the case.
const KNOWN: [(bool, bool, &str); 3] =
    [(false, false, "unknown"), (false, true, "refused"), (true, false, "accepted")];

fn node(state: NodeState, (configured, refused, _): (bool, bool, &str)) -> Node {
    let mut node = Node { seen: true, configured, refused, valid: configured, ..Node::default() };
    node.report.state = state;
    node
}

fn diagram() -> String {
    let mut lines = String::from("```mermaid\nstateDiagram-v2\n");
    for ((from, _, name), (_, target, to)) in STATES.iter().flat_map(|from| STATES.map(|to| (*from, to))) {
        for (goal, title) in GOALS {
            let asked = |known| node(from, known).request(goal) == target && target != Target::NoChange;
            let with: Vec<_> =
                KNOWN.into_iter().filter(|known| asked(*known)).map(|(.., word)| word).collect();
            match with.len() {
                0 => {}
                3 => lines += &format!("    {name} --> {to}: {title}\n"),
                _ => {
                    lines += &format!("    {name} --> {to}: {title}, configuration {}\n", with.join(" or "));
                }
            }
        }
        let cleared = Node { clear: true, ..node(from, KNOWN[2]) };
        if cleared.request(Goal::Down) == target && target != Target::NoChange && from != NodeState::INIT {
            lines += &format!("    {name} --> {to}: to clear its errors\n");
        }
    }
    lines + "```\n"
}

#[test]
fn j16_j20_the_diagram_is_what_is_requested() {
    is_in_the_protocol("bring-up", &diagram());
}

/// The controller enables a drive only with the goal Enabled, and only if the drive is in ReadyToOperate or in a
/// transition. The test covers all state codes.
#[test]
fn j16_only_a_drive_that_is_ready_and_wanted_enabled_is_enabled() {
    for (goal, known) in GOALS.iter().flat_map(|(goal, _)| KNOWN.map(|known| (*goal, known))) {
        for code in 0..=255 {
            let state = NodeState::new(code);
            let enables = node(state, known).request(goal) == Target::Enable;
            let may = goal == Goal::Enabled && (state == NodeState::READY || state.is_transition());
            assert_eq!(enables, may, "{state} {goal:?} {known:?}");
        }
    }
}
