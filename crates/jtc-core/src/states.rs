//! States of the controller, and the choice of the next state (J-20 to J-25). The diagram in docs/protocol-jtc.md shows this function.
use crate::ControllerState;

/// Conditions that choose the next state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Conditions {
    /// An error is latched (J-21).
    pub error: bool,
    /// A joint is still being cleared, because the cause of its error persists.
    pub clearing: bool,
    /// Every parameter was received and every node was brought up (J-20).
    pub initialised: bool,
    /// The host has enabled teaching.
    pub teaching: bool,
    /// The arm is held at rest, and its loads are known or not needed (J-25). This condition is evaluated only if `teaching` is set.
    pub teachable: bool,
    /// A trajectory is being executed.
    pub execute: bool,
}

/// Returns the next state, which is the first of Error, Init, Teaching, Operate and HoldPos whose conditions are met.
pub(crate) fn next_state(state: ControllerState, conditions: &Conditions) -> ControllerState {
    let Conditions { error, clearing, initialised, teaching, teachable, execute } = *conditions;
    if error || (state == ControllerState::Error && clearing) {
        ControllerState::Error
    } else if !initialised {
        ControllerState::Init
    } else if teaching && (state == ControllerState::Teaching || teachable) {
        // An accepted teach request waits until every joint is held at rest, because the loads of the arm can be found only at rest (J-25).
        ControllerState::Teaching
    } else if execute {
        ControllerState::Operate
    } else {
        ControllerState::HoldPos
    }
}

#[cfg(test)]
mod tests;
