//! States that nodes report.

/// Node FSM bytes.
pub mod fsm {
    /// Start.
    pub const START: u8 = 0;
    /// Init: motor off, waits for configuration.
    pub const INIT: u8 = 1;
    /// Ready to operate: motor off, configured.
    pub const READY: u8 = 2;
    /// Operation enabled: follows its command.
    pub const ENABLED: u8 = 3;
    /// Fault reaction active.
    pub const FAULT_REACTION: u8 = 254;
    /// Fault.
    pub const FAULT: u8 = 255;

    /// The state in words. Generations of drives disagree about what 14, 15 and 16 mean, so these only say
    /// that the node is between two states.
    pub const fn name(fsm: u8) -> &'static str {
        match fsm {
            START => "start",
            INIT => "init",
            READY => "ready to operate",
            ENABLED => "operation enabled",
            10 => "start to init",
            11 => "init to ready",
            12 => "ready to enabled (motor alignment)",
            13 => "enabled to ready",
            14..=16 => "changing state",
            100..=106 | 110..=117 | 131..=134 | 141..=144 | 161..=166 | 171 | 172 => {
                "calibrating (the drive moves by itself)"
            }
            FAULT_REACTION => "fault reaction",
            FAULT => "fault",
            _ => "unknown state",
        }
    }

    /// Between two of its states (10..16).
    pub const fn is_transition(fsm: u8) -> bool {
        matches!(fsm, 10..=16)
    }

    /// In fault, or on its way there.
    pub const fn is_fault(fsm: u8) -> bool {
        matches!(fsm, FAULT_REACTION | FAULT)
    }
}
