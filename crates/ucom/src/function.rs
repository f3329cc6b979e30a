//! The 28 functions of the protocol, and the identifiers that consist of a function and a sequence number (D-01).

use core::fmt;

use crate::foreign::Foreign;

/// Node address of a board. The node address is the board's position in the chain (0..31). The manual calls this address the sequence
/// number; this project also calls it the board's number. From the PC, address 0 means broadcast; from a board, address 0 means that the
/// board has no number yet (D-04).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Sequence(u8);

impl Sequence {
    /// The lowest sequence number, 0.
    pub const ZERO: Self = Self(0);
    /// The highest sequence number, 31.
    pub const MAX: Self = Self(31);

    /// Creates a sequence number. For values above 31, the function returns `None` instead of masking the value silently (D-01).
    pub const fn new(number: u8) -> Option<Self> {
        if number > 31 { None } else { Some(Self(number)) }
    }

    /// Creates a sequence number from the low 5 bits of a value, for fields that have only 5 bits.
    pub(crate) const fn low5(number: u8) -> Self {
        Self(number & 0x1F)
    }

    /// Returns the sequence number, 0..31.
    pub const fn number(self) -> u8 {
        self.0
    }

    /// Returns all sequence numbers, 0 to 31.
    pub fn all() -> impl Iterator<Item = Self> {
        (0..32).map(Self)
    }
}

impl fmt::Display for Sequence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.0, f)
    }
}

/// Sender of a function: the PC, a board, or both.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sender {
    /// Only the PC sends the function.
    Pc,
    /// Only boards send the function.
    Board,
    /// The PC and the boards send the function with the same identifier. D-05 defines how the PC and a board avoid sending this identifier
    /// at the same time.
    Both,
}

macro_rules! functions {
    ($($(#[doc = $doc:literal])+ $variant:ident = $number:literal, $name:literal, $sender:ident;)+) => {
        /// Function of a message, which is encoded in the upper five bits of the identifier.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(u8)]
        pub enum Function { $($(#[doc = $doc])+ $variant = $number),+ }

        impl Function {
            /// All functions in the order of their numbers.
            pub const ALL: [Self; 28] = [$(Self::$variant),+];

            /// Returns the name of the function in the published list, such as `PC_RESET`.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$variant => $name),+ }
            }

            /// Returns the sender of the function.
            pub const fn sender(self) -> Sender {
                match self { $(Self::$variant => Sender::$sender),+ }
            }

            /// Returns the purpose of the function as one sentence.
            pub const fn doc(self) -> &'static str {
                match self { $(Self::$variant => concat!($($doc),+).trim_ascii()),+ }
            }
        }
    };
}

functions! {
    /// Resets a board: outputs safe, number deleted, DSP_REPORT0..3 as answer.
    Reset = 0, "PC_RESET", Pc;
    /// Special reset before an update: exloader with programming enabled, number kept.
    XReset = 1, "PC_XRESET", Pc;
    /// Error code of a board.
    Error = 2, "DSP_ERROR", Board;
    /// Confirmation that a board has accepted its number.
    InitAck = 3, "DSP_INITACK", Board;
    /// Report that the image is written and verified.
    ProgFinished = 4, "DSP_PROGFINISHED", Board;
    /// Numbers, status, program and description of a board.
    DspInfo = 5, "DSP_INFO", Board;
    /// Confirmation of a block of program data; the PC may send the next block.
    DspReady = 6, "DSP_READY", Board;
    /// Sets bits of the status byte.
    SetStatus = 7, "PC_SETSTATUS", Pc;
    /// Requests DSP_INFO.
    Info = 8, "PC_INFO", Pc;
    /// Requests the DSP_REPORT of every board, without a reset.
    AskReport = 9, "PC_REPORT", Pc;
    /// Assigns the number in the identifier to the next board of the chain.
    Init = 10, "PC_INIT", Pc;
    /// Eight bytes of program data.
    Prog = 11, "PC_PROG", Pc;
    /// Makes the exloader start the application.
    Start = 12, "PC_START", Pc;
    /// Sets controller inputs.
    Ci = 13, "MCA_PC_CI", Pc;
    /// Sensor outputs of a running board.
    So = 14, "MCA_DSP_SO", Board;
    /// Sets parameters.
    Par = 15, "MCA_PC_PAR", Pc;
    /// Presence report of a board with a flash id in 0..31.
    Report0 = 16, "DSP_REPORT0", Board;
    /// Presence report of a board with a flash id in 32..63.
    Report1 = 17, "DSP_REPORT1", Board;
    /// Presence report of a board with a flash id in 64..95.
    Report2 = 18, "DSP_REPORT2", Board;
    /// Presence report of a board with a flash id in 96..127.
    Report3 = 19, "DSP_REPORT3", Board;
    /// Report that the application has started and serves the MCA_ functions.
    McaReady = 20, "MCA_DSP_READY", Board;
    /// Starts the control loop.
    McaStart = 21, "MCA_PC_START", Pc;
    /// Request for the descriptions of inputs, outputs and parameters, and the answer with these descriptions.
    DumpIo = 22, "MCA_DUMP_IO_DESCRIPTION", Both;
    /// Requests the initial controller inputs.
    DumpCi = 23, "MCA_DUMP_CI", Pc;
    /// The flags run, active, debug and global debug, set by the PC and reported by the board.
    Admin = 24, "MCA_ADMIN_DATA", Both;
    /// Debug text for a human reader.
    Debug = 25, "MCA_DEBUG_MSG", Board;
    /// Heartbeat.
    Alive = 26, "MCA_ALIVE", Both;
    /// Initial controller inputs.
    DspCi = 27, "MCA_DSP_CI", Board;
}

impl Function {
    /// Returns the function with this number; returns `None` for numbers above 27.
    pub const fn from_number(number: u8) -> Option<Self> {
        if number < 28 { Some(Self::ALL[number as usize]) } else { None }
    }

    /// Returns the number of the function, 0..27.
    pub const fn number(self) -> u8 {
        self as u8
    }

    /// Returns the identifier of the function for a sequence number: `(sequence & 0x1F) | ((function & 0x3F) << 6)` (D-01).
    pub const fn id(self, sequence: Sequence) -> u16 {
        (sequence.0 as u16 & 0x1F) | ((self as u16 & 0x3F) << 6)
    }

    /// Returns the function DSP_REPORT0..3 for an index 0..3; returns `None` for an index above 3.
    pub const fn report(k: u8) -> Option<Self> {
        if k < 4 { Self::from_number(16 + k) } else { None }
    }

    /// Returns the function and the sequence number of an identifier.
    pub const fn split(id: u16) -> Result<(Self, Sequence), Foreign> {
        if id > 0x7FF {
            return Err(Foreign::Malformed);
        }
        if id & 0x20 != 0 {
            return Err(Foreign::Bit5);
        }
        let number = (id >> 6) as u8;
        match Self::from_number(number) {
            Some(function) => Ok((function, Sequence((id & 0x1F) as u8))),
            None => Err(Foreign::NoFunction(number)),
        }
    }

    /// Returns `true` if the PC may send this function. Boards react only to functions that the PC may send.
    pub const fn from_pc(self) -> bool {
        !matches!(self.sender(), Sender::Board)
    }

    /// Returns `true` if a board may send this function. The PC reacts only to functions that a board may send.
    pub const fn from_board(self) -> bool {
        !matches!(self.sender(), Sender::Pc)
    }

    /// Returns `true` if boards accept this function as a broadcast (D-04).
    pub const fn broadcast(self) -> bool {
        use Function::*;
        matches!(
            self,
            Reset | AskReport | XReset | SetStatus | Info | Prog | Start | McaStart | Admin | Alive
        )
    }
}

impl fmt::Display for Function {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// C-1: the identifiers of all 28 functions with all 32 sequence numbers follow the published formula. Each
    /// identifier decodes to its function and sequence number.
    #[test]
    fn d01_c1_identifiers_follow_the_formula() {
        for (number, function) in Function::ALL.into_iter().enumerate() {
            assert_eq!(usize::from(function.number()), number);
            for sequence in 0..32u16 {
                let id = (sequence & 0x001f) | ((number as u16 & 0x003f) << 6);
                let place = Sequence::new(sequence as u8).unwrap();
                assert_eq!(function.id(place), id);
                assert_eq!(Function::split(id), Ok((function, place)));
            }
        }
        assert_eq!(Function::DspCi.id(Sequence::MAX), 0x6DF);
        assert_eq!(std::format!("{} to {:>3}", Function::DspCi, Sequence::MAX), "MCA_DSP_CI to  31");
    }

    #[test]
    fn d01_nothing_is_masked() {
        assert_eq!(Sequence::new(32), None);
        assert_eq!(Sequence::new(255), None);
        assert_eq!(Function::from_number(28), None);
        assert_eq!(Function::from_number(32), None);
        assert_eq!(Function::report(4), None);
        assert_eq!(Function::split(0x800), Err(Foreign::Malformed));
    }

    /// D-00: names and numbers of the functions match the published list.
    #[test]
    fn d00_names_are_those_of_the_list() {
        assert_eq!(Function::from_number(22).unwrap().name(), "MCA_DUMP_IO_DESCRIPTION");
        assert_eq!(Function::from_number(19).unwrap().name(), "DSP_REPORT3");
        assert_eq!(Function::ALL.iter().filter(|f| f.sender() == Sender::Both).count(), 3);
        for function in Function::ALL {
            let name = function.name();
            let board = name.starts_with("DSP_") || name.starts_with("MCA_DSP_") || name == "MCA_DEBUG_MSG";
            assert_eq!(function.sender() == Sender::Board, board, "{name}");
            assert!(!function.doc().starts_with(' ') && function.doc().ends_with('.'), "{name}");
        }
    }
}
