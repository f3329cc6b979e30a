//! Summary of the ticks for the log.
use core::cell::Cell;

use critical_section::Mutex;

use crate::fdcan::Counters;

/// Summary of a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Summary {
    /// State of the controller.
    pub state: u8,
    /// Current error word.
    pub errors: u16,
    /// Error counters of the joint bus.
    pub bus: Counters,
    /// Number of ticks that were skipped because the previous tick took too long.
    pub left_out: u32,
}

impl Summary {
    /// Creates the summary before the first tick.
    pub const fn new() -> Self {
        Self { state: 0, errors: 0, bus: Counters::new(), left_out: 0 }
    }

    /// Logs the values that have changed since `last`, with one log line per value.
    pub fn log(&self, last: &Self) {
        let (bus, before) = (&self.bus, &last.bus);
        if self.state != last.state {
            defmt::info!("state {=u8}", self.state);
        }
        if self.errors != last.errors {
            defmt::info!("errors {=u16:#06x}", self.errors);
        }
        if bus.transmit != before.transmit {
            defmt::info!("transmit errors of the bus {=u8}", bus.transmit);
        }
        if bus.receive != before.receive {
            defmt::info!("receive errors of the bus {=u8}", bus.receive);
        }
        if bus.cancelled != before.cancelled {
            defmt::info!("frames cancelled {=u32}", bus.cancelled);
        }
        if bus.bus_off != before.bus_off {
            defmt::warn!("times off the bus {=u32}", bus.bus_off);
        }
        if bus.wrong_format != before.wrong_format {
            defmt::warn!("frames of a wrong format {=u32}", bus.wrong_format);
        }
        if self.left_out != last.left_out {
            defmt::warn!("ticks left out {=u32}", self.left_out);
        }
    }
}

/// Summary of the last tick.
pub static LAST: Mutex<Cell<Summary>> = Mutex::new(Cell::new(Summary::new()));
