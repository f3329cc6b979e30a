//! Whether boards do what the protocol page says: the acceptance tests of the board side, against boards that are there.
//!
//! By default only what changes nothing is asked. More is allowed by [`ConformanceOptions`]: numbering the chain anew,
//! running applications with safe outputs, programming. Each test is a short conversation in frames of its own making, so that
//! the procedures of this crate are not their own judges.

mod application;
mod ask;
mod bench;
mod chain;
mod program;

use std::prelude::v1::*;

use serde::Serialize;

use super::link::Link;
use super::request::{confirmed, numbers};
use super::{BoardSeen, Error, Outcome};
use crate::{Function, Status};
use bench::Bench;

/// What the tests may do.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ConformanceOptions {
    /// The boards; empty: all that answer.
    pub boards: Vec<u8>,
    /// Reset and number the chain anew, set and clear status bits.
    pub init: bool,
    /// Start applications and control loops, outputs safe.
    pub run: bool,
    /// Program boards with this image, in wire order, and this flash date.
    pub program: Option<(Vec<u8>, u16)>,
    /// Only the tests with these names; empty: all.
    pub only: Vec<String>,
    /// Also when another PC is on the bus.
    pub force: bool,
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
}

/// What a test needs to be allowed.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Level {
    Ask,
    Init,
    Run,
    Program,
}

/// Name, level and expectation of every test; the numbers are those of the acceptance tests.
const TESTS: [(&str, Level, &str); 19] = [
    (
        "D-T1",
        Level::Init,
        "PC_RESET: one report of each board within 500 ms and its delay, under the identifier of its flash id",
    ),
    ("D-T2", Level::Ask, "PC_REPORT twice: the same reports, and nothing is forgotten"),
    ("D-T3", Level::Init, "boards without a number answer nothing but reset, report and PC_INIT"),
    (
        "D-T4",
        Level::Init,
        "numbers follow the init wire: the next board is silent until the pin before it is raised",
    ),
    ("D-T5", Level::Ask, "PC_INIT with its own number: acknowledged again, by this board alone"),
    ("D-T6", Level::Init, "PC_SETSTATUS 0040 sets ASTART (the formula, literally), 4000 clears it"),
    ("D-T7", Level::Init, "PC_SETSTATUS of IPINIT, EXLRUN, MCARUN changes nothing: they mirror reality"),
    (
        "D-T8",
        Level::Run,
        "status walk: PC_XRESET 1F, PC_START 8B, MCA_PC_START AB, run = 0 8B, MSTART = 0 1B (pins as they are)",
    ),
    (
        "D-T9",
        Level::Run,
        "PC_START: MCA_DSP_READY within 2 s and EXLRUN = 0; without an application error 11",
    ),
    (
        "D-T10",
        Level::Ask,
        "IO description: dimensions, then exactly 1 + CI + SO + PAR strings; with one byte of data no answer",
    ),
    ("D-T11", Level::Ask, "MCA_DUMP_CI: packages at 0, 3, 6 …, surplus words 0"),
    ("D-T12", Level::Run, "CI at the dimension: error 5; surplus words behind the last one are ignored"),
    (
        "D-T13",
        Level::Run,
        "no life sign of the PC: loop ends after 1.5 s, flags 0, no outputs; a life sign does not restart it, MCA_PC_START does",
    ),
    ("D-T14", Level::Run, "life signs for 60 s: runs; one missing: runs; three missing: safe"),
    ("D-T15", Level::Run, "flags 02000000: ignored; flags of three bytes: error 7"),
    ("D-T16", Level::Init, "PC_XRESET within 300 ms of PC_INIT prevents the autostart"),
    (
        "D-T17",
        Level::Program,
        "update by frames: DSP_READY after each block, then DSP_PROGFINISHED; PC_INFO shows Program ID and date",
    ),
    (
        "D-T18",
        Level::Program,
        "a wrong length, a pause, a bad header, another board's, beyond the memory, other cycle 2: errors 7 10 5 2 2 10, once each, and the application stays",
    ),
    ("D-T20", Level::Init, "PC_INIT before the last DSP_INITACK has left: error 9"),
];

/// Names of all tests, for a command line.
pub fn test_names() -> impl Iterator<Item = &'static str> {
    TESTS.iter().map(|(id, ..)| *id)
}

pub(crate) async fn conformance(link: Link, options: ConformanceOptions) -> Result<Outcome, Error> {
    let mut boards = Vec::new();
    let asked: Vec<u8> = match options.boards.is_empty() {
        true => link.profile().board_numbers().map(|n| n.number()).collect(),
        false => options.boards.clone(),
    };
    for board in asked {
        link.board(board)?;
        match confirmed(&link, board).await {
            Ok(seen) => boards.push(seen),
            Err(Error::NoAnswer { .. }) if options.boards.is_empty() => {}
            Err(e) => return Err(e),
        }
    }
    let intrusive = options.init || options.run || options.program.is_some();
    let running: Vec<u8> =
        boards.iter().filter(|b| b.info.status.has(Status::MCARUN)).map(|b| b.number).collect();
    if intrusive && !running.is_empty() {
        return Err(Error::LoopRuns { boards: running });
    }
    if intrusive {
        link.become_master(options.force).await?;
    }
    link.with(|core| core.tap(link.id, true));
    let mut tests = Run { link: &link, options: &options, report: ConformanceReport::default() };
    let result = all(&mut tests, &boards).await;
    link.with(|core| core.tap(link.id, false));
    let report = tests.report;
    result.map(|()| Outcome::Conformance(report))
}

/// The tests under way.
struct Run<'a> {
    link: &'a Link,
    options: &'a ConformanceOptions,
    report: ConformanceReport,
}

impl Run<'_> {
    fn wanted(&self, id: &str) -> bool {
        self.options.only.is_empty() || self.options.only.iter().any(|o| o.eq_ignore_ascii_case(id))
    }

    fn bench(&self) -> Bench<'_> {
        Bench::new(self.link)
    }

    /// Whether a test is to be done; one that is not allowed is skipped with its reason.
    fn may(&mut self, id: &'static str, board: Option<u8>) -> bool {
        if !self.wanted(id) {
            return false;
        }
        let level = TESTS.iter().find(|(name, ..)| *name == id).map_or(Level::Ask, |(_, level, _)| *level);
        let (allowed, option) = match level {
            Level::Ask => (true, ""),
            Level::Init => (self.options.init, "--init"),
            Level::Run => (self.options.run, "--run"),
            Level::Program => (self.options.program.is_some(), "--program IMAGE"),
        };
        if !allowed {
            let why = Verdict::Skipped(format!("only with {option}"));
            self.note(id, board, why, Vec::new(), Vec::new());
        }
        allowed
    }

    fn note(
        &mut self,
        id: &'static str,
        board: Option<u8>,
        verdict: Verdict,
        sent: Vec<String>,
        came: Vec<String>,
    ) {
        let expected = TESTS.iter().find(|(name, ..)| *name == id).map_or("", |(.., expected)| *expected);
        self.report.tests.push(ConformanceTest { id, board, expected, verdict, sent, came });
    }
}

/// Does one test when it may be done.
macro_rules! test {
    ($run:ident, $id:literal, $board:expr, $bench:ident => $body:expr) => {
        if $run.may($id, $board) {
            let mut $bench = $run.bench();
            let verdict = $body;
            let (sent, came) = $bench.log();
            $run.note($id, $board, verdict, sent, came);
        }
    };
}

async fn all(run: &mut Run<'_>, boards: &[BoardSeen]) -> Result<(), Error> {
    let numbers_of: Vec<u8> = boards.iter().map(|b| b.number).collect();
    test!(run, "D-T2", None, bench => ask::reports(&mut bench, boards).await?);
    let strangers = ask::strangers(&mut run.bench(), boards.len()).await;
    for board in boards {
        let n = board.number;
        test!(run, "D-T5", Some(n), bench => ask::init_again(&mut bench, n, strangers, run.options.force).await?);
        test!(run, "D-T10", Some(n), bench => ask::description(&mut bench, n).await?);
        test!(run, "D-T11", Some(n), bench => ask::initial_inputs(&mut bench, n).await?);
    }
    if run.options.init {
        chain(run, boards).await?;
    } else {
        for id in ["D-T1", "D-T3", "D-T4", "D-T6", "D-T7", "D-T16", "D-T20"] {
            run.may(id, None);
        }
    }
    for n in &numbers_of {
        let n = *n;
        let before = numbers(run.link, n).await?;
        test!(run, "D-T8", Some(n), bench => application::walk(&mut bench, n).await?);
        test!(run, "D-T9", Some(n), bench => application::start(&mut bench, n).await?);
        test!(run, "D-T12", Some(n), bench => application::inputs(&mut bench, n).await?);
        test!(run, "D-T13", Some(n), bench => application::alone(&mut bench, n).await?);
        test!(run, "D-T14", Some(n), bench => application::alive(&mut bench, n).await?);
        test!(run, "D-T15", Some(n), bench => application::flags(&mut bench, n).await?);
        if run.options.run {
            bench::restore(run.link, n, before.status).await?;
        }
        let image = run.options.program.clone().unwrap_or_default();
        test!(run, "D-T18", Some(n), bench => program::refusals(&mut bench, n, &image).await?);
        test!(run, "D-T17", Some(n), bench => program::update(&mut bench, n, &image).await?);
        if run.options.program.is_some() {
            bench::restore(run.link, n, before.status).await?;
        }
    }
    Ok(())
}

/// Tests of the chain; in the end every board has its number again.
async fn chain(run: &mut Run<'_>, boards: &[BoardSeen]) -> Result<(), Error> {
    test!(run, "D-T1", None, bench => chain::reset(&mut bench, boards).await);
    test!(run, "D-T3", None, bench => chain::unnumbered(&mut bench).await);
    test!(run, "D-T4", None, bench => chain::wire(&mut bench, boards).await);
    let whole = super::InitOptions { force: run.options.force, ..Default::default() };
    super::init::init(run.link.clone(), whole.clone()).await?;
    for board in boards {
        let n = board.number;
        test!(run, "D-T6", Some(n), bench => chain::formula(&mut bench, n).await?);
        test!(run, "D-T7", Some(n), bench => chain::mirrors(&mut bench, n).await?);
    }
    if let Some(first) = boards.first() {
        test!(run, "D-T16", Some(first.number), bench => chain::autostart(&mut bench, first).await?);
        super::init::init(run.link.clone(), whole).await?;
    }
    let why = "needs a bus that holds the acknowledge back: the simulator's fault ack-held does".to_owned();
    if run.may("D-T20", None) {
        run.note("D-T20", None, Verdict::Skipped(why), Vec::new(), Vec::new());
    }
    Ok(())
}

/// Functions that come by themselves and answer nothing.
const NOISE: [Function; 3] = [Function::So, Function::Alive, Function::Debug];
