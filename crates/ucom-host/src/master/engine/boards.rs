//! The last known states of the boards, and the supervision of the boards by heartbeats (D-51).

use std::collections::BTreeMap;
use ucom::{Admin, Assembled, BoardInfo, ErrorCode, Function, Payload, Profile, Status, StringAssembler};

/// State of a board's heartbeats.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Life {
    /// No heartbeat was received yet, or a command stopped the application.
    #[default]
    Unarmed,
    /// The heartbeats of the board arrive in time.
    Alive,
    /// A single heartbeat of the board is missing.
    Late,
    /// Three heartbeats of the board are missing.
    Lost,
}

/// Time in µs after the end of a board's application within which a last heartbeat can still arrive.
const UNDER_WAY: u64 = 100_000;

/// Last known state of a board.
#[derive(Clone, Debug, Default)]
pub struct Board {
    /// Last answer of the board to PC_INFO.
    pub info: Option<BoardInfo>,
    /// Description; `None` until it has been received completely.
    pub description: Option<String>,
    /// Flags that the board sent last (`MCA_ADMIN_DATA`).
    pub admin: Option<Admin>,
    /// State of the board's heartbeat supervision.
    pub life: Life,
    /// Time of the last heartbeat, µs.
    pub alive_at: Option<u64>,
    /// Time (µs) and function of the last frame from the board.
    pub last: Option<(u64, Function)>,
    /// Time of the last sensor outputs, µs. Sensor outputs show that the control loop was running at that time.
    pub so_at: Option<u64>,
    /// `true` if the board has rebooted since it got its number.
    pub rebooted: bool,
    /// Last errors that the board reported, at most 16, the newest last. Each entry contains the time in µs and the code.
    pub errors: Vec<(u64, ErrorCode)>,
    /// Number of errors that the board has reported.
    pub error_count: u64,
    /// Number of strings of the board that could not be reassembled.
    pub bad_strings: u64,
    /// Number of MCA_DSP_READY frames from the board, including frames without a request.
    pub ready_count: u64,
    /// Time since which the application has certainly been stopped, without a pending automatic start; `None` if this
    /// is not known.
    pub(crate) stopped_at: Option<u64>,
    /// Time of the last start command to the board. The time is cleared when the board reports that it has started.
    pub(crate) starting_since: Option<u64>,
    pub(crate) debug: Option<Box<StringAssembler>>,
}

impl Life {
    /// Returns the name of the state for display, which is one word.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Unarmed => "-",
            Self::Alive => "alive",
            Self::Late => "late",
            Self::Lost => "lost",
        }
    }
}

/// Returns the state of a board with this status, in one word.
pub const fn state_name(status: Status) -> &'static str {
    if status.has(Status::MCARUN) {
        "running"
    } else if status.has(Status::MSTART) {
        "started"
    } else if status.has(Status::PROG) {
        "programming"
    } else {
        "exloader"
    }
}

impl Board {
    /// Returns `true` if the last received state of the board is still valid: the board is not lost and has not rebooted.
    pub fn is_known(&self) -> bool {
        self.life != Life::Lost && !self.rebooted
    }

    /// Returns the state of the board in one word. Frames that the board sends without a request, such as heartbeats
    /// and outputs, have priority over an older answer to PC_INFO.
    pub fn state_name(&self, now_us: u64) -> &'static str {
        match (self.life, self.status()) {
            _ if self.rebooted => "rebooted",
            (Life::Lost, _) => "lost",
            _ if self.running(now_us) => "running",
            (Life::Alive, _) => "started",
            (_, Some(status)) => state_name(status),
            (_, None) => "?",
        }
    }

    /// Returns the time since the last heartbeat of the board in s.
    pub fn alive_age_s(&self, now_us: u64) -> Option<f64> {
        self.alive_at.map(|at| now_us.saturating_sub(at) as f64 * 1e-6)
    }

    /// Returns the last status that the master has read.
    pub fn status(&self) -> Option<Status> {
        self.info.map(|info| info.status)
    }

    /// Returns `true` if the board sends its outputs. The outputs show that the control loop runs, even if the last answer of the board
    /// showed another state.
    pub fn sends_outputs(&self, now: u64) -> bool {
        self.so_at.is_some_and(|at| now.saturating_sub(at) < 500_000)
    }

    /// Returns `true` if the control loop of the board runs, according to the last frames of the board.
    pub fn running(&self, now: u64) -> bool {
        self.sends_outputs(now)
            || self.admin.map_or_else(|| self.status().is_some_and(|s| s.has(Status::MCARUN)), |a| a.run)
    }

    /// Handles one package of a text that the board sends. The function returns the text when it is complete. `passed_us` is the sum of the
    /// times between the received frames.
    pub(crate) fn debug_text(
        &mut self,
        passed_us: u64,
        payload: &Payload,
        profile: &Profile,
    ) -> Option<String> {
        let assembler = self.debug.get_or_insert_with(|| Box::new(StringAssembler::new()));
        match assembler.push(passed_us, payload, profile) {
            Assembled::Complete(text) => Some(text.to_string()),
            Assembled::Partial => None,
            Assembled::Refused => {
                self.bad_strings += 1;
                None
            }
        }
    }

    pub(crate) fn error(&mut self, at: u64, code: ErrorCode) {
        self.error_count += 1;
        if self.errors.len() >= 16 {
            self.errors.remove(0);
        }
        self.errors.push((at, code));
    }

    /// Returns `true` if a heartbeat with the number of this board cannot come from the board, because its
    /// application is known to be stopped (D-08).
    pub(crate) fn cannot_be_alive(&self, now: u64) -> bool {
        self.stopped_at.is_some_and(|at| now.saturating_sub(at) > UNDER_WAY)
    }

    /// Records that the application of the board has ended or will end now. After this call, the master expects no heartbeats of the board,
    /// and the state of the board is unknown.
    pub(crate) fn application_ended(&mut self) {
        self.life = Life::Unarmed;
        self.alive_at = None;
        self.admin = None;
        self.so_at = None;
    }
}

/// Last known states of the boards, by board number.
#[derive(Clone, Debug, Default)]
pub struct Boards {
    boards: BTreeMap<u8, Board>,
}

impl Boards {
    /// Returns the board with this number, if the master has data about the board.
    pub fn get(&self, number: u8) -> Option<&Board> {
        self.boards.get(&number)
    }

    /// Returns all boards in the order of their numbers.
    pub fn iter(&self) -> impl Iterator<Item = (u8, &Board)> {
        self.boards.iter().map(|(n, board)| (*n, board))
    }

    pub(crate) fn of(&mut self, number: u8) -> &mut Board {
        self.boards.entry(number & 31).or_default()
    }

    pub(crate) fn iter_mut(&mut self) -> impl Iterator<Item = (u8, &mut Board)> {
        self.boards.iter_mut().map(|(n, board)| (*n, board))
    }

    /// Removes all boards, because all board numbers have become invalid.
    pub(crate) fn clear(&mut self) {
        self.boards.clear();
    }

    /// Returns the number of the board that has this UCoM id.
    pub(crate) fn with_ucom_id(&self, ucom_id: u8) -> Option<u8> {
        let has = |board: &Board| board.info.is_some_and(|info| info.flash_number as u8 == ucom_id);
        self.boards.iter().find(|(_, board)| has(board)).map(|(n, _)| *n)
    }
}
