//! DSP_REPORT0..3: presence reports of boards (D-07).

use crate::function::{Function, Sequence};
use crate::profile::ReportMode;

/// Contents of a DSP_REPORT frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Report {
    /// Index of the DSP_REPORT function, 0..3.
    pub k: u8,
    /// Sequence field in the identifier of the report.
    pub id_field: Sequence,
    /// Data byte of the report, which contains the low byte of the flash number and distinguishes boards.
    pub ucom_id: u8,
}

impl Report {
    /// Returns the report of a board in mode `flash7`. This mode uses 128 identifiers, one for each 7-bit flash id.
    pub const fn flash7(flash_number: u16) -> Self {
        Self {
            k: (flash_number >> 5 & 3) as u8,
            id_field: Sequence::low5(flash_number as u8),
            ucom_id: flash_number as u8,
        }
    }

    /// Returns frame `i` (counted from 0) of the report that a board sends in this mode; returns `None` after the
    /// last frame.
    ///
    /// `sequence` is the number of the board. A board without a number uses the number that the profile requires.
    pub const fn nth(mode: ReportMode, i: u8, flash_number: u16, sequence: Sequence) -> Option<Self> {
        let report = Self::flash7(flash_number);
        match mode {
            ReportMode::Flash7 if i == 0 => Some(report),
            ReportMode::Seq if i == 0 => Some(Self { k: 0, id_field: sequence, ..report }),
            ReportMode::All4 if i < 4 => Some(Self { k: i, ..report }),
            _ => None,
        }
    }

    /// Returns `true` if the identifier and the data contain equal flash ids, as mode `flash7` requires.
    pub const fn agrees(&self) -> bool {
        let by_data = Self::flash7(self.ucom_id as u16);
        by_data.k == self.k && by_data.id_field.number() == self.id_field.number()
    }

    /// Returns the function of the report, DSP_REPORT0..3.
    pub const fn function(&self) -> Function {
        match self.k & 3 {
            0 => Function::Report0,
            1 => Function::Report1,
            2 => Function::Report2,
            _ => Function::Report3,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// D-07: each flash id has its own identifier, so all boards can answer one broadcast without collisions.
    #[test]
    fn d07_each_flash_id_has_an_identifier_of_its_own() {
        let id = |flash: u16| {
            let report = Report::flash7(flash);
            report.function().id(report.id_field)
        };
        let ids: BTreeSet<u16> = (0..128).map(id).collect();
        assert_eq!(ids.len(), 128);
        // These are the flash ids of the five boards in the acceptance table of the protocol page.
        let five = [0x21, 0x42, 0x63, 0x04, 0x7F].map(id);
        assert_eq!(five, [0x441, 0x482, 0x4C3, 0x404, 0x4DF]);
        for flash in 0..256 {
            assert!(Report::flash7(flash).agrees());
            assert_eq!(u16::from(Report::flash7(0x1200 | flash).ucom_id), flash);
        }
    }

    #[test]
    fn d07_other_modes() {
        let own = Sequence::new(2).unwrap();
        let all = |mode| (0..8).filter_map(move |i| Report::nth(mode, i, 0x42, own));
        assert_eq!(all(ReportMode::Flash7).count(), 1);
        assert_eq!(all(ReportMode::All4).map(|r| r.k).collect::<std::vec::Vec<_>>(), [0, 1, 2, 3]);
        let seq = all(ReportMode::Seq).collect::<std::vec::Vec<_>>();
        assert_eq!(seq, [Report { k: 0, id_field: own, ucom_id: 0x42 }]);
    }
}
