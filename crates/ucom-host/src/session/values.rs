//! Converts values to words of the boards. The names and the ranges of values are checked before any frame is sent.

use std::cell::RefCell;
use std::collections::BTreeMap;

use host_kit::{Diagnose, ErrorKind};

use super::cache::Cache;
use super::driver::Driver;
use super::error::{SessionError, ValuesError};
use super::known::Known;
use super::selection::Assignment;
use crate::files::SignalTable;
use crate::files::params::ParamsWord;
use crate::master::io::Kind;
use crate::master::{Error, Outcome, Request, SignalError, StopLevel};

/// Word for a signal.
pub type Word = ParamsWord;

/// Converts the assignments of values for a board to words.
pub fn words(known: &Known, kind: Kind, values: &[Assignment]) -> Result<Vec<Word>, SessionError> {
    let board = known.board;
    let word = |a: &Assignment| {
        let index = known.names.find(board, kind, &a.name).map_err(Error::from)?;
        let name = known.names.names(kind).get(usize::from(index)).cloned().unwrap_or_default();
        let Some(signal) = known.signals.get(kind, index.into()) else {
            return Err(SessionError::from(ValuesError::NoSignal { board, kind, index }));
        };
        let word = signal.word(&a.value).map_err(|error| {
            let (name, program_id, error) = (a.name.clone(), known.info.program_id, Box::new(error));
            ValuesError::Value { board, kind, name, program_id, error }
        })?;
        let rounded = signal.rounded(&a.value, word).map(|sent| format!("{} → {sent}", a.value));
        Ok(Word { index, name, word, text: signal.text_with_unit(word), rounded })
    };
    let all = values.iter().map(word).collect::<Result<Vec<_>, _>>()?;
    let earlier = |(i, word): &(usize, &Word)| all.iter().take(*i).any(|other| other.index == word.index);
    if let Some((_, word)) = all.iter().enumerate().find(earlier) {
        return Err(ValuesError::Twice { board, kind, name: word.name.clone() }.into());
    }
    Ok(all)
}

/// Shows a note about each value that no word can represent exactly. The word with the nearest value is sent instead.
pub fn note_rounded(driver: &Driver, board: u8, kind: Kind, words: &[Word]) {
    for word in words {
        if let Some(rounded) = &word.rounded {
            driver.note(format!("board {board}: {} `{}`: {rounded}", kind.name(), word.name));
        }
    }
}

/// Runs an action with the cached signal names. If a board has other names, the function reads the names from the boards and runs the
/// action once more.
pub fn with_names<T>(
    cache: &Cache,
    mut act: impl FnMut(&Cache) -> Result<T, SessionError>,
) -> Result<T, SessionError> {
    match act(cache) {
        Err(SessionError::Procedure(
            Error::Signal(SignalError::StaleNames { .. }) | Error::Signal(SignalError::NoSignal { .. }),
        )) if !cache.fresh => act(&cache.refreshed()),
        other => other,
    }
}

/// Boards with their signal names. Applications were started only on boards whose signal names were not known
/// otherwise.
#[derive(Default)]
pub struct Prepared {
    /// Boards with their signal names, by board number.
    pub known: BTreeMap<u8, Known>,
    started: RefCell<Vec<u8>>,
}

impl Prepared {
    /// Reads the signal names of a board. The function starts the application of the board only if necessary; this start does not move an
    /// axis.
    pub fn add(
        &mut self,
        driver: &mut Driver,
        cache: &Cache,
        table: &SignalTable,
        board: u8,
        force: bool,
    ) -> Result<(), SessionError> {
        let known = match cache.known(driver, table, board) {
            Err(SessionError::Procedure(Error::Signal(SignalError::NoApplication { .. }))) => {
                // The board is recorded before the start command is sent, because a cancelled start may still have reached the board.
                self.started.borrow_mut().push(board);
                let started = driver.run(Request::Start { board, force }).inspect_err(|e| {
                    // A refused start has sent no frame, so no stop is needed. A stop could be a command on a bus
                    // whose master is another PC.
                    if e.kind() == ErrorKind::Refused {
                        self.started.borrow_mut().pop();
                    }
                });
                started.and_then(|outcome| match outcome {
                    Outcome::Started(_) => cache.described(driver, table, board),
                    other => Err(other.into()),
                })
            }
            other => other,
        };
        self.known.insert(board, known.inspect_err(|_| self.undo(driver))?);
        Ok(())
    }

    /// Stops the applications that were started only to read signal names. A caller whose action is refused can use
    /// this function to return the boards to their previous state. A second call of this function has no effect.
    /// Failures of a stop are shown to the operator.
    pub fn undo(&self, driver: &mut Driver) {
        for board in self.started.take().into_iter().rev() {
            if let Err(e) = driver.stop_board(board, StopLevel::Application) {
                driver.note(format!("the application of board {board} may still run: {e}"));
            }
        }
    }
}
