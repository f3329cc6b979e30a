//! Inventory files: which board stands where. Written after an init, read before updates of several boards.
//!
//! ```toml
//! [[board]]
//! number = 1
//! flash_number = 0x0021
//! description = "UCoM2 head pan"
//! name = "head pan"
//! ```

use host_kit::{Diagnose, Diagnosis, ErrorKind, write_whole};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::master::InitReport;

/// Longest file that is read, bytes.
const MAX_BYTES: u64 = 1 << 20;

/// One board of an inventory.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InventoryBoard {
    /// Position in the chain, 0..31.
    pub number: u8,
    /// Flash number.
    pub flash_number: u16,
    /// What the board reports about itself.
    #[serde(default)]
    pub description: String,
    /// What people call it.
    #[serde(default)]
    pub name: String,
}

/// Boards by position.
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

/// Why a file is no inventory.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum InventoryError {
    /// The file cannot be used.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Larger than any inventory.
    #[error("{}: {bytes} bytes are too many for an inventory (limit {MAX_BYTES})", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its size.
        bytes: u64,
    },
    /// Not TOML of this form; the text names the line.
    #[error("{0}")]
    Form(String),
    /// A number that no board has.
    #[error("board number {number} is above 31")]
    Number {
        /// The number.
        number: u8,
    },
    /// Two boards at one place.
    #[error("board {number} is given twice")]
    Twice {
        /// Its number.
        number: u8,
    },
    /// Two places for one board.
    #[error("flash number 0x{flash_number:04X} is given to boards {first} and {second}; it must be unique")]
    FlashTwice {
        /// The flash number.
        flash_number: u16,
        /// Number of one board.
        first: u8,
        /// Number of the other.
        second: u8,
    },
}

/// Why nobody knows which board stands at a number.
#[derive(Debug, thiserror::Error)]
pub enum IdentifyError {
    /// There is no inventory.
    #[error("which board stands at number {board}? there is no inventory {}", path.display())]
    NoInventory {
        /// The number.
        board: u8,
        /// The file.
        path: PathBuf,
    },
    /// The inventory does not have it.
    #[error("board {board} is not in the inventory {}", path.display())]
    NotListed {
        /// The number.
        board: u8,
        /// The file.
        path: PathBuf,
    },
    /// The inventory cannot be read.
    #[error(transparent)]
    Inventory(#[from] InventoryError),
}

impl Diagnose for IdentifyError {
    fn diagnosis(&self) -> Diagnosis {
        let (kind, code, next) = match self {
            Self::NoInventory { .. } => (
                ErrorKind::Refused,
                "no-inventory",
                "ucom init writes one; or name the board and its --flash-id",
            ),
            Self::NotListed { .. } => (
                ErrorKind::Refused,
                "not-in-inventory",
                "ucom init --renew writes it anew; or name the board's --flash-id",
            ),
            Self::Inventory(_) => (ErrorKind::Usage, "usage", ""),
        };
        Diagnosis::new(kind, code, next)
    }
}

/// The flash number of a board by an inventory file.
///
/// # Errors
/// There is no such file, it cannot be read, or it does not have the board.
pub fn flash_number_of(path: &Path, board: u8) -> Result<u16, IdentifyError> {
    if !path.exists() {
        return Err(IdentifyError::NoInventory { board, path: path.into() });
    }
    let known = Inventory::read(path)?.get(board).map(|known| known.flash_number);
    known.ok_or_else(|| IdentifyError::NotListed { board, path: path.into() })
}

impl Inventory {
    /// Reads TOML.
    pub fn parse(text: &str) -> Result<Self, InventoryError> {
        let file: File = toml::from_str(text).map_err(|e| InventoryError::Form(e.to_string()))?;
        let mut inventory = Self::default();
        for board in file.board {
            inventory.insert(board)?;
        }
        Ok(inventory)
    }

    /// Reads a file.
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

    /// Writes a file, at once or not at all.
    pub fn write(&self, path: &Path) -> Result<(), InventoryError> {
        let io = |source| InventoryError::Io { path: path.into(), source };
        write_whole(path, self.to_toml().as_bytes()).map_err(io)
    }

    /// Adds a board. Numbers above 31, a place taken and a flash number known already are refused.
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

    /// The board at a position.
    pub fn get(&self, number: u8) -> Option<&InventoryBoard> {
        self.boards.get(&number)
    }

    /// All boards in the order of the chain.
    pub fn boards(&self) -> impl Iterator<Item = &InventoryBoard> {
        self.boards.values()
    }

    /// The boards of an init, with the names that people gave them in an older inventory.
    ///
    /// # Errors
    /// Two boards have one flash number.
    pub fn of_init(report: &InitReport, older: Option<&Self>) -> Result<Self, InventoryError> {
        let mut inventory = Self::default();
        for board in &report.boards {
            inventory.insert(InventoryBoard {
                number: board.number,
                flash_number: board.info.flash_number,
                description: board.description.clone().unwrap_or_default(),
                name: String::new(),
            })?;
        }
        if let Some(older) = older {
            inventory.keep_names(older);
        }
        Ok(inventory)
    }

    /// Takes over the names that people gave in an older inventory, by flash number.
    pub fn keep_names(&mut self, older: &Self) {
        for board in self.boards.values_mut().filter(|b| b.name.is_empty()) {
            if let Some(known) = older.boards.values().find(|b| b.flash_number == board.flash_number) {
                board.name.clone_from(&known.name);
            }
        }
    }

    /// The file's text.
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
        }
        text
    }
}

/// A basic string of TOML.
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
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn board(number: u8, flash_number: u16) -> InventoryBoard {
        InventoryBoard { number, flash_number, ..Default::default() }
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let refused = |text: &str| Inventory::parse(text).unwrap_err().to_string();
        assert!(refused("[[board]]\nnumber = 32\nflash_number = 1").contains("above 31"));
        let twice = "[[board]]\nnumber = 1\nflash_number = 1\n[[board]]\nnumber = 1\nflash_number = 2";
        assert!(refused(twice).contains("board 1 is given twice"));
        let same = "[[board]]\nnumber = 1\nflash_number = 7\n[[board]]\nnumber = 2\nflash_number = 7";
        assert!(refused(same).contains("0x0007") && refused(same).contains("boards 1 and 2"));
        assert!(refused("[[board]]\nnumber = 1\nflash_number = 1\nposition = 2").contains("position"));
        assert!(refused("[[bord]]").contains("line 1"));
    }

    #[test]
    fn names_stay_with_their_board() {
        let mut old = Inventory::default();
        old.insert(InventoryBoard { name: "head pan".into(), ..board(1, 0x21) }).unwrap();
        let mut new = Inventory::default();
        new.insert(board(1, 0x42)).unwrap();
        new.insert(board(2, 0x21)).unwrap();
        new.keep_names(&old);
        assert_eq!(new.get(2).unwrap().name, "head pan");
        assert_eq!(new.get(1).unwrap().name, "");
    }

    proptest! {
        #[test]
        fn round_trip(boards in prop::collection::btree_map(0_u8..32, (any::<u16>(), any::<String>()), 0..32)) {
            let mut inventory = Inventory::default();
            for (number, (flash, text)) in boards {
                let flash = flash & 0xFFE0 | u16::from(number);
                inventory.insert(InventoryBoard { description: text, ..board(number, flash) }).unwrap();
            }
            prop_assert_eq!(Inventory::parse(&inventory.to_toml()).unwrap(), inventory);
        }
    }
}
