//! Requests to boards that procedures use, each with a limited number of repetitions.
use crate::master::engine::Link;
use crate::master::error::{Error, ExchangeError, IdentityError, Incomplete, StatusError};
use crate::master::reports::BoardSeen;
use ucom::{Admin, Assembled, BoardInfo, FromBoard, Function, Payload, Status, StringAssembler, ToBoard};

/// Maximum number of times that a request is sent. A request is repeated only if its repetition has no further effect on the board.
pub(crate) const TRIES: u32 = 3;

/// Result of one PC_INFO request.
#[derive(Debug)]
pub(crate) enum Answer {
    /// No frame of the board arrived.
    Silence,
    /// The frames of the board were not a valid answer.
    Broken(Incomplete),
    /// Values in the first frame of the answer. The description of the board is included only if it was complete.
    Info(BoardInfo, Option<String>),
}

/// Collects the frames of one DSP_INFO answer.
#[derive(Default)]
pub(crate) struct InfoCollector {
    info: Option<BoardInfo>,
    assembler: StringAssembler,
    text: Option<String>,
    broken: bool,
}

impl InfoCollector {
    /// Handles a frame of DSP_INFO. Returns `Err` if the frame does not belong to an answer.
    pub(crate) fn push(&mut self, at: u64, payload: &Payload, link: &Link) -> Result<(), Incomplete> {
        let profile = link.profile();
        if self.info.is_none() {
            let start = Incomplete::Start { len: payload.len(), need: 8 };
            self.info = Some(BoardInfo::parse(payload, profile.endian).ok_or(start)?);
        } else if self.text.is_some() || (self.assembler.missing() > 1 && payload.len() < 8) {
            self.broken = true;
        } else {
            match self.assembler.push(at, payload, &profile) {
                Assembled::Partial => {}
                Assembled::Complete(text) => self.text = Some(text.to_string()),
                Assembled::Refused => self.broken = true,
            }
        }
        Ok(())
    }

    pub(crate) fn finished(&self) -> bool {
        self.broken || self.text.is_some()
    }

    pub(crate) fn answer(self) -> Answer {
        match self.info {
            None => Answer::Silence,
            Some(info) => Answer::Info(info, self.text.filter(|_| !self.broken)),
        }
    }
}

/// Sends a single PC_INFO and waits for the answer. The filter of the mailbox must accept DSP_INFO.
pub(crate) async fn ask_info(link: &Link, board: u8) -> Result<Answer, Error> {
    let (to, times) = (link.board(board)?, link.times());
    link.ask(to, ToBoard::Info).await;
    let mut collector = InfoCollector::default();
    let mut until = link.now() + times.info;
    while !collector.finished() {
        let Some(received) = link.next(until).await else { break };
        if received.from != board {
            continue;
        }
        if let FromBoard::Info(payload) = received.message {
            if let Err(problem) = collector.push(received.at, &payload, link) {
                return Ok(Answer::Broken(problem));
            }
            until = link.now() + times.gap;
        }
    }
    let answer = collector.answer();
    if let Answer::Info(info, text) = &answer {
        // A string package can be mistaken for the first frame of an answer. At the positions of the status and the
        // board number, such a package has other bytes.
        if info.status.contradiction().is_some() || !info.status.has(Status::INIT) {
            return Ok(Answer::Broken(Incomplete::Misfit { string: 0 }));
        }
        if info.sequence != board {
            return Err(IdentityError::WrongSequence { board, reported: info.sequence }.into());
        }
        remember(link, board, info, text.as_deref());
    }
    Ok(answer)
}

/// Stores a board's answer to PC_INFO.
pub(crate) fn remember(link: &Link, board: u8, info: &BoardInfo, text: Option<&str>) {
    link.with(|core| {
        let now = core.now;
        let known = core.boards.of(board);
        if known.info.is_some_and(|old| old.flash_number != info.flash_number) {
            *known = Default::default();
        }
        let was_started = known.status().is_some_and(|s| s.has(Status::MSTART));
        known.info = Some(*info);
        known.rebooted = false;
        if let Some(text) = text {
            known.description = Some(text.into());
        }
        let starts_itself = info.status.has(Status::ASTART) && info.has_application();
        known.stopped_at = match info.status.has(Status::MSTART) || starts_itself {
            true => None,
            false => known.stopped_at.or(Some(now)),
        };
        if !info.status.has(Status::MSTART) {
            known.application_ended();
            if was_started {
                core.forget_parameters(board);
            }
        }
    });
}

/// Sends PC_INFO to a board and reads the answer with the description. The function makes at most three attempts.
///
/// If the description is never complete, the function returns the values of the first frame without the description. If an answer contains
/// another board number, PC_INFO is sent again. If a later answer contains the same wrong number, the procedure ends at once with an error
/// (D-24).
pub(crate) async fn info(link: &Link, board: u8) -> Result<BoardSeen, Error> {
    info_for(link, board, true).await
}

/// Sends PC_INFO and reads only the first frame of the answer.
pub(crate) async fn numbers(link: &Link, board: u8) -> Result<BoardInfo, Error> {
    info_for(link, board, false).await.map(|seen| seen.info)
}

async fn info_for(link: &Link, board: u8, description: bool) -> Result<BoardSeen, Error> {
    link.listen(1 << board, &[Function::DspInfo]);
    let since = link.now();
    let (mut numbers, mut problem) = (None, None);
    let mut mismatch = None;
    for tries in 0..TRIES {
        if tries > 0 {
            // The remaining frames of an incomplete answer must not mix with the next answer.
            link.quiet(link.times().gap).await;
        }
        match ask_info(link, board).await {
            Ok(Answer::Info(info, text)) if text.is_some() || !description => {
                return Ok(BoardSeen { number: board, info, description: text });
            }
            Ok(Answer::Info(info, _)) => numbers = Some(info),
            Ok(Answer::Broken(p)) => problem = Some(p),
            Ok(Answer::Silence) => {}
            // A single damaged frame can contain any values, so PC_INFO is sent again.
            Err(e @ Error::Identity(IdentityError::WrongSequence { .. }))
                if mismatch.as_ref() != Some(&e) =>
            {
                mismatch = Some(e)
            }
            Err(e) => return Err(e),
        }
    }
    if let Some(info) = numbers {
        return Ok(BoardSeen { number: board, info, description: None });
    }
    let asked = Function::DspInfo;
    match (mismatch, problem) {
        (Some(mismatch), _) => Err(mismatch),
        (None, Some(problem)) => {
            Err(ExchangeError::Incomplete { board, asked, tries: TRIES, problem }.into())
        }
        (None, None) => Err(link.no_answer(board, Function::Info, TRIES, since).into()),
    }
}

/// Sends PC_INFO to a board until two consecutive answers agree. Therefore the function never mistakes one damaged answer for another
/// board.
pub(crate) async fn confirmed(link: &Link, board: u8) -> Result<BoardSeen, Error> {
    let mut first = info(link, board).await?;
    for _ in 0..TRIES {
        let second = info(link, board).await?;
        let same = identity(&first.info) == identity(&second.info);
        let description = second.description.clone().or(first.description);
        first = BoardSeen { description, ..second };
        if same {
            return Ok(first);
        }
    }
    Err(ExchangeError::Contradiction { board, tries: TRIES + 1 }.into())
}

/// Returns the flash number, the Program ID and the flash date, which are equal in all answers of one board.
pub(crate) fn identity(info: &BoardInfo) -> (u16, u16, u16) {
    (info.flash_number, info.program_id, info.date)
}

/// Sends PC_SETSTATUS and reads the status back with PC_INFO. The function repeats the command and the query if the board did not execute
/// the command (D-22). The function never sends value bits that are outside the mask.
pub(crate) async fn set_status(
    link: &Link,
    board: u8,
    mask: Status,
    value: Status,
) -> Result<BoardInfo, Error> {
    let to = link.board(board)?;
    let value = value & mask;
    let mut status = Status(0);
    for _ in 0..TRIES {
        link.send(to, ToBoard::SetStatus { mask: mask.0, value: value.0 }).await;
        let info = numbers(link, board).await?;
        status = info.status;
        if status & mask == value {
            return Ok(info);
        }
    }
    Err(StatusError::StatusNotTaken { board, mask, wanted: value, status, tries: TRIES }.into())
}

/// Sends MCA_ADMIN_DATA to a board. The board answers with its flags.
pub(crate) async fn admin(link: &Link, board: u8, wanted: Admin) -> Result<Admin, Error> {
    let to = link.board(board)?;
    let wanted = Admin { active: wanted.active && wanted.run, ..wanted };
    ask_admin(link, board, ToBoard::Admin(wanted), to, |is| is == wanted, wanted).await
}

/// Sends MCA_PC_START to a board. The board answers with its flags.
pub(crate) async fn mca_start(link: &Link, board: u8) -> Result<Admin, Error> {
    let to = link.board(board)?;
    let wanted = Admin { run: true, ..Admin::default() };
    ask_admin(link, board, ToBoard::McaStart, to, |is| is.run, wanted).await
}

/// Sends a request that the board answers with its flags. An error of the board does not end the exchange: a bad bus
/// can cause errors, and a board often reports an error when the request itself was lost. If all attempts fail, the
/// function returns the error of the board.
async fn ask_admin(
    link: &Link,
    board: u8,
    ask: ToBoard,
    to: ucom::Sequence,
    taken: impl Fn(Admin) -> bool,
    wanted: Admin,
) -> Result<Admin, Error> {
    link.listen(1 << board, &[Function::Admin]);
    let since = link.now();
    let (mut other, mut error) = (None, None);
    for _ in 0..TRIES {
        link.ask(to, ask).await;
        let until = link.now() + link.times().admin;
        while let Some(received) = link.next(until).await {
            match received.message {
                FromBoard::Admin(is) if taken(is) => return Ok(is),
                // The board sent these flags before it received the request.
                FromBoard::Admin(is) => other = Some(is),
                message => error = Link::device(board, &message, "MCA_ADMIN_DATA").or(error),
            }
        }
    }
    match (error, other) {
        (Some(error), _) => Err(error.into()),
        (None, Some(is)) => Err(StatusError::AdminRefused { board, wanted, is }.into()),
        (None, None) => Err(link.no_answer(board, ask.function(), TRIES, since).into()),
    }
}
