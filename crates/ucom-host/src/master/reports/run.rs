//! Options for a run of boards, and the values that the boards get.
use crate::master::load::LoadForecast;
use ucom::Admin;

/// Value that the user sets for an input or a parameter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Setting {
    /// Name or index of the signal.
    pub name: String,
    /// Value of the signal as a 16-bit word.
    pub value: u16,
}

/// Values that a board gets before its control loop starts.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RunBoard {
    /// Board number.
    pub board: u8,
    /// Inputs whose values the user sets; these values replace the board's initial inputs.
    pub ci: Vec<Setting>,
    /// Parameters that the user sets.
    pub par: Vec<Setting>,
}

/// Options for a run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RunOptions {
    /// Boards to run, with their values.
    pub boards: Vec<RunBoard>,
    /// `true` to enable the outputs of the boards at the end.
    pub active: bool,
    /// Permission to run even if the bus load would be too high or another PC is on the bus.
    pub force: bool,
}

/// Result of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunReport {
    /// Flags of each board after the start.
    pub boards: Vec<(u8, Admin)>,
    /// Forecast of the bus load with all running boards.
    pub load: LoadForecast,
}
