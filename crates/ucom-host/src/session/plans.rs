//! Inputs and parameters that each board gets at the start of a run.

use super::cache::Cache;
use super::driver::Driver;
use super::error::SessionError;
use super::history::History;
use super::known::Known;
use super::parameters::ParameterFile;
use super::selection::{Assignment, for_board};
use super::values::{Prepared, Word, note_rounded, words};
use crate::master::io::Kind;
use crate::master::{RunBoard, Setting};

/// Returns the values for each board: the values of the parameter file, replaced or extended by `ci` and `par`.
pub fn plans(
    driver: &Driver,
    prepared: &Prepared,
    file: Option<&ParameterFile>,
    ci: &[Assignment],
    par: &[Assignment],
) -> Result<Vec<RunBoard>, SessionError> {
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
            note_rounded(driver, board, kind, &all);
            Ok::<_, SessionError>(all.iter().map(|w| known.setting(kind, w)).collect())
        };
        let ci = settings(Kind::Ci, of_file.map(|(ci, _)| ci), ci)?;
        let par = settings(Kind::Par, of_file.map(|(_, par)| par), par)?;
        Ok(RunBoard { board, ci, par })
    };
    prepared.known.values().map(plan).collect()
}

/// Stores the parameters that a run has written in the history of each board.
pub fn remember(cache: &Cache, prepared: &Prepared, plans: &[RunBoard]) {
    for plan in plans.iter().filter(|plan| !plan.par.is_empty()) {
        let Some(known) = prepared.known.get(&plan.board) else { continue };
        let index = |s: &Setting| known.names.find(plan.board, Kind::Par, &s.name).ok();
        let words = plan.par.iter().filter_map(|s| Some((index(s)?, s.value)));
        History::of(cache, &known.info).wrote(words);
    }
}
