//! Cached names of the boards' inputs, outputs and parameters (D-36), and the meaning of the signals' words (D-11).

use ucom::{BoardInfo, Profile};

use super::cache::Cache;
use super::driver::Driver;
use super::error::SessionError;
use crate::files::params::ParamsWord;
use crate::files::{BoardSignals, SignalTable};
use crate::master::io::{DescriptionKey, IoDescription, Kind};
use crate::master::{Outcome, Request, Setting};

/// Board with the names of its signals and the meaning of their words.
#[derive(Clone, Debug)]
pub struct Known {
    /// Board number.
    pub board: u8,
    /// Answer of the board to PC_INFO.
    pub info: BoardInfo,
    /// Names of the board's signals.
    pub names: IoDescription,
    /// Types, scales and units of the board's signals.
    pub signals: BoardSignals,
    /// Names in the signal table that the program of the board does not have.
    strays: Vec<String>,
}

impl Cache {
    /// Returns a board with the signal names from the cache. If the cache does not have the names, the function requests them from the
    /// running application. If the cache cannot be written, the function ignores the failure, and the names are read again the next time.
    pub fn known(&self, driver: &mut Driver, table: &SignalTable, board: u8) -> Result<Known, SessionError> {
        let info = driver.seen(board)?.info;
        if let Some(names) = self.kept(driver, &info) {
            return Ok(with_signals(board, info, names, table, driver.master.profile()).with_notes(driver));
        }
        self.described(driver, table, board)
    }

    /// Like `known`, for a board whose application must run. The function reads the names from the board, because cached names may belong
    /// to another application.
    pub fn described(
        &self,
        driver: &mut Driver,
        table: &SignalTable,
        board: u8,
    ) -> Result<Known, SessionError> {
        let info = driver.seen(board)?.info;
        let names = match driver.run(Request::Describe { board, fresh: self.fresh })? {
            Outcome::Description { description, .. } => description,
            other => return Err(other.into()),
        };
        if let Ok(text) = serde_json::to_string_pretty(&names) {
            self.write(file(DescriptionKey::of(&info)), text);
        }
        Ok(with_signals(board, info, names, table, driver.master.profile()).with_notes(driver))
    }

    /// Returns boards with their signal names. Boards in `must_run` are read as in [`Self::described`], and other boards as in
    /// [`Self::known`].
    ///
    /// # Errors
    /// Returns [`SessionError::NoNames`], with every board that failed, after the function has sent queries to all boards. Errors of any
    /// other type are returned at once.
    pub fn all(
        &self,
        driver: &mut Driver,
        table: &SignalTable,
        boards: &[u8],
        must_run: impl Fn(u8) -> bool,
    ) -> Result<Vec<Known>, SessionError> {
        let (mut all, mut failed) = (Vec::new(), Vec::new());
        for &board in boards {
            let known = match must_run(board) {
                true => self.described(driver, table, board),
                false => self.known(driver, table, board),
            };
            match known {
                Ok(known) => all.push(known),
                Err(error) if error.is_of_one_board() => failed.push((board, error)),
                Err(error) => return Err(error),
            }
        }
        if failed.is_empty() { Ok(all) } else { Err(SessionError::NoNames { failed }) }
    }

    /// Returns the cached signal names of a program, without a query to the board.
    fn kept(&self, driver: &mut Driver, info: &BoardInfo) -> Option<IoDescription> {
        let key = DescriptionKey::of(info);
        if self.fresh || !info.has_application() {
            return None;
        }
        if let Some(names) = driver.master.descriptions().remove(&key) {
            return Some(names);
        }
        let text = self.read(&file(key))?;
        let names: IoDescription = serde_json::from_str(&text).ok()?;
        driver.master.know_description(key, names.clone());
        Some(names)
    }
}

/// Returns the name of the cache file for the signal names of a program.
fn file(key: DescriptionKey) -> String {
    let DescriptionKey { program_id, date, flash_number } = key;
    format!("io-{program_id:04X}-{date:04X}-{flash_number:04X}.json")
}

impl Known {
    /// Returns a word together with the name of its signal, as the master expects it. If the name also belongs to
    /// another signal, the index is used instead.
    pub fn setting(&self, kind: Kind, word: &ParamsWord) -> Setting {
        // The name of a signal can also match the name or the index of another signal. Then the index is used instead
        // of the name.
        let by_name = self.names.find(self.board, kind, &word.name) == Ok(word.index);
        let name = if by_name { word.name.clone() } else { format!("##{}", word.index) };
        Setting { name, value: word.word }
    }

    /// Returns this board with the signal names `names`, which the board itself has sent.
    pub fn renamed(self, names: IoDescription, table: &SignalTable, profile: Profile) -> Self {
        if self.names == names { self } else { with_signals(self.board, self.info, names, table, profile) }
    }

    /// Shows a note about names in the signal table that the program of the board does not have.
    fn with_notes(self, driver: &Driver) -> Self {
        for stray in &self.strays {
            driver.note(format!("signal table: {stray}"));
        }
        self
    }
}

fn with_signals(
    board: u8,
    info: BoardInfo,
    names: IoDescription,
    table: &SignalTable,
    profile: Profile,
) -> Known {
    let who = format!("program 0x{:04X} (board {board})", info.program_id);
    let program = table.program(info.program_id).filter(|_| info.has_application());
    let strays = program.map(|p| p.strays(&names)).unwrap_or_default();
    let mut strays: Vec<String> = strays.iter().map(|stray| format!("{who} has no {stray}")).collect();
    let mut signals = BoardSignals::new(&names, program, &profile);
    // A user who has a signal table expects units. Without an entry for this program in the table, values would be sent without a scale.
    if table.is_given() && program.is_none() && info.has_application() {
        strays.push(format!("the table does not contain {who}"));
        signals = signals.raw_only();
    }
    Known { board, info, names, signals, strays }
}
