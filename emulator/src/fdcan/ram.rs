//! Message RAM of the FDCAN, with filters, receive buffers, receive FIFOs and transmit buffers (RM0399 56.3.21).
use can_link::{CanFrame, Id};

/// Size of the message RAM in bytes.
pub const SIZE: usize = 10 * 1024;

/// The message RAM.
pub struct MessageRam {
    words: Vec<u32>,
    /// Number of accesses to elements outside the message RAM.
    pub outside: u32,
}

impl Default for MessageRam {
    fn default() -> Self {
        Self { words: vec![0; SIZE / 4], outside: 0 }
    }
}

/// Number of payload bytes for each code of RXESC and TXESC.
pub const ELEMENT_SIZES: [u32; 8] = [8, 12, 16, 20, 24, 32, 48, 64];
/// Number of payload bytes for each data length code (DLC).
const LENGTHS: [usize; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];

/// Destination that the filters select for a received frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// FIFO 0 or 1, with the index of the filter that matched, if any.
    Fifo(usize, Option<u32>),
    /// Dedicated receive buffer.
    Buffer(u32, u32),
    /// Rejection of the frame.
    Reject,
}

impl MessageRam {
    /// Returns the word at a byte offset.
    pub fn read(&self, offset: u32) -> u32 {
        self.words.get(offset as usize / 4).copied().unwrap_or(0)
    }

    /// Replaces the word at a byte offset.
    pub fn write(&mut self, offset: u32, value: u32) {
        match self.words.get_mut(offset as usize / 4) {
            Some(word) => *word = value,
            None => self.outside += 1,
        }
    }

    /// Returns the target of the first standard filter that matches (registers SIDFC and GFC). If `busy` returns `true`
    /// for a receive buffer, the buffer contains unread data, and its filters do not match.
    pub fn standard(&self, id: u32, sidfc: u32, gfc: u32, busy: impl Fn(u32) -> bool) -> Target {
        let start = sidfc & 0xFFFC;
        for index in 0..(sidfc >> 16 & 0xFF) {
            let element = self.read(start + 4 * index);
            let (kind, action) = (element >> 30, element >> 27 & 7);
            let (first, second) = (element >> 16 & 0x7FF, element & 0x7FF);
            if action == 7 {
                let buffer = second & 0x3F;
                if first == id && second >> 9 == 0 && !busy(buffer) {
                    return Target::Buffer(buffer, index);
                }
                continue;
            }
            if action == 0 || !matches(kind, id, first, second) {
                continue;
            }
            if let Some(target) = of_action(action, index) {
                return target;
            }
        }
        unmatched(gfc >> 4)
    }

    /// Like [`standard`](Self::standard), for 29-bit identifiers (registers XIDFC, XIDAM and GFC).
    pub fn extended(&self, id: u32, xidfc: u32, xidam: u32, gfc: u32, busy: impl Fn(u32) -> bool) -> Target {
        let start = xidfc & 0xFFFC;
        for index in 0..(xidfc >> 16 & 0x7F) {
            let (f0, f1) = (self.read(start + 8 * index), self.read(start + 8 * index + 4));
            let (kind, action) = (f1 >> 30, f0 >> 29);
            let (first, second) = (f0 & 0x1FFF_FFFF, f1 & 0x1FFF_FFFF);
            if action == 7 {
                if first == id && second >> 9 & 3 == 0 && !busy(second & 0x3F) {
                    return Target::Buffer(second & 0x3F, index);
                }
                continue;
            }
            let masked = id & xidam;
            let hit = match kind {
                3 => first <= id && id <= second,
                _ => matches(kind, masked, first, second),
            };
            if action != 0
                && hit
                && let Some(target) = of_action(action, index)
            {
                return target;
            }
        }
        unmatched(gfc >> 2)
    }

    /// Stores a received frame in an element that has space for `room` payload bytes.
    pub fn store(&mut self, start: u32, room: u32, frame: &CanFrame, filter: Option<u32>, time: u16) {
        let id = frame.id();
        let r0 = if id.is_extended() { 1 << 30 | id.value() } else { id.value() << 18 };
        let dlc = LENGTHS.iter().position(|&n| n >= frame.len()).unwrap_or(15) as u32;
        let r1 = match filter {
            Some(index) => index << 24,
            None => 1 << 31,
        };
        self.write(start, r0 | u32::from(frame.is_remote()) << 29);
        let flags = u32::from(frame.is_fd()) << 21 | u32::from(frame.is_brs()) << 20;
        self.write(start + 4, r1 | flags | dlc << 16 | u32::from(time));
        for (i, chunk) in frame.data().chunks(4).enumerate().take(room as usize / 4) {
            let mut word = [0; 4];
            word[..chunk.len()].copy_from_slice(chunk);
            self.write(start + 8 + 4 * i as u32, u32::from_le_bytes(word));
        }
    }

    /// Returns the frame of a transmit element that has space for `room` payload bytes. Payload bytes beyond the
    /// element are 0xCC, as in the hardware. `fd` and `brs` are the enable bits of CCCR.
    pub fn load(&self, start: u32, room: u32, fd: bool, brs: bool) -> Option<CanFrame> {
        let (t0, t1) = (self.read(start), self.read(start + 4));
        let id =
            if t0 >> 30 & 1 == 1 { Id::extended(t0 & 0x1FFF_FFFF) } else { Id::standard(t0 >> 18 & 0x7FF) };
        let id = id.ok()?;
        let fd = fd && t1 >> 21 & 1 == 1;
        let length = LENGTHS[(t1 >> 16 & 15) as usize];
        let length = if fd { length } else { length.min(8) };
        let data: Vec<u8> = (0..length as u32)
            .map(|i| if i < room { (self.read(start + 8 + i) >> (8 * (i % 4))) as u8 } else { 0xCC })
            .collect();
        if fd {
            return Some(CanFrame::fd(id, &data).ok()?.with_brs(brs && t1 >> 20 & 1 == 1));
        }
        if t0 >> 29 & 1 == 1 { CanFrame::remote(id, length).ok() } else { CanFrame::classic(id, &data).ok() }
    }
}

fn matches(kind: u32, id: u32, first: u32, second: u32) -> bool {
    match kind {
        0 => first <= id && id <= second,
        1 => id == first || id == second,
        2 => id & second == first & second,
        _ => false,
    }
}

/// Returns the target of a filter action. Returns `None` if the action is only a priority event, which this model does
/// not generate. In this case, the search continues with the next filter.
fn of_action(action: u32, index: u32) -> Option<Target> {
    match action {
        1 | 5 => Some(Target::Fifo(0, Some(index))),
        2 | 6 => Some(Target::Fifo(1, Some(index))),
        3 => Some(Target::Reject),
        _ => None,
    }
}

fn unmatched(bits: u32) -> Target {
    match bits & 3 {
        0 => Target::Fifo(0, None),
        1 => Target::Fifo(1, None),
        _ => Target::Reject,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filter(kind: u32, action: u32, first: u32, second: u32) -> MessageRam {
        let mut ram = MessageRam::default();
        ram.write(0x40, kind << 30 | action << 27 | first << 16 | second);
        ram
    }

    fn target(ram: &MessageRam, id: u32) -> Target {
        ram.standard(id, 0x40 | 1 << 16, 0x20, |_| false)
    }

    #[test]
    fn standard_filters_of_every_type() {
        let fifo = Target::Fifo(1, Some(0));
        let range = filter(0, 2, 0x200, 0x206);
        let dual = filter(1, 2, 0x200, 0x206);
        let mask = filter(2, 2, 0x200, 0x7F0);
        for (id, by_range, by_dual, by_mask) in [
            (0x1FF, false, false, false),
            (0x200, true, true, true),
            (0x203, true, false, true),
            (0x206, true, true, true),
            (0x207, false, false, true),
            (0x210, false, false, false),
        ] {
            let expect = |hit| if hit { fifo } else { Target::Reject };
            assert_eq!(target(&range, id), expect(by_range), "range {id:x}");
            assert_eq!(target(&dual, id), expect(by_dual), "dual {id:x}");
            assert_eq!(target(&mask, id), expect(by_mask), "mask {id:x}");
            assert_eq!(target(&filter(3, 2, 0x200, 0x206), id), Target::Reject, "disabled {id:x}");
        }
        assert_eq!(target(&filter(0, 3, 0, 0x7FF), 5), Target::Reject);
    }

    #[test]
    fn a_buffer_with_new_data_does_not_match() {
        let ram = filter(0, 7, 0x2F3, 17);
        assert_eq!(target(&ram, 0x2F3), Target::Buffer(17, 0));
        assert_eq!(target(&ram, 0x2F4), Target::Reject);
        assert_eq!(ram.standard(0x2F3, 0x40 | 1 << 16, 0x20, |b| b == 17), Target::Reject);
    }

    #[test]
    fn what_matches_nothing_goes_where_gfc_says() {
        let ram = MessageRam::default();
        assert_eq!(ram.standard(1, 0, 0x00, |_| false), Target::Fifo(0, None));
        assert_eq!(ram.standard(1, 0, 0x10, |_| false), Target::Fifo(1, None));
        assert_eq!(ram.extended(1, 0, 0, 0x08, |_| false), Target::Reject);
    }

    #[test]
    fn elements_survive_both_ways() {
        let mut ram = MessageRam::default();
        let frame = CanFrame::fd(Id::standard(0x2A5).unwrap(), &[7; 20]).unwrap();
        ram.store(0x100, 24, &frame, Some(3), 0);
        assert_eq!(ram.read(0x100) >> 18, 0x2A5);
        assert_eq!(ram.read(0x104) >> 24, 3);
        assert_eq!(ram.load(0x100, 24, true, true), Some(frame));
    }
}
