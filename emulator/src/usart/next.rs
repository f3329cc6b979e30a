//! Computes the time of the next event of a serial port.
use super::bits::cr1;
use super::{DMAR, DMAT, LOOK_AHEAD, Usart};
use crate::clock::{NEVER, Time};
use crate::dma::Dma;

impl Usart {
    /// Returns the time of the next event of the serial port that causes an interrupt.
    pub fn next_event(&self, dma: &Dma) -> Time {
        self.next_receive(dma).min(self.next_send(dma))
    }

    fn next_receive(&self, dma: &Dma) -> Time {
        if !self.on(cr1::RE) {
            return NEVER;
        }
        let frame = self.frame();
        let idle_on = self.cr1 & cr1::IDLEIE != 0;
        let silent = |from: Time| {
            let idle = if idle_on { from.saturating_add(frame) } else { NEVER };
            let timeout =
                if self.cr1 & cr1::RTOIE != 0 { from.saturating_add(self.timeout()) } else { NEVER };
            idle.min(timeout)
        };
        let Some(first) = self.rx_wire.front() else {
            // An idle line and a timeout are events only if their interrupts are enabled. Otherwise, their times
            // could be in the past, and the machine would check for these events in every cycle.
            let idle = self.idle_from.filter(|_| idle_on).map_or(NEVER, |from| from.saturating_add(frame));
            let timeout = self.timeout_from.filter(|_| self.cr1 & cr1::RTOIE != 0);
            return idle.min(timeout.map_or(NEVER, |from| from.saturating_add(self.timeout())));
        };
        let byte_by_byte = self.cr1 & cr1::RXNEIE != 0 || self.cr3 & DMAR == 0 || !self.rates_match();
        if byte_by_byte {
            let idle = self.idle_from.map_or(NEVER, silent);
            return first.end.min(idle);
        }
        let until = dma
            .serving(self.rx_request)
            .and_then(|s| dma.until_interrupt(s))
            .map_or(LOOK_AHEAD, |n| (n as usize).min(LOOK_AHEAD));
        let mut before = self.idle_from;
        for (i, byte) in self.rx_wire.iter().enumerate() {
            if let Some(from) = before {
                let quiet = silent(from);
                if quiet <= byte.end.saturating_sub(frame) {
                    return quiet;
                }
            }
            if i + 1 >= until {
                return byte.end;
            }
            before = Some(byte.end);
        }
        before.map_or(NEVER, silent)
    }

    fn next_send(&self, dma: &Dma) -> Time {
        let Some(shifting) = self.shifting else { return NEVER };
        let frame = self.frame();
        let mut next = NEVER;
        if self.cr1 & cr1::TXEIE != 0 {
            next = shifting.end;
        }
        let stream = if self.cr3 & DMAT != 0 { dma.serving(self.tx_request) } else { None };
        if let Some(transfers) = stream.and_then(|s| dma.until_interrupt(s)) {
            next = next.min(shifting.end + u64::from(transfers.max(1) - 1) * frame);
        }
        if self.cr1 & cr1::TCIE != 0 {
            next = next.min(shifting.end + self.tx_fifo.len() as u64 * frame);
        }
        next
    }
}
