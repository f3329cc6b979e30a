//! Which boards run with which values.
use crate::master::load::LoadForecast;
use ucom::Admin;

/// A value for an input or a parameter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Setting {
    /// The signal's text, or its number.
    pub name: String,
    /// The word.
    pub value: u16,
}

/// What a board gets before its control loop starts.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RunBoard {
    /// Its number.
    pub board: u8,
    /// Inputs that differ from the board's initial ones.
    pub ci: Vec<Setting>,
    /// Parameters.
    pub par: Vec<Setting>,
}

/// Which boards to run, and how far.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RunOptions {
    /// The boards.
    pub boards: Vec<RunBoard>,
    /// Enable the outputs at the end.
    pub active: bool,
    /// Also when the bus would be too busy or another PC is on it.
    pub force: bool,
}

/// What runs now.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunReport {
    /// Flags of each board.
    pub boards: Vec<(u8, Admin)>,
    /// Forecast of the bus load with all running boards.
    pub load: LoadForecast,
}
