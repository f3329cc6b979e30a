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
    /// Buffers whose transmission is cancelled when the current frame on the bus has ended.
    pub cancel: u32,
    /// Time at which the transmission of each buffer was requested.
    pub times: [Time; 32],
    /// Index of the FIFO element that is sent next.
    pub get: u32,
    /// Index of the FIFO element that is written next.
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
