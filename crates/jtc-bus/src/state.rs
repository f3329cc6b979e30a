//! States that nodes report.
use core::fmt;

/// State of a node, as one byte. The states depend on the generation of the drive.
///
/// ```
/// use jtc_bus::NodeState;
///
/// assert_eq!(NodeState::new(3), NodeState::ENABLED);
/// assert_eq!(NodeState::ENABLED.name(), "OperationEnable");
/// assert!(NodeState::new(12).is_transition() && NodeState::FAULT.is_fault());
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct NodeState(u8);

impl NodeState {
    /// State Start, the first state of a drive.
    pub const START: Self = Self(0);
    /// Init. The motor is off, and the node waits for its configuration.
    pub const INIT: Self = Self(1);
    /// Ready to operate. The motor is off, and the node is configured.
    pub const READY: Self = Self(2);
    /// Operation enabled. The node follows its command.
    pub const ENABLED: Self = Self(3);
    /// Transition from Start to Init.
    pub const START_TO_INIT: Self = Self(10);
    /// Transition from Init to ready.
    pub const INIT_TO_READY: Self = Self(11);
    /// Transition from ready to enabled. The drive may align the motor in this state.
    pub const READY_TO_ENABLED: Self = Self(12);
    /// Transition from enabled to ready.
    pub const ENABLED_TO_READY: Self = Self(13);
    /// Fault reaction active.
    pub const FAULT_REACTION: Self = Self(254);
    /// Fault.
    pub const FAULT: Self = Self(255);

    /// Returns the state that a byte represents.
    pub const fn new(code: u8) -> Self {
        Self(code)
    }

    /// Returns the byte that represents the state on the bus.
    pub const fn code(self) -> u8 {
        self.0
    }

    /// Returns the name of the state as manuals and statuses write it.
    pub const fn name(self) -> &'static str {
        self.texts().0
    }

    /// Returns a text for a bus log that describes what the node is doing.
    pub const fn description(self) -> &'static str {
        self.texts().1
    }

    /// Returns the name and the description of the state. The meaning of the states 14, 15 and 16 depends on the generation of the drive.
    /// The description of these states therefore says only that the node is between two states.
    const fn texts(self) -> (&'static str, &'static str) {
        match self {
            Self::START => ("Start", "start"),
            Self::INIT => ("Init", "init"),
            Self::READY => ("ReadyToOperate", "ready to operate"),
            Self::ENABLED => ("OperationEnable", "operation enabled"),
            Self::START_TO_INIT => ("in transition", "start to init"),
            Self::INIT_TO_READY => ("in transition", "init to ready"),
            Self::READY_TO_ENABLED => ("in transition", "ready to enabled (motor alignment)"),
            Self::ENABLED_TO_READY => ("in transition", "enabled to ready"),
            Self(14..=16) => ("in transition", "changing state"),
            Self(100..=106 | 110..=117 | 131..=134 | 141..=144 | 161..=166 | 171 | 172) => {
                ("unknown state", "calibrating (the drive moves by itself)")
            }
            Self::FAULT_REACTION => ("fault reaction", "fault reaction"),
            Self::FAULT => ("Fault", "fault"),
            _ => ("unknown state", "unknown state"),
        }
    }

    /// Returns `true` in Start, in Init, and in the transition from Start to Init.
    pub const fn is_starting(self) -> bool {
        matches!(self, Self::START | Self::INIT | Self::START_TO_INIT)
    }

    /// Returns true in a transition between two states (10..16).
    pub const fn is_transition(self) -> bool {
        matches!(self.0, 10..=16)
    }

    /// Returns true in the states Fault and Fault reaction active.
    pub const fn is_fault(self) -> bool {
        matches!(self, Self::FAULT_REACTION | Self::FAULT)
    }
}

impl fmt::Display for NodeState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl fmt::Debug for NodeState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({})", self.0, self.description())
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::format;

    use super::*;

    #[test]
    fn a_state_prints_its_name_and_in_debug_its_number() {
        assert_eq!(format!("{}|{:>8}", NodeState::ENABLED, NodeState::INIT), "OperationEnable|    Init");
        assert_eq!(format!("{:?}", NodeState::ENABLED), format!("3 ({})", NodeState::ENABLED.description()));
    }
}
