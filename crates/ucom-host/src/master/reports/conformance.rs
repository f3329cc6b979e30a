//! Options and results of the conformance tests.
use crate::master::error::Error;
use crate::master::reports::update::UpdateImage;
use host_kit::{Diagnose, ErrorKind};
use serde::Serialize;
use std::collections::BTreeMap;

/// Permissions for the tests, and the selection of tests and boards.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ConformanceOptions {
    /// Boards to test. If empty, the tests cover all boards that answer.
    pub boards: Vec<u8>,
    /// Permission to reset and renumber the chain, and to set and clear status bits.
    pub init: bool,
    /// Permission to start applications and control loops, with safe outputs.
    pub run: bool,
    /// Program for one board, and permission to program that board.
    pub program: Option<ConformanceProgram>,
    /// Names of the tests to run. Empty: all tests.
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

/// Program for one board.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConformanceProgram {
    /// Board number.
    pub board: u8,
    /// Flash number that the board must have. The header of the image contains this number, so that other boards refuse the image.
    pub flash_number: u16,
    /// The program.
    pub image: UpdateImage,
    /// Flash date in the form that `prog.date` in the profile defines.
    pub date: u16,
}

/// Result of a test.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase", tag = "verdict", content = "why")]
pub enum Verdict {
    /// The board behaves as expected.
    Pass,
    /// The test failed; the text describes the actual result.
    Fail(String),
    /// The test was skipped; the text contains the reason.
    Skipped(String),
}

/// Result of a test with one board or the whole chain.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ConformanceTest {
    /// Name, such as `D-T10`.
    pub id: &'static str,
    /// Board number; `None` for the whole chain.
    pub board: Option<u8>,
    /// Expected behaviour.
    pub expected: &'static str,
    /// Actual result.
    #[serde(flatten)]
    pub verdict: Verdict,
    /// Option that would have allowed the test; `None` if the test was allowed.
    pub needs: Option<&'static str>,
    /// Sent frames in candump's form.
    pub sent: Vec<String>,
    /// Received frames in candump's form, at most 64.
    pub came: Vec<String>,
}

impl ConformanceTest {
    /// Returns the tested part in words: `board 3` or `chain`.
    pub fn subject(&self) -> String {
        self.board.map_or_else(|| "chain".into(), |n| format!("board {n}"))
    }
}

/// Results of all tests of a bus.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ConformanceReport {
    /// Tests in the order of execution.
    pub tests: Vec<ConformanceTest>,
    /// Remaining differences from the state before the tests, each with the remedy.
    pub left: Vec<String>,
    /// Error that ended the tests early. The remaining tests are skipped.
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

    /// Returns the kind of failure. If an error ended the tests, returns the kind of that error. If a test failed or a board is not in its
    /// previous state, returns `Device`. Returns `None` if every test passed.
    pub fn failure(&self) -> Option<ErrorKind> {
        match &self.error {
            Some(error) => Some(error.kind()),
            None => (self.failed() > 0 || !self.left.is_empty()).then_some(ErrorKind::Device),
        }
    }
}
