//! Options and results of the conformance tests.
use crate::master::error::Error;
use crate::master::reports::update::UpdateImage;
use host_kit::{Diagnose, ErrorKind};
use serde::Serialize;
use std::collections::BTreeMap;

/// Permissions for the tests, and the selection of tests and boards.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ConformanceOptions {
    /// Numbers of the boards to test. If this list is empty, the tests cover all boards that answer.
    pub boards: Vec<u8>,
    /// Permission to reset and renumber the chain, and to set and clear status bits.
    pub init: bool,
    /// Permission to start applications and control loops, with safe outputs.
    pub run: bool,
    /// Program for one board, and permission to program that board.
    pub program: Option<ConformanceProgram>,
    /// Names of the tests to run. An empty list selects all tests.
    pub only: Vec<String>,
    /// Permission to run the tests while another PC is on the bus.
    pub force: bool,
}

impl ConformanceOptions {
    /// Returns `true` if tests that change a board are allowed.
    pub fn changes(&self) -> bool {
        self.init || self.run || self.program.is_some()
    }
}

/// Program for one board, which the programming tests write.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConformanceProgram {
    /// Number of the board that the tests may program.
    pub board: u8,
    /// Flash number that the board must have. The header of the image contains this number, so that other boards refuse the image.
    pub flash_number: u16,
    /// Image of the program.
    pub image: UpdateImage,
    /// Flash date in the form that `prog.date` in the profile defines.
    pub date: u16,
}

/// Result of a conformance test.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase", tag = "verdict", content = "why")]
pub enum Verdict {
    /// The board behaves as the test expects.
    Pass,
    /// The test failed; the text describes the actual result.
    Fail(String),
    /// The test was skipped; the text contains the reason.
    Skipped(String),
}

/// Result of a conformance test for one board or for the whole chain.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ConformanceTest {
    /// Name of the test, such as `D-T10`.
    pub id: &'static str,
    /// Board number; `None` for a test of the whole chain.
    pub board: Option<u8>,
    /// Behaviour that the test expects.
    pub expected: &'static str,
    /// Result of the test.
    #[serde(flatten)]
    pub verdict: Verdict,
    /// Option that would have allowed the test; `None` if the test was allowed.
    pub needs: Option<&'static str>,
    /// Frames that the test sent, in the format of candump.
    pub sent: Vec<String>,
    /// Frames that the test received, in the format of candump, at most 64.
    pub came: Vec<String>,
}

impl ConformanceTest {
    /// Returns the subject of the test in words: `board 3` or `chain`.
    pub fn subject(&self) -> String {
        self.board.map_or_else(|| "chain".into(), |n| format!("board {n}"))
    }
}

/// Results of all conformance tests of a bus.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ConformanceReport {
    /// Results of the tests in the order of execution.
    pub tests: Vec<ConformanceTest>,
    /// Remaining differences of the boards from their state before the tests, each with the remedy.
    pub left: Vec<String>,
    /// Error that ended the series of tests early. The remaining tests are skipped.
    #[serde(skip)]
    pub error: Option<Error>,
}

impl ConformanceReport {
    /// Returns the number of failed tests.
    pub fn failed(&self) -> usize {
        self.tests.iter().filter(|t| matches!(t.verdict, Verdict::Fail(_))).count()
    }

    /// Returns the number of passed tests.
    pub fn passed(&self) -> usize {
        self.tests.iter().filter(|t| t.verdict == Verdict::Pass).count()
    }

    /// Returns the number of skipped tests.
    pub fn skipped(&self) -> usize {
        self.tests.len() - self.passed() - self.failed()
    }

    /// Returns the names of the tests that were not allowed, sorted by the option that would have allowed them. Each name appears only
    /// once, for any number of boards.
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

    /// Returns the kind of failure of the tests. If an error ended the tests early, the function returns the kind of that error. If a test
    /// failed or a board is not in its previous state, the function returns `Device`. If every test passed, the function returns `None`.
    pub fn failure(&self) -> Option<ErrorKind> {
        match &self.error {
            Some(error) => Some(error.kind()),
            None => (self.failed() > 0 || !self.left.is_empty()).then_some(ErrorKind::Device),
        }
    }
}
