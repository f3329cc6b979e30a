//! States of the controller, and selection of the next state (J-20 to J-25). The diagram in docs/protocol-jtc.md is generated from the
//! function that selects the state.
use crate::ControllerState;

/// Conditions that determine the next state of the controller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Conditions {
    /// `true` if an error is latched (J-21).
    pub error: bool,
    /// `true` if a joint is still being cleared, because the cause of its error persists.
    pub clearing: bool,
    /// `true` if every parameter was received and every node was brought up (J-20).
    pub initialised: bool,
    /// `true` if the host has enabled Teaching.
    pub teaching: bool,
    /// `true` if the arm is held at rest, and its loads are known or not needed (J-25). `teachable` is evaluated only if `teaching` is set.
    pub teachable: bool,
    /// `true` if a trajectory is being executed.
    pub execute: bool,
}

/// Returns the next state of the controller: the first of Error, Init, Teaching, Operate and HoldPos whose conditions are met.
pub(crate) fn next_state(state: ControllerState, conditions: &Conditions) -> ControllerState {
    let Conditions { error, clearing, initialised, teaching, teachable, execute } = *conditions;
    if error || (state == ControllerState::Error && clearing) {
        ControllerState::Error
    } else if !initialised {
        ControllerState::Init
    } else if teaching && (state == ControllerState::Teaching || teachable) {
        // An accepted teach request waits until every joint is held at rest, because the controller can estimate the
        // loads of the joints only at rest (J-25).
        ControllerState::Teaching
    } else if execute {
        ControllerState::Operate
    } else {
        ControllerState::HoldPos
    }
}

#[cfg(test)]
mod tests;
