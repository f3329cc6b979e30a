//! The registers of FDCAN1, at address 0x4000_A000.
use super::{Fdcan, Fifo, INTEGRATION, RECOVERY, cccr, lec};
use crate::clock::{NEVER, Time};
use crate::fdcan::pending::Pending;

impl Fdcan {
    /// Reads a register of FDCAN1.
    pub fn read(&mut self, offset: u32, now: Time) -> u32 {
        self.advance(now);
        match offset {
            0x00 => 0x3214_1218,
            0x04 => 0x8765_4321,
            0x0C => self.dbtp,
            0x18 => self.cccr,
            0x1C => self.nbtp,
            0x40 => self.tec.min(255) | self.rec.min(127) << 8 | u32::from(self.rec > 127) << 15,
            0x44 => {
                let activity = match (self.takes_part(), self.wire.busy(), self.wire.sending()) {
                    (NEVER, ..) => 0,
                    (_, false, _) => 1,
                    (_, true, None) => 2,
                    (_, true, Some(_)) => 3,
                };
                let value = self.psr & !0x18 | activity << 3;
                // A read of PSR sets the last error codes to "unchanged" and clears the receive flags.
                self.psr = self.psr & !0x7807 | lec::UNCHANGED;
                self.psr = self.psr & !0x700 | lec::UNCHANGED << 8;
                value
            }
            0x48 => self.tdcr,
            0x50 => self.ir,
            0x54 => self.ie,
            0x58 => self.ils,
            0x5C => self.ile,
            0x80 => self.gfc,
            0x84 => self.sidfc,
            0x88 => self.xidfc,
            0x90 => self.xidam,
            0x98 | 0x9C => self.ndat[(offset as usize - 0x98) / 4],
            0xA0 => self.fifos[0].config,
            0xA4 => self.fifos[0].status(),
            0xAC => self.rxbc,
            0xB0 => self.fifos[1].config,
            0xB4 => self.fifos[1].status(),
            0xBC => self.rxesc,
            0xC0 => self.txbc,
            0xC4 => self.fifo_status(),
            0xC8 => self.txesc,
            0xCC => self.tx.requests,
            0xD4 => self.tx.cancel,
            0xD8 => self.tx.sent,
            0xDC => self.tx.cancelled,
            0xE0 => self.txbtie,
            0xE4 => self.txbcie,
            _ => self.plain.read(offset),
        }
    }

    /// Writes a register of FDCAN1.
    pub fn write(&mut self, offset: u32, value: u32, now: Time) {
        self.advance(now);
        let open = self.cccr & (cccr::INIT | cccr::CCE) == cccr::INIT | cccr::CCE;
        match offset {
            0x0C if open => self.dbtp = value,
            0x18 => self.write_cccr(value, now),
            0x1C if open => self.nbtp = value,
            0x48 if open => self.tdcr = value,
            0x50 => self.ir &= !value,
            0x54 => self.ie = value,
            0x58 => self.ils = value,
            0x5C => self.ile = value,
            0x80 if open => self.gfc = value,
            0x84 if open => self.sidfc = value,
            0x88 if open => self.xidfc = value,
            0x90 if open => self.xidam = value,
            // Writing a 1 clears a new-data flag.
            0x98 | 0x9C => self.ndat[(offset as usize - 0x98) / 4] &= !value,
            0xA0 if open => self.fifos[0].config = value,
            0xA8 => self.fifos[0].acknowledge(value),
            0xAC if open => self.rxbc = value,
            0xB0 if open => self.fifos[1].config = value,
            0xB8 => self.fifos[1].acknowledge(value),
            0xBC if open => self.rxesc = value,
            0xC0 if open => self.txbc = value,
            0xC8 if open => self.txesc = value,
            0xD0 => self.request(value, now),
            0xD4 => self.cancel(value),
            0xE0 => self.txbtie = value,
            0xE4 => self.txbcie = value,
            0x0C | 0x1C | 0x48 | 0x80..=0x90 | 0xA0 | 0xAC | 0xB0 | 0xBC | 0xC0 | 0xC8 => {}
            _ => self.plain.write(offset, value),
        }
        self.advance(now);
    }

    fn write_cccr(&mut self, value: u32, now: Time) {
        let before = self.cccr;
        let open = before & (cccr::INIT | cccr::CCE) == cccr::INIT | cccr::CCE;
        let mut next = before;
        next = next & !(cccr::INIT | cccr::CSR | 0x8) | value & (cccr::INIT | cccr::CSR);
        // CCE can be set only while INIT is set, and is cleared together with INIT.
        next = next & !cccr::CCE | if before & cccr::INIT != 0 { value & cccr::CCE } else { 0 };
        if next & cccr::INIT == 0 {
            next &= !cccr::CCE;
        }
        if open {
            next = next & !cccr::PROTECTED | value & cccr::PROTECTED;
            next = next & !4 | value & 4;
        }
        // The controller acknowledges a clock stop request at once.
        next |= (value & cccr::CSR) >> 1;
        self.cccr = next;
        if next & cccr::CCE != 0 && before & cccr::CCE == 0 {
            for fifo in &mut self.fifos {
                *fifo = Fifo { config: fifo.config, ..Fifo::default() };
            }
            self.tx = Pending::default();
        }
        let (was, is) = (before & cccr::INIT != 0, next & cccr::INIT != 0);
        if was && !is {
            if self.psr & 0x80 != 0 {
                self.recovers = now + RECOVERY;
            } else {
                self.online = now + INTEGRATION;
            }
        }
        if is && !was {
            self.online = NEVER;
            self.recovers = NEVER;
            self.wire.drop_controller();
        }
    }
}

impl Fifo {
    fn status(&self) -> u32 {
        let size = self.config >> 16 & 0x7F;
        self.fill
            | self.get << 8
            | self.put << 16
            | u32::from(size > 0 && self.fill == size) << 24
            | u32::from(self.lost) << 25
    }

    fn acknowledge(&mut self, index: u32) {
        let size = (self.config >> 16 & 0x7F).min(64);
        if size == 0 || self.fill == 0 {
            return;
        }
        // All FIFO elements up to the acknowledged element become free.
        let freed = (index + size - self.get) % size + 1;
        self.fill = self.fill.saturating_sub(freed);
        self.get = (index + 1) % size;
        self.lost = false;
    }
}
