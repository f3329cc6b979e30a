//! The status byte of a board (D-20).

use core::fmt;
use core::ops::{BitAnd, BitOr, Not};

/// Status byte of a board. The constants of this type name its bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Status(pub u8);

impl Status {
    /// MSTART: the exloader has started the application.
    pub const MSTART: Self = Self(0x80);
    /// ASTART: the automatic start of the application is enabled. The bit ASTART survives a power loss.
    pub const ASTART: Self = Self(0x40);
    /// MCARUN: the control loop is running. The bit MCARUN shows the actual state, and the PC cannot write it.
    pub const MCARUN: Self = Self(0x20);
    /// EXLRUN: the exloader is running. The bit EXLRUN is always the opposite of MSTART. The bit EXLRUN shows the actual state, and the PC
    /// cannot write it.
    pub const EXLRUN: Self = Self(0x10);
    /// INIT: the board has a sequence number.
    pub const INIT: Self = Self(0x08);
    /// PROG: the board accepts program data.
    pub const PROG: Self = Self(0x04);
    /// OPINIT: level of the outgoing init pin.
    pub const OPINIT: Self = Self(0x02);
    /// IPINIT: level of the incoming init pin. The bit IPINIT shows the actual state, and the PC cannot write it.
    pub const IPINIT: Self = Self(0x01);
    /// Status bits that show the actual state and that the PC cannot write.
    pub const MIRRORS: Self = Self(0x31);

    /// Names of the status bits, beginning with bit 7.
    pub const NAMES: [(&'static str, Self); 8] = [
        ("MSTART", Self::MSTART),
        ("ASTART", Self::ASTART),
        ("MCARUN", Self::MCARUN),
        ("EXLRUN", Self::EXLRUN),
        ("INIT", Self::INIT),
        ("PROG", Self::PROG),
        ("OPINIT", Self::OPINIT),
        ("IPINIT", Self::IPINIT),
    ];

    /// Returns the status bit with this name, in upper or lower case.
    pub fn bit(name: &str) -> Option<Self> {
        Self::NAMES.iter().find(|(known, _)| known.eq_ignore_ascii_case(name)).map(|(_, bit)| *bit)
    }

    /// Returns `true` if all bits in `bits` are set.
    pub const fn has(self, bits: Self) -> bool {
        self.0 & bits.0 == bits.0
    }

    /// Returns the status with the bits in `bits` set or cleared.
    #[must_use]
    pub const fn with(self, bits: Self, on: bool) -> Self {
        if on { Self(self.0 | bits.0) } else { Self(self.0 & !bits.0) }
    }

    /// Applies the published formula of PC_SETSTATUS literally: `(old & ~mask) | value`. The formula does not mask the value (D-22).
    #[must_use]
    pub const fn set(self, mask: u8, value: u8) -> Self {
        Self((self.0 & !mask) | value)
    }

    /// Returns a text that explains which bits of this status contradict each other; returns `None` without a
    /// contradiction. No board can be in a contradictory state.
    pub const fn contradiction(self) -> Option<&'static str> {
        if self.has(Self::EXLRUN) == self.has(Self::MSTART) {
            Some("EXLRUN must be the opposite of MSTART")
        } else if self.has(Self::MCARUN) && !self.has(Self::MSTART) {
            Some("MCARUN is set without MSTART")
        } else if !self.has(Self::INIT) && (self.has(Self::MSTART) || self.has(Self::OPINIT)) {
            Some("MSTART or OPINIT is set without INIT")
        } else if self.has(Self::PROG) && !self.has(Self::EXLRUN) {
            Some("PROG is set without EXLRUN")
        } else {
            None
        }
    }
}

impl BitOr for Status {
    type Output = Self;
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl BitAnd for Status {
    type Output = Self;
    fn bitand(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }
}

impl Not for Status {
    type Output = Self;
    fn not(self) -> Self {
        Self(!self.0)
    }
}

/// Prints the names of the status bits that are set, such as `EXLRUN INIT IPINIT`; prints `-` if no bit is set.
impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        words(f, Self::NAMES.map(|(name, bit)| (self.has(bit), name)))
    }
}

/// Prints the names that are marked `true`, separated by blanks; prints `-` if all names are marked `false`.
pub(crate) fn words<const N: usize>(f: &mut fmt::Formatter<'_>, names: [(bool, &str); N]) -> fmt::Result {
    let mut gap = "";
    for (_, name) in names.iter().filter(|(on, _)| *on) {
        write!(f, "{gap}{name}")?;
        gap = " ";
    }
    if gap.is_empty() { f.write_str("-") } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn d20_names_in_the_order_of_the_table() {
        assert_eq!(Status(0x1B).to_string(), "EXLRUN INIT OPINIT IPINIT");
        assert_eq!(Status(0).to_string(), "-");
        assert_eq!(Status::bit("mcarun"), Some(Status(0x20)));
        assert_eq!(Status::bit("OPINT"), None);
        let all = Status::NAMES.iter().fold(0, |sum, (_, bit)| sum + u32::from(bit.0));
        assert_eq!(all, 255);
    }

    #[test]
    fn bits_together() {
        let (a, b) = (Status(0x1B), Status(0x82));
        assert_eq!((a | b, a & b, !a), (Status(0x9B), Status(0x02), Status(0xE4)));
    }

    #[test]
    fn d22_formula_is_literal() {
        assert_eq!(Status(0x19).set(0x00, 0x40), Status(0x59));
        assert_eq!(Status(0x59).set(0x40, 0x00), Status(0x19));
        assert_eq!(Status(0x19).set(0x02, 0x06), Status(0x1F));
    }

    #[test]
    fn d20_contradictions() {
        for good in [0x11, 0x10, 0x19, 0x1B, 0x1F, 0x8B, 0xAB, 0x59, 0x15] {
            assert_eq!(Status(good).contradiction(), None, "{good:02X}");
        }
        for bad in [0x00, 0x98, 0x30, 0x80, 0x12, 0x8C, 0x38] {
            assert!(Status(bad).contradiction().is_some(), "{bad:02X}");
        }
    }
}
