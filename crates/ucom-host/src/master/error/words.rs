//! Words that several errors and findings share.
use core::fmt;

use ucom::profile::Endian;

/// What helps against a wrong byte order.
pub(crate) const MEASURE_ORDER: &str =
    "`ucom probe --out FILE` measures it and writes a profile for --profile";

/// Words for boards that send the bytes of a word in the other order than the profile has.
pub(crate) fn other_order(endian: Endian) -> String {
    let (here, there) = match endian {
        Endian::Little => ("little", "big"),
        Endian::Big => ("big", "little"),
    };
    format!(
        "wrong byte order: the flash numbers fit the reports only with their bytes exchanged, so the boards send words as \
         {there}-endian, and the profile has `endian = \"{here}\"`"
    )
}

/// `board 1 is`, `boards 1, 2 are`.
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

/// `flash numbers 0x0021 and 0x0042`, or `both with flash number 0x0021`.
pub(crate) struct Sharing<'a>(pub &'a [u16]);

impl fmt::Display for Sharing<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            [first, rest @ ..] if rest.iter().all(|other| other == first) => {
                write!(f, "both with flash number 0x{first:04X}")
            }
            all => {
                let list: Vec<String> = all.iter().map(|n| format!("0x{n:04X}")).collect();
                write!(f, "flash numbers {}", list.join(" and "))
            }
        }
    }
}

pub(crate) struct Near<'a>(pub &'a [String]);

impl fmt::Display for Near<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() { Ok(()) } else { write!(f, "; there is `{}`", self.0.join("`, `")) }
    }
}

/// What makes two boards take one number, and what helps.
pub(crate) const SHARED_CAUSE: (&str, &str) = (
    "both took it from one PC_INIT: an init pin is strapped or shorted, or a PC repeated it blindly",
    "`ucom stop all` if anything runs, then `ucom init` numbers all anew; if it comes again, power one of them down and \
     check the init wires",
);
