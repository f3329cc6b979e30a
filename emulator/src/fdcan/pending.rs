//! Pending transmit requests of FDCAN1.
use crate::clock::{NEVER, Time};

/// Transmit requests and their states.
#[derive(Default)]
pub(super) struct Pending {
    /// Value of register TXBRP.
    pub requests: u32,
    /// Values of registers TXBTO and TXBCF.
    pub sent: u32,
    pub cancelled: u32,
    /// Buffers whose transmission the controller cancels when the current frame on the bus has ended.
    pub cancel: u32,
    /// Time at which the program requested the transmission of each buffer.
    pub times: [Time; 32],
    /// Index of the FIFO element that the controller sends next.
    pub get: u32,
    /// Index of the FIFO element that the program writes next.
    pub put: u32,
}

impl Pending {
    /// Returns the time of the oldest pending request; `NEVER` if no request is pending.
    pub fn since(&self) -> Time {
        let bits = (0..32).filter(|&b| self.requests >> b & 1 == 1);
        bits.map(|b| self.times[b]).min().unwrap_or(NEVER)
    }

    pub fn forget(&mut self, buffer: u32) {
        self.requests &= !(1 << buffer);
        self.cancel &= !(1 << buffer);
    }
}
