//! The USART registers that the core accesses, and the interrupt line that the registers control.
use super::bits::{cr1, isr};
use super::{FIFO, Usart};
use crate::clock::Time;
use crate::dma::{Dma, Memory};

const EIE: u32 = 1;

impl Usart {
    fn status(&self) -> u32 {
        let fifo = self.cr1 & cr1::FIFOEN != 0;
        let depth = if fifo { FIFO } else { 1 };
        let bit = |condition: bool, mask: u32| if condition { mask } else { 0 };
        self.flags & !isr::TC
            | bit(self.flags & isr::TC != 0 && self.shifting.is_none() && self.tx_fifo.is_empty(), isr::TC)
            | bit(!self.rx_fifo.is_empty(), isr::RXNE)
            | bit(self.tx_fifo.len() < depth, isr::TXE)
            | bit(fifo && self.tx_fifo.is_empty(), isr::TXFE)
            | bit(fifo && self.rx_fifo.len() >= FIFO, isr::RXFF)
            | bit(self.on(cr1::TE), isr::TEACK)
            | bit(self.on(cr1::RE), isr::REACK)
            | bit(self.idle_from.is_some() && !self.rx_wire.is_empty(), isr::BUSY)
    }

    /// Returns the level of the interrupt line of the USART.
    pub fn line(&self) -> bool {
        let status = self.status();
        let pairs = [
            (cr1::IDLEIE, isr::IDLE),
            (cr1::RXNEIE, isr::RXNE | isr::ORE),
            (cr1::TCIE, isr::TC),
            (cr1::TXEIE, isr::TXE),
            (cr1::RTOIE, isr::RTOF),
        ];
        self.cr1 & cr1::UE != 0
            && (pairs.iter().any(|&(enable, flag)| self.cr1 & enable != 0 && status & flag != 0)
                || self.cr3 & EIE != 0 && status & (isr::FE | isr::NE | isr::ORE) != 0)
    }

    /// Reads a register of the USART.
    pub fn read(&mut self, offset: u32, now: Time, dma: &mut Dma, memory: &mut dyn Memory) -> u32 {
        self.advance(now, dma, memory);
        match offset {
            0x00 => self.cr1,
            0x04 => self.cr2,
            0x08 => self.cr3,
            0x0C => self.brr,
            0x10 => self.gtpr,
            0x14 => self.rtor,
            0x1C => self.status(),
            0x24 => {
                if let Some(byte) = self.rx_fifo.pop_front() {
                    self.last_rdr = byte;
                }
                u32::from(self.last_rdr)
            }
            0x2C => self.presc,
            _ => 0,
        }
    }

    /// Writes a register of the USART.
    pub fn write(&mut self, offset: u32, value: u32, now: Time, dma: &mut Dma, memory: &mut dyn Memory) {
        self.advance(now, dma, memory);
        match offset {
            0x00 => {
                self.cr1 = value;
                if value & cr1::UE == 0 {
                    self.flags = isr::TC;
                    self.rx_fifo.clear();
                    self.tx_fifo.clear();
                    (self.idle_from, self.timeout_from) = (None, None);
                }
            }
            0x04 => self.cr2 = value,
            0x08 => self.cr3 = value,
            0x0C => self.brr = value & 0xFFFF,
            0x10 => self.gtpr = value,
            0x14 => self.rtor = value,
            0x18 => {
                if value & 8 != 0 {
                    self.rx_fifo.clear();
                }
                if value & 16 != 0 {
                    self.tx_fifo.clear();
                }
            }
            0x20 => self.flags &= !(value & isr::STICKY),
            0x28 => {
                self.flags &= !isr::TC;
                self.tx_fifo.push_back(value as u8);
            }
            0x2C => self.presc = value,
            _ => {}
        }
        self.update_bit();
        self.advance(now, dma, memory);
    }
}
