//! Whether boards send the bytes of a word in the other order than the profile has (D-10): what shows without asking more.
use super::BoardSeen;
use super::scan::Reports;
use ucom::profile::Endian;

/// Words for boards that send the bytes of a word in the other order than the profile has.
pub(crate) fn other_order(endian: Endian) -> String {
    let (here, there) = match endian {
        Endian::Little => ("little", "big"),
        Endian::Big => ("big", "little"),
    };
    format!(
        "wrong byte order: the flash numbers fit the reports only with their bytes exchanged, so the boards send words as \
         {there}-endian, and the profile has `endian = \"{here}\"`: `ucom probe --out FILE` measures it and writes a profile"
    )
}

/// Whether the boards' flash numbers fit the reports only with their bytes exchanged. A report is one byte: no order changes it.
pub(crate) fn exchanged(reports: &Reports, boards: &[BoardSeen]) -> bool {
    let fits = |byte: u16| reports.ids.contains(&(byte as u8));
    let only_exchanged = |b: &BoardSeen| !fits(b.info.flash_number) && fits(b.info.flash_number >> 8);
    let [high, low] = [|b: &BoardSeen| b.info.flash_number >> 8, |b: &BoardSeen| b.info.flash_number & 0xFF];
    boards.iter().any(only_exchanged) && boards.iter().all(|b| only_exchanged(b) || high(b) == low(b))
}
