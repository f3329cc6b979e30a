//! First frames of DSP_INFO and of the IO description, in which a board describes itself.

use crate::frame::Payload;
use crate::profile::Endian;
use crate::status::Status;

/// First frame of DSP_INFO. The description of the board follows as a string.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct BoardInfo {
    /// Number chosen when the bootloader was flashed; the low byte of this number is the UCoM id (D-07).
    pub flash_number: u16,
    /// Sequence number that the board reports.
    pub sequence: u8,
    /// Status byte of the board.
    pub status: Status,
    /// Checksum of the application (D-44); 0xFFFF if the board has no application.
    pub program_id: u16,
    /// Date of the application as a number (D-45); 0xFFFF if the board has no application.
    pub date: u16,
}

impl BoardInfo {
    /// Returns `true` if the board reports that it has an application.
    pub const fn has_application(&self) -> bool {
        !(self.program_id == 0xFFFF && self.date == 0xFFFF)
    }

    /// Returns the 8 data bytes of the first frame of DSP_INFO.
    pub const fn payload(&self, endian: Endian) -> Payload {
        let [f0, f1] = endian.bytes(self.flash_number);
        let [p0, p1] = endian.bytes(self.program_id);
        let [d0, d1] = endian.bytes(self.date);
        Payload::of([f0, f1, self.sequence, self.status.0, p0, p1, d0, d1], 8)
    }

    /// Reads the values from the first frame of DSP_INFO. Returns `None` if the payload has fewer than 8 bytes.
    pub fn parse(payload: &Payload, endian: Endian) -> Option<Self> {
        let &[f0, f1, sequence, status, p0, p1, d0, d1] = payload.bytes() else { return None };
        Some(Self {
            flash_number: endian.word([f0, f1]),
            sequence,
            status: Status(status),
            program_id: endian.word([p0, p1]),
            date: endian.word([d0, d1]),
        })
    }
}

/// First frame of the IO description, which contains the numbers of inputs, outputs and parameters (D-36).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Dimensions {
    /// Number of controller inputs.
    pub ci: u16,
    /// Number of sensor outputs.
    pub so: u16,
    /// Number of parameters.
    pub par: u16,
}

impl Dimensions {
    /// Returns the 6 data bytes of the first frame of the IO description.
    pub const fn payload(&self, endian: Endian) -> Payload {
        let [c0, c1] = endian.bytes(self.ci);
        let [s0, s1] = endian.bytes(self.so);
        let [p0, p1] = endian.bytes(self.par);
        Payload::of([c0, c1, s0, s1, p0, p1, 0, 0], 6)
    }

    /// Reads the dimensions from the first frame of the IO description. Returns `None` if the payload has fewer than 6 bytes; surplus bytes
    /// are ignored (D-12).
    pub fn parse(payload: &Payload, endian: Endian) -> Option<Self> {
        let &[c0, c1, s0, s1, p0, p1, ..] = payload.bytes() else { return None };
        Some(Self { ci: endian.word([c0, c1]), so: endian.word([s0, s1]), par: endian.word([p0, p1]) })
    }

    /// Returns the number of strings in a complete IO description (one for the application and one for each signal).
    pub const fn strings(&self) -> u32 {
        1 + self.ci as u32 + self.so as u32 + self.par as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// D-10: the first DSP_INFO frame of the example board decodes to the same values in both byte orders.
    #[test]
    fn d10_info_in_both_orders() {
        let info = BoardInfo {
            flash_number: 0x0021,
            sequence: 1,
            status: Status(0x19),
            program_id: 0x1234,
            date: 0x386E,
        };
        let little = [0x21, 0x00, 0x01, 0x19, 0x34, 0x12, 0x6E, 0x38];
        assert_eq!(info.payload(Endian::Little).bytes(), little);
        let big = [0x00, 0x21, 0x01, 0x19, 0x12, 0x34, 0x38, 0x6E];
        assert_eq!(info.payload(Endian::Big).bytes(), big);
        for endian in [Endian::Little, Endian::Big] {
            assert_eq!(BoardInfo::parse(&info.payload(endian), endian), Some(info));
        }
        assert_eq!(BoardInfo::parse(&Payload::new(&little[..7]).unwrap(), Endian::Little), None);
    }

    #[test]
    fn d36_dimensions_in_both_orders() {
        let dimensions = Dimensions { ci: 2, so: 4, par: 3 };
        assert_eq!(dimensions.payload(Endian::Little).bytes(), [2, 0, 4, 0, 3, 0]);
        assert_eq!(dimensions.payload(Endian::Big).bytes(), [0, 2, 0, 4, 0, 3]);
        assert_eq!(dimensions.strings(), 10);
        let padded = Payload::new(&[2, 0, 4, 0, 3, 0, 0, 0]).unwrap();
        assert_eq!(Dimensions::parse(&padded, Endian::Little), Some(dimensions));
        assert_eq!(Dimensions::parse(&Payload::new(&[2, 0, 4, 0, 3]).unwrap(), Endian::Little), None);
    }

    #[test]
    fn d45_no_application_is_both_ffff() {
        let mut info = BoardInfo {
            flash_number: 1,
            sequence: 1,
            status: Status(0x19),
            program_id: 0xFFFF,
            date: 0xFFFF,
        };
        assert!(!info.has_application());
        info.date = 0;
        assert!(info.has_application());
    }
}
