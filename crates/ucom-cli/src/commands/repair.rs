//! `ucom repair`: one board gets its number back, the others keep theirs.

use serde_json::json;
use ucom_host::files::Inventory;
use ucom_host::master::{Outcome, Request};

use cli_kit::{Failure, Output};
use ucom_host::session::SessionError;

use crate::args::{LinkArgs, RepairArgs};
use crate::shape::{board_table, board_value};

/// Repairs the board; its flash number must be the one that is named, else as the inventory has it.
pub fn repair(args: &RepairArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let board = args.board;
    let flash_number = match args.flash_id {
        Some(flash) => flash,
        None => known(args)?,
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

/// The flash number of the inventory.
fn known(args: &RepairArgs) -> Result<u16, Failure> {
    let (board, file) = (args.board, args.inventory.display());
    let helps = "name the board's --flash-id; ucom init writes an inventory";
    if !args.inventory.exists() {
        let text = format!("which board stands at number {board}? there is no inventory {file}");
        return Err(Failure::usage(text).hint(helps));
    }
    let inventory = Inventory::read(&args.inventory).map_err(Failure::usage)?;
    let known = inventory.get(board).map(|b| b.flash_number);
    known.ok_or_else(|| Failure::usage(format!("board {board} is not in the inventory {file}")).hint(helps))
}
