//! Texts that several errors and findings contain.
use core::fmt;

use ucom::profile::Endian;

/// Remedy for a wrong byte order.
pub(crate) const MEASURE_ORDER: &str =
    "`ucom probe --out FILE` measures it and writes a profile for --profile";

/// Returns the text about boards whose byte order differs from the profile.
pub(crate) fn other_order(endian: Endian) -> String {
    let (here, there) = match endian {
        Endian::Little => ("little", "big"),
        Endian::Big => ("big", "little"),
    };
    format!(
        "wrong byte order: the flash numbers match the reports only if their bytes are swapped; the boards \
         send {there}-endian words, but the profile has `endian = \"{here}\"`"
    )
}

/// Prints `board 1 is` or `boards 1, 2 are`.
pub(crate) struct Boards<'a>(pub &'a [u8]);

impl fmt::Display for Boards<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let list: Vec<String> = self.0.iter().map(u8::to_string).collect();
        match self.0 {
            [one] => write!(f, "board {one} is"),
            _ => write!(f, "boards {} are", list.join(", ")),
        }
    }
}
