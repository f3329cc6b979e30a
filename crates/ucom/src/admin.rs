//! Four flags in the frame MCA_ADMIN_DATA (D-37).

use core::fmt;

use crate::frame::Payload;

/// Flags of one board.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Admin {
    /// `true` if the control loop of the board runs.
    pub run: bool,
    /// `true` if the outputs of the board are enabled; never `true` without `run`.
    pub active: bool,
    /// `true` if the PC has requested debug texts with the flag *debug*.
    pub debug: bool,
    /// `true` if the PC has requested debug texts with the flag *global debug*. The board sends debug texts if at
    /// least one of the two flags is set (D-38).
    pub global_debug: bool,
}

impl Admin {
    /// Returns the four data bytes of MCA_ADMIN_DATA.
    pub const fn payload(self) -> Payload {
        let data = [self.run as u8, self.active as u8, self.debug as u8, self.global_debug as u8, 0, 0, 0, 0];
        Payload::of(data, 4)
    }

    /// Reads the four data bytes of MCA_ADMIN_DATA. Returns `None` if a byte is not 0 or 1. The receiver ignores a frame that contains such
    /// a byte.
    pub const fn from_bytes(bytes: [u8; 4]) -> Option<Self> {
        if bytes[0] > 1 || bytes[1] > 1 || bytes[2] > 1 || bytes[3] > 1 {
            return None;
        }
        Some(Self {
            run: bytes[0] == 1,
            active: bytes[1] == 1,
            debug: bytes[2] == 1,
            global_debug: bytes[3] == 1,
        })
    }
}

/// Prints the names of the flags that are set, such as `run active`; prints `-` if no flag is set.
impl fmt::Display for Admin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let flags = [
            (self.run, "run"),
            (self.active, "active"),
            (self.debug, "debug"),
            (self.global_debug, "global-debug"),
        ];
        crate::status::words(f, flags)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn d37_flags_are_0_or_1() {
        for number in 0..16u8 {
            let bytes = [number & 1, number >> 1 & 1, number >> 2 & 1, number >> 3 & 1];
            let admin = Admin::from_bytes(bytes).unwrap();
            assert_eq!(admin.payload().bytes(), bytes);
        }
        for place in 0..4 {
            let mut bytes = [0; 4];
            bytes[place] = 2;
            assert_eq!(Admin::from_bytes(bytes), None);
        }
    }

    #[test]
    fn flags_in_words() {
        for (bytes, text) in [
            ([0; 4], "-"),
            ([1, 0, 0, 0], "run"),
            ([0, 1, 0, 1], "active global-debug"),
            ([1; 4], "run active debug global-debug"),
        ] {
            assert_eq!(std::format!("{}", Admin::from_bytes(bytes).unwrap()), text);
        }
    }
}
