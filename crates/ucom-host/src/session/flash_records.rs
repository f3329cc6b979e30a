//! Updates boards with the help of flash records. An update uses the flash records of the boards, and stores its results as new flash
//! records.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use super::driver::Driver;
use super::error::SessionError;
use crate::files::{FlashRecord, Inventory, InventoryError};
use crate::master::update::{UpdateOptions, UpdateReport};
use crate::master::{Event, Outcome, Request};

/// Flash records of this tool (D-62). Flash records of boards in the inventory are stored in the inventory file; other flash records are
/// stored in memory until the session ends.
#[derive(Debug, Default)]
pub struct FlashRecords {
    inventory: Option<PathBuf>,
    records: BTreeMap<u16, FlashRecord>,
    listed: BTreeSet<u16>,
}

impl FlashRecords {
    /// Creates the flash records of an inventory file, which need not exist. Without an inventory file, the flash records are stored only
    /// during the session.
    pub fn new(inventory: Option<PathBuf>) -> Self {
        Self { inventory, ..Self::default() }
    }

    /// Reads the inventory again, because other programs and users may have changed it.
    fn read(&mut self) -> Result<(), InventoryError> {
        self.listed.clear();
        let Some(path) = self.inventory.as_ref().filter(|path| path.exists()) else { return Ok(()) };
        for board in Inventory::read(path)?.boards() {
            self.listed.insert(board.flash_number);
            match board.record() {
                Some(record) => self.records.insert(board.flash_number, record),
                None => self.records.remove(&board.flash_number),
            };
        }
        Ok(())
    }

    fn set(&mut self, flash_number: u16, record: Option<FlashRecord>) -> Result<(), InventoryError> {
        match record {
            Some(record) => self.records.insert(flash_number, record),
            None => self.records.remove(&flash_number),
        };
        match &self.inventory {
            Some(path) if self.listed.contains(&flash_number) => {
                Inventory::set_record(path, flash_number, record)
            }
            _ => Ok(()),
        }
    }
}

impl Driver {
    /// Updates the firmware of boards. The flash record of a board is removed before the board is reset for programming, and stored again
    /// after the board has been read back. If the flash record cannot be removed, the update is cancelled before more memory is erased.
    ///
    /// # Errors
    /// Returns the errors of [`Driver::run`], or an error if the inventory cannot be read.
    pub fn update(
        &mut self,
        mut options: UpdateOptions,
        records: &mut FlashRecords,
        see: &mut dyn FnMut(&Event),
    ) -> Result<UpdateReport, SessionError> {
        records.read()?;
        options.records.clone_from(&records.records);
        let image = options.image.clone();
        let mut notes = Vec::new();
        let outcome = self.drive(Request::Update(options), true, &mut |master, event| {
            match event {
                Event::FlashBegins { id, flash_number } => {
                    if let Err(error) = records.set(*flash_number, None) {
                        notes.push(format!("{error}; the update ends before it erases more memory"));
                        master.cancel(*id);
                    }
                }
                Event::FlashVerified { info, .. } => {
                    let record = FlashRecord::new(&image.bytes, image.address_words, info);
                    if let Err(error) = records.set(info.flash_number, Some(record)) {
                        notes.push(format!("the written program is not recorded in the inventory: {error}"));
                    }
                }
                _ => {}
            }
            see(event);
        });
        notes.into_iter().for_each(|note| self.note(note));
        match outcome? {
            Outcome::Update(report) => Ok(report),
            other => Err(other.into()),
        }
    }
}
