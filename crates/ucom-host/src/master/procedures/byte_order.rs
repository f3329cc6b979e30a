//! Detects boards whose byte order differs from the profile (D-10). The PC sends additional queries only if they are necessary.
use crate::master::engine::Link;
use crate::master::error::IdentityError;
use crate::master::procedures::ask_reports::ask_reports;
use crate::master::reports::{BoardSeen, Reports};

/// Returns `true` if the flash numbers of boards match the boards' reports only after their bytes are swapped. A report is a single byte,
/// so it does not depend on the byte order.
pub(crate) fn exchanged(reports: &Reports, flash_numbers: &[u16]) -> bool {
    let fits = |byte: u16| reports.ids.contains(&(byte as u8));
    let only_exchanged = |number: u16| !fits(number) && fits(number >> 8);
    flash_numbers.iter().any(|number| only_exchanged(*number))
        && flash_numbers.iter().all(|number| only_exchanged(*number) || number >> 8 == number & 0xFF)
}

/// Returns an error if boards send words in the other byte order. Requests reports only if the high byte of a flash number is not 0, which
/// is rare.
pub(crate) async fn right_order(link: &Link, flash_numbers: &[u16]) -> Result<(), IdentityError> {
    if flash_numbers.iter().all(|number| *number < 0x100) {
        return Ok(());
    }
    let mut reports = Reports::default();
    ask_reports(link, &mut reports).await;
    if exchanged(&reports, flash_numbers) {
        return Err(IdentityError::ByteOrder { endian: link.profile().endian });
    }
    Ok(())
}

/// Returns the flash numbers of boards.
pub(crate) fn flash_numbers(boards: &[BoardSeen]) -> Vec<u16> {
    boards.iter().map(|board| board.info.flash_number).collect()
}
