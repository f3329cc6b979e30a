//! Names of boards' inputs, outputs and parameters that were read before (D-36), and what their words mean (D-11).

use ucom::{BoardInfo, Profile};

use super::cache::Cache;
use super::driver::Driver;
use super::error::SessionError;
use crate::files::params::ParamsWord;
use crate::files::{BoardSignals, SignalTable};
use crate::master::io::{DescriptionKey, IoDescription, Kind};
use crate::master::{Outcome, Request, Setting};

/// A board, its names, and what its words mean.
#[derive(Clone, Debug)]
pub struct Known {
    /// Its number.
    pub board: u8,
    /// Its answer to PC_INFO.
    pub info: BoardInfo,
    /// Its names.
    pub names: IoDescription,
    /// Types, scales and units.
    pub signals: BoardSignals,
    /// Where signal table and program do not fit.
    strays: Vec<String>,
}

impl Cache {
    /// A board with its names. They are known from before, or its application runs and is asked; what cannot be kept is
    /// read anew next time: that is no error.
    pub fn known(&self, driver: &mut Driver, table: &SignalTable, board: u8) -> Result<Known, SessionError> {
        let info = driver.seen(board)?.info;
        if let Some(names) = self.kept(driver, &info) {
            return Ok(with_signals(board, info, names, table, driver.master.profile()).with_notes(driver));
        }
        self.described(driver, table, board)
    }

    /// The same for a board whose application must run: it is asked, for what is kept may be of another application.
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

    /// Boards with their names, as [`Self::known`] gives them; those that `must_run` names as [`Self::described`] does.
    ///
    /// # Errors
    /// [`SessionError::NoNames`] with every board that failed, after all were asked; what fails otherwise, at once.
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

    /// What is known of a program without asking for it.
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

/// Where the names of a program are kept.
fn file(key: DescriptionKey) -> String {
    let DescriptionKey { program_id, date, flash_number } = key;
    format!("io-{program_id:04X}-{date:04X}-{flash_number:04X}.json")
}

impl Known {
    /// A word of this board as the master takes it; by number where a name would mean another signal.
    pub fn setting(&self, kind: Kind, word: &ParamsWord) -> Setting {
        // A text that means another signal cannot be its name, and numbers may be names.
        let by_name = self.names.find(self.board, kind, &word.name) == Ok(word.index);
        let name = if by_name { word.name.clone() } else { format!("##{}", word.index) };
        Setting { name, value: word.word }
    }

    /// The same board by the names that it has sent since.
    pub fn renamed(self, names: IoDescription, table: &SignalTable, profile: Profile) -> Self {
        if self.names == names { self } else { with_signals(self.board, self.info, names, table, profile) }
    }

    /// Notes where signal table and program do not fit.
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
    // Who gives a table thinks in its units: numbers for a program that is not in it would be sent as they are.
    if table.is_given() && program.is_none() && info.has_application() {
        strays.push(format!("it knows nothing of {who}"));
        signals = signals.raw_only();
    }
    Known { board, info, names, signals, strays }
}
