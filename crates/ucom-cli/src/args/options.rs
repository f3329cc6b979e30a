//! The options of each command.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use cli_kit::variables::on_off;

use super::boards::{Assignment, Boards, bits, flash_id, one_board, raw_status, seconds};
use super::{ForceArgs, OverwriteArgs, ValueEnum};

/// Options of `ucom sim`.
#[derive(Args, Debug)]
pub struct SimArgs {
    /// Number of boards, 0..31; default: those of the chain file
    #[arg(long, env = "UCOM_BOARDS", value_name = "N", value_parser = clap::value_parser!(u8).range(0..=31))]
    pub boards: Option<u8>,
    /// Flash numbers along the chain, as 0x21,0x42
    #[arg(long, env = "UCOM_FLASH_IDS", value_name = "LIST", value_delimiter = ',', value_parser = flash_id)]
    pub flash_ids: Vec<u16>,
    /// Where clients of the socketcand protocol connect; port 0 takes a free one
    #[arg(long, env = "UCOM_LISTEN", value_name = "HOST:PORT", default_value = "127.0.0.1:29536")]
    pub listen: String,
    /// Boards of the chain, TOML; default: a built-in head
    #[arg(long, env = "UCOM_CHAIN", value_name = "FILE")]
    pub chain: Option<PathBuf>,
    /// Faults to inject, TOML; `ucom help faults` shows the form
    #[arg(long, env = "UCOM_FAULTS", value_name = "FILE")]
    pub faults: Option<PathBuf>,
    /// Seed of all that is drawn by chance
    #[arg(long, env = "UCOM_SEED", value_name = "N", default_value_t = 1)]
    pub seed: u64,
}

/// Options of `ucom init`.
#[derive(Args, Debug)]
pub struct InitArgs {
    /// Inventory to write, and to compare with when it is there
    #[arg(long, env = "UCOM_INVENTORY", value_name = "FILE", default_value = "ucom-inventory.toml")]
    pub inventory: PathBuf,
    /// Write the inventory anew, whatever stood in it before
    #[arg(long)]
    pub renew: bool,
    #[command(flatten)]
    pub force: ForceArgs,
}

/// Which boards.
#[derive(Args, Debug)]
pub struct BoardsArgs {
    /// Board number, list, range, or all
    #[arg(value_name = "BOARDS", default_value = "all")]
    pub boards: Boards,
}

/// Options of `ucom status`.
#[derive(Args, Debug)]
pub struct StatusArgs {
    /// Board number, list, range, or all
    #[arg(value_name = "BOARDS", default_value = "all")]
    pub boards: Boards,
    /// Bits to set, as ASTART,OPINIT
    #[arg(long, value_name = "BITS", value_parser = bits)]
    pub set: Option<ucom::Status>,
    /// Bits to clear
    #[arg(long, value_name = "BITS", value_parser = bits)]
    pub clear: Option<ucom::Status>,
    /// One PC_SETSTATUS as it is: mask and value as hexadecimal bytes, value bits outside the mask included
    #[arg(long, value_name = "MASK:VALUE", value_parser = raw_status, conflicts_with_all = ["set", "clear"])]
    pub raw: Option<(u8, u8)>,
    #[command(flatten)]
    pub force: ForceArgs,
}

/// Options of `ucom reset`.
#[derive(Args, Debug)]
pub struct ResetArgs {
    /// Board number, list, range, or all
    #[arg(value_name = "BOARDS", default_value = "all")]
    pub boards: Boards,
    #[command(flatten)]
    pub force: ForceArgs,
}

/// Options of commands that act on boards.
#[derive(Args, Debug)]
pub struct ActArgs {
    /// Board number, list, range, or all
    #[arg(value_name = "BOARDS")]
    pub boards: Boards,
    #[command(flatten)]
    pub force: ForceArgs,
}

/// Options of `ucom stop`.
#[derive(Args, Debug)]
pub struct StopArgs {
    /// Board number, list, range, or all
    #[arg(value_name = "BOARDS")]
    pub boards: Boards,
    /// Only end control; the application stays started
    #[arg(long)]
    pub control_only: bool,
}

/// Options of `ucom io`.
#[derive(Args, Debug)]
pub struct IoArgs {
    /// Board number, list, range, or all
    #[arg(value_name = "BOARDS", default_value = "all")]
    pub boards: Boards,
    /// Begin a signal table of all names, TOML; - is stdout
    #[arg(long, env = "UCOM_TEMPLATE", value_name = "FILE")]
    pub template: Option<PathBuf>,
    #[command(flatten)]
    pub cache: CacheArgs,
    #[command(flatten)]
    pub overwrite: OverwriteArgs,
    /// Taken from older scripts: there is no check of the bus to overrule
    #[arg(long, hide = true)]
    pub force: bool,
}

/// Where descriptions are kept.
#[derive(Args, Clone, Debug)]
pub struct CacheArgs {
    /// Ask the board even when its descriptions are known
    #[arg(long, env = "UCOM_FRESH", value_parser = on_off)]
    pub fresh: bool,
    /// Directory of known descriptions; default: ucom in the user's cache directory
    #[arg(long, env = "UCOM_CACHE", value_name = "DIR")]
    pub cache: Option<PathBuf>,
}

/// Options of `ucom ci`.
#[derive(Args, Debug)]
pub struct CiArgs {
    /// Board number
    #[arg(value_name = "BOARD", value_parser = one_board)]
    pub board: u8,
    /// NAME=VALUE; a name as `ucom io` shows it, in any case, with or without its unit, or an index
    #[arg(value_name = "NAME=VALUE")]
    pub values: Vec<Assignment>,
    /// Run the board under supervision for so many seconds, outputs active
    #[arg(long = "for", value_name = "S", value_parser = seconds)]
    pub duration: Option<Duration>,
    #[command(flatten)]
    pub cache: CacheArgs,
    #[command(flatten)]
    pub force: ForceArgs,
}

/// Options of `ucom par`.
#[derive(Args, Debug)]
pub struct ParArgs {
    /// Board number, list, range, or all; with --apply those of the file
    #[arg(value_name = "BOARDS", default_value = "all")]
    pub boards: Boards,
    /// NAME=VALUE; a name as `ucom io` shows it, in any case, with or without its unit, or an index
    #[arg(value_name = "NAME=VALUE", conflicts_with = "apply")]
    pub values: Vec<Assignment>,
    /// Write a parameter file, YAML: what was written last, and all other names as comments; - is stdout
    #[arg(long, env = "UCOM_SAVE", value_name = "FILE", conflicts_with = "apply")]
    pub save: Option<PathBuf>,
    /// Check a parameter file against the boards, then write its parameters
    #[arg(long, value_name = "FILE")]
    pub apply: Option<PathBuf>,
    /// With --apply: check everything, write nothing
    #[arg(long, env = "UCOM_DRY_RUN", value_parser = on_off)]
    pub dry_run: bool,
    /// Names of the boards, as `ucom init` wrote them
    #[arg(long, env = "UCOM_INVENTORY", value_name = "FILE", default_value = "ucom-inventory.toml")]
    pub inventory: PathBuf,
    #[command(flatten)]
    pub cache: CacheArgs,
    #[command(flatten)]
    pub overwrite: OverwriteArgs,
    #[command(flatten)]
    pub force: ForceArgs,
}

/// Options of `ucom so`.
#[derive(Args, Debug)]
pub struct SoArgs {
    /// Board number, list, range, or all
    #[arg(value_name = "BOARDS", default_value = "all")]
    pub boards: Boards,
    /// End after so many snapshots
    #[arg(long, value_name = "N")]
    pub count: Option<u64>,
    /// A CSV table: time_s, board, then a column for each output
    #[arg(long, env = "UCOM_CSV", value_parser = on_off)]
    pub csv: bool,
    #[command(flatten)]
    pub cache: CacheArgs,
}

/// What happens when a board's heartbeats stop.
#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
pub enum OnLost {
    /// Only report it.
    Report,
    /// Stop that board's control.
    StopBoard,
    /// Stop control of all boards.
    StopAll,
}

/// Options of `ucom run`.
#[derive(Args, Debug)]
pub struct RunArgs {
    /// Board number, list, range, or all
    #[arg(value_name = "BOARDS", default_value = "all")]
    pub boards: Boards,
    /// Enable the outputs: things move
    #[arg(long)]
    pub active: bool,
    /// Inputs to begin with, BOARD.NAME=VALUE
    #[arg(long, value_name = "B.NAME=V", value_delimiter = ',')]
    pub ci: Vec<Assignment>,
    /// Parameters to begin with, BOARD.NAME=VALUE
    #[arg(long, value_name = "B.NAME=V", value_delimiter = ',')]
    pub par: Vec<Assignment>,
    /// Parameters and first inputs from a file, YAML; `ucom help params` shows the form
    #[arg(long, value_name = "FILE")]
    pub params: Option<PathBuf>,
    /// Names of the boards, as `ucom init` wrote them
    #[arg(long, env = "UCOM_INVENTORY", value_name = "FILE", default_value = "ucom-inventory.toml")]
    pub inventory: PathBuf,
    /// What to do when a board is lost; default: the profile's on_lost
    #[arg(long, value_enum, value_name = "POLICY")]
    pub on_lost: Option<OnLost>,
    /// Have the boards send the texts of their applications
    #[arg(long)]
    pub debug: bool,
    /// Have the boards send all their texts (global debug)
    #[arg(long)]
    pub global_debug: bool,
    /// End after so many seconds
    #[arg(long = "for", value_name = "S", value_parser = seconds)]
    pub duration: Option<Duration>,
    #[command(flatten)]
    pub cache: CacheArgs,
    #[command(flatten)]
    pub force: ForceArgs,
}

/// Options of `ucom monitor`.
#[derive(Args, Debug)]
pub struct MonitorArgs {
    /// End after so many views, one a second
    #[arg(long, value_name = "N")]
    pub count: Option<u64>,
    /// Send nothing at all, not even PC_INFO
    #[arg(long, env = "UCOM_LISTEN_ONLY", value_parser = on_off)]
    pub listen_only: bool,
}

/// Options of `ucom record`.
#[derive(Args, Debug)]
pub struct RecordArgs {
    /// File to write, .log .fzi .mcap, or - for stdout
    pub file: PathBuf,
    /// End after so many seconds
    #[arg(long = "for", env = "UCOM_FOR", value_name = "S", value_parser = seconds)]
    pub duration: Option<Duration>,
    /// End after so many frames
    #[arg(long, value_name = "N")]
    pub count: Option<u64>,
    /// Write over output files that are there already
    #[arg(long, alias = "force")]
    pub overwrite: bool,
}

/// Options of `ucom replay`.
#[derive(Args, Debug)]
pub struct ReplayArgs {
    /// Recording, .log .fzi .mcap
    pub file: PathBuf,
    /// Send frames too that reset, number, program, start or move boards
    #[arg(long)]
    pub intrusive: bool,
    /// Times the original speed
    #[arg(long, value_name = "X", default_value_t = 1.0)]
    pub speed: f64,
    #[command(flatten)]
    pub force: ForceArgs,
}

/// Options of `ucom send`.
#[derive(Args, Debug)]
pub struct SendArgs {
    /// Frames as candump writes them: ID#DATA, 240#, 1C1#0202, 12345678#11, 123#R
    #[arg(value_name = "FRAME", required = true)]
    pub frames: Vec<String>,
    /// Send frames too that reset, number, program, start or move boards
    #[arg(long)]
    pub intrusive: bool,
}

/// Options of `ucom decode`.
#[derive(Args, Debug)]
pub struct DecodeArgs {
    /// Recording, or - for a candump log or bare frames on stdin
    #[arg(default_value = "-")]
    pub file: PathBuf,
    /// Decode the bus instead
    #[arg(long)]
    pub live: bool,
    /// End after so many frames
    #[arg(long, value_name = "N")]
    pub count: Option<u64>,
}

/// Options of `ucom probe`.
#[derive(Args, Debug)]
pub struct ProbeArgs {
    /// Profile to write; default: stdout
    #[arg(long, env = "UCOM_PROBE_OUT", value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Measure also what shows only while numbers are given: resets and numbers the chain
    #[arg(long)]
    pub init: bool,
    /// Start a control loop, outputs safe, to see which heartbeats count
    #[arg(long)]
    pub alive: bool,
    /// Image that is on a board, to find the checksum of Program IDs
    #[arg(long, env = "UCOM_IMAGE", value_name = "FILE")]
    pub image: Option<PathBuf>,
    #[command(flatten)]
    pub overwrite: OverwriteArgs,
    #[command(flatten)]
    pub force: ForceArgs,
}

/// Options of `ucom conformance`.
#[derive(Args, Debug)]
pub struct ConformanceArgs {
    /// Board number, list, range, or all
    #[arg(value_name = "BOARDS", default_value = "all")]
    pub boards: Boards,
    /// Also tests that reset and number the chain anew, and that set and clear status bits
    #[arg(long)]
    pub init: bool,
    /// Also tests that start applications and control loops; outputs stay safe; more than a minute a board
    #[arg(long)]
    pub run: bool,
    /// Also tests that program the one board that is named with this image
    #[arg(long, value_name = "IMAGE")]
    pub program: Option<PathBuf>,
    /// With --program: the flash number that the board must have; default: as the inventory has it
    #[arg(long, value_name = "ID", value_parser = super::boards::flash_id)]
    pub flash_id: Option<u16>,
    /// Flash numbers of the boards, as `ucom init` wrote them
    #[arg(long, env = "UCOM_INVENTORY", value_name = "FILE", default_value = "ucom-inventory.toml")]
    pub inventory: PathBuf,
    /// Only these tests, as D-T10,D-T11
    #[arg(long, value_name = "TESTS", value_delimiter = ',')]
    pub only: Vec<String>,
    /// Also when another PC is on the bus; boards that run are never tested with --init, --run or --program
    #[arg(long)]
    pub force: bool,
}

/// Options of `ucom dbc`.
#[derive(Args, Debug)]
pub struct DbcArgs {
    /// Board number, list, range, all, or none
    #[arg(value_name = "BOARDS", default_value = "all")]
    pub boards: Boards,
    /// File to write; default: stdout
    #[arg(long, env = "UCOM_DBC_OUT", value_name = "FILE")]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub cache: CacheArgs,
    #[command(flatten)]
    pub overwrite: OverwriteArgs,
    /// Taken from older scripts: there is no check of the bus to overrule
    #[arg(long, hide = true)]
    pub force: bool,
}

/// Options of `ucom explain`.
#[derive(Args, Debug)]
pub struct ExplainArgs {
    /// The word as a screen shows it, or the number of an error; without it: the list
    pub word: Vec<String>,
}
