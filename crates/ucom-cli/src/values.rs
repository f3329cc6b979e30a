//! Values of the command line as words of the boards: names and ranges are checked before anything is sent.

use std::cell::RefCell;
use std::collections::BTreeMap;

use ucom_host::files::SignalTable;
use ucom_host::files::signals::ValueError;
use ucom_host::master::io::Kind;
use ucom_host::master::{Outcome, Request, Setting, StopLevel};

use crate::args::{Assignment, CacheArgs};
use crate::cache::Known;
use crate::driver::{Driver, unexpected};
use crate::failure::{Failure, REFUSED};

/// A word for a signal.
#[derive(Clone, Debug, PartialEq)]
pub struct Word {
    /// Place in the buffer.
    pub index: u16,
    /// The whole text of the signal.
    pub name: String,
    /// What is sent.
    pub word: u16,
    /// The value in the signal's unit, with the unit.
    pub text: String,
    /// `0.04 → 0.0` where what was given lies between two words.
    pub rounded: Option<String>,
}

impl Word {
    /// As the library takes it; by number, which always means this signal.
    pub fn setting(&self, known: &Known, kind: Kind) -> Setting {
        // A text that means another signal cannot be its name, and numbers may be names.
        let by_name = known.names.find(known.board, kind, &self.name) == Ok(self.index);
        let name = if by_name { self.name.clone() } else { format!("##{}", self.index) };
        Setting { name, value: self.word }
    }
}

/// The words of assignments for a board.
pub fn words(known: &Known, kind: Kind, values: &[Assignment]) -> Result<Vec<Word>, Failure> {
    let word = |a: &Assignment| {
        let index = known.names.find(known.board, kind, &a.name)?;
        let name = known.names.names(kind).get(usize::from(index)).cloned().unwrap_or_default();
        let Some(signal) = known.signals.get(kind, index.into()) else {
            return Err(Failure::usage(format!("board {} has no {} {index}", known.board, kind.name())));
        };
        let word = signal.word(&a.value).map_err(|e| {
            let hint = match e {
                ValueError::Meaning { .. } => format!(
                    "add program 0x{:04X} to the signal table (ucom help edges), or give the word as 0x0000",
                    known.info.program_id
                ),
                _ => format!(
                    "ucom io {} shows types, scales and units; a word as 0x05DC is sent as it is",
                    known.board
                ),
            };
            let message = format!("board {}: {} `{}`: {e}", known.board, kind.name(), a.name);
            Failure::new(REFUSED, "value", message).hint(hint)
        })?;
        let rounded = signal.rounded(&a.value, word).map(|sent| format!("{} → {sent}", a.value));
        Ok(Word { index, name, word, text: signal.text_with_unit(word), rounded })
    };
    let all = values.iter().map(word).collect::<Result<Vec<_>, _>>()?;
    let earlier = |(i, word): &(usize, &Word)| all.iter().take(*i).any(|other| other.index == word.index);
    if let Some((_, word)) = all.iter().enumerate().find(earlier) {
        let what = format!("board {}: {} `{}` is given twice", known.board, kind.name(), word.name);
        return Err(Failure::usage(what).hint("give each name once: nothing was sent"));
    }
    Ok(all)
}

/// Prints which values lie between two words and go as the nearer one.
pub fn print_rounded(driver: &Driver, board: u8, kind: Kind, words: &[Word]) {
    for word in words {
        if let Some(rounded) = &word.rounded {
            driver.note(format!("board {board}: {} `{}`: {rounded}", kind.name(), word.name));
        }
    }
}

/// Values belong to the one board that is meant, or to all of them.
pub fn for_board(values: &[Assignment], board: u8) -> Vec<Assignment> {
    values.iter().filter(|a| a.board.is_none_or(|b| b == board)).cloned().collect()
}

/// A value for a board that is not meant is a mistake.
pub fn only(boards: &[u8], values: &[Assignment], to: &str) -> Result<(), Failure> {
    match values.iter().find(|a| a.board.is_some_and(|b| !boards.contains(&b))) {
        Some(a) => {
            let board = a.board.unwrap_or_default();
            Err(Failure::usage(format!("{board}.{}: board {board} is not among those to {to}", a.name)))
        }
        None => Ok(()),
    }
}

/// Does something by names that may be kept from before; when a board turns out to have others, once more by those that it sends.
pub fn with_names<T>(
    cache: &CacheArgs,
    mut act: impl FnMut(&CacheArgs) -> Result<T, Failure>,
) -> Result<T, Failure> {
    match act(cache) {
        Err(e) if !cache.fresh && ["stale-names", "no-edge"].contains(&e.code.as_str()) => {
            act(&CacheArgs { fresh: true, ..cache.clone() })
        }
        other => other,
    }
}

/// Boards with their names, whose applications were started where only they could send the names.
#[derive(Default)]
pub struct Prepared {
    /// By number.
    pub known: BTreeMap<u8, Known>,
    started: RefCell<Vec<u8>>,
}

impl Prepared {
    /// Asks for the names of a board; starts its application where nothing else helps. Nothing moves by that.
    pub fn add(
        &mut self,
        driver: &mut Driver,
        cache: &CacheArgs,
        table: &SignalTable,
        board: u8,
        force: bool,
    ) -> Result<(), Failure> {
        let known = match cache.known(driver, table, board) {
            Err(e) if e.code == "no-application" => {
                // Before the command leaves: a start that is cancelled may have reached it.
                self.started.borrow_mut().push(board);
                let started = driver.run(Request::Start { board, force }).inspect_err(|e| {
                    // Refused means that nothing was sent; taking that back would speak on another PC's bus.
                    if e.exit == REFUSED {
                        self.started.borrow_mut().pop();
                    }
                });
                started.and_then(|outcome| match outcome {
                    Outcome::Started(_) => cache.described(driver, table, board),
                    other => Err(unexpected(&other)),
                })
            }
            other => other,
        };
        self.known.insert(board, known.inspect_err(|_| self.undo(driver))?);
        Ok(())
    }

    /// Stops what was started only to be asked, once: a refusal leaves the boards as they were. What cannot be stopped is reported.
    pub fn undo(&self, driver: &mut Driver) {
        for board in self.started.take().into_iter().rev() {
            if let Err(e) = driver.stop_board(board, StopLevel::Application) {
                driver.note(format!("board {board} may still be started: {}", e.message));
            }
        }
    }
}
