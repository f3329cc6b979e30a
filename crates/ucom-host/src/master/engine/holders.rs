//! Detection of board numbers that two boards share. The master checks every answer to PC_INFO, in every procedure.
//!
//! If two boards have the same number, both boards carry out every command to this number: an update writes both
//! boards, and a motion command moves both boards. A board cannot detect a shared number, but the PC can, because
//! both boards answer a PC_INFO. The master compares all answers ([`Holders::received`]). Before a procedure changes
//! a board, it waits until no further answer can arrive (`one_board_each`).

use crate::master::error::IdentityError;
use std::collections::BTreeMap;
use ucom::{BoardInfo, Function, Payload, Profile, Sequence, Status};

/// Number of consecutive PC_INFO requests that must each get two answers with the same flash number before the board
/// number is considered shared. A single double answer is not enough, because a gateway can send a frame twice.
const TWICE: u32 = 3;
/// Limit of flash numbers that are stored for each board number. The limit is necessary because damaged answers may contain any flash
/// number.
const MOST: usize = 8;

/// Returns the values in a payload if it is the first frame of a DSP_INFO answer; returns `None` otherwise. The
/// function checks the board number and the status, because the packages of the description contain other bytes at
/// these positions.
pub(crate) fn head(number: u8, payload: &Payload, profile: &Profile) -> Option<BoardInfo> {
    let info = BoardInfo::parse(payload, profile.endian)?;
    let possible = info.status.contradiction().is_none() && info.status.has(Status::INIT);
    (possible && info.sequence == number).then_some(info)
}

/// Boards that answered PC_INFO, by board number.
#[derive(Debug, Default)]
pub(crate) struct Holders {
    numbers: BTreeMap<u8, Holder>,
}

/// Boards that have answered to one board number since this number was assigned.
#[derive(Debug, Default)]
struct Holder {
    /// Time of the last PC_INFO to the board number, µs.
    asked_at: Option<u64>,
    /// Number of first frames in the answers to the last PC_INFO, by flash number. `packages` counts all other frames
    /// in these answers; `of_one` is the number of other frames in one complete answer.
    heads: BTreeMap<u16, u32>,
    packages: u32,
    of_one: Option<u32>,
    /// Number of consecutive PC_INFO requests, before the last request, that got two answers with the same flash
    /// number.
    twice: u32,
    /// Number of answered PC_INFO requests, by flash number. `last` is the flash number in the last answer; `changes`
    /// counts how often it differed from the answer before.
    seen: BTreeMap<u16, u32>,
    last: Option<u16>,
    changes: u32,
    /// Flash numbers of the boards that share the board number; empty unless a shared number is certain.
    shared: Vec<u16>,
}

impl Holder {
    /// Returns `true` if one flash number sent two complete answers to the last PC_INFO.
    fn answered_twice(&self) -> bool {
        let two = self.heads.len() == 1 && self.heads.values().all(|count| *count > 1);
        two && self.of_one.is_some_and(|of_one| self.packages >= 2 * of_one)
    }

    fn ask(&mut self, now: u64) {
        if !self.heads.is_empty() {
            self.twice = if self.answered_twice() { self.twice + 1 } else { 0 };
        }
        self.asked_at = Some(now);
        self.heads.clear();
        (self.packages, self.of_one) = (0, None);
    }

    fn answer(&mut self, number: u8, payload: &Payload, profile: &Profile) {
        let Some(info) = head(number, payload, profile) else {
            if self.packages == 0 && payload.len() == 2 {
                let count = payload.bytes().try_into().map_or(0, |bytes| profile.endian.word(bytes));
                let with_header = u32::from(profile.string_count_includes_header);
                self.of_one = Some(1 + u32::from(count).saturating_sub(with_header));
            }
            self.packages = self.packages.saturating_add(1);
            return;
        };
        let flash = info.flash_number;
        if self.seen.len() >= MOST && !self.seen.contains_key(&flash) {
            return;
        }
        let times = self.heads.entry(flash).or_default();
        *times = times.saturating_add(1);
        if *times == 1 {
            *self.seen.entry(flash).or_default() += 1;
        }
        if self.last.replace(flash).is_some_and(|last| last != flash) {
            self.changes = self.changes.saturating_add(1);
        }
    }

    /// Returns the flash numbers of the boards that share the board number, according to the answers received so far.
    /// The list is empty if the answers do not show a shared number.
    ///
    /// A single damaged answer, or the replacement of a board, must not look like a shared number. Therefore, if each
    /// PC_INFO gets only one answer, at least two flash numbers must have answered more than once, and they must
    /// alternate.
    fn sharing(&self) -> Vec<u16> {
        if self.heads.len() > 1 {
            return self.heads.keys().copied().collect();
        }
        let often: Vec<u16> =
            self.seen.iter().filter(|(_, times)| **times > 1).map(|(flash, _)| *flash).collect();
        if often.len() > 1 && self.changes > 1 {
            return often;
        }
        match self.heads.keys().next() {
            Some(flash) if self.answered_twice() && self.twice + 1 >= TWICE => vec![*flash; 2],
            _ => Vec::new(),
        }
    }
}

/// Next step of the check that a board number belongs to only one board.
pub(crate) enum Open {
    Nothing,
    /// Time until which another board can still answer.
    Wait(u64),
    /// No board has answered a recent PC_INFO to the board number.
    Ask,
    /// A single flash number answered the same PC_INFO twice, so one more PC_INFO is needed.
    AskAgain,
}

impl Holders {
    /// Records that PC_INFO was sent to a board number.
    fn asked(&mut self, number: Sequence, now: u64) {
        self.numbers.entry(number.number()).or_default().ask(now);
    }

    /// Handles a frame of DSP_INFO for a board number. If this frame shows that boards share the number, the function
    /// returns their flash numbers.
    pub(crate) fn received(&mut self, number: u8, payload: &Payload, profile: &Profile) -> Option<Vec<u16>> {
        let holder = self.numbers.entry(number).or_default();
        holder.answer(number, payload, profile);
        if !holder.shared.is_empty() {
            return None;
        }
        holder.shared = holder.sharing();
        (!holder.shared.is_empty()).then(|| holder.shared.clone())
    }

    /// Handles a frame of this PC, or of another PC, that can change which board has a board number.
    pub(crate) fn may_change(
        &mut self,
        function: Function,
        to: Sequence,
        data: &[u8],
        profile: &Profile,
        now: u64,
    ) {
        let broadcast = profile.broadcast_number() == Some(to);
        let forgets = match function {
            Function::Reset | Function::Init => true,
            Function::SetStatus => match data {
                [mask, value, ..] => Status(*mask).has(Status::INIT) && !Status(*value).has(Status::INIT),
                _ => false,
            },
            _ => false,
        };
        match (forgets, function) {
            // A reset that is sent to the number for boards without a number reaches all boards, for any
            // value of `addr.broadcast`.
            (true, _) if broadcast || to == profile.unnumbered() => self.clear(),
            (true, _) => self.forget(to.number()),
            (false, Function::Info) if broadcast => {
                profile.board_numbers().for_each(|number| self.asked(number, now));
            }
            (false, Function::Info) => self.asked(to, now),
            _ => {}
        }
    }

    /// Returns the time of the last PC_INFO to one of these boards, µs. Each bit of `boards` is a board.
    pub(crate) fn last_asked(&self, boards: u32) -> Option<u64> {
        let mine = self.numbers.iter().filter(|(number, _)| boards >> **number & 1 == 1);
        mine.filter_map(|(_, holder)| holder.asked_at).max()
    }

    /// Removes the recorded answers of a board number, because another board can have the number now: the number was
    /// assigned or withdrawn, or its board has rebooted.
    pub(crate) fn forget(&mut self, number: u8) {
        self.numbers.remove(&number);
    }

    /// Removes the recorded answers of all numbers, because all numbers have become invalid.
    fn clear(&mut self) {
        self.numbers.clear();
    }

    /// Returns an error for the lowest of these board numbers that two boards share. Each bit of `numbers` is a board
    /// number.
    pub(crate) fn shared(&self, numbers: u32) -> Option<IdentityError> {
        let mine =
            |(number, holder): &(&u8, &Holder)| numbers >> **number & 1 == 1 && !holder.shared.is_empty();
        let (board, holder) = self.numbers.iter().find(mine)?;
        Some(IdentityError::NumberShared { board: *board, found: holder.shared.clone(), given_back: false })
    }

    /// Returns an error for each board number that two boards share.
    pub(crate) fn all_shared(&self) -> Vec<IdentityError> {
        self.numbers.keys().filter_map(|number| self.shared(1 << number)).collect()
    }

    /// Returns the board numbers that two boards possibly share: one flash number has answered a PC_INFO twice, but
    /// not often enough to be certain.
    pub(crate) fn doubtful(&self) -> Vec<u8> {
        let doubtful = |holder: &Holder| holder.shared.is_empty() && holder.answered_twice();
        self.numbers.iter().filter(|(_, holder)| doubtful(holder)).map(|(number, _)| *number).collect()
    }

    /// Returns the next step that is needed to be sure that a board number belongs to only one board. `received` is
    /// the time up to which the driver has delivered all frames. `patience` is the time that boards have for an
    /// answer, µs. A PC_INFO that is older than `oldest` µs is ignored.
    pub(crate) fn open(&self, number: u8, received: u64, patience: u64, oldest: u64) -> Open {
        let Some(holder) = self.numbers.get(&number) else { return Open::Ask };
        match holder.asked_at.filter(|at| received.saturating_sub(*at) <= oldest) {
            None => Open::Ask,
            Some(at) if received < at + patience => Open::Wait(at + patience),
            Some(_) if holder.heads.is_empty() => Open::Ask,
            Some(_) if holder.answered_twice() => Open::AskAgain,
            Some(_) => Open::Nothing,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Simulates one PC_INFO to board 1 for each list in `answers`. A list contains the flash numbers of the boards
    /// that answer. The function returns flash numbers if the answers show a shared number.
    fn question(holders: &mut Holders, answers: &[&[u16]]) -> Option<Vec<u16>> {
        let profile = Profile::default();
        let mut news = None;
        let one = Sequence::new(1).unwrap();
        for flashes in answers {
            holders.asked(one, 0);
            for flash_number in *flashes {
                let (program_id, date) = (0x1234, 0x386E);
                let info = BoardInfo {
                    flash_number: *flash_number,
                    sequence: 1,
                    status: Status(0x19),
                    program_id,
                    date,
                };
                let text = ["0100", "78"].map(|hex| match hex {
                    "0100" => Payload::new(&[1, 0]).unwrap(),
                    _ => Payload::new(&[0x78]).unwrap(),
                });
                for payload in [info.payload(profile.endian)].into_iter().chain(text) {
                    news = holders.received(1, &payload, &profile).or(news);
                }
            }
        }
        news
    }

    #[test]
    fn d24_two_answers_to_one_question_are_two_boards() {
        assert_eq!(question(&mut Holders::default(), &[&[0x21, 0x42]]), Some(vec![0x21, 0x42]));
        let mut once = Holders::default();
        question(&mut once, &[&[0x21, 0x42]]);
        assert_eq!(question(&mut once, &[&[0x21, 0x42]]), None, "reported once");
        assert!(matches!(once.shared(2), Some(IdentityError::NumberShared { board: 1, .. })));
        assert!(once.shared(!2).is_none(), "of another number");
        once.forget(1);
        assert!(once.shared(2).is_none());
    }

    #[test]
    fn d24_boards_that_answer_in_turns_are_two_boards() {
        let turns: [&[u16]; 4] = [&[0x21], &[0x42], &[0x21], &[0x42]];
        assert_eq!(question(&mut Holders::default(), &turns), Some(vec![0x21, 0x42]));
        let exchanged: [&[u16]; 4] = [&[0x21], &[0x21], &[0x42], &[0x42]];
        assert_eq!(question(&mut Holders::default(), &exchanged), None, "put in the place of the other");
        let damaged: [&[u16]; 4] = [&[0x21], &[0x21], &[0x121], &[0x21]];
        assert_eq!(question(&mut Holders::default(), &damaged), None, "one damaged answer");
    }

    #[test]
    fn d24_one_flash_number_that_answers_twice_each_time_is_two_boards() {
        let twice: &[u16] = &[0x21, 0x21];
        assert_eq!(question(&mut Holders::default(), &[twice; 3]), Some(vec![0x21, 0x21]));
        assert_eq!(question(&mut Holders::default(), &[twice, twice, &[0x21], twice, twice]), None);
    }
}
