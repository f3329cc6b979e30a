//! Options of `ucom update` and `ucom repair`.

use std::path::PathBuf;

use clap::Args;
use cli_kit::variables::on_off;

use super::boards::{Boards, flash_id};
use super::{ForceArgs, ValueEnum};

/// Unit of the addresses of records.
#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
pub(crate) enum Addresses {
    /// Count bytes.
    Byte,
    /// Count words of two bytes.
    Word,
}

/// Options of `ucom update`.
#[derive(Args, Debug)]
pub(crate) struct UpdateArgs {
    /// Board number, list, range, or all
    #[arg(value_name = "BOARDS")]
    pub boards: Boards,
    /// Image to write.
    ///
    /// Formats: Intel HEX, S-record, or raw bytes in a .bin file. Other raw files need --raw
    #[arg(value_name = "IMAGE")]
    pub image: PathBuf,
    /// Read files of any name as raw bytes.
    ///
    /// With this option, the command refuses Intel HEX and S-records. The command reads text as raw bytes only from a
    /// .bin file
    #[arg(long)]
    pub raw: bool,
    /// Set the unit of the addresses in Intel HEX and S-records.
    ///
    /// Default: words in S-records, and bytes in Intel HEX. If the records are without gaps only in the other unit, the
    /// command uses the other unit
    #[arg(long, value_enum, value_name = "UNIT")]
    pub addresses: Option<Addresses>,
    /// Fill gaps between records with this byte.
    ///
    /// Example: 0xFF, the erased state of flash. Without this option, the command refuses an image with a gap
    #[arg(long, value_name = "BYTE", value_parser = fill_byte)]
    pub fill_gaps: Option<u8>,
    /// Require this flash number of the board
    #[arg(long, value_name = "ID", value_parser = flash_id)]
    pub flash_id: Option<u16>,
    /// Write this flash date, or a 16-bit value such as 0x3AC1.
    ///
    /// Default: today. A board that is already up to date keeps its date
    #[arg(long, value_name = "YYYY-MM-DD")]
    pub date: Option<String>,
    /// Check files and boards, but do not change any board
    #[arg(long, env = "UCOM_DRY_RUN", value_parser = on_off)]
    pub dry_run: bool,
    /// Start the application afterwards, and check that it runs
    #[arg(long)]
    pub start: bool,
    /// Write the board's flash number into the image header.
    ///
    /// Only the board with this flash number then accepts the image
    #[arg(long, conflicts_with = "group")]
    pub name_target: bool,
    /// Program the named boards with one broadcast transfer.
    ///
    /// Without this option, the command programs one board after the other
    #[arg(long)]
    pub group: bool,
    /// First send this exloader (boot loader) to the RAM.
    ///
    /// The profile must set `prog.plan` to exloader-app
    #[arg(long, value_name = "FILE")]
    pub exloader: Option<PathBuf>,
    /// Write this image of data memory.
    ///
    /// The profile must set `prog.plan` to pmem-xmem
    #[arg(long, value_name = "FILE")]
    pub data: Option<PathBuf>,
    /// Send this file in the second cycle (default: IMAGE again).
    ///
    /// The profile must set `prog.plan` to raw
    #[arg(long, value_name = "FILE")]
    pub second: Option<PathBuf>,
    /// Require that the board reports this Program ID at the end.
    ///
    /// Use this option for images that do not contain the Program ID
    #[arg(long, value_name = "ID", value_parser = program_id)]
    pub expect_program_id: Option<u16>,
    /// Accept an update that the command cannot verify.
    ///
    /// The exit code is then 0 for the outcome `program-up-to-date`. The code is also 0 if the profile does not allow a
    /// verification
    #[arg(long)]
    pub unverified: bool,
    /// Write even if the board already reports this program.
    ///
    /// The command still makes all checks
    #[arg(long)]
    pub rewrite: bool,
    /// Read the flash numbers from this inventory file.
    ///
    /// `ucom init` writes this file. Each update records the written image in the file
    #[arg(long, env = "UCOM_INVENTORY", value_name = "FILE", default_value = "ucom-inventory.toml")]
    pub inventory: PathBuf,
    #[command(flatten)]
    pub force: ForceArgs,
}

/// Options of `ucom repair`.
#[derive(Args, Debug)]
pub(crate) struct RepairArgs {
    /// Board number
    #[arg(value_name = "BOARD", value_parser = clap::value_parser!(u8).range(0..=31))]
    pub board: u8,
    /// Require this flash number of the board.
    ///
    /// Default: the flash number in the inventory
    #[arg(long, value_name = "ID", value_parser = flash_id)]
    pub flash_id: Option<u16>,
    /// Read the flash numbers from this inventory file.
    ///
    /// `ucom init` writes this file
    #[arg(long, env = "UCOM_INVENTORY", value_name = "FILE", default_value = "ucom-inventory.toml")]
    pub inventory: PathBuf,
    #[command(flatten)]
    pub force: ForceArgs,
}

/// Parses a Program ID, which is decimal, or hexadecimal with 0x.
fn program_id(text: &str) -> Result<u16, String> {
    flash_id(text).map_err(|_| format!("\"{text}\" is not a Program ID, as 0x4B3F"))
}

/// Parses the byte that fills gaps, which is decimal, or hexadecimal with 0x.
fn fill_byte(text: &str) -> Result<u8, String> {
    let byte = flash_id(text).ok().and_then(|word| u8::try_from(word).ok());
    byte.ok_or_else(|| format!("\"{text}\" is not a valid byte, expected 0 to 255 or 0x00 to 0xFF"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn program_ids_are_words_and_fill_bytes_are_bytes() {
        assert_eq!((program_id("0x4B3F"), program_id("19263")), (Ok(0x4B3F), Ok(0x4B3F)));
        assert_eq!((fill_byte("0xFF"), fill_byte("0")), (Ok(0xFF), Ok(0)));
        for wrong in ["FF", "256", "0x100", "-1", ""] {
            assert!(fill_byte(wrong).is_err_and(|e| e.contains("0x00 to 0xFF")), "{wrong}");
        }
        assert!(program_id("0x10000").is_err_and(|e| e.contains("Program ID")));
    }
}
