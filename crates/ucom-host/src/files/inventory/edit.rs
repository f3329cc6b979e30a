//! Edits the text of an inventory file. An edit keeps the comments, the line ends and the order of the file.

use std::collections::BTreeSet;
use std::path::Path;

use host_kit::write_atomically;
use toml_edit::{ArrayOfTables, DocumentMut, Item, Table, Value, value};

use super::{Inventory, InventoryBoard, InventoryError};

/// Byte order mark that some editors write before a text.
const MARK: &str = "\u{feff}";

impl Inventory {
    /// Writes the inventory to a file atomically. A file that already contains this inventory is not written. In a file with other
    /// contents, only the values that differ are changed, so comments are kept. Returns `true` if the file was written.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read or written, or if it is not an inventory.
    pub fn write(&self, path: &Path) -> Result<bool, InventoryError> {
        let io = |source| InventoryError::Io { path: path.into(), source };
        // A command can have created the file, still empty, to check that it is writable.
        let text = match std::fs::read_to_string(path) {
            Ok(text) => text,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => String::new(),
            Err(e) => return Err(io(e)),
        };
        let edited = if text.trim().is_empty() { self.to_toml() } else { self.edited(&text)? };
        if edited == text {
            return Ok(false);
        }
        write_atomically(path, edited.as_bytes()).map_err(io)?;
        Ok(true)
    }

    /// Returns the text of an inventory file with the values of this inventory.
    fn edited(&self, text: &str) -> Result<String, InventoryError> {
        let old = Self::parse(text)?;
        if old == *self {
            return Ok(text.into());
        }
        let mut document = parsed(text)?;
        let item = document.remove("board").unwrap_or_default();
        let mut tables = item.into_array_of_tables().unwrap_or_default();
        let heading = tables.get_mut(0).map(take_heading).unwrap_or_default();
        let mut left: BTreeSet<u8> = self.boards.keys().copied().collect();
        // A table belongs to the board with its flash number. If the chain no longer contains this board, the table belongs to the board
        // that has taken the position.
        let of_flash =
            |flash| self.boards().find(|board| board.flash_number == flash).map(|board| board.number);
        let mut owners: Vec<Option<u8>> = tables.iter().map(|table| of_flash(flash_number(table)?)).collect();
        left.retain(|number| !owners.contains(&Some(*number)));
        for (owner, table) in owners.iter_mut().zip(tables.iter()) {
            let position = table.get("number").and_then(Item::as_integer).and_then(|n| u8::try_from(n).ok());
            *owner = owner.or_else(|| position.filter(|number| left.remove(number)));
        }
        let mut heading = heading;
        for (index, owner) in owners.iter().enumerate().rev() {
            let board = owner.and_then(|number| self.get(number));
            match (board, tables.get_mut(index)) {
                (Some(board), Some(table)) => set(table, board)?,
                (_, table) => {
                    // The comment before a removed table may be about the whole file, so it is kept.
                    let before = table.and_then(|table| table.decor().prefix()?.as_str().map(str::to_owned));
                    for line in
                        before.iter().flat_map(|text| text.lines()).filter(|line| line.starts_with('#'))
                    {
                        heading += &format!("{line}\n");
                    }
                    tables.remove(index);
                }
            }
        }
        for board in left.iter().filter_map(|number| self.get(*number)) {
            let mut table = Table::new();
            table.decor_mut().set_prefix("\n");
            set(&mut table, board)?;
            tables.push(table);
        }
        if tables.is_empty() {
            return Ok(self.to_toml());
        }
        document.insert("board", Item::ArrayOfTables(in_order(tables, &heading)));
        Ok(rendered(&document, text))
    }
}

/// Returns the text before a table up to the last empty line, and removes it from the table. This text belongs to the file; the text
/// after the empty line belongs to the table.
fn take_heading(first: &mut Table) -> String {
    let before = first.decor().prefix().and_then(|text| text.as_str()).unwrap_or_default().to_owned();
    let (heading, own) = before.rsplit_once("\n\n").unwrap_or(("", &before));
    first.decor_mut().set_prefix(format!("\n{}", own.trim_start_matches('\n')));
    if heading.is_empty() { String::new() } else { format!("{heading}\n") }
}

/// Returns the tables in the order of the board numbers, after the heading of the file.
fn in_order(tables: ArrayOfTables, heading: &str) -> ArrayOfTables {
    let mut all: Vec<Table> = tables.into_iter().collect();
    all.sort_by_key(|table| table.get("number").and_then(Item::as_integer));
    let mut sorted = ArrayOfTables::new();
    for (place, mut table) in (0..).zip(all) {
        table.set_position(place);
        if sorted.is_empty() {
            let own = table.decor().prefix().and_then(|text| text.as_str()).unwrap_or_default();
            let own = if heading.is_empty() { own.trim_start_matches('\n') } else { own };
            let prefix = format!("{heading}{own}");
            table.decor_mut().set_prefix(prefix);
        }
        sorted.push(table);
    }
    sorted
}

fn flash_number(table: &Table) -> Option<u16> {
    table.get("flash_number").and_then(Item::as_integer).and_then(|n| u16::try_from(n).ok())
}

/// Sets the values of a board that differ, and removes the keys of empty values.
fn set(table: &mut Table, board: &InventoryBoard) -> Result<(), InventoryError> {
    let form = |e: toml_edit::TomlError| InventoryError::Form(e.to_string());
    let number = |n: &Item| n.as_integer();
    if table.get("number").and_then(number) != Some(board.number.into()) {
        put(table, "number", i64::from(board.number).into());
    }
    if flash_number(table) != Some(board.flash_number) {
        put(table, "flash_number", format!("0x{:04X}", board.flash_number).parse().map_err(form)?);
    }
    for (key, text) in [("description", &board.description), ("name", &board.name)] {
        match table.get(key).and_then(Item::as_str) {
            _ if text.is_empty() => drop(table.remove(key)),
            Some(old) if old == text => {}
            _ => put(table, key, text.as_str().into()),
        }
    }
    match board.program {
        None => drop(table.remove("program")),
        Some(record) => {
            let new: Value = record.to_toml().parse().map_err(form)?;
            if table.get("program").map(|item| item.to_string().trim().to_owned()) != Some(record.to_toml()) {
                put(table, "program", new);
            }
        }
    }
    Ok(())
}

/// Sets a value, and keeps the comment after the old value.
fn put(table: &mut Table, key: &str, mut new: Value) {
    match table.get_mut(key) {
        Some(Item::Value(old)) => {
            *new.decor_mut() = old.decor().clone();
            *old = new;
        }
        _ => drop(table.insert(key, value(new))),
    }
}

/// Reads the text of an inventory for an edit.
pub(super) fn parsed(text: &str) -> Result<DocumentMut, InventoryError> {
    let text = text.strip_prefix(MARK).unwrap_or(text).replace("\r\n", "\n");
    text.parse().map_err(|e: toml_edit::TomlError| InventoryError::Form(e.to_string()))
}

/// Returns the text of an edited document, with the byte order mark and the line ends of the text before.
pub(super) fn rendered(document: &DocumentMut, before: &str) -> String {
    let mut text = document.to_string();
    if before.contains("\r\n") {
        text = text.replace("\r\n", "\n").replace('\n', "\r\n");
    }
    if before.starts_with(MARK) { format!("{MARK}{text}") } else { text }
}
