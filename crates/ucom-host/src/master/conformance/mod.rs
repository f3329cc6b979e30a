//! Whether boards follow the protocol page: the acceptance tests of the board side, against boards that are there.
//!
//! By default only what changes nothing is asked. More is allowed by [`ConformanceOptions`]: a new address assignment,
//! running applications with safe outputs, programming. Each test is a short conversation in frames of its own making, so that
//! the procedures of this crate are not their own judges.

mod application;
mod ask;
mod bench;
mod chain;
mod order;
mod program;
mod restore;
mod table;
use crate::master::ErrorKind;
use serde::Serialize;

use super::holders::one_board_each;
use super::link::Link;
use super::request::confirmed;
use super::scan::board_states;
use super::{Error, Outcome};
use order::Run;
use restore::Found;
pub use table::test_names;
use ucom::{Function, Status};

/// What the tests may do.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ConformanceOptions {
    /// The boards; empty: all that answer.
    pub boards: Vec<u8>,
    /// Reset and number the chain anew, set and clear status bits.
    pub init: bool,
    /// Start applications and control loops, outputs safe.
    pub run: bool,
    /// Program one board.
    pub program: Option<ConformanceProgram>,
    /// Only the tests with these names; empty: all.
    pub only: Vec<String>,
    /// Also when another PC is on the bus.
    pub force: bool,
}

impl ConformanceOptions {
    /// Whether tests are allowed that change something on a board.
    pub fn changes(&self) -> bool {
        self.init || self.run || self.program.is_some()
    }
}

/// What one board is programmed with.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ConformanceProgram {
    /// Its number.
    pub board: u8,
    /// The flash number that it must have; the header of the image names it, so that no other board takes it.
    pub flash_number: u16,
    /// The program.
    pub image: Vec<u8>,
    /// Where it is loaded to, in words.
    pub address: u32,
    /// Flash date, in the form of the profile's `prog.date`.
    pub date: u16,
}

/// How a test ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase", tag = "verdict", content = "why")]
pub enum Verdict {
    /// The board does what was expected.
    Pass,
    /// It does not; what came instead.
    Fail(String),
    /// Not done; why.
    Skipped(String),
}

/// One test of one board, or of the chain.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ConformanceTest {
    /// Its name, as `D-T10`.
    pub id: &'static str,
    /// The board; `None`: the chain as a whole.
    pub board: Option<u8>,
    /// What was expected.
    pub expected: &'static str,
    /// How it ended.
    #[serde(flatten)]
    pub verdict: Verdict,
    /// The option that would have allowed it; `None`: it was allowed.
    pub needs: Option<&'static str>,
    /// Frames that were sent, in candump's form.
    pub sent: Vec<String>,
    /// Frames that came, at most 64 of them.
    pub came: Vec<String>,
}

/// All tests.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ConformanceReport {
    /// In the order in which they were done.
    pub tests: Vec<ConformanceTest>,
    /// What is not as it was found, and the command that helps.
    pub left: Vec<String>,
    /// Why the tests ended before the last one; those that were left are skipped.
    #[serde(skip)]
    pub error: Option<Error>,
}

impl ConformanceReport {
    /// Tests that failed.
    pub fn failed(&self) -> usize {
        self.tests.iter().filter(|t| matches!(t.verdict, Verdict::Fail(_))).count()
    }

    /// Tests that were passed.
    pub fn passed(&self) -> usize {
        self.tests.iter().filter(|t| t.verdict == Verdict::Pass).count()
    }

    /// What kind of failure it is: that of the error that ended the tests; of the board when a test failed, or a board is not
    /// as it was found. `None`: every test was passed.
    pub fn failure(&self) -> Option<ErrorKind> {
        match &self.error {
            Some(error) => Some(error.kind()),
            None => (self.failed() > 0 || !self.left.is_empty()).then_some(ErrorKind::Device),
        }
    }
}

pub(crate) async fn conformance(link: Link, options: ConformanceOptions) -> Result<Outcome, Error> {
    let (found, strangers) = link.or_cancel(look(&link, &options)).await?;
    link.with(|core| core.tap(link.id, true));
    let mut tests = Run::new(&link, &options, &found, strangers);
    let result = link.or_cancel(tests.all()).await;
    link.with(|core| core.tap(link.id, false));
    link.bear_shared_numbers(true);
    if let Err(error) = result {
        let why = match &error {
            Error::Cancelled => "cancelled".to_owned(),
            Error::NoAnswer { board, .. } => format!("board {board} does not answer"),
            other => other.to_string(),
        };
        tests.skip_rest(&why);
        tests.report.error = Some(error);
    }
    let Run { mut report, unnumbered, at, .. } = tests;
    if options.changes() && !matches!(report.error, Some(Error::Bus { .. })) {
        let at = at.filter(|_| report.error.is_some());
        let back = restore::put_all_back(&link, &found, &options, unnumbered, at, &mut report.left);
        if let Err(error) = link.or_cancel(back).await {
            report.left.push(format!("not every board is as it was found ({error}): `ucom scan`"));
        }
    } else if options.changes() {
        report.left.push("the boards are as the last test left them: `ucom scan`, `ucom init`".into());
    }
    Ok(Outcome::Conformance(report))
}

/// Which boards are there, and whether the tests may be done with them. Changes nothing.
async fn look(link: &Link, options: &ConformanceOptions) -> Result<(Found, bool), Error> {
    let mut boards = Vec::new();
    let asked: Vec<u8> = match options.boards.is_empty() {
        true => link.profile().board_numbers().map(|n| n.number()).collect(),
        false => options.boards.clone(),
    };
    for board in asked {
        link.board(board)?;
        match confirmed(link, board).await {
            Ok(seen) => boards.push(seen),
            Err(Error::NoAnswer { .. }) if options.boards.is_empty() => {}
            Err(e) => return Err(e),
        }
    }
    one_board_each(link, &boards.iter().map(|b| b.number).collect::<Vec<_>>()).await?;
    let mut running: Vec<u8> =
        boards.iter().filter(|b| b.info.status.has(Status::MCARUN)).map(|b| b.number).collect();
    if let Some(program) = &options.program {
        let board = program.board;
        let seen = match boards.iter().find(|b| b.number == board) {
            Some(seen) => seen.clone(),
            None => return Err(link.no_answer(board, Function::Info, 3, link.now())),
        };
        if seen.info.flash_number != program.flash_number {
            let (wanted, found) = (program.flash_number, seen.info.flash_number);
            return Err(Error::WrongBoard { board, wanted, found });
        }
        // U-2: program data outrank the process data of any board that runs, tested or not.
        let states = board_states(link).await;
        running.extend(states.iter().filter(|(_, s)| s.has(Status::MCARUN)).map(|(b, _)| *b));
        running.sort_unstable();
        running.dedup();
    }
    if options.changes() && !running.is_empty() {
        return Err(Error::LoopRuns { boards: running });
    }
    let (reports, all) = order::who_reports(link, &boards).await;
    if options.init && !all {
        return Err(Error::NotNumbered { reports: reports as u32, boards: boards.len() as u32 });
    }
    if options.changes() {
        link.become_master(options.force).await?;
    }
    Ok((Found { boards }, !all))
}

/// Functions that come by themselves and answer nothing.
const NOISE: [Function; 3] = [Function::So, Function::Alive, Function::Debug];
