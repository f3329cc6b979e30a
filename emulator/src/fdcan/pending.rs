//! Pending transmit requests.
use crate::clock::{NEVER, Time};

/// Transmit requests.
#[derive(Default)]
pub(super) struct Pending {
    /// TXBRP.
    pub requests: u32,
    /// TXBTO, TXBCF.
    pub sent: u32,
    pub cancelled: u32,
    /// Buffers to be cancelled after the frame that is on the wire.
    pub cancel: u32,
    /// Time since which each buffer has been requested.
    pub times: [Time; 32],
    /// Get index of the FIFO.
    pub get: u32,
    /// Put index of the FIFO.
    pub put: u32,
}

impl Pending {
    /// Returns the time since which a request has been pending.
    pub fn since(&self) -> Time {
        let bits = (0..32).filter(|&b| self.requests >> b & 1 == 1);
        bits.map(|b| self.times[b]).min().unwrap_or(NEVER)
    }

    pub fn forget(&mut self, buffer: u32) {
        self.requests &= !(1 << buffer);
        self.cancel &= !(1 << buffer);
    }
}
