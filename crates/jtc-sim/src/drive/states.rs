//! The state machine of a drive: requests stay pending until a transition erases them, and enabling takes its time.
use jtc_bus::fsm;

use super::DriveConfig;

/// States between the lasting ones.
pub(super) mod transition {
    pub const START_TO_INIT: u8 = 10;
    pub const INIT_TO_READY: u8 = 11;
    pub const READY_TO_ENABLED: u8 = 12;
    pub const ENABLED_TO_READY: u8 = 13;
    pub const READY_TO_INIT: u8 = 14;
    pub const REACTION_TO_FAULT: u8 = 15;
    pub const FAULT_TO_INIT: u8 = 16;
}

use transition::*;

/// State and what it remembers of the way there.
#[derive(Clone, Debug)]
pub(super) struct States {
    state: u8,
    /// Ticks in `state`.
    age: u32,
    /// State that was requested last; 0: none.
    pending: u8,
    /// The motor was aligned since the last reset.
    aligned: bool,
    /// Ticks until the motor control may start.
    rest: u32,
}

impl States {
    /// After a reset.
    pub fn new() -> Self {
        Self { state: fsm::START, age: 0, pending: 0, aligned: false, rest: 0 }
    }

    pub fn state(&self) -> u8 {
        self.state
    }

    /// Any byte is taken; what it means is decided by [`accept`](Self::accept).
    pub fn request(&mut self, state: u8) {
        self.pending = state;
    }

    /// A tick begins.
    pub fn begin_tick(&mut self) {
        self.age = self.age.saturating_add(1);
    }

    /// A further error changes nothing: the drive reacts to one already, or has just started.
    pub fn reacting(&self) -> bool {
        matches!(
            self.state,
            fsm::FAULT_REACTION | REACTION_TO_FAULT | fsm::FAULT | FAULT_TO_INIT | fsm::START
        )
    }

    /// Begin the transition that is pending, if there is one from here.
    pub fn accept(&mut self, config: &DriveConfig) {
        let next = match (self.pending, self.state) {
            (fsm::INIT, fsm::START) => START_TO_INIT,
            (fsm::INIT, fsm::READY) => READY_TO_INIT,
            (fsm::INIT, fsm::FAULT) => FAULT_TO_INIT,
            (fsm::READY, fsm::INIT) => INIT_TO_READY,
            (fsm::READY, fsm::ENABLED) => ENABLED_TO_READY,
            // Some drives take an echoed fault byte as a command to move: this one does.
            (fsm::ENABLED | fsm::FAULT, fsm::READY) => READY_TO_ENABLED,
            // Its error byte stays 0.
            (fsm::FAULT_REACTION, state) if state != fsm::START => {
                self.pending = 0;
                fsm::FAULT
            }
            // Anything else stays pending until a transition erases it.
            _ => return,
        };
        self.enter(next, config);
    }

    pub fn enter(&mut self, state: u8, config: &DriveConfig) {
        if self.state == fsm::ENABLED && state != fsm::ENABLED {
            self.rest = config.rest_ms;
        }
        self.state = state;
        self.age = 0;
    }

    /// Let a transition go on; when it is complete, a pending request is forgotten. True: the errors are acknowledged.
    pub fn proceed(&mut self, config: &DriveConfig) -> bool {
        self.rest = self.rest.saturating_sub(1);
        let start_time = if self.aligned { config.enable_ms } else { config.first_enable_ms };
        let mut acknowledged = false;
        let next = match self.state {
            fsm::START => START_TO_INIT,
            START_TO_INIT | READY_TO_INIT if self.age > 0 => fsm::INIT,
            FAULT_TO_INIT if self.age > 0 => {
                acknowledged = true;
                fsm::INIT
            }
            INIT_TO_READY | ENABLED_TO_READY if self.age > 0 => fsm::READY,
            READY_TO_ENABLED if self.rest == 0 && self.age >= start_time => {
                self.aligned = true;
                fsm::ENABLED
            }
            // Any stop on the way interrupts it.
            fsm::FAULT_REACTION if self.age > 0 => REACTION_TO_FAULT,
            REACTION_TO_FAULT if self.age > 0 => fsm::FAULT,
            _ => return false,
        };
        self.enter(next, config);
        if matches!(next, fsm::INIT | fsm::READY | fsm::ENABLED | fsm::FAULT) {
            self.pending = 0;
        }
        acknowledged
    }
}
