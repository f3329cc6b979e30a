//! Types of the profile keys whose values are not numbers.

use core::fmt;

/// Conversion of a key's value to and from text.
pub(crate) trait Value: Sized {
    /// Parses a value from text.
    fn read(text: &str) -> Option<Self>;
    /// Writes a value as text.
    fn write(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result;
}

/// Declares an enum with a word for each variant. Profile files contain these words.
macro_rules! words {
    ($(#[$about:meta])* pub enum $name:ident { $($(#[doc = $doc:literal])+ $variant:ident = $word:literal,)+ }) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum $name { $($(#[doc = $doc])+ $variant),+ }

        impl $name {
            /// All values of the type.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];

            /// Returns the word that profile files contain for the value.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$variant => $word),+ }
            }
        }

        impl core::fmt::Display for $name {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                f.pad(self.name())
            }
        }

        impl $crate::profile::Value for $name {
            fn read(text: &str) -> Option<Self> {
                Self::ALL.iter().copied().find(|value| value.name() == text)
            }
            fn write(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                core::fmt::Display::fmt(self, f)
            }
        }
    };
}
pub(crate) use words;

words! {
    /// Order of the two bytes of a word (D-10).
    pub enum Endian {
        /// The first byte is the least significant byte.
        Little = "little",
        /// The first byte is the most significant byte.
        Big = "big",
    }
}

impl Endian {
    /// Returns the two bytes of a 16-bit word.
    pub const fn bytes(self, word: u16) -> [u8; 2] {
        match self {
            Self::Little => word.to_le_bytes(),
            Self::Big => word.to_be_bytes(),
        }
    }

    /// Returns the 16-bit word that consists of two bytes.
    pub const fn word(self, bytes: [u8; 2]) -> u16 {
        match self {
            Self::Little => u16::from_le_bytes(bytes),
            Self::Big => u16::from_be_bytes(bytes),
        }
    }
}

words! {
    /// Number to which the PC sends broadcasts (D-04).
    pub enum Broadcast {
        /// The broadcast number is 0.
        Zero = "0",
        /// The broadcast number is 31.
        ThirtyOne = "31",
        /// Boards with a number accept no broadcast. Number 0 addresses only the boards without a number.
        None = "none",
    }
}

words! {
    /// Form of the boards' reports to PC_REPORT and PC_RESET (D-07).
    pub enum ReportMode {
        /// The board sends a single frame whose function and sequence field contain the 7-bit flash id.
        Flash7 = "flash7",
        /// The board sends a single DSP_REPORT0 with its sequence number.
        Seq = "seq",
        /// The board sends four frames, one for each of the functions DSP_REPORT0..3.
        All4 = "all4",
    }
}

words! {
    /// Content of the two cycles of an update (D-40).
    pub enum Plan {
        /// The update sends the image twice: the first cycle checks the image, and the second cycle writes the image.
        VerifyWrite = "verify-write",
        /// The first cycle loads an exloader into RAM, and the second cycle writes the application.
        ExloaderApp = "exloader-app",
        /// The first cycle writes program memory, and the second cycle writes data memory.
        PmemXmem = "pmem-xmem",
        /// Each cycle sends one of two files unchanged.
        Raw = "raw",
    }
}

words! {
    /// Block before the data of a cycle (D-41).
    pub enum HeaderForm {
        /// The header block that this project defines.
        V1 = "v1",
        /// The cycle has no header. The first block of the cycle contains data, and the length of the image is configured in the board.
        None = "none",
    }
}

words! {
    /// Time at which received controller inputs take effect (D-34).
    pub enum CiLatch {
        /// Each package of inputs takes effect when it arrives.
        Frame = "frame",
        /// All inputs take effect together with the package that contains the last word.
        Last = "last",
    }
}

words! {
    /// Receivers of a heartbeat frame from the PC (D-04, D-50).
    pub enum AliveMode {
        /// The PC sends a single broadcast frame.
        Broadcast = "broadcast",
        /// The PC sends a heartbeat to each board, and boards ignore broadcast heartbeats.
        Unicast = "unicast",
        /// The PC sends both broadcast heartbeats and a heartbeat to each board.
        Both = "both",
    }
}

words! {
    /// Reaction of the PC if a board's heartbeat is missing (D-51).
    pub enum OnLost {
        /// The PC only reports an event to its user.
        Report = "report",
        /// The PC stops the board whose heartbeat is missing.
        StopBoard = "stop-board",
        /// The PC stops every board. This reaction is intended for coupled joints.
        StopAll = "stop-all",
    }
}

impl Value for bool {
    fn read(text: &str) -> Option<Self> {
        match text {
            "yes" | "true" => Some(true),
            "no" | "false" => Some(false),
            _ => None,
        }
    }

    fn write(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if *self { "yes" } else { "no" })
    }
}

impl Value for u32 {
    fn read(text: &str) -> Option<Self> {
        text.parse().ok()
    }

    fn write(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}
