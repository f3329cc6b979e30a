//! Runs the conformance tests one after the other.
use crate::master::engine::{Event, Link};
use crate::master::error::Error;
use crate::master::procedures::conformance::bench::{Bench, Found};
use crate::master::procedures::conformance::restore::{put_back, renumber};
use crate::master::procedures::conformance::table::{Level, Run, Scope, TESTS, Test};
use crate::master::procedures::exchange::set_status;
use crate::master::reports::{ConformanceOptions, ConformanceReport, ConformanceTest, Verdict};
use ucom::Status;

/// A test and the board to test; `None` for a test of the whole chain.
type Planned = (&'static Test, Option<u8>);

/// State of the series of tests.
pub(super) struct Runner<'a> {
    link: &'a Link,
    options: &'a ConformanceOptions,
    /// State of the boards before the tests, which the runner restores.
    found: &'a Found,
    pub report: ConformanceReport,
    /// `true` if boards may have lost their numbers.
    pub unnumbered: bool,
    /// Board of the current test.
    pub at: Option<u8>,
}

impl<'a> Runner<'a> {
    pub(super) fn new(link: &'a Link, options: &'a ConformanceOptions, found: &'a Found) -> Self {
        Self { link, options, found, report: Default::default(), unnumbered: false, at: None }
    }

    /// Returns all requested tests in the order in which they run.
    fn planned(&self) -> Vec<Planned> {
        let only = &self.options.only;
        let wanted = |test: &&Test| only.is_empty() || only.iter().any(|o| o.eq_ignore_ascii_case(test.id));
        let mut all = Vec::new();
        for together in TESTS.chunk_by(Test::goes_with) {
            let Some(first) = together.first() else { continue };
            for board in self.boards_of(first) {
                let of_it = together.iter().filter(wanted).filter(|test| self.is_of(test, board));
                all.extend(of_it.map(|test| (test, board)));
            }
        }
        all
    }

    fn boards_of(&self, test: &Test) -> Vec<Option<u8>> {
        let boards = self.found.boards.iter().map(|b| b.number);
        match test.scope {
            Scope::Chain | Scope::Numbers => vec![None],
            // If the user has not allowed the tests that need `--init`, each of these tests is listed once, and not
            // once for each board.
            _ if test.level == Level::Init && !self.options.init => vec![None],
            Scope::First => boards.min().into_iter().map(Some).collect(),
            Scope::Board | Scope::Programmed => boards.map(Some).collect(),
        }
    }

    fn is_of(&self, test: &Test, board: Option<u8>) -> bool {
        let programmed = self.options.program.as_ref().filter(|_| test.scope == Scope::Programmed);
        programmed.is_none_or(|program| Some(program.board) == board)
    }

    /// Runs every test that the user allowed. The runner skips the other tests and records the reason.
    pub(super) async fn all(&mut self) -> Result<(), Error> {
        let planned = self.planned();
        for (i, (test, board)) in planned.iter().copied().enumerate() {
            let talk = match (test.level.needs(self.options), &test.run) {
                (Some(option), _) => {
                    self.skip(test, board, format!("only with {option}"), Some(option));
                    continue;
                }
                (None, Run::Elsewhere(why)) => {
                    self.skip(test, board, (*why).into(), None);
                    continue;
                }
                (None, Run::Talk(talk)) => talk,
            };
            self.at = board;
            if test.scope != Scope::Numbers {
                self.numbered().await?;
            }
            self.unnumbered = matches!(test.scope, Scope::Numbers | Scope::First);
            let mut bench = Bench::new(self.link, self.options, self.found);
            let verdict = talk(&mut bench, board.unwrap_or_default()).await?;
            if test.scope == Scope::First {
                self.numbered().await?;
                self.autostart_as_found(board).await?;
            }
            let (sent, came) = bench.log();
            self.note(test, board, verdict, sent, came);
            let own = |test: &Test| matches!(test.level, Level::Run | Level::Program);
            let more =
                |(next, of): &Planned| *of == board && own(next) && next.level.needs(self.options).is_none();
            if let Some(number) = board.filter(|_| own(test))
                && !planned.iter().skip(i + 1).any(more)
            {
                self.board_back(number).await?;
            }
        }
        self.numbered().await
    }

    async fn board_back(&mut self, number: u8) -> Result<(), Error> {
        if let Some(before) = self.found.boards.iter().find(|b| b.number == number) {
            put_back(self.link, before, self.options, false, &mut self.report.left).await?;
        }
        Ok(())
    }

    /// Restores the ASTART bit of a board to its value before the tests.
    async fn autostart_as_found(&self, board: Option<u8>) -> Result<(), Error> {
        if let Some(before) = self.found.boards.iter().find(|b| Some(b.number) == board) {
            let kept = before.info.status & Status::ASTART;
            set_status(self.link, before.number, Status::ASTART, kept).await?;
        }
        Ok(())
    }

    /// Assigns numbers again, so that every board has the number that it had before the tests.
    async fn numbered(&mut self) -> Result<(), Error> {
        if self.unnumbered {
            // If the assignment fails, the flag `unnumbered` stays set, so that the assignment is repeated later.
            renumber(self.link, self.found).await?;
            self.unnumbered = false;
        }
        Ok(())
    }

    /// Records the tests that were skipped because the series of tests ended early.
    pub(super) fn skip_rest(&mut self, why: &str) {
        for (test, board) in self.planned() {
            if self.report.tests.iter().any(|t| t.id == test.id && t.board == board) {
                continue;
            }
            match test.level.needs(self.options) {
                Some(option) => self.skip(test, board, format!("only with {option}"), Some(option)),
                None => self.skip(test, board, why.into(), None),
            }
        }
    }

    fn skip(&mut self, test: &Test, board: Option<u8>, why: String, needs: Option<&'static str>) {
        let (id, expected, verdict) = (test.id, test.expects, Verdict::Skipped(why));
        let (sent, came) = (Vec::new(), Vec::new());
        self.report.tests.push(ConformanceTest { id, board, expected, verdict, needs, sent, came });
    }

    fn note(
        &mut self,
        test: &Test,
        board: Option<u8>,
        verdict: Verdict,
        sent: Vec<String>,
        came: Vec<String>,
    ) {
        let (id, expected) = (test.id, test.expects);
        let test = ConformanceTest { id, board, expected, verdict, needs: None, sent, came };
        self.link.with(|core| core.event(Event::Tested { id: self.link.id, test: test.clone() }));
        self.report.tests.push(test);
    }
}
