//! With which inputs and parameters `ucom run` starts each board.

use ucom_host::master::io::Kind;
use ucom_host::master::{RunBoard, Setting};

use super::params::Applied;
use crate::args::{Assignment, RunArgs};
use crate::cache::Known;
use crate::driver::Driver;
use crate::failure::Failure;
use crate::values::{Prepared, Word, for_board, print_rounded, words};
use crate::written::History;

/// What each board is to get: the file's values, then those of the command line.
pub fn plans(
    driver: &Driver,
    args: &RunArgs,
    prepared: &Prepared,
    file: Option<&Applied>,
) -> Result<Vec<RunBoard>, Failure> {
    let from_file = file.map(|f| f.words(|n| prepared.known.get(&n))).transpose()?.unwrap_or_default();
    let plan = |known: &Known| {
        let board = known.board;
        let of_file = from_file.iter().find(|(n, _)| *n == board).map(|(_, words)| words);
        let settings = |kind, first: Option<&Vec<Word>>, values: &[Assignment]| {
            let mut all: Vec<Word> = first.cloned().unwrap_or_default();
            for word in words(known, kind, &for_board(values, board))? {
                all.retain(|w| w.index != word.index);
                all.push(word);
            }
            print_rounded(driver, board, kind, &all);
            Ok::<_, Failure>(all.iter().map(|w| w.setting(known, kind)).collect())
        };
        let ci = settings(Kind::Ci, of_file.map(|(ci, _)| ci), &args.ci)?;
        let par = settings(Kind::Par, of_file.map(|(_, par)| par), &args.par)?;
        Ok(RunBoard { board, ci, par })
    };
    prepared.known.values().map(plan).collect()
}

/// The parameters that were written, for `ucom par`.
pub fn remember(args: &RunArgs, prepared: &Prepared, plans: &[RunBoard]) {
    for plan in plans.iter().filter(|plan| !plan.par.is_empty()) {
        let Some(known) = prepared.known.get(&plan.board) else { continue };
        let index = |s: &Setting| known.names.find(plan.board, Kind::Par, &s.name).ok();
        let words = plan.par.iter().filter_map(|s| Some((index(s)?, s.value)));
        History::of(&args.cache, &known.info).wrote(words);
    }
}
