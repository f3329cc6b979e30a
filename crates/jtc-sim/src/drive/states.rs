//! State machine of a drive. A requested state stays pending until a transition clears the request. Enabling takes
//! time.
use jtc_bus::NodeState;

use super::DriveConfig;

/// Codes of the transitions in the simulated generation of drives. Other generations use other codes.
const READY_TO_INIT: NodeState = NodeState::new(14);
const REACTION_TO_FAULT: NodeState = NodeState::new(15);
const FAULT_TO_INIT: NodeState = NodeState::new(16);

/// State of a drive and progress of a transition.
#[derive(Clone, Debug)]
pub(super) struct States {
    state: NodeState,
    /// Number of ticks since `state` was entered.
    age: u32,
    /// Last requested state. The value Start means that no request is pending.
    pending: NodeState,
    /// `true` if the motor was aligned since the last reset.
    aligned: bool,
    /// Remaining ticks of the pause in which the motor control must not start.
    rest: u32,
}

impl States {
    /// Creates the state after a reset.
    pub(super) fn new() -> Self {
        Self { state: NodeState::START, age: 0, pending: NodeState::START, aligned: false, rest: 0 }
    }

    pub(super) fn state(&self) -> NodeState {
        self.state
    }

    /// Stores the requested state, which may be any byte. [`accept`](Self::accept) interprets the byte.
    pub(super) fn request(&mut self, state: NodeState) {
        self.pending = state;
    }

    /// Begins a tick.
    pub(super) fn begin_tick(&mut self) {
        self.age = self.age.saturating_add(1);
    }

    /// Returns `true` while the drive already reacts to an error or has just started. A further error then has no
    /// effect.
    pub(super) fn reacting(&self) -> bool {
        matches!(
            self.state,
            NodeState::FAULT_REACTION
                | REACTION_TO_FAULT
                | NodeState::FAULT
                | FAULT_TO_INIT
                | NodeState::START
        )
    }

    /// Begins the pending transition, if the current state permits a transition.
    pub(super) fn accept(&mut self, config: &DriveConfig) {
        let next = match (self.pending, self.state) {
            (NodeState::INIT, NodeState::START) => NodeState::START_TO_INIT,
            (NodeState::INIT, NodeState::READY) => READY_TO_INIT,
            (NodeState::INIT, NodeState::FAULT) => FAULT_TO_INIT,
            (NodeState::READY, NodeState::INIT) => NodeState::INIT_TO_READY,
            (NodeState::READY, NodeState::ENABLED) => NodeState::ENABLED_TO_READY,
            // Some drives, including the simulated drive, treat a request for the state Fault as an enable command.
            (NodeState::ENABLED | NodeState::FAULT, NodeState::READY) => NodeState::READY_TO_ENABLED,
            // A request for the fault reaction leads directly to the fault state. The error byte of the drive stays
            // 0.
            (NodeState::FAULT_REACTION, state) if state != NodeState::START => {
                self.pending = NodeState::START;
                NodeState::FAULT
            }
            // Any other requested state stays pending until a transition clears it.
            _ => return,
        };
        self.enter(next, config);
    }

    pub(super) fn enter(&mut self, state: NodeState, config: &DriveConfig) {
        if self.state == NodeState::ENABLED && state != NodeState::ENABLED {
            self.rest = config.rest_ms;
        }
        self.state = state;
        self.age = 0;
    }

    /// Continues a transition. At the end of a transition, clears the pending request. Returns `true` if the drive
    /// has acknowledged its errors.
    pub(super) fn proceed(&mut self, config: &DriveConfig) -> bool {
        self.rest = self.rest.saturating_sub(1);
        let start_time = if self.aligned { config.enable_ms } else { config.first_enable_ms };
        let mut acknowledged = false;
        let next = match self.state {
            NodeState::START => NodeState::START_TO_INIT,
            NodeState::START_TO_INIT | READY_TO_INIT if self.age > 0 => NodeState::INIT,
            FAULT_TO_INIT if self.age > 0 => {
                acknowledged = true;
                NodeState::INIT
            }
            NodeState::INIT_TO_READY | NodeState::ENABLED_TO_READY if self.age > 0 => NodeState::READY,
            NodeState::READY_TO_ENABLED if self.rest == 0 && self.age >= start_time => {
                self.aligned = true;
                NodeState::ENABLED
            }
            // An error interrupts a transition and begins the fault reaction.
            NodeState::FAULT_REACTION if self.age > 0 => REACTION_TO_FAULT,
            REACTION_TO_FAULT if self.age > 0 => NodeState::FAULT,
            _ => return false,
        };
        self.enter(next, config);
        if matches!(next, NodeState::INIT | NodeState::READY | NodeState::ENABLED | NodeState::FAULT) {
            self.pending = NodeState::START;
        }
        acknowledged
    }
}
