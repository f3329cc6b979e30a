//! Classic frames as bits on the bus (ISO 11898-1), with their arbitration key, stuff bits and length.

use crate::CanFrame;

/// A dominant bit wins against a recessive bit.
pub(crate) const DOMINANT: bool = false;
const RECESSIVE: bool = true;

/// Bits after the CRC: CRC delimiter, acknowledge slot, acknowledge delimiter, and end of frame.
const TAIL: u32 = 1 + 1 + 1 + 7;
/// Number of bits from the end of the CRC to the end of the acknowledge slot.
pub(crate) const TO_ACKNOWLEDGE: u32 = 2;
/// Number of bits of the intermission between two frames.
pub(crate) const INTERMISSION: u32 = 3;
/// Longest error frame in bits: an error flag (6), the error flags of the other members (6), and the delimiter (8).
pub(crate) const ERROR_FRAME: u32 = 6 + 6 + 8;
/// Bits that an error passive member waits after the intermission that follows its own frame.
pub(crate) const SUSPENDED: u32 = 8;
/// Number of consecutive recessive bits in one sequence of the recovery from bus-off. The next constant is the number
/// of such sequences that a bus-off controller needs.
pub(crate) const RECESSIVE_RUN: u32 = 11;
pub(crate) const RECOVERIES: u32 = 128;

/// Largest number of bits from the start of a frame to the end of its CRC, for a 29-bit identifier and 8 bytes: 118
/// bits and 29 stuff bits.
const MOST: usize = 147;

/// The bits from start of frame to CRC, with stuff bits.
#[derive(Clone, Copy)]
pub(crate) struct WireBits {
    bits: [bool; MOST],
    len: usize,
}

impl WireBits {
    /// Returns the bits of a frame, or `None` for CAN FD.
    pub(crate) fn of(frame: &CanFrame) -> Option<Self> {
        if frame.is_fd() {
            return None;
        }
        let mut writer =
            Writer { out: Self { bits: [DOMINANT; MOST], len: 0 }, crc: 0, same: 0, last: RECESSIVE };
        writer.put(0, 1);
        let value = frame.id().value();
        if frame.is_extended() {
            writer.put(value >> 18, 11);
            // Substitute remote request bit and identifier extension bit.
            writer.put(0b11, 2);
            writer.put(value & 0x3_FFFF, 18);
            writer.put(u32::from(frame.is_remote()), 1);
            writer.put(0, 2);
        } else {
            writer.put(value, 11);
            writer.put(u32::from(frame.is_remote()), 1);
            writer.put(0, 2);
        }
        writer.put(frame.len() as u32, 4);
        for byte in frame.data() {
            writer.put(u32::from(*byte), 8);
        }
        let crc = writer.crc;
        writer.put(u32::from(crc), 15);
        Some(writer.out)
    }

    pub(crate) fn bits(&self) -> &[bool] {
        &self.bits[..self.len]
    }
}

struct Writer {
    out: WireBits,
    crc: u16,
    /// Number of consecutive equal bits so far.
    same: u32,
    last: bool,
}

impl Writer {
    fn put(&mut self, value: u32, count: u32) {
        for at in (0..count).rev() {
            let bit = value >> at & 1 != 0;
            self.crc = crc15(self.crc, bit);
            self.emit(bit);
            if self.same == 5 {
                self.emit(!bit);
            }
        }
    }

    fn emit(&mut self, bit: bool) {
        self.same = if bit == self.last { self.same + 1 } else { 1 };
        self.last = bit;
        self.out.bits[self.out.len] = bit;
        self.out.len += 1;
    }
}

fn crc15(crc: u16, bit: bool) -> u16 {
    let out = (crc >> 14 & 1 != 0) != bit;
    (crc << 1 ^ if out { 0x4599 } else { 0 }) & 0x7FFF
}

/// Returns the arbitration key of a frame. The frame with the lowest key wins. Frames with equal keys do not lose
/// arbitration against each other.
///
/// The key begins with the base identifier. The next bit is the remote bit of an 11-bit frame, or the recessive
/// substitute bit of a 29-bit frame.
pub(crate) fn arbitration(frame: &CanFrame) -> u32 {
    let (value, remote) = (frame.id().value(), u32::from(frame.is_remote()));
    if frame.is_extended() {
        (value >> 18) << 21 | 0b11 << 19 | (value & 0x3_FFFF) << 1 | remote
    } else {
        value << 21 | remote << 20
    }
}

/// Returns the exact length of a classic frame on the bus in bits, or `None` for CAN FD. The length includes stuff
/// bits and the three bits of intermission.
///
/// A bus is fully loaded if the frame lengths of one second add up to the bit rate.
pub fn classic_frame_bits(frame: &CanFrame) -> Option<u32> {
    WireBits::of(frame).map(|bits| bits.bits().len() as u32 + TAIL + INTERMISSION)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Id;
    use proptest::prelude::*;

    fn any_classic() -> impl Strategy<Value = CanFrame> {
        let id = prop_oneof![
            (0..0x800_u32).prop_map(|id| Id::standard(id).unwrap()),
            (0..0x2000_0000_u32).prop_map(|id| Id::extended(id).unwrap()),
        ];
        // The generated payloads contain more groups of equal bits, which need stuff bits, than random bytes do.
        let byte = prop_oneof![any::<u8>(), Just(0), Just(0xFF), Just(0x0F), Just(0xF0)];
        (id, prop::collection::vec(byte, 0..=8), any::<bool>()).prop_map(|(id, data, remote)| match remote {
            true => CanFrame::remote(id, data.len()).unwrap(),
            false => CanFrame::classic(id, &data).unwrap(),
        })
    }

    fn number(bits: &[bool]) -> u32 {
        bits.iter().fold(0, |sum, bit| sum << 1 | u32::from(*bit))
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

        /// Compares the CRC with an independent implementation, and reads the fields at the positions that the
        /// standard defines.
        #[test]
        fn fields_stand_where_the_standard_has_them(frame in any_classic()) {
            let wire = WireBits::of(&frame).unwrap();
            let mut run = 0;
            for pair in wire.bits().windows(2) {
                run = if pair[0] == pair[1] { run + 1 } else { 0 };
                prop_assert!(run < 5, "never six alike");
            }
            // The stuff bit of the last group of equal bits can follow the CRC.
            let mut logical = destuff(wire.bits());
            let crc = logical.split_off(logical.len() - 15);
            // Leading zeros do not change a CRC that starts at 0.
            let mut padded = vec![false; (8 - logical.len() % 8) % 8];
            padded.extend(&logical);
            let bytes: Vec<u8> = padded.chunks(8).map(|byte| number(byte) as u8).collect();
            let reference = crc::Crc::<u16>::new(&crc::CRC_15_CAN).checksum(&bytes);
            prop_assert_eq!(number(&crc), u32::from(reference));
            let remote = frame.is_remote();
            let (id, control) = if frame.is_extended() {
                prop_assert_eq!(&logical[12..14], &[true, true]);
                prop_assert_eq!(logical[32], remote);
                (number(&logical[1..12]) << 18 | number(&logical[14..32]), 33)
            } else {
                prop_assert_eq!(logical[12], remote);
                (number(&logical[1..12]), 13)
            };
            prop_assert_eq!(id, frame.id().value());
            prop_assert_eq!(number(&logical[control..control + 2]), 0);
            prop_assert_eq!(number(&logical[control + 2..control + 6]), frame.len() as u32);
            let data: Vec<u8> = logical[control + 6..].chunks(8).map(|byte| number(byte) as u8).collect();
            prop_assert_eq!(&data[..], frame.data());
        }

        /// A bus arbitrates bit by bit; the keys must produce the same order of frames.
        #[test]
        fn keys_order_frames_as_the_wire_does(a in any_classic(), b in any_classic(), near in any::<bool>()) {
            // Frames with equal base identifiers are the most critical case.
            let b = if near { with_base_of(&a, &b) } else { b };
            let (wa, wb) = (WireBits::of(&a).unwrap(), WireBits::of(&b).unwrap());
            let first = wa.bits().iter().zip(wb.bits()).find(|(a, b)| a != b);
            match arbitration(&a).cmp(&arbitration(&b)) {
                std::cmp::Ordering::Equal => prop_assert_eq!(a.id(), b.id()),
                order => {
                    let wins = if *first.unwrap().0 == DOMINANT {
                        std::cmp::Ordering::Less
                    } else {
                        std::cmp::Ordering::Greater
                    };
                    prop_assert_eq!(order, wins);
                }
            }
        }
    }

    fn with_base_of(a: &CanFrame, b: &CanFrame) -> CanFrame {
        let base = if a.is_extended() { a.id().value() >> 18 } else { a.id().value() };
        let id = match b.is_extended() {
            true => Id::extended(base << 18 | b.id().value() & 0x3_FFFF),
            false => Id::standard(base),
        };
        match b.is_remote() {
            true => CanFrame::remote(id.unwrap(), b.len()).unwrap(),
            false => CanFrame::classic(id.unwrap(), b.data()).unwrap(),
        }
    }

    /// Removes stuff bits like a receiver: drops the bit after five equal bits.
    fn destuff(bits: &[bool]) -> Vec<bool> {
        let (mut found, mut run, mut last, mut skip) = (Vec::new(), 0, None, false);
        for bit in bits {
            run = if last == Some(*bit) { run + 1 } else { 1 };
            last = Some(*bit);
            if !skip {
                found.push(*bit);
            }
            skip = run == 5;
        }
        found
    }

    /// Known lengths of frames with 8 bytes, including intermission. Without stuff bits: 111 bits (11-bit identifier)
    /// and 131 bits (29-bit identifier). With stuff bits: at most 135 and 160 bits.
    #[test]
    fn lengths_lie_between_the_known_bounds() {
        let bits = |frame| classic_frame_bits(&frame).unwrap();
        let standard = Id::standard(0x555).unwrap();
        let extended = Id::extended(0x1555_5555).unwrap();
        let alternating = [0x55; 8];
        assert!((111..=115).contains(&bits(CanFrame::classic(standard, &alternating).unwrap())));
        assert!((131..=136).contains(&bits(CanFrame::classic(extended, &alternating).unwrap())));
        let mut longest = [0, 0];
        let mut random = fastrand::Rng::with_seed(1);
        for _ in 0..20_000 {
            let mut data = [0x0F, 0x87, 0xC3, 0xE1, 0xF0, 0x78, 0x3C, 0x1E];
            data[7] = random.u8(..);
            data[6] = random.u8(..);
            let id = Id::standard(random.u32(0..0x800)).unwrap();
            longest[0] = longest[0].max(bits(CanFrame::classic(id, &data).unwrap()));
            let id = Id::extended(random.u32(0..0x2000_0000)).unwrap();
            longest[1] = longest[1].max(bits(CanFrame::classic(id, &data).unwrap()));
        }
        assert!((125..=135).contains(&longest[0]) && (145..=160).contains(&longest[1]), "{longest:?}");
        assert_eq!(classic_frame_bits(&CanFrame::fd(standard, &[]).unwrap()), None);
    }
}
