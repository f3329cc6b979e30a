//! Time for which a frame occupies the bus.

use crate::frame::Frame;
use crate::timing::{DATA_BIT_RATE, NOMINAL_BIT_RATE};

const NOMINAL_NS: u32 = 1_000_000_000 / NOMINAL_BIT_RATE;
const DATA_NS: u32 = 1_000_000_000 / DATA_BIT_RATE;

/// Number of nominal bits after the data phase, for acknowledgement, acknowledgement delimiter, end of frame and intermission.
const TAIL_BITS: u32 = 1 + 1 + 7 + 3;
/// Bits of the stuff count with its parity, sent before the checksum.
const STUFF_COUNT_BITS: u32 = 4;
/// Delimiter bit after the checksum. The bit rate rises within the BRS bit and falls within the delimiter bit, at the
/// same fraction of each bit. Both bits together therefore take as long as one nominal bit and one data bit. The code
/// counts the BRS bit as nominal and the delimiter as a data bit.
const CRC_DELIMITER_BITS: u32 = 1;

/// Returns the time from the start of the frame until the next frame may start, in ns, at the rates in [`timing`](crate::timing). The
/// duration of the frame includes the intermission.
///
/// The duration is exact, because it includes the stuff bits of this payload. The duration does not include repetitions and error frames.
pub fn duration_ns(frame: &Frame) -> u32 {
    let mut stuffer = Stuffer::default();
    // The bits before the data phase are start, identifier, RRS, IDE, FDF, reserved and BRS.
    stuffer.push(0, 1);
    stuffer.push(u32::from(frame.id), 11);
    stuffer.push(0b00101, 5);
    let nominal = stuffer.bits + TAIL_BITS;
    let before = stuffer.bits;
    // The data phase begins with ESI and the length code.
    stuffer.push(u32::from(frame.dlc()), 5);
    for byte in frame.data() {
        stuffer.push(u32::from(*byte), 8);
    }
    let crc_bits = STUFF_COUNT_BITS + if frame.data().len() <= 16 { 17 } else { 21 };
    // The sender inserts a fixed stuff bit before the stuff count, and one after every four of the bits that follow.
    let fixed_stuff_bits = 1 + crc_bits / 4;
    let data = stuffer.bits - before + crc_bits + fixed_stuff_bits + CRC_DELIMITER_BITS;
    nominal * NOMINAL_NS + data * DATA_NS
}

/// Counter of the sent bits. After five equal bits, a stuff bit of the opposite value is sent.
#[derive(Default)]
struct Stuffer {
    bits: u32,
    last: Option<bool>,
    run: u32,
}

impl Stuffer {
    fn push(&mut self, value: u32, width: u32) {
        for at in (0..width).rev() {
            // After five equal bits, the sender inserts a stuff bit before the next bit. After the last bit of the payload, the fixed stuff
            // bit replaces this stuff bit.
            if self.run == 5 {
                self.bits += 1;
                self.last = self.last.map(|bit| !bit);
                self.run = 1;
            }
            let bit = value >> at & 1 == 1;
            self.run = if self.last == Some(bit) { self.run + 1 } else { 1 };
            self.last = Some(bit);
            self.bits += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn j10_a_frame_without_stuff_bits() {
        // The frame has 17 + 12 nominal bits. The data bits are ESI, length, 8 bytes, 4 + 17 checksum bits, 6 fixed stuff bits and
        // delimiter.
        let frame = Frame::new(0x555, &[0x55; 8]).unwrap();
        assert_eq!(duration_ns(&frame), 29_000 + (1 + 4 + 64 + 21 + 6 + 1) * 200);
        // A frame of 20 bytes has the longer checksum, with 4 + 21 bits and 7 fixed stuff bits.
        let frame = Frame::new(0x555, &[0x55; 20]).unwrap();
        assert_eq!(duration_ns(&frame), 29_000 + (1 + 4 + 160 + 25 + 7 + 1) * 200);
    }

    #[test]
    fn j10_stuff_bits_are_those_of_the_payload() {
        // The start bit and the identifier are 12 zeros. With RRS and IDE, these are 14 zeros and need two stuff bits. FDF is 1, the
        // reserved bit is 0, and BRS is 1. ESI is 0 and the length is 1010. The last 0 of the length and the 128 zeros of the payload need
        // 25 stuff bits.
        let frame = Frame::new(0x000, &[0; 16]).unwrap();
        assert_eq!(duration_ns(&frame), (29 + 2) * 1_000 + (1 + 4 + 128 + 21 + 6 + 1 + 25) * 200);
    }

    #[test]
    fn j12_move_and_seven_answers_fit_into_a_tick() {
        let worst = |id, len| {
            let frame = |byte| Frame::new(id, &[byte; 24][..len]).unwrap();
            (0..=255).map(|byte| duration_ns(&frame(byte))).max().unwrap()
        };
        let bus = worst(0x000, 16) + (0x200..0x207).map(|id| worst(id, 20)).sum::<u32>();
        assert!((500_000..700_000).contains(&bus), "{bus} ns");
    }
}
