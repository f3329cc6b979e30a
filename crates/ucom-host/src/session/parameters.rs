//! Parameters of boards: the PC reads parameters from files, and writes parameters with a check that the boards received them.

use std::path::Path;

use ucom::Status;

use super::driver::Driver;
use super::error::{SessionError, ValuesError};
use super::history::History;
use super::known::Known;
use super::values::Word;
use crate::files::Inventory;
use crate::files::inventory::InventoryError;
use crate::files::params::{
    ParamsBoard, ParamsFile, ParamsProblem, ParamsProblemKind, ParamsTarget, check_board, check_identity,
};
use crate::master::io::Kind;
use crate::master::{AdminChange, Error, Outcome, Request};

/// Board, the words to write to the board, and the words that were written before.
#[derive(Debug)]
pub struct Parameters {
    /// Board with its signal names.
    pub known: Known,
    /// Words to write to the parameters.
    pub words: Vec<Word>,
    /// Words that were written to the parameters before.
    pub history: History,
}

/// Writes all words of all boards. The function writes no word until every board is ready.
pub fn write(driver: &mut Driver, all: &mut [Parameters], force: bool) -> Result<(), SessionError> {
    for board in all.iter().filter(|p| !p.words.is_empty()) {
        become_master(driver, board.known.board, force)?;
    }
    let mut written: Vec<u8> = Vec::new();
    for Parameters { known, words, history } in all.iter_mut().filter(|p| !p.words.is_empty()) {
        for word in words.iter() {
            let (now, setting) = (driver.now_us(), known.setting(Kind::Par, word));
            driver
                .master
                .set_parameter(now, known.board, &setting.name, setting.value)
                .map_err(Error::from)?;
        }
        arrived(driver, known.board).map_err(|failure| match failure {
            ValuesError::Unknown { board, why, .. } => {
                ValuesError::Unknown { board, why, written: Some(written.clone()) }
            }
            other => other,
        })?;
        written.push(known.board);
        history.wrote(words.iter().map(|w| (w.index, w.word)));
    }
    Ok(())
}

/// Makes this PC the master. Before it sends any frame, the function listens for another PC (D-08). The function returns `true` if the
/// control loop of the board runs.
pub fn become_master(driver: &mut Driver, board: u8, force: bool) -> Result<bool, SessionError> {
    let change = AdminChange::default();
    match driver.run(Request::Admin { board, change, force })? {
        Outcome::Admin { admin, .. } => Ok(admin.run),
        other => Err(other.into()),
    }
}

/// Sends the queued frames, and then checks that the application of the board still runs and has therefore received the frames. The check
/// is necessary because the board does not confirm inputs and parameters (D-35). Frames are sent in order, so the answer to a query shows
/// that all frames before the query were sent.
pub fn arrived(driver: &mut Driver, board: u8) -> Result<(), ValuesError> {
    let unknown = |why: String| Err(ValuesError::Unknown { board, why, written: None });
    match driver.seen(board) {
        Ok(found) if found.info.status.has(Status::MSTART) => Ok(()),
        Ok(_) => unknown("its application has stopped".into()),
        Err(e) => unknown(format!("the board no longer answers ({e})")),
    }
}

/// Reads the inventory if it exists.
pub fn inventory(path: &Path) -> Result<Option<Inventory>, InventoryError> {
    match path.exists() {
        true => Inventory::read(path).map(Some),
        false => Ok(None),
    }
}

/// Returns the name of a board in an inventory.
pub fn name_of(inventory: Option<&Inventory>, flash_number: u16) -> Option<&str> {
    let board = inventory?.boards().find(|b| b.flash_number == flash_number)?;
    Some(board.name.as_str()).filter(|name| !name.is_empty())
}

/// Parameter file that is compared with the boards on the bus.
#[derive(Debug)]
pub struct ParameterFile {
    file: String,
    boards: Vec<ParamsBoard>,
    inventory: Option<Inventory>,
}

/// Words for one board in a parameter file: initial inputs, then parameters.
pub type FileWords = (Vec<Word>, Vec<Word>);

impl ParameterFile {
    /// Reads a parameter file, and removes the boards that are not selected.
    pub fn read(path: &Path, inventory_file: &Path, meant: impl Fn(u8) -> bool) -> Result<Self, ValuesError> {
        let wrong = |message: String, hint| ValuesError::File { message, hint };
        let file =
            ParamsFile::read(path).map_err(|e| wrong(e.to_string(), "ucom help params shows the form"))?;
        if file.boards.iter().all(|b| b.par.is_empty() && b.ci.is_empty()) {
            return Err(wrong(
                format!("{}: the file contains no value", path.display()),
                "write a name and a value without # at the beginning of the line, as `kp: 120`, or an index \
                 and a value, as \"#0\": 120",
            ));
        }
        let inventory = inventory(inventory_file).map_err(|e| wrong(e.to_string(), ""))?;
        let boards = file.boards.into_iter().filter(|b| meant(b.number)).collect();
        Ok(Self { file: path.display().to_string(), boards, inventory })
    }

    /// Removes the boards that are not selected from the parameter file. The function is used for a file that was read before the boards
    /// were known.
    #[must_use]
    pub fn of_boards(mut self, meant: impl Fn(u8) -> bool) -> Self {
        self.boards.retain(|board| meant(board.number));
        self
    }

    /// Returns the numbers of the boards in the parameter file.
    pub fn numbers(&self) -> Vec<u8> {
        self.boards.iter().map(|b| b.number).collect()
    }

    /// Checks that the boards on the bus are the boards in the file. The function sends only queries.
    pub fn identities(&self, driver: &mut Driver) -> Result<(), SessionError> {
        let mut problems = Vec::new();
        for board in &self.boards {
            match driver.seen(board.number) {
                Ok(found) => {
                    let name = name_of(self.inventory.as_ref(), found.info.flash_number);
                    problems.extend(check_identity(board, &ParamsTarget { info: &found.info, name }));
                }
                Err(e) if e.is_no_answer() => {
                    let kind = ParamsProblemKind::Absent;
                    problems.push(ParamsProblem { place: board.place, board: board.number, kind });
                }
                Err(e) => return Err(e),
            }
        }
        Ok(self.verdict(problems)?)
    }

    /// Returns the words in the file for all boards. If the file has errors, the function returns all errors.
    pub fn words<'a>(
        &self,
        known: impl Fn(u8) -> Option<&'a Known>,
    ) -> Result<Vec<(u8, FileWords)>, ValuesError> {
        let (mut all, mut problems) = (Vec::new(), Vec::new());
        for board in &self.boards {
            let Some(known) = known(board.number) else { continue };
            match check_board(board, &known.names, &known.signals) {
                Ok(words) => all.push((board.number, words)),
                Err(more) => problems.extend(more),
            }
        }
        self.verdict(problems).map(|()| all)
    }

    fn verdict(&self, problems: Vec<ParamsProblem>) -> Result<(), ValuesError> {
        if problems.is_empty() {
            return Ok(());
        }
        let lines: Vec<String> = problems.iter().map(|p| format!("{}: {p}", self.file)).collect();
        Err(ValuesError::Misfit { lines })
    }
}
