//! Extended interrupt and event controller (RM0399, EXTI and SYSCFG_EXTICR1..4). This module models EXTI only for pins.
//! The edges of a pin set pending bits. A pending bit remains set until the program writes a 1 to it.

/// Number of EXTI lines that pins can use.
const LINES: usize = 16;

/// Registers of EXTI lines 0..15 for core 1.
#[derive(Clone, Debug, Default)]
pub struct Exti {
    rtsr: u32,
    ftsr: u32,
    /// Interrupt mask of core 1. In this model, a masked EXTI line does not set its pending bit, which is the stricter
    /// of two interpretations of the manual.
    imr: u32,
    emr: u32,
    pending: u32,
    exticr: [u32; 4],
}

impl Exti {
    /// Reads a register of EXTI.
    pub fn read(&self, offset: u32) -> u32 {
        match offset {
            0x00 => self.rtsr,
            0x04 => self.ftsr,
            0x80 => self.imr,
            0x84 => self.emr,
            0x88 => self.pending,
            _ => 0,
        }
    }

    /// Writes a register of EXTI.
    pub fn write(&mut self, offset: u32, value: u32) {
        match offset {
            0x00 => self.rtsr = value,
            0x04 => self.ftsr = value,
            0x80 => self.imr = value,
            0x84 => self.emr = value,
            // Writing 1 clears a pending bit.
            0x88 => self.pending &= !value,
            _ => {}
        }
    }

    /// Reads SYSCFG_EXTICR1..4; `n` is 0..3.
    pub fn source(&self, n: usize) -> u32 {
        self.exticr.get(n).copied().unwrap_or(0)
    }

    /// Writes SYSCFG_EXTICR1..4; `n` is 0..3.
    pub fn set_source(&mut self, n: usize, value: u32) {
        if let Some(register) = self.exticr.get_mut(n) {
            *register = value & 0xFFFF;
        }
    }

    /// Sets the pending bits for the edges between two sets of pin levels of a port. Port 0 is port A.
    pub fn edges(&mut self, port: usize, before: u32, after: u32) {
        let falling = before & !after & self.ftsr;
        let rising = after & !before & self.rtsr;
        for line in 0..LINES {
            let selected = self.exticr[line / 4] >> (4 * (line % 4)) & 0xF;
            if selected as usize == port {
                self.pending |= (falling | rising) & self.imr & 1 << line;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_falling_edge_stays_pending_until_a_1_is_written() {
        let mut exti = Exti::default();
        // Connects EXTI line 3 to port D.
        exti.set_source(0, 3 << 12);
        exti.write(0x04, 1 << 3);
        exti.edges(3, 1 << 3, 0);
        assert_eq!(exti.read(0x88), 0, "masked");
        exti.write(0x80, 1 << 3);
        exti.edges(2, 1 << 3, 0);
        exti.edges(3, 1 << 4, 0);
        exti.edges(3, 0, 1 << 3);
        assert_eq!(exti.read(0x88), 0, "another port, another pin, the other edge");
        exti.edges(3, 1 << 3, 0);
        exti.edges(3, 0, 1 << 3);
        exti.write(0x88, 0xFFF7);
        assert_eq!(exti.read(0x88), 1 << 3);
        exti.write(0x88, 1 << 3);
        assert_eq!(exti.read(0x88), 0);
    }
}
