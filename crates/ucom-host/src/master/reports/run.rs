//! Options for a run of boards, and the values that the boards get.
use crate::master::load::LoadForecast;
use ucom::Admin;

/// Value for an input or a parameter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Setting {
    /// Name or index of the signal.
    pub name: String,
    /// The word.
    pub value: u16,
}

/// Values that a board gets before its control loop starts.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RunBoard {
    /// Board number.
    pub board: u8,
    /// Inputs whose values differ from the board's initial inputs.
    pub ci: Vec<Setting>,
    /// Parameters.
    pub par: Vec<Setting>,
}

/// Options for a run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RunOptions {
    /// The boards.
    pub boards: Vec<RunBoard>,
    /// `true` to enable the outputs at the end.
    pub active: bool,
    /// Permission to run even if the bus load would be too high or another PC is on the bus.
    pub force: bool,
}

/// Result of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunReport {
    /// Flags of each board.
    pub boards: Vec<(u8, Admin)>,
    /// Forecast of the bus load with all running boards.
    pub load: LoadForecast,
}
