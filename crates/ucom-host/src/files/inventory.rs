//! Reads and writes inventory files, which list the boards and their positions in the chain. An inventory is written after an init and read
//! before an update of several boards.
//!
//! ```toml
//! [[board]]
//! number = 1
//! flash_number = 0x0021
//! description = "UCoM2 head pan"
//! name = "head pan"
//! program = { flash_number = 0x0021, sha256 = "…", address = 0x0, program_id = 0x4B3F, date = 0x3AC1 }
//! ```
//!
//! The key `program` of a board is the [`FlashRecord`] of the last update that was read back. An update changes only the key `program`. An
//! update does not change any other part of the file, including comments.

mod edit;

use host_kit::{Diagnose, Diagnosis, ErrorKind, Facts, write_atomically};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use toml_edit::{Item, TableLike, Value};

use super::FlashRecord;
use crate::master::InitReport;

/// Size limit of an inventory file in bytes.
const MAX_BYTES: u64 = 1 << 20;

/// Board in an inventory.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InventoryBoard {
    /// Position of the board in the chain, 0..31.
    pub number: u8,
    /// Flash number of the board.
    pub flash_number: u16,
    /// Description that the board reported.
    #[serde(default)]
    pub description: String,
    /// Name that the user has chosen for the board.
    #[serde(default)]
    pub name: String,
    /// Flash record of the last update of the board.
    #[serde(default)]
    pub program: Option<FlashRecord>,
}

impl InventoryBoard {
    /// Returns the flash record of the last update of this board; `None` if the record belongs to another board or
    /// does not exist.
    pub fn record(&self) -> Option<FlashRecord> {
        self.program.filter(|record| record.flash_number == self.flash_number)
    }
}

/// Boards of an inventory, by position in the chain.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Inventory {
    boards: BTreeMap<u8, InventoryBoard>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    board: Vec<InventoryBoard>,
}

/// Reasons why a file is not a valid inventory.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum InventoryError {
    /// The inventory file cannot be used.
    #[error("{}: {source}", path.display())]
    Io {
        /// Path of the inventory file.
        path: PathBuf,
        /// Error that the system reported.
        source: std::io::Error,
    },
    /// The file is larger than the size limit of an inventory.
    #[error("{}: the inventory has {bytes} bytes, expected at most {MAX_BYTES}", path.display())]
    TooLarge {
        /// Path of the inventory file.
        path: PathBuf,
        /// Size of the file in bytes.
        bytes: u64,
    },
    /// The text is not TOML in the form of an inventory. The error message contains the line.
    #[error("{0}")]
    Form(String),
    /// A board number is higher than the highest possible board number.
    #[error("board number {number} is above 31")]
    Number {
        /// Board number in the file.
        number: u8,
    },
    /// Two boards have the same position.
    #[error("board {number} has two entries")]
    Twice {
        /// Board number that both boards have.
        number: u8,
    },
    /// A board is listed at two positions.
    #[error(
        "boards {first} and {second} have the same flash number 0x{flash_number:04X}; each flash number \
         must be unique"
    )]
    FlashTwice {
        /// Flash number that is listed twice.
        flash_number: u16,
        /// Number of the first board.
        first: u8,
        /// Number of the second board.
        second: u8,
    },
}

/// Reasons why the flash number of a board is not known.
#[derive(Debug, thiserror::Error)]
pub enum IdentifyError {
    /// The inventory file does not exist.
    #[error("the flash number of board {board} is not known: there is no inventory {}", path.display())]
    NoInventory {
        /// Board number that was requested.
        board: u8,
        /// Path of the inventory file.
        path: PathBuf,
    },
    /// The inventory does not list the board.
    #[error("board {board} is not in the inventory {}", path.display())]
    NotListed {
        /// Board number that was requested.
        board: u8,
        /// Path of the inventory file.
        path: PathBuf,
    },
    /// The inventory file cannot be read.
    #[error(transparent)]
    Inventory(#[from] InventoryError),
}

impl Diagnose for IdentifyError {
    fn diagnosis(&self) -> Diagnosis {
        let (kind, code, next) = match self {
            Self::NoInventory { .. } => (
                ErrorKind::Refused,
                "no-inventory",
                "write the inventory with ucom init, or give --flash-id for this board",
            ),
            Self::NotListed { .. } => (
                ErrorKind::Refused,
                "not-in-inventory",
                "write the inventory again with ucom init --renew, or give --flash-id for this board",
            ),
            Self::Inventory(_) => (ErrorKind::Usage, "usage", ""),
        };
        Diagnosis::new(kind, code, next)
    }

    fn facts(&self) -> Facts {
        match self {
            Self::NoInventory { board, .. } | Self::NotListed { board, .. } => {
                Facts::default().at_board(*board)
            }
            Self::Inventory(_) => Facts::default(),
        }
    }
}

/// Returns the flash number of a board from an inventory file.
///
/// # Errors
/// Returns an error if the file does not exist, cannot be read, or does not list the board.
pub fn flash_number_of(path: &Path, board: u8) -> Result<u16, IdentifyError> {
    if !path.exists() {
        return Err(IdentifyError::NoInventory { board, path: path.into() });
    }
    let known = Inventory::read(path)?.get(board).map(|known| known.flash_number);
    known.ok_or_else(|| IdentifyError::NotListed { board, path: path.into() })
}

impl Inventory {
    /// Reads an inventory from TOML text.
    pub fn parse(text: &str) -> Result<Self, InventoryError> {
        let file: File = toml::from_str(text).map_err(|e| InventoryError::Form(e.to_string()))?;
        let mut inventory = Self::default();
        for board in file.board {
            inventory.insert(board)?;
        }
        Ok(inventory)
    }

    /// Reads an inventory from a file.
    pub fn read(path: &Path) -> Result<Self, InventoryError> {
        let io = |source| InventoryError::Io { path: path.into(), source };
        let bytes = std::fs::metadata(path).map_err(io)?.len();
        if bytes > MAX_BYTES {
            return Err(InventoryError::TooLarge { path: path.into(), bytes });
        }
        let text = std::fs::read_to_string(path).map_err(io)?;
        Self::parse(&text).map_err(|e| match e {
            InventoryError::Form(text) => InventoryError::Form(format!("{}: {text}", path.display())),
            other => other,
        })
    }

    /// Adds a board to the inventory. The function refuses a number above 31, a position that is already used, and a flash number that the
    /// inventory already lists.
    pub fn insert(&mut self, board: InventoryBoard) -> Result<(), InventoryError> {
        let number = board.number;
        if number > 31 {
            return Err(InventoryError::Number { number });
        }
        if self.boards.contains_key(&number) {
            return Err(InventoryError::Twice { number });
        }
        let flash_number = board.flash_number;
        if let Some(first) = self.boards.values().find(|b| b.flash_number == flash_number) {
            return Err(InventoryError::FlashTwice { flash_number, first: first.number, second: number });
        }
        self.boards.insert(number, board);
        Ok(())
    }

    /// Returns the board at a position of the chain.
    pub fn get(&self, number: u8) -> Option<&InventoryBoard> {
        self.boards.get(&number)
    }

    /// Returns all boards of the inventory in the order of the chain.
    pub fn boards(&self) -> impl Iterator<Item = &InventoryBoard> {
        self.boards.values()
    }

    /// Creates an inventory of the boards in the report of an init. The names and the flash records come from an older inventory.
    ///
    /// # Errors
    /// Returns an error if two boards have the same flash number.
    pub fn of_init(report: &InitReport, older: Option<&Self>) -> Result<Self, InventoryError> {
        let mut inventory = Self::default();
        for board in &report.boards {
            inventory.insert(InventoryBoard {
                number: board.number,
                flash_number: board.info.flash_number,
                description: board.description.clone().unwrap_or_default(),
                ..InventoryBoard::default()
            })?;
        }
        if let Some(older) = older {
            inventory.keep(older);
        }
        Ok(inventory)
    }

    /// Copies names and flash records from an older inventory; boards are matched by flash number.
    pub fn keep(&mut self, older: &Self) {
        for board in self.boards.values_mut() {
            let Some(known) = older.boards.values().find(|b| b.flash_number == board.flash_number) else {
                continue;
            };
            if board.name.is_empty() {
                board.name.clone_from(&known.name);
            }
            board.program = board.program.or(known.record());
        }
    }

    /// Returns the inventory without its flash records. The function is used after the inventory file was deleted,
    /// because the flash records are then not reliable.
    #[must_use]
    pub fn without_records(mut self) -> Self {
        self.boards.values_mut().for_each(|board| board.program = None);
        self
    }

    /// Sets or removes the flash record of a board in an inventory file, and changes nothing else in the file.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read or written. If the file does not list the board, the file stays unchanged, and the
    /// function returns no error.
    pub fn set_record(
        path: &Path,
        flash_number: u16,
        record: Option<FlashRecord>,
    ) -> Result<(), InventoryError> {
        let io = |source| InventoryError::Io { path: path.into(), source };
        let wrong = |text: String| InventoryError::Form(format!("{}: {text}", path.display()));
        let text = std::fs::read_to_string(path).map_err(io)?;
        let mut document = edit::parsed(&text)?;
        let item = match record {
            None => None,
            Some(record) => {
                let value: Value = record.to_toml().parse().map_err(|e| wrong(format!("{e}")))?;
                Some(Item::Value(value))
            }
        };
        let boards: Vec<&mut dyn TableLike> = match document.get_mut("board") {
            Some(Item::ArrayOfTables(tables)) => tables.iter_mut().map(|t| t as &mut dyn TableLike).collect(),
            Some(Item::Value(Value::Array(array))) => {
                let tables = array.iter_mut().filter_map(Value::as_inline_table_mut);
                tables.map(|table| table as &mut dyn TableLike).collect()
            }
            _ => Vec::new(),
        };
        let is_meant = |board: &&mut dyn TableLike| {
            board.get("flash_number").and_then(Item::as_integer) == Some(i64::from(flash_number))
        };
        match (boards.into_iter().find(is_meant), item) {
            (Some(board), Some(item)) => drop(board.insert("program", item)),
            (Some(board), None) if board.contains_key("program") => drop(board.remove("program")),
            (Some(_), None) | (None, _) => return Ok(()),
        }
        write_atomically(path, edit::rendered(&document, &text).as_bytes()).map_err(io)
    }

    /// Returns the inventory as the text of a file.
    pub fn to_toml(&self) -> String {
        let mut text = String::from("# Boards of the chain, by position.\n");
        for board in self.boards.values() {
            text += &format!("\n[[board]]\nnumber = {}\n", board.number);
            text += &format!("flash_number = 0x{:04X}\n", board.flash_number);
            for (key, value) in [("description", &board.description), ("name", &board.name)] {
                if !value.is_empty() {
                    text += &format!("{key} = {}\n", quoted(value));
                }
            }
            if let Some(record) = board.program {
                text += &format!("program = {}\n", record.to_toml());
            }
        }
        text
    }
}

/// Returns a text as a TOML basic string.
fn quoted(text: &str) -> String {
    let mut out = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            c if c.is_control() => out += &format!("\\u{:04X}", u32::from(c)),
            c => out.push(c),
        }
    }
    out + "\""
}

#[cfg(test)]
mod tests;
