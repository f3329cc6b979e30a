//! What the log says of the ticks.
use core::cell::Cell;

use critical_section::Mutex;

use crate::fdcan::Counters;

/// The tick in the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub struct Summary {
    /// State of the controller.
    pub state: u8,
    /// Current error word.
    pub errors: u16,
    /// Joint bus.
    pub bus: Counters,
    /// Ticks that were left out because the one before took too long.
    pub left_out: u32,
}

impl Summary {
    /// Before the first tick.
    pub const fn new() -> Self {
        Self { state: 0, errors: 0, bus: Counters::new(), left_out: 0 }
    }
}

/// As of the last tick.
pub static LAST: Mutex<Cell<Summary>> = Mutex::new(Cell::new(Summary::new()));
