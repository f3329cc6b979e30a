//! Tests of the state machine under all combinations of conditions, and of the diagram in docs/protocol-jtc.md.
extern crate std;
use std::format;
use std::string::String;
use std::vec::Vec;

use jtc_wire::{ExecCommand, FrameRef, FrameType, LinkEvent, RawPoint, Segment};

use super::*;
use crate::docs_check::is_in_the_protocol;
use crate::{Config, Controller, HostEvent, Inputs, TrajectoryState};

const STATES: [ControllerState; 6] = [
    ControllerState::Start,
    ControllerState::Init,
    ControllerState::HoldPos,
    ControllerState::Operate,
    ControllerState::Teaching,
    ControllerState::Error,
];

/// Condition, with its text in the diagram if it is met, and its text if it is not met.
type Named = (fn(&Conditions) -> bool, &'static str, &'static str);
const NAMES: [Named; 6] = [
    (|c| c.error, "an error", "errors cleared"),
    (|c| c.clearing, "a joint is being cleared", "every joint cleared"),
    (|c| c.initialised, "nodes ready and parameters given", "not initialised"),
    (|c| c.teaching, "teaching on", "teaching off"),
    (|c| c.teachable, "held at rest", "not held at rest"),
    (|c| c.execute, "execute", "execution over"),
];

fn all_conditions() -> impl Iterator<Item = Conditions> {
    (0..64u8).map(|bits| {
        let bit = |n: u8| bits >> n & 1 == 1;
        Conditions {
            error: bit(0),
            clearing: bit(1),
            initialised: bit(2),
            teaching: bit(3),
            teachable: bit(4),
            execute: bit(5),
        }
    })
}

/// Returns the conditions after the host has sent this frame in `state`. Before that, a trajectory was loaded in
/// HoldPos.
fn sent(state: ControllerState, frame_type: FrameType, body: [u8; 4]) -> Conditions {
    let mut controller = Controller::new(Config::avena(), [RawPoint::default(); 4]);
    controller.state = ControllerState::HoldPos;
    let points = [0, 1, 0, 0, 0, 1, 0, 10].into_iter().chain([0; 4 * 36]).collect::<Vec<u8>>();
    let segment = Segment::parse(&points).expect("four points at standstill");
    controller.store.begin(&segment, false, false);
    controller.store.copy(&segment, 0, 4);
    controller.store.commit(&segment, Default::default());
    controller.set_trajectory(TrajectoryState::Stop);
    controller.enter(state);
    let bytes = [&[0; 4], &body[..], &[0; 2]].concat();
    let event = LinkEvent::Frame(FrameRef { frame_type, bytes: &bytes });
    let host = [HostEvent { line: 0, overtaken: false, plain: false, event }];
    controller.serve_host(&Inputs { host: &host, ..Inputs::QUIET });
    let (teaching, execute) = (controller.teaching, controller.trajectory == TrajectoryState::Execute);
    Conditions { teaching, execute, ..Conditions::default() }
}

/// Returns the conditions that are possible in a state. Some conditions require a command that the host sends and that the state accepts.
fn possible(state: ControllerState) -> Vec<Conditions> {
    // In Start, the controller does not execute host commands, so all parameters are missing.
    let start = state == ControllerState::Start;
    let teaching = !start
        && (state == ControllerState::Teaching
            || sent(state, FrameType::TeachingModeEnable, [0; 4]).teaching);
    let execute = [ExecCommand::Execute as u8, 0, 0, 0];
    let execute = !start && sent(state, FrameType::TrajSetExecStatus, execute).execute;
    all_conditions()
        .filter(|c| (teaching || !c.teaching) && (execute || !c.execute))
        .filter(|c| !(c.initialised && (start || c.clearing)))
        .collect()
}

/// Returns the conditions for an arrow of the diagram. These conditions are met in every transition along this arrow. Conditions that only
/// exclude a state with a higher priority are omitted.
fn label(from: ControllerState, to: ControllerState) -> Option<String> {
    let all = possible(from);
    let taken: Vec<_> = all.iter().filter(|c| next_state(from, c) == to).collect();
    let first = taken.first()?;
    let mut needed: Vec<_> = NAMES
        .iter()
        .filter(|(holds, ..)| taken.iter().all(|c| holds(c) == holds(first)))
        .filter(|(holds, ..)| all.iter().any(|c| holds(c) != holds(first)))
        .collect();
    let comes_before = |state: ControllerState| match to {
        ControllerState::Error => false,
        ControllerState::Init => state == ControllerState::Error,
        ControllerState::Operate if state == ControllerState::Teaching => true,
        _ => matches!(state, ControllerState::Error | ControllerState::Init),
    };
    for n in (0..needed.len()).rev() {
        let without: Vec<_> = needed.iter().enumerate().filter(|(k, _)| *k != n).map(|(_, c)| *c).collect();
        let only = |c: &&Conditions| without.iter().all(|(holds, ..)| holds(c) == holds(first));
        let reached = all.iter().filter(only).map(|c| next_state(from, c));
        if reached.into_iter().all(|state| state == to || state != from && comes_before(state)) {
            needed.remove(n);
        }
    }
    let words = needed.iter().map(|(holds, yes, no)| if holds(first) { *yes } else { *no });
    Some(words.collect::<Vec<_>>().join(", "))
}

fn diagram() -> String {
    let mut lines = String::from("```mermaid\nstateDiagram-v2\n    [*] --> Start\n");
    for (from, to) in STATES.iter().flat_map(|from| STATES.map(|to| (*from, to))) {
        match label(from, to) {
            Some(label) if from != to && label.is_empty() => lines += &format!("    {from:?} --> {to:?}\n"),
            Some(label) if from != to => lines += &format!("    {from:?} --> {to:?}: {label}\n"),
            _ => {}
        }
    }
    lines + "```\n"
}

#[test]
fn j20_the_diagram_is_what_the_code_does() {
    is_in_the_protocol("states", &diagram());
}

/// The next state has torque only if no error is latched and everything is initialised. The test covers all
/// combinations of conditions, including impossible combinations.
#[test]
fn j20_j21_torque_is_on_with_no_error_and_all_initialised_only() {
    for (state, conditions) in STATES.iter().flat_map(|state| all_conditions().map(move |c| (*state, c))) {
        let next = next_state(state, &conditions);
        if conditions.error {
            assert_eq!(next, ControllerState::Error, "{state:?} {conditions:?}");
        }
        if !conditions.initialised || conditions.error {
            assert!(!next.has_torque(), "{state:?} {conditions:?}");
        }
        if state == ControllerState::Error && conditions.clearing {
            assert_eq!(next, ControllerState::Error, "{conditions:?}");
        }
        assert_ne!(next, ControllerState::Start, "{state:?} {conditions:?}");
    }
}

/// The arm begins to move or becomes compliant only from HoldPos, and only on a command of the host.
#[test]
fn j24_j25_no_state_but_holdpos_leads_to_motion_or_teaching() {
    for (from, conditions) in STATES.iter().flat_map(|from| possible(*from).into_iter().map(|c| (*from, c))) {
        let next = next_state(from, &conditions);
        for (to, ordered) in [
            (ControllerState::Operate, conditions.execute),
            (ControllerState::Teaching, conditions.teaching && conditions.teachable),
        ] {
            if next == to && from != to {
                assert!(from == ControllerState::HoldPos && ordered, "{from:?} {conditions:?} {next:?}");
            }
        }
    }
}
