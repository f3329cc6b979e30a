//! CRC registers that are stored along the receive buffer. The CRC of a candidate of any length needs only two of these registers.
use crate::crc::crc16_update;
use crate::frame::FRAME_MAX;

/// Number of bytes between two stored CRC registers.
const GRID: usize = 64;
/// Number of stored CRC registers.
const REGISTERS: usize = FRAME_MAX.div_ceil(GRID) + 1;

/// CRC registers along the buffer: the register before the first byte, and the registers before the bytes `phase`, `phase + 64`, …
pub(super) struct Registers {
    base: u16,
    last: u16,
    /// Position of the first stored register, 1..=GRID.
    phase: usize,
    count: usize,
    kept: [u16; REGISTERS],
}

impl Registers {
    pub(super) const fn new() -> Self {
        Self { base: 0, last: 0, phase: GRID, count: 0, kept: [0; REGISTERS] }
    }

    /// Computes the registers for `bytes`, which are at `end..` of the buffer.
    pub(super) fn absorb(&mut self, mut end: usize, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            let next = self.phase + self.count * GRID;
            let (piece, rest) = bytes.split_at((next - end).min(bytes.len()));
            self.last = crc16_update(self.last, piece);
            end += piece.len();
            bytes = rest;
            if end == next {
                self.kept[self.count] = self.last;
                self.count += 1;
            }
        }
    }

    pub(super) fn at(&self, at: usize, buffer: &[u8]) -> u16 {
        if at < self.phase {
            crc16_update(self.base, &buffer[..at])
        } else {
            let slot = (at - self.phase) / GRID;
            crc16_update(self.kept[slot], &buffer[self.phase + slot * GRID..at])
        }
    }

    /// Removes the first `by` bytes of the buffer from the stored registers.
    pub(super) fn shift(&mut self, by: usize, buffer: &[u8]) {
        self.base = self.at(by, buffer);
        if by >= self.phase {
            let gone = (by - self.phase) / GRID + 1;
            self.kept.copy_within(gone.min(self.count)..self.count, 0);
            self.count = self.count.saturating_sub(gone);
            self.phase += gone * GRID;
        }
        self.phase -= by;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crc16;
    use proptest::prelude::*;
    use std::vec::Vec;

    /// Generates pieces of bytes. Sometimes bytes are removed from the front of the buffer.
    fn steps() -> impl Strategy<Value = Vec<(Vec<u8>, Option<prop::sample::Index>)>> {
        let piece = prop::collection::vec(any::<u8>(), 0..200);
        prop::collection::vec((piece, any::<Option<prop::sample::Index>>()), 1..12)
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

        /// At every position, the register must equal the register of the complete stream. Fewer than `GRID` bytes must suffice to compute
        /// the register, so the test overwrites the older bytes.
        #[test]
        fn any_register_from_a_few_bytes(steps in steps()) {
            let (mut registers, mut gone, mut held) = (Registers::new(), Vec::new(), Vec::new());
            for (bytes, shift) in steps {
                registers.absorb(held.len(), &bytes);
                held.extend(bytes);
                if let Some(by) = shift {
                    let by = by.index(held.len() + 1);
                    registers.shift(by, &held);
                    gone.extend(held.drain(..by));
                }
                prop_assert!((1..=GRID).contains(&registers.phase));
                for at in 0..=held.len() {
                    let mut buffer = held.clone();
                    buffer[..(at + 1).saturating_sub(GRID)].fill(0xA5);
                    let whole = [&gone[..], &held[..at]].concat();
                    prop_assert_eq!(registers.at(at, &buffer), crc16(&whole), "at {} of {}", at, held.len());
                }
            }
        }
    }
}
