//! Reads the descriptions and the initial inputs of boards. A request for a description or for inputs changes nothing
//! and is sent at most three times. The PC accepts an answer only if the numbers of received strings and packages are
//! correct (D-14).
use crate::master::engine::Link;
use crate::master::error::{Error, ExchangeError, Incomplete, SignalError};
use crate::master::io::{DescriptionKey, IoDescription, SnapshotAssembler};
use crate::master::procedures::exchange::{TRIES, info};
use crate::master::procedures::one_board::one_board_each;
use crate::master::reports::Outcome;
use ucom::{
    Assembled, BoardInfo, Dimensions, FromBoard, Function, Payload, Status, StringAssembler, ToBoard,
};

/// Limit of the strings in a description. A board cannot have more signals, because a bus could not carry their data.
const MAX_STRINGS: u32 = 4096;

/// Parts of one description that were received so far.
struct Collector {
    dimensions: Option<Dimensions>,
    strings: Vec<String>,
    assembler: StringAssembler,
}

impl Collector {
    fn push(&mut self, at: u64, payload: &Payload, link: &Link) -> Result<(), Incomplete> {
        let profile = link.profile();
        let Some(dimensions) = self.dimensions else {
            let need = 6;
            // Each string begins with a package of 2 bytes, followed by packages of 1 to 8 bytes. The first frame of a description is an
            // exception: its 6 bytes are the dimensions of the buffers.
            let start = Incomplete::Start { len: payload.len(), need };
            let dimensions = Dimensions::parse(payload, profile.endian).ok_or(start)?;
            self.dimensions = Some(dimensions);
            if dimensions.strings() > MAX_STRINGS {
                return Err(Incomplete::TooMany { strings: dimensions.strings() });
            }
            return Ok(());
        };
        let string = self.strings.len() as u32;
        if self.done() || dimensions.strings() <= string {
            return Err(Incomplete::Surplus);
        }
        // Only the last package of a string may have fewer than 8 bytes.
        if self.assembler.missing() > 1 && payload.len() < 8 {
            return Err(Incomplete::Misfit { string });
        }
        match self.assembler.push(at, payload, &profile) {
            Assembled::Partial => Ok(()),
            Assembled::Complete(text) => {
                self.strings.push(text.to_string());
                Ok(())
            }
            Assembled::Refused => Err(Incomplete::Misfit { string }),
        }
    }

    fn done(&self) -> bool {
        self.dimensions.is_some_and(|d| self.strings.len() as u32 == d.strings())
    }

    fn silence(&self) -> Incomplete {
        let of = self.dimensions.map_or(0, |d| d.strings());
        Incomplete::Silence { complete: self.strings.len() as u32, of }
    }

    /// Returns the reason why the answer is not complete: `problem`, or the byte order if it is probably wrong.
    fn problem(&self, problem: Incomplete) -> Incomplete {
        let exchanged = |d: &Dimensions| {
            let all = [d.ci, d.so, d.par];
            all.iter().all(|n| n & 0xFF == 0) && all.iter().any(|n| *n > 0)
        };
        match self.dimensions.filter(exchanged) {
            Some(d) => Incomplete::ByteOrder { strings: d.strings() },
            None => problem,
        }
    }

    fn description(self) -> Option<IoDescription> {
        let d = self.dimensions?;
        let mut strings = self.strings.into_iter();
        let description = strings.next()?;
        let mut take = |n: u16| strings.by_ref().take(n.into()).collect::<Vec<_>>();
        Some(IoDescription { description, ci: take(d.ci), so: take(d.so), par: take(d.par) })
    }
}

/// Sends the request for the description once. The function returns `None` if no frame arrived.
async fn try_describe(link: &Link, board: u8) -> Result<Option<Result<IoDescription, Incomplete>>, Error> {
    let (to, times) = (link.board(board)?, link.times());
    link.ask(to, ToBoard::DumpIo).await;
    let mut collector =
        Collector { dimensions: None, strings: Vec::new(), assembler: StringAssembler::new() };
    let mut until = link.now() + times.gap.max(times.info);
    loop {
        let Some(received) = link.next(until).await else {
            if collector.done() {
                return Ok(collector.description().map(Ok));
            }
            return Ok(collector.dimensions.map(|_| Err(collector.problem(collector.silence()))));
        };
        match received.message {
            FromBoard::IoDescription(payload) => {
                if let Err(problem) = collector.push(received.at, &payload, link) {
                    return Ok(Some(Err(collector.problem(problem))));
                }
                // A surplus frame would follow a complete description immediately, so a short wait is enough.
                until = link.now() + if collector.done() { times.quiet } else { times.gap };
            }
            message => {
                if let Some(error) = Link::device(board, &message, "the IO description") {
                    return Err(error.into());
                }
            }
        }
    }
}

/// Reads a board's description from the board, without any cache.
async fn read_description(link: &Link, board: u8) -> Result<IoDescription, Error> {
    link.listen(1 << board, &[Function::DumpIo]);
    let since = link.now();
    let mut problem = None;
    for tries in 0..TRIES {
        if tries > 0 {
            link.quiet(link.times().gap).await;
        }
        match try_describe(link, board).await? {
            Some(Ok(description)) => return Ok(description),
            Some(Err(p)) => problem = Some(p),
            None => {}
        }
    }
    let asked = Function::DumpIo;
    match problem {
        Some(problem) => Err(ExchangeError::Incomplete { board, asked, tries: TRIES, problem }.into()),
        None => Err(link.no_answer(board, asked, TRIES, since).into()),
    }
}

/// Returns the description of a board whose application runs. The board must have sent the description since the
/// application started.
///
/// A description from an earlier start can belong to another application, even if Program ID and date are equal
/// (D-36). Therefore the names in such a description are not used to write values.
pub(crate) async fn describe(link: &Link, board: u8, known: &BoardInfo) -> Result<IoDescription, Error> {
    let key = DescriptionKey::of(known);
    let kept = link.with(|core| {
        let sent = core.data.get(&board).is_some_and(|data| data.sent && data.description == Some(key));
        core.descriptions.get(&key).filter(|_| sent).cloned()
    });
    if let Some(description) = kept {
        return Ok(description);
    }
    let description = read_description(link, board).await?;
    link.with(|core| core.descriptions.insert(key, description.clone()));
    take_over(link, board, key, &description);
    Ok(description)
}

/// Sets the sizes of the board's buffers according to the description.
fn take_over(link: &Link, board: u8, key: DescriptionKey, description: &IoDescription) {
    let d = description.dimensions();
    link.with(|core| {
        let data = core.data.entry(board).or_default();
        data.description = Some(key);
        data.sent = true;
        data.ci.resize(d.ci.into(), 0);
        data.par.resize(d.par);
        if data.so.dimension() != usize::from(d.so) {
            data.so = SnapshotAssembler::new(d.so);
        }
    });
}

/// Reads the board's own initial inputs (MCA_DUMP_CI).
pub(crate) async fn read_initial_inputs(link: &Link, board: u8, dimension: u16) -> Result<Vec<u16>, Error> {
    let packages = u32::from(ucom::package_count(dimension));
    if packages == 0 {
        return Ok(Vec::new());
    }
    let (to, times) = (link.board(board)?, link.times());
    link.listen(1 << board, &[Function::DspCi]);
    let since = link.now();
    let mut received_any = false;
    let mut missing = packages;
    for tries in 0..TRIES {
        if tries > 0 {
            link.quiet(times.gap).await;
        }
        // Each attempt starts with an empty buffer, because a board can change its values between two attempts.
        let mut words = vec![0; dimension.into()];
        let mut seen = vec![false; packages as usize];
        link.ask(to, ToBoard::DumpCi).await;
        // The time of an attempt is limited, even if a board repeats its frames endlessly.
        let limit = link.now() + times.gap * u64::from(packages + 1);
        while missing_packages(&seen) > 0
            && let Some(received) = link.next((link.now() + times.gap).min(limit)).await
            && link.now() < limit
        {
            match received.message {
                FromBoard::Ci(package) if package.offset.is_multiple_of(3) => {
                    received_any = true;
                    if package.apply(&mut words).is_ok()
                        && let Some(place) = seen.get_mut(usize::from(package.offset / 3))
                    {
                        *place = true;
                    }
                }
                message => {
                    if let Some(error) = Link::device(board, &message, "MCA_DUMP_CI") {
                        return Err(error.into());
                    }
                }
            }
        }
        missing = missing_packages(&seen);
        if missing == 0 {
            return Ok(words);
        }
    }
    let asked = Function::DumpCi;
    if received_any {
        let problem = Incomplete::Packages { missing, of: packages };
        return Err(ExchangeError::Incomplete { board, asked, tries: TRIES, problem }.into());
    }
    Err(link.no_answer(board, asked, TRIES, since).into())
}

fn missing_packages(seen: &[bool]) -> u32 {
    seen.iter().filter(|seen| !**seen).count() as u32
}

/// Reads a board's identity and the state of its application, and then reads its description.
async fn described(link: &Link, board: u8) -> Result<(BoardInfo, IoDescription), Error> {
    let known = info(link, board).await?.info;
    one_board_each(link, &[board]).await?;
    if !known.status.has(Status::MSTART) {
        return Err(SignalError::NoApplication { board, valid: known.has_application() }.into());
    }
    let description = describe(link, board, &known).await?;
    Ok((known, description))
}

pub(crate) async fn describe_procedure(link: Link, board: u8, fresh: bool) -> Result<Outcome, Error> {
    if fresh {
        let known = info(&link, board).await?.info;
        link.with(|core| core.descriptions.remove(&DescriptionKey::of(&known)));
    }
    let (_, description) = described(&link, board).await?;
    Ok(Outcome::Description { board, description })
}

pub(crate) async fn initial_inputs_procedure(link: Link, board: u8) -> Result<Outcome, Error> {
    let (_, description) = described(&link, board).await?;
    let values = read_initial_inputs(&link, board, description.dimensions().ci).await?;
    link.with(|core| {
        if let Some(data) = core.data.get_mut(&board) {
            data.know_inputs(values.clone());
        }
    });
    Ok(Outcome::InitialInputs { board, values })
}
