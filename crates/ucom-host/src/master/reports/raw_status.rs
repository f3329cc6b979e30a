//! Effect of PC_SETSTATUS on the status of a board (D-22).
use ucom::{BoardInfo, Status};

/// Effect of one PC_SETSTATUS on one board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RawStatus {
    /// Board number.
    pub board: u8,
    /// Answer to PC_INFO before the command.
    pub before: BoardInfo,
    /// Status that the formula and the rules of D-22 require.
    pub expected: Status,
    /// Answer to PC_INFO after the command; `None` if the board no longer answers to its number.
    pub after: Option<BoardInfo>,
}

impl RawStatus {
    /// Returns `true` if the board has the status that the rules require. If INIT was cleared, the board must be silent, because it has
    /// forgotten its number.
    pub fn as_expected(&self) -> bool {
        match self.after {
            Some(after) => after.status == self.expected,
            None => !self.expected.has(Status::INIT),
        }
    }
}

/// Returns the status that the rules require after PC_SETSTATUS (D-22).
pub fn expected_status(before: &BoardInfo, mask: u8, value: u8) -> Status {
    let old = before.status;
    let new = old.set(mask, value);
    let kept = new & Status::ASTART;
    if !new.has(Status::INIT) || !old.has(Status::INIT) {
        // Without INIT, the board has no number. A board without a number ends its application, clears PROG and switches off its outgoing
        // pin.
        return kept | Status::EXLRUN | (old & Status::IPINIT);
    }
    let started = new.has(Status::MSTART) && (old.has(Status::MSTART) || before.has_application());
    let just_started = started && !old.has(Status::MSTART);
    // While an application runs, the board ignores PROG. A start of the application clears PROG.
    let prog = new.has(Status::PROG) && !started && !just_started;
    let pins = (new & Status::OPINIT) | (old & Status::IPINIT);
    let running = old.has(Status::MCARUN) && started;
    let mirrors = Status::default().with(Status::EXLRUN, !started).with(Status::MCARUN, running);
    kept | pins | mirrors | Status::INIT.with(Status::MSTART, started).with(Status::PROG, prog)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use ucom::node::{Node, NodeConfig, Record};
    use ucom::{Frame, Profile, Sequence, ToBoard};
    use ucom_sim::memory::{MemoryApplication, MemoryFlash, MemoryStore, WirePins};

    /// Creates a board that has a number. The parameters define the application and the state of the simulated board.
    fn board(application: bool, started: bool, history: &[(u8, u8)]) -> (Board, u64) {
        let mut flash = MemoryFlash::default();
        if application {
            flash.install(Record { program_id: 1, date: 2, address: 0, words: 4 }, &[0; 8]);
        }
        let pins = WirePins::chain(1).remove(0);
        let program = MemoryApplication::new("x", &["a"], &["b"], &["c"]);
        let mut board = Node::new(NodeConfig::new(0x21), flash, pins, MemoryStore::default(), program, 0);
        let mut now = 250_000;
        turn(&mut board, &mut now, None);
        turn(&mut board, &mut now, Some(ToBoard::Init));
        if started {
            turn(&mut board, &mut now, Some(ToBoard::Start));
        }
        for (mask, value) in history {
            turn(&mut board, &mut now, Some(ToBoard::SetStatus { mask: *mask, value: value | 0x08 }));
        }
        (board, now)
    }

    type Board = Node<MemoryFlash, WirePins, MemoryStore, MemoryApplication>;

    fn turn(board: &mut Board, now: &mut u64, message: Option<ToBoard>) {
        if let Some(message) = message {
            let frame: Frame = message.encode(Sequence::new(1).unwrap(), &Profile::default());
            board.receive(*now, &frame);
        }
        for _ in 0..60 {
            *now += 2_000;
            while let Some(frame) = board.poll(*now) {
                board.sent(*now, &frame);
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

        /// D-22: for any two bytes, the expected status equals the status of a simulated board.
        #[test]
        fn d22_what_is_expected_is_what_a_board_does(mask: u8, value: u8, application: bool, started: bool, history in prop::collection::vec((any::<u8>(), any::<u8>()), 0..3)) {
            let history: Vec<(u8, u8)> = history.into_iter().map(|(m, v)| (m & !0x08, v & !0x40)).collect();
            let (mut board, mut now) = board(application, started, &history);
            let (program_id, date) = if application { (1, 2) } else { (0xFFFF, 0xFFFF) };
            let before = BoardInfo { flash_number: 0x21, sequence: 1, status: board.status(), program_id, date };
            let expected = expected_status(&before, mask, value);
            prop_assert_eq!(expected.contradiction(), None, "{}", expected);
            turn(&mut board, &mut now, Some(ToBoard::SetStatus { mask, value }));
            prop_assert_eq!(board.status(), expected, "{} {:02X}:{:02X}", before.status, mask, value);
        }
    }
}
