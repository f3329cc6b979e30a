//! Command `ucom repair`: assigns the lost number to one board again; the other boards keep their numbers.

use serde_json::json;
use ucom_host::files::inventory::flash_number_of;
use ucom_host::master::{Outcome, Request};

use cli_kit::{Diagnose, Failure, Output};
use ucom_host::session::SessionError;

use crate::args::{LinkArgs, RepairArgs};
use crate::shape::{board_table, board_value};

/// Gives one board its lost number again. The board must have the flash number on the command line. Without this
/// option, it must have the flash number in the inventory.
pub(super) fn repair(args: &RepairArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let board = args.board;
    let flash_number = match args.flash_id {
        Some(flash) => flash,
        // The user must select the board by its flash number, so a missing flash number is a usage error.
        None => flash_number_of(&args.inventory, board).map_err(|e| Failure::usage(&e).next(e.hint()))?,
    };
    let mut driver = link.session()?;
    let profile = driver.master.profile();
    let seen = match driver.run(Request::Repair { board, flash_number, force: args.force.force })? {
        Outcome::Repaired(seen) => seen,
        other => return Err(SessionError::from(other).into()),
    };
    let value = json!({ "repaired": true, "board": board_value(&seen, &profile) });
    out.result(&value, || {
        format!("board {board} has its number\n{}", board_table(std::slice::from_ref(&seen), &profile))
    });
    Ok(())
}
