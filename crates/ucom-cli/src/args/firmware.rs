//! The options of `ucom update` and `ucom repair`.

use std::path::PathBuf;

use clap::Args;
use cli_kit::variables::on_off;

use super::boards::{Boards, flash_id};
use super::{ForceArgs, ValueEnum};

/// What an address of a record counts.
#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
pub enum Addresses {
    /// Bytes.
    Byte,
    /// Words of two bytes.
    Word,
}

/// Options of `ucom update`.
#[derive(Args, Debug)]
pub struct UpdateArgs {
    /// Board number, list, range, or all
    #[arg(value_name = "BOARDS")]
    pub boards: Boards,
    /// Image: Intel HEX, S-record, or raw bytes in a .bin (anything else raw needs --raw)
    #[arg(value_name = "IMAGE")]
    pub image: PathBuf,
    /// Take files of any name as raw bytes; never records, and text only from a .bin
    #[arg(long)]
    pub raw: bool,
    /// What the addresses of Intel HEX and S-records count; default: words in S-records and bytes in Intel HEX, unless the records
    /// follow each other in the other unit alone
    #[arg(long, value_enum, value_name = "UNIT")]
    pub addresses: Option<Addresses>,
    /// Fill gaps between records with FF, the erased state of flash
    #[arg(long)]
    pub fill_gaps: bool,
    /// The flash number that the board must have
    #[arg(long, value_name = "ID", value_parser = flash_id)]
    pub flash_id: Option<u16>,
    /// Flash date to write, or its 16 bits as 0x3AC1; default: today, and a board that shows the program keeps its date
    #[arg(long, value_name = "YYYY-MM-DD")]
    pub date: Option<String>,
    /// Check everything, send nothing that changes a board
    #[arg(long, env = "UCOM_DRY_RUN", value_parser = on_off)]
    pub dry_run: bool,
    /// Start the application afterwards and see that it runs
    #[arg(long)]
    pub start: bool,
    /// Write the board's flash number into the header, so that no other board takes the image
    #[arg(long, conflicts_with = "group")]
    pub name_target: bool,
    /// All these boards with one transfer, by broadcast, instead of one after the other
    #[arg(long)]
    pub group: bool,
    /// Exloader for RAM, with the profile's `prog.plan` exloader-app
    #[arg(long, value_name = "FILE")]
    pub exloader: Option<PathBuf>,
    /// Image of data memory, with `prog.plan` pmem-xmem
    #[arg(long, value_name = "FILE")]
    pub data: Option<PathBuf>,
    /// File of the second cycle, with `prog.plan` raw; default: IMAGE again
    #[arg(long, value_name = "FILE")]
    pub second: Option<PathBuf>,
    /// Program ID that the board must show at the end, where the image does not contain it
    #[arg(long, value_name = "ID", value_parser = program_id)]
    pub expect_program_id: Option<u16>,
    /// Accept as done what cannot be verified: exit code 0 for `program-up-to-date`, and where the profile leaves nothing to
    /// compare
    #[arg(long)]
    pub unverified: bool,
    /// Write also where the board shows this program already; lifts no check
    #[arg(long)]
    pub rewrite: bool,
    /// Flash numbers of the boards, as `ucom init` wrote them; updates keep there what they wrote
    #[arg(long, env = "UCOM_INVENTORY", value_name = "FILE", default_value = "ucom-inventory.toml")]
    pub inventory: PathBuf,
    #[command(flatten)]
    pub force: ForceArgs,
}

/// Options of `ucom repair`.
#[derive(Args, Debug)]
pub struct RepairArgs {
    /// Board number
    #[arg(value_name = "BOARD", value_parser = clap::value_parser!(u8).range(0..=31))]
    pub board: u8,
    /// The flash number that the board must have; default: as the inventory has it
    #[arg(long, value_name = "ID", value_parser = flash_id)]
    pub flash_id: Option<u16>,
    /// Flash numbers of the boards, as `ucom init` wrote them
    #[arg(long, env = "UCOM_INVENTORY", value_name = "FILE", default_value = "ucom-inventory.toml")]
    pub inventory: PathBuf,
    #[command(flatten)]
    pub force: ForceArgs,
}

/// A Program ID, decimal or with 0x.
fn program_id(text: &str) -> Result<u16, String> {
    flash_id(text).map_err(|_| format!("\"{text}\" is no Program ID, as 0x4B3F"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn program_ids_are_words() {
        assert_eq!((program_id("0x4B3F"), program_id("19263")), (Ok(0x4B3F), Ok(0x4B3F)));
        assert!(program_id("0x10000").is_err_and(|e| e.contains("Program ID")));
    }
}
