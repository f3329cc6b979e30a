//! What the conformance tests may do, and how each ended.
use crate::master::error::Error;
use crate::master::reports::update::UpdateImage;
use host_kit::{Diagnose, ErrorKind};
use serde::Serialize;
use std::collections::BTreeMap;

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
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConformanceProgram {
    /// Its number.
    pub board: u8,
    /// The flash number that it must have; the header of the image names it, so that no other board takes it.
    pub flash_number: u16,
    /// The program.
    pub image: UpdateImage,
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

impl ConformanceTest {
    /// What was tested, in words: `board 3`, or `chain`.
    pub fn subject(&self) -> String {
        self.board.map_or_else(|| "chain".into(), |n| format!("board {n}"))
    }
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

    /// Tests that were not done.
    pub fn skipped(&self) -> usize {
        self.tests.len() - self.passed() - self.failed()
    }

    /// Names of the tests that were not allowed, by the option that would have allowed them; each once, however many boards there
    /// are.
    pub fn not_allowed(&self) -> BTreeMap<&'static str, Vec<&'static str>> {
        let mut by_option: BTreeMap<_, Vec<_>> = BTreeMap::new();
        for (option, test) in self.tests.iter().filter_map(|test| Some((test.needs?, test))) {
            let ids = by_option.entry(option).or_default();
            if !ids.contains(&test.id) {
                ids.push(test.id);
            }
        }
        by_option
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
