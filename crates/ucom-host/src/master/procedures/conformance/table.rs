//! Table of all conformance tests: name, required permission, scope, expectation, and function.
use core::pin::Pin;

use crate::master::error::Error;
use crate::master::procedures::conformance::bench::Bench;
use crate::master::procedures::conformance::{application, ask, chain, program};
use crate::master::reports::{ConformanceOptions, Verdict};

/// Effect of a conformance test on boards. This effect determines which permission the test needs.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Level {
    /// The test does not change any board.
    Ask,
    /// The test resets and numbers boards, or changes bits of their status.
    Init,
    /// The test starts the application and its control loop.
    Run,
    /// The test writes a program to a board.
    Program,
}

impl Level {
    /// Returns the name of the option that the test needs; returns `None` if the test is already allowed.
    pub(super) fn needs(self, options: &ConformanceOptions) -> Option<&'static str> {
        match self {
            Self::Init if !options.init => Some("--init"),
            Self::Run if !options.run => Some("--run"),
            Self::Program if options.program.is_none() => Some("--program IMAGE"),
            _ => None,
        }
    }
}

/// Boards that a conformance test covers.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Scope {
    /// The test covers the whole chain once.
    Chain,
    /// The test covers the whole chain once. The boards need no numbers before the test, and possibly have no numbers
    /// after it.
    Numbers,
    /// The test covers each board.
    Board,
    /// The test covers the board with the first number. After the test, boards possibly have no numbers.
    First,
    /// The test covers the board that the user allowed the tests to program.
    Programmed,
}

/// Function that performs a test by exchanging frames with a board. For a test of the whole chain the board number is not used.
pub(super) type Talk =
    for<'a> fn(&'a mut Bench<'_>, u8) -> Pin<Box<dyn Future<Output = Result<Verdict, Error>> + Send + 'a>>;

/// Implementation of a test.
pub(super) enum Run {
    /// The test exchanges frames with a board.
    Talk(Talk),
    /// The test cannot be run on this bus; the text is the reason.
    Elsewhere(&'static str),
}

/// A conformance test.
pub(super) struct Test {
    pub id: &'static str,
    pub level: Level,
    pub scope: Scope,
    /// Behaviour that the test expects, in words.
    pub expects: &'static str,
    pub run: Run,
}

impl Test {
    /// Returns `true` if each board must complete this test and the `next` test before the tests of another board
    /// begin.
    pub(super) fn goes_with(&self, next: &Self) -> bool {
        let board = |test: &Self| matches!(test.scope, Scope::Board | Scope::Programmed);
        board(self) && board(next) && (self.level == next.level || next.level == Level::Program)
    }
}

macro_rules! talk {
    ($test:path) => {
        Run::Talk(|bench, board| Box::pin($test(bench, board)))
    };
}

/// All tests in the order in which they run, with the numbers of the acceptance tests.
#[rustfmt::skip]
pub(super) static TESTS: [Test; 21] = [
    Test { id: "D-T2", level: Level::Ask, scope: Scope::Chain, run: talk!(ask::reports),
        expects: "PC_REPORT twice: the same reports, and the boards keep their numbers" },
    Test { id: "D-T5", level: Level::Ask, scope: Scope::Board, run: talk!(ask::init_again),
        expects: "PC_INIT with its own number: only this board acknowledges again" },
    Test { id: "D-T10", level: Level::Ask, scope: Scope::Board, run: talk!(ask::description),
        expects: "IO description: dimensions, then exactly 1 + CI + SO + PAR strings; with one byte of data no answer" },
    Test { id: "D-T11", level: Level::Ask, scope: Scope::Board, run: talk!(ask::initial_inputs),
        expects: "MCA_DUMP_CI: packages at 0, 3, 6 …, surplus words 0" },
    Test { id: "D-T1", level: Level::Init, scope: Scope::Numbers, run: talk!(chain::reset),
        expects: "PC_RESET: one report of each board within 500 ms and its delay, under the identifier of its flash id" },
    Test { id: "D-T3", level: Level::Init, scope: Scope::Numbers, run: talk!(chain::unnumbered),
        expects: "boards without a number answer nothing but reset, report and PC_INIT" },
    Test { id: "D-T4", level: Level::Init, scope: Scope::Numbers, run: talk!(chain::wire),
        expects: "numbers follow the init wire: the next board is silent until the pin of the previous \
                  board is on" },
    Test { id: "D-T6", level: Level::Init, scope: Scope::Board, run: talk!(chain::formula),
        expects: "PC_SETSTATUS 0040 sets ASTART (the formula, literally), 4000 clears it" },
    Test { id: "D-T7", level: Level::Init, scope: Scope::Board, run: talk!(chain::mirrors),
        expects: "PC_SETSTATUS of IPINIT, EXLRUN, MCARUN changes nothing: they mirror the real state" },
    Test { id: "D-T16", level: Level::Init, scope: Scope::First, run: talk!(chain::autostart),
        expects: "PC_XRESET within 300 ms of PC_INIT prevents the autostart" },
    Test { id: "D-T8", level: Level::Run, scope: Scope::Board, run: talk!(application::walk),
        expects: "status walk: PC_XRESET 1F, PC_START 8B, MCA_PC_START AB, run = 0 8B, MSTART = 0 1B (pins as they are)" },
    Test { id: "D-T9", level: Level::Run, scope: Scope::Board, run: talk!(application::start),
        expects: "PC_START: MCA_DSP_READY within 2 s and EXLRUN = 0; without an application error 11" },
    Test { id: "D-T12", level: Level::Run, scope: Scope::Board, run: talk!(application::inputs),
        expects: "CI at the dimension: error 5; surplus words after the last one are ignored" },
    Test { id: "D-T13", level: Level::Run, scope: Scope::Board, run: talk!(application::alone),
        expects: "no heartbeat of the PC: loop ends after 1.5 s, flags 0, no outputs; a heartbeat does not restart it, MCA_PC_START does" },
    Test { id: "D-T14", level: Level::Run, scope: Scope::Board, run: talk!(application::alive),
        expects: "heartbeats for 60 s: runs; one missing: runs; three missing: safe" },
    Test { id: "D-T15", level: Level::Run, scope: Scope::Board, run: talk!(application::flags),
        expects: "flags 02000000: ignored; flags of three bytes: error 7" },
    Test { id: "D-T18", level: Level::Program, scope: Scope::Programmed, run: talk!(program::refusals),
        expects: "a wrong length, a pause, a bad header, another board's, beyond the memory, other cycle 2: errors 7 10 5 2 2 10, once each, and the application stays" },
    Test { id: "D-T17", level: Level::Program, scope: Scope::Programmed, run: talk!(program::update),
        expects: "update by frames: DSP_READY after each block, then DSP_PROGFINISHED; PC_INFO shows Program ID and date" },
    Test { id: "D-T19", level: Level::Ask, scope: Scope::Chain,
        expects: "broadcast program data: boards with PROG = 1 take them, the others are silent",
        run: Run::Elsewhere("would program several boards at once: use `ucom update --group`, which shows \
                             the result of each board") },
    Test { id: "D-T20", level: Level::Ask, scope: Scope::Chain,
        expects: "PC_INIT before the last DSP_INITACK has left: error 9",
        run: Run::Elsewhere("needs a bus that delays the acknowledgement: use the simulator's fault ack-held") },
    Test { id: "D-T21", level: Level::Ask, scope: Scope::Chain,
        expects: "two boards with one flash id: one report is seen, and the PC reports that there are more boards than reports",
        run: Run::Elsewhere("needs two boards with one flash id: use `ucom sim --flash-ids 0x21,0x21`") },
];

/// Returns the names of all conformance tests, for a command line.
pub fn test_names() -> impl Iterator<Item = &'static str> {
    let mut names: Vec<&str> = TESTS.iter().map(|test| test.id).collect();
    names.sort_by_key(|name| (name.len(), *name));
    names.into_iter()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_test_stands_once() {
        assert!(test_names().eq((1..=21).map(|number| format!("D-T{number}"))));
    }
}
