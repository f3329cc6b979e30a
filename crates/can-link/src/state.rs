//! State of a member's CAN controller on its bus.

use std::fmt;

/// The error state of a CAN controller (ISO 11898-1, fault confinement).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ErrorState {
    /// The adapter does not report the state.
    #[default]
    Unknown,
    /// Error active: no error counter has reached 96.
    Active,
    /// An error counter has reached 96, but none is above 127.
    Warning,
    /// Error passive: an error counter is above 127. The controller no longer destroys frames of other members.
    Passive,
    /// Bus-off: the transmit error counter was above 255, and the controller has left the bus.
    BusOff,
}

impl ErrorState {
    /// Returns the error state for these error counters.
    pub const fn of_counters(tec: u16, rec: u16) -> Self {
        let worst = if tec > rec { tec } else { rec };
        match (tec, worst) {
            (256.., _) => Self::BusOff,
            (_, 128..) => Self::Passive,
            (_, 96..) => Self::Warning,
            _ => Self::Active,
        }
    }
}

impl fmt::Display for ErrorState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Unknown => "unknown",
            Self::Active => "error active",
            Self::Warning => "error warning",
            Self::Passive => "error passive",
            Self::BusOff => "bus-off",
        })
    }
}

/// Error state and error counters of a CAN controller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ControllerState {
    /// Error state.
    pub errors: ErrorState,
    /// Transmit error counter, if the adapter reports it.
    pub tec: Option<u16>,
    /// Receive error counter, if the adapter reports it.
    pub rec: Option<u16>,
}

impl ControllerState {
    /// Creates a state without counters.
    pub const fn without_counters(errors: ErrorState) -> Self {
        Self { errors, tec: None, rec: None }
    }

    /// Creates the state for these counters.
    pub const fn of_counters(tec: u16, rec: u16) -> Self {
        Self { errors: ErrorState::of_counters(tec, rec), tec: Some(tec), rec: Some(rec) }
    }
}

/// Prints the state as in `error passive (TEC 136, REC 0)`.
impl fmt::Display for ControllerState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.tec, self.rec) {
            (Some(tec), Some(rec)) => write!(f, "{} (TEC {tec}, REC {rec})", self.errors),
            _ => write!(f, "{}", self.errors),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counters_give_the_states_of_the_standard() {
        for (tec, rec, state) in [
            (0, 0, ErrorState::Active),
            (95, 95, ErrorState::Active),
            (96, 0, ErrorState::Warning),
            (0, 127, ErrorState::Warning),
            (128, 0, ErrorState::Passive),
            (0, 300, ErrorState::Passive),
            (255, 0, ErrorState::Passive),
            (256, 0, ErrorState::BusOff),
        ] {
            assert_eq!(ErrorState::of_counters(tec, rec), state, "TEC {tec}, REC {rec}");
        }
        assert_eq!(ControllerState::of_counters(136, 2).to_string(), "error passive (TEC 136, REC 2)");
        assert_eq!(ControllerState::default().to_string(), "unknown");
    }
}
