//! Pending transmit requests.
use crate::clock::{NEVER, Time};

/// Transmit requests.
#[derive(Default)]
pub(super) struct Pending {
    /// TXBRP.
    pub requests: u32,
    /// TXBTO and TXBCF.
    pub sent: u32,
    pub cancelled: u32,
    /// Buffers to be cancelled when the frame now on the bus has ended.
    pub cancel: u32,
    /// Time at which the transmission of each buffer was requested.
    pub times: [Time; 32],
    /// Get index of the FIFO.
    pub get: u32,
    /// Put index of the FIFO.
    pub put: u32,
}

impl Pending {
    /// Returns the time at which the oldest pending request was made.
    pub fn since(&self) -> Time {
        let bits = (0..32).filter(|&b| self.requests >> b & 1 == 1);
        bits.map(|b| self.times[b]).min().unwrap_or(NEVER)
    }

    pub fn forget(&mut self, buffer: u32) {
        self.requests &= !(1 << buffer);
        self.cancel &= !(1 << buffer);
    }
}
