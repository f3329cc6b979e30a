//! Transmission of frames: requests, order, success, failure and cancellation.
use can_link::CanFrame;

use super::bus::{Outcome, rank};
use super::ram::ELEMENT_SIZES;
use super::{Fdcan, cccr, ir, lec};
use crate::clock::Time;

impl Fdcan {
    fn dedicated(&self) -> u32 {
        self.txbc >> 16 & 0x3F
    }

    fn fifo_size(&self) -> u32 {
        self.txbc >> 24 & 0x3F
    }

    /// Returns the frame in a transmit buffer.
    pub(super) fn load(&self, buffer: u32) -> Option<CanFrame> {
        let room = ELEMENT_SIZES[(self.txesc & 7) as usize];
        let start = (self.txbc & 0xFFFC) + buffer * (room + 8);
        self.ram.load(start, room, self.cccr & cccr::FDOE != 0, self.cccr & cccr::BRSE != 0)
    }

    /// Returns the transmit buffer that the controller sends next, which is the buffer with the lowest identifier. In a
    /// FIFO, only the oldest entry can be sent.
    pub(super) fn next_buffer(&self) -> Option<u32> {
        let dedicated = self.dedicated();
        let queue = self.txbc >> 30 & 1 == 1;
        let takes_part = |b: &u32| {
            self.tx.requests >> b & 1 == 1 && (*b < dedicated || queue || *b == dedicated + self.tx.get)
        };
        (0..32).filter(takes_part).min_by_key(|&b| (self.load(b).map_or(u32::MAX, |f| rank(&f)), b))
    }

    /// Handles a write to TXBAR.
    pub(super) fn request(&mut self, bits: u32, now: Time) {
        if self.cccr & cccr::CCE != 0 {
            return;
        }
        let count = (self.dedicated() + self.fifo_size()).min(32);
        for buffer in (0..count).filter(|b| bits >> b & 1 == 1) {
            self.tx.requests |= 1 << buffer;
            self.tx.sent &= !(1 << buffer);
            self.tx.cancelled &= !(1 << buffer);
            self.tx.times[buffer as usize] = now;
            if buffer >= self.dedicated() && self.fifo_size() > 0 {
                self.tx.put = (self.tx.put + 1) % self.fifo_size();
            }
        }
    }

    /// Handles a write to TXBCR. The controller cancels a frame that is already on the bus only if its transmission
    /// fails.
    pub(super) fn cancel(&mut self, bits: u32) {
        let bits = bits & self.tx.requests;
        for buffer in (0..32).filter(|b| bits >> b & 1 == 1) {
            if self.wire.sending() == Some(buffer) {
                self.tx.cancel |= 1 << buffer;
            } else {
                self.end_request(buffer, false);
            }
        }
    }

    fn end_request(&mut self, buffer: u32, success: bool) {
        let cancelled = !success || self.tx.cancel >> buffer & 1 == 1;
        self.tx.forget(buffer);
        if success {
            self.tx.sent |= 1 << buffer;
            if self.txbtie >> buffer & 1 == 1 {
                self.ir |= ir::TC;
            }
        }
        if cancelled {
            self.tx.cancelled |= 1 << buffer;
            if self.txbcie >> buffer & 1 == 1 {
                self.ir |= ir::TCF;
            }
        }
        if buffer >= self.dedicated() && self.fifo_size() > 0 {
            self.tx.get = (self.tx.get + 1) % self.fifo_size();
            if self.fifo_fill() == 0 {
                self.ir |= ir::TFE;
            }
        }
    }

    pub(super) fn sent(&mut self, buffer: u32) {
        self.tec = self.tec.saturating_sub(1);
        self.last_error(lec::NONE);
        self.end_request(buffer, true);
    }

    pub(super) fn failed(&mut self, buffer: u32, outcome: Outcome, end: Time) {
        match outcome {
            Outcome::NoAcknowledge => {
                self.last_error(lec::ACK);
                // An error-passive node does not increase its error counter if no node acknowledges its frame,
                // because it could be the only node on the bus.
                if self.tec < 128 {
                    self.tec += 8;
                }
            }
            _ => {
                self.last_error(lec::BIT1);
                self.psr = self.psr & !0x700 | lec::BIT0 << 8;
                self.ir |= ir::PED;
                self.tec += 8;
            }
        }
        if self.cccr & cccr::DAR != 0 || self.tx.cancel >> buffer & 1 == 1 {
            self.end_request(buffer, false);
        } else {
            self.tx.times[buffer as usize] = end;
        }
    }

    fn fifo_fill(&self) -> u32 {
        (self.tx.requests >> self.dedicated().min(31)).count_ones()
    }

    /// Returns the value of register TXFQS.
    pub(super) fn fifo_status(&self) -> u32 {
        let size = self.fifo_size();
        let free = size.saturating_sub(self.fifo_fill());
        let dedicated = self.dedicated();
        let put = if self.txbc >> 30 & 1 == 1 {
            (0..size).find(|&i| self.tx.requests >> (dedicated + i) & 1 == 0).unwrap_or(0)
        } else {
            self.tx.put
        };
        let full = u32::from(size > 0 && free == 0);
        free.min(0x3F) | (dedicated + self.tx.get) << 8 | (dedicated + put) << 16 | full << 21
    }
}
