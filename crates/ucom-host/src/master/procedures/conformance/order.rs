//! The tests one after the other.
use crate::master::engine::{Event, Link};
use crate::master::error::Error;
use crate::master::procedures::ask_reports::ask_reports;
use crate::master::procedures::conformance::bench::Bench;
use crate::master::procedures::conformance::restore::{Found, put_back, renumber};
use crate::master::procedures::conformance::table::{Level, TESTS};
use crate::master::procedures::conformance::{application, ask, chain, program};
use crate::master::procedures::exchange::set_status;
use crate::master::reports::{
    BoardSeen, ConformanceOptions, ConformanceReport, ConformanceTest, Reports, Verdict,
};
use ucom::Status;

/// A test, and the board it is of; `None`: the chain as a whole.
type Planned = (&'static str, Option<u8>);

/// The tests under way.
pub(super) struct Run<'a> {
    pub link: &'a Link,
    pub options: &'a ConformanceOptions,
    pub report: ConformanceReport,
    /// What is to be as it was.
    pub found: &'a Found,
    /// Boards may be without their numbers.
    pub unnumbered: bool,
    /// The board whose test is under way.
    pub at: Option<u8>,
    /// A board that nobody tests could take a number.
    strangers: bool,
}

/// The option that a test needs; `None`: it may be done.
fn needs(level: Level, options: &ConformanceOptions) -> Option<&'static str> {
    match level {
        Level::Init if !options.init => Some("--init"),
        Level::Run if !options.run => Some("--run"),
        Level::Program if options.program.is_none() => Some("--program IMAGE"),
        _ => None,
    }
}

fn level_of(id: &str) -> Level {
    TESTS.iter().find(|(name, ..)| *name == id).map_or(Level::Ask, |(_, level, _)| *level)
}

impl<'a> Run<'a> {
    pub fn new(link: &'a Link, options: &'a ConformanceOptions, found: &'a Found, strangers: bool) -> Self {
        let report = ConformanceReport::default();
        Self { link, options, report, found, unnumbered: false, at: None, strangers }
    }

    fn wanted(&self, id: &str) -> bool {
        self.options.only.is_empty() || self.options.only.iter().any(|o| o.eq_ignore_ascii_case(id))
    }

    /// All tests that are wanted, in their order: those that ask, those of the chain, those of each board.
    fn planned(&self) -> Vec<Planned> {
        let boards: Vec<u8> = self.found.boards.iter().map(|b| b.number).collect();
        let first = boards.iter().min().copied();
        let mut all: Vec<Planned> = vec![("D-T2", None)];
        let each = |ids: &[&'static str]| -> Vec<Planned> {
            boards.iter().flat_map(|n| ids.iter().map(|id| (*id, Some(*n))).collect::<Vec<_>>()).collect()
        };
        all.extend(each(&["D-T5", "D-T10", "D-T11"]));
        all.extend(["D-T1", "D-T3", "D-T4"].map(|id| (id, None)));
        if self.options.init {
            all.extend(each(&["D-T6", "D-T7"]));
            all.extend(first.map(|n| ("D-T16", Some(n))));
        } else {
            all.extend(["D-T6", "D-T7", "D-T16"].map(|id| (id, None)));
        }
        for n in &boards {
            all.extend(["D-T8", "D-T9", "D-T12", "D-T13", "D-T14", "D-T15"].map(|id| (id, Some(*n))));
            if self.options.program.as_ref().is_none_or(|p| p.board == *n) {
                all.extend(["D-T18", "D-T17"].map(|id| (id, Some(*n))));
            }
        }
        all.extend(["D-T19", "D-T20", "D-T21"].map(|id| (id, None)));
        all.retain(|(id, _)| self.wanted(id));
        all
    }

    /// Does every test that may be done; the others are skipped with their reason.
    pub async fn all(&mut self) -> Result<(), Error> {
        let planned = self.planned();
        for (i, (id, board)) in planned.iter().copied().enumerate() {
            let level = level_of(id);
            if let Some(option) = needs(level, self.options) {
                self.skip(id, board, format!("only with {option}"), Some(option));
                continue;
            }
            if let Level::Elsewhere(why) = level {
                self.skip(id, board, why.into(), None);
                continue;
            }
            self.at = board;
            let mut bench = Bench::new(self.link);
            let verdict = self.one(&mut bench, id, board).await?;
            let (sent, came) = bench.log();
            self.note(id, board, verdict, sent, came);
            let own = |id: &str| matches!(level_of(id), Level::Run | Level::Program);
            let more = |(next, of): &Planned| {
                *of == board && own(next) && needs(level_of(next), self.options).is_none()
            };
            if let Some(number) = board.filter(|_| own(id))
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

    /// What was not done, because the tests ended before.
    pub fn skip_rest(&mut self, why: &str) {
        for (id, board) in self.planned() {
            if self.report.tests.iter().any(|t| t.id == id && t.board == board) {
                continue;
            }
            match needs(level_of(id), self.options) {
                Some(option) => self.skip(id, board, format!("only with {option}"), Some(option)),
                None => self.skip(id, board, why.into(), None),
            }
        }
    }

    /// Every board has its number again.
    async fn numbered(&mut self) -> Result<(), Error> {
        if core::mem::take(&mut self.unnumbered) {
            // True as long as it may not be so.
            self.unnumbered = true;
            renumber(self.link, self.found).await?;
            self.unnumbered = false;
        }
        Ok(())
    }

    async fn one(
        &mut self,
        bench: &mut Bench<'_>,
        id: &'static str,
        board: Option<u8>,
    ) -> Result<Verdict, Error> {
        let boards = self.found.boards.as_slice();
        if ["D-T1", "D-T3", "D-T4"].contains(&id) {
            self.unnumbered = true;
            return Ok(match id {
                "D-T1" => chain::reset(bench, boards).await,
                "D-T3" => chain::unnumbered(bench).await,
                _ => chain::wire(bench, boards).await,
            });
        }
        self.numbered().await?;
        let Some(n) = board else { return ask::reports(bench, boards).await };
        match id {
            "D-T5" => ask::init_again(bench, n, self.strangers, self.options.force).await,
            "D-T10" => ask::description(bench, n).await,
            "D-T11" => ask::initial_inputs(bench, n).await,
            "D-T6" => chain::formula(bench, n).await,
            "D-T7" => chain::mirrors(bench, n).await,
            "D-T16" => self.autostart(bench, n).await,
            "D-T8" => application::walk(bench, n).await,
            "D-T9" => application::start(bench, n).await,
            "D-T12" => application::inputs(bench, n).await,
            "D-T13" => application::alone(bench, n).await,
            "D-T14" => {
                self.link.note(format!("board {n}: D-T14 takes more than 60 s"));
                application::alive(bench, n).await
            }
            "D-T15" => application::flags(bench, n).await,
            _ => match &self.options.program {
                Some(image) if id == "D-T18" => program::refusals(bench, image).await,
                Some(image) => program::update(bench, image).await,
                None => Ok(Verdict::Skipped("only with --program IMAGE".into())),
            },
        }
    }

    /// The board that has the first number, which the test gives again after a reset.
    async fn autostart(&mut self, bench: &mut Bench<'_>, n: u8) -> Result<Verdict, Error> {
        let Some(board) = self.found.boards.iter().find(|b| b.number == n) else {
            return Ok(Verdict::Skipped("there is no such board".into()));
        };
        self.unnumbered = true;
        let verdict = chain::autostart(bench, board).await;
        self.numbered().await?;
        let kept = board.info.status & Status::ASTART;
        set_status(self.link, n, Status::ASTART, kept).await?;
        Ok(verdict)
    }

    fn skip(&mut self, id: &'static str, board: Option<u8>, why: String, needs: Option<&'static str>) {
        let expected = expected(id);
        let (sent, came) = (Vec::new(), Vec::new());
        let verdict = Verdict::Skipped(why);
        self.report.tests.push(ConformanceTest { id, board, expected, verdict, needs, sent, came });
    }

    fn note(
        &mut self,
        id: &'static str,
        board: Option<u8>,
        verdict: Verdict,
        sent: Vec<String>,
        came: Vec<String>,
    ) {
        let test = ConformanceTest { id, board, expected: expected(id), verdict, needs: None, sent, came };
        self.link.with(|core| core.event(Event::Tested { id: self.link.id, test: test.clone() }));
        self.report.tests.push(test);
    }
}

fn expected(id: &str) -> &'static str {
    TESTS.iter().find(|(name, ..)| *name == id).map_or("", |(.., expected)| *expected)
}

/// Whether who reports is who has a number, each with a flash id of its own.
pub(super) async fn who_reports(link: &Link, boards: &[BoardSeen]) -> (usize, bool) {
    let mut reports = Reports::default();
    for _ in 0..2 {
        ask_reports(link, &mut reports).await;
    }
    let low = boards.iter().map(|b| b.info.flash_number as u8);
    let all =
        reports.ids.len() == boards.len() && low.collect::<std::collections::BTreeSet<_>>() == reports.ids;
    (reports.ids.len(), all)
}
