//! Options of each `ucom` command.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use cli_kit::variables::on_off;

use super::boards::{Assignment, Boards, bits, flash_id, one_board, raw_status, seconds};
use super::{ForceArgs, OverwriteArgs, ValueEnum};

/// Options of `ucom sim`.
#[derive(Args, Debug)]
pub(crate) struct SimArgs {
    /// Simulate this number of boards (0 to 31).
    ///
    /// Default: all boards of the chain file
    #[arg(long, env = "UCOM_BOARDS", value_name = "N", value_parser = clap::value_parser!(u8).range(0..=31))]
    pub boards: Option<u8>,
    /// Set the flash numbers, first board first, such as 0x21,0x42
    #[arg(long, env = "UCOM_FLASH_IDS", value_name = "LIST", value_delimiter = ',', value_parser = flash_id)]
    pub flash_ids: Vec<u16>,
    /// Listen at this address for socketcand clients.
    ///
    /// With port 0, the simulator selects a free port
    #[arg(long, env = "UCOM_LISTEN", value_name = "HOST:PORT", default_value = "127.0.0.1:29536")]
    pub listen: String,
    /// Simulate the boards of this TOML file.
    ///
    /// Default: a built-in head
    #[arg(long, env = "UCOM_CHAIN", value_name = "FILE")]
    pub chain: Option<PathBuf>,
    /// Inject the faults of this TOML file.
    ///
    /// `ucom help faults` shows the format
    #[arg(long, env = "UCOM_FAULTS", value_name = "FILE")]
    pub faults: Option<PathBuf>,
    /// Set the seed of random numbers
    #[arg(long, env = "UCOM_SEED", value_name = "N", default_value_t = 1)]
    pub seed: u64,
}

/// Options of `ucom init`.
#[derive(Args, Debug)]
pub(crate) struct InitArgs {
    /// Compare the boards with this inventory, and write it
    #[arg(long, env = "UCOM_INVENTORY", value_name = "FILE", default_value = "ucom-inventory.toml")]
    pub inventory: PathBuf,
    /// Write a new inventory without comparing it to the old one.
    ///
    /// Boards with the same flash number keep their names and their records of updates
    #[arg(long)]
    pub renew: bool,
    #[command(flatten)]
    pub force: ForceArgs,
}

/// Option that selects the boards.
#[derive(Args, Debug)]
pub(crate) struct BoardsArgs {
    /// Board number, list, range, or all
    #[arg(value_name = "BOARDS", default_value = "all")]
    pub boards: Boards,
}

/// Options of `ucom status`.
#[derive(Args, Debug)]
pub(crate) struct StatusArgs {
    /// Board number, list, range, or all
    #[arg(value_name = "BOARDS", default_value = "all")]
    pub boards: Boards,
    /// Set these bits, for example ASTART,OPINIT
    #[arg(long, value_name = "BITS", value_parser = bits)]
    pub set: Option<ucom::Status>,
    /// Clear these bits
    #[arg(long, value_name = "BITS", value_parser = bits)]
    pub clear: Option<ucom::Status>,
    /// Send one PC_SETSTATUS frame unchanged.
    ///
    /// Mask and value are hexadecimal bytes. The command also sends the bits of the value that are outside the mask
    #[arg(long, value_name = "MASK:VALUE", value_parser = raw_status, conflicts_with_all = ["set", "clear"])]
    pub raw: Option<(u8, u8)>,
    #[command(flatten)]
    pub force: ForceArgs,
}

/// Options of `ucom reset`.
#[derive(Args, Debug)]
pub(crate) struct ResetArgs {
    /// Board number, list, range, or all
    #[arg(value_name = "BOARDS", default_value = "all")]
    pub boards: Boards,
    #[command(flatten)]
    pub force: ForceArgs,
}

/// Options of commands that act on boards.
#[derive(Args, Debug)]
pub(crate) struct ActArgs {
    /// Board number, list, range, or all
    #[arg(value_name = "BOARDS")]
    pub boards: Boards,
    #[command(flatten)]
    pub force: ForceArgs,
}

/// Options of `ucom stop`.
#[derive(Args, Debug)]
pub(crate) struct StopArgs {
    /// Board number, list, range, or all
    #[arg(value_name = "BOARDS")]
    pub boards: Boards,
    /// Stop only the control loop, not the application
    #[arg(long)]
    pub control_only: bool,
}

/// Options of `ucom io`.
#[derive(Args, Debug)]
pub(crate) struct IoArgs {
    /// Board number, list, range, or all
    #[arg(value_name = "BOARDS", default_value = "all")]
    pub boards: Boards,
    /// Write a template of a signal table to this TOML file.
    ///
    /// The template contains the names of all signals. With -, the command writes to stdout
    #[arg(long, env = "UCOM_TEMPLATE", value_name = "FILE")]
    pub template: Option<PathBuf>,
    #[command(flatten)]
    pub cache: CacheArgs,
    #[command(flatten)]
    pub overwrite: OverwriteArgs,
    /// Accepted for older scripts, without effect
    #[arg(long, hide = true)]
    pub force: bool,
}

/// Options of the cache of descriptions.
#[derive(Args, Clone, Debug)]
pub(crate) struct CacheArgs {
    /// Read descriptions from the boards, not from the cache
    #[arg(long, env = "UCOM_FRESH", value_parser = on_off)]
    pub fresh: bool,
    /// Use this directory for the cache of descriptions.
    ///
    /// Default: the directory ucom in the user's cache directory
    #[arg(long, env = "UCOM_CACHE", value_name = "DIR")]
    pub cache: Option<PathBuf>,
}

/// Options of `ucom ci`.
#[derive(Args, Debug)]
pub(crate) struct CiArgs {
    /// Board number
    #[arg(value_name = "BOARD", value_parser = one_board)]
    pub board: u8,
    /// Name or index of the signal, and its value.
    ///
    /// `ucom io` shows the names. You can use upper or lower case. You can omit a unit in brackets at the end of a name
    #[arg(value_name = "NAME=VALUE")]
    pub values: Vec<Assignment>,
    /// Run the board under supervision for this time, s.
    ///
    /// The command enables the outputs, and the motors move
    #[arg(long = "for", value_name = "S", value_parser = seconds)]
    pub duration: Option<Duration>,
    #[command(flatten)]
    pub cache: CacheArgs,
    #[command(flatten)]
    pub force: ForceArgs,
}

/// Options of `ucom par`.
#[derive(Args, Debug)]
pub(crate) struct ParArgs {
    /// Board number, list, range, or all.
    ///
    /// With --apply, all means all boards of the file. Numbers select some of these boards
    #[arg(value_name = "BOARDS", default_value = "all")]
    pub boards: Boards,
    /// Name or index of the signal, and its value.
    ///
    /// `ucom io` shows the names. You can use upper or lower case. You can omit a unit in brackets at the end of a name
    #[arg(value_name = "NAME=VALUE", conflicts_with = "apply")]
    pub values: Vec<Assignment>,
    /// Write a parameter file, YAML (- for stdout).
    ///
    /// The file contains the values that this tool wrote last. All other names are in the file as comments
    #[arg(long, env = "UCOM_SAVE", value_name = "FILE", conflicts_with = "apply")]
    pub save: Option<PathBuf>,
    /// Write the parameters of this file to the boards.
    ///
    /// The command first checks the file against the boards
    #[arg(long, value_name = "FILE")]
    pub apply: Option<PathBuf>,
    /// With --apply, only check the file, and write nothing
    #[arg(long, env = "UCOM_DRY_RUN", value_parser = on_off)]
    pub dry_run: bool,
    /// Read the names of the boards from this inventory file
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
pub(crate) struct SoArgs {
    /// Board number, list, range, or all
    #[arg(value_name = "BOARDS", default_value = "all")]
    pub boards: Boards,
    /// End after this number of snapshots
    #[arg(long, value_name = "N")]
    pub count: Option<u64>,
    /// Print CSV: time_s, board, then one column per output
    #[arg(long, env = "UCOM_CSV", value_parser = on_off)]
    pub csv: bool,
    #[command(flatten)]
    pub cache: CacheArgs,
}

/// Action when the heartbeats of a board stop.
#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
pub(crate) enum OnLost {
    /// Only report the lost board.
    Report,
    /// Stop control of the lost board.
    StopBoard,
    /// Stop control of all boards.
    StopAll,
}

/// Options of `ucom run`.
#[derive(Args, Debug)]
pub(crate) struct RunArgs {
    /// Board number, list, range, or all
    #[arg(value_name = "BOARDS", default_value = "all")]
    pub boards: Boards,
    /// Enable the outputs (motors move)
    #[arg(long)]
    pub active: bool,
    /// Set initial inputs in the form BOARD.NAME=VALUE
    #[arg(long, value_name = "B.NAME=V", value_delimiter = ',')]
    pub ci: Vec<Assignment>,
    /// Set parameters before the start, BOARD.NAME=VALUE
    #[arg(long, value_name = "B.NAME=V", value_delimiter = ',')]
    pub par: Vec<Assignment>,
    /// Read parameters and initial inputs from this YAML file.
    ///
    /// `ucom help params` shows the format
    #[arg(long, value_name = "FILE")]
    pub params: Option<PathBuf>,
    /// Read the names of the boards from this inventory file
    #[arg(long, env = "UCOM_INVENTORY", value_name = "FILE", default_value = "ucom-inventory.toml")]
    pub inventory: PathBuf,
    /// Set the action if the heartbeats of a board stop.
    ///
    /// Default: the key `on_lost` of the profile
    #[arg(long, value_enum, value_name = "POLICY")]
    pub on_lost: Option<OnLost>,
    /// Make the boards send debug texts of their applications
    #[arg(long)]
    pub debug: bool,
    /// Make the boards send all debug texts (global debug)
    #[arg(long)]
    pub global_debug: bool,
    /// End after this time, s
    #[arg(long = "for", value_name = "S", value_parser = seconds)]
    pub duration: Option<Duration>,
    #[command(flatten)]
    pub cache: CacheArgs,
    #[command(flatten)]
    pub force: ForceArgs,
}

/// Options of `ucom monitor`.
#[derive(Args, Debug)]
pub(crate) struct MonitorArgs {
    /// End after this number of views, one per second
    #[arg(long, value_name = "N")]
    pub count: Option<u64>,
    /// Only listen: do not send any frame, not even PC_INFO
    #[arg(long, env = "UCOM_LISTEN_ONLY", value_parser = on_off)]
    pub listen_only: bool,
}

/// Options of `ucom record`.
#[derive(Args, Debug)]
pub(crate) struct RecordArgs {
    /// File to write: .log, .fzi, .mcap, or - for stdout
    pub file: PathBuf,
    /// End after this time, s
    #[arg(long = "for", env = "UCOM_FOR", value_name = "S", value_parser = seconds)]
    pub duration: Option<Duration>,
    /// End after this number of frames
    #[arg(long, value_name = "N")]
    pub count: Option<u64>,
    /// Overwrite existing output files
    #[arg(long, alias = "force")]
    pub overwrite: bool,
}

/// Options of `ucom replay`.
#[derive(Args, Debug)]
pub(crate) struct ReplayArgs {
    /// Recording: .log, .fzi or .mcap
    pub file: PathBuf,
    /// Also send frames that change boards or keep them running.
    ///
    /// For example, these frames reset, number, program, start or move boards
    #[arg(long)]
    pub intrusive: bool,
    /// Set the speed as a factor of the original speed
    #[arg(long, value_name = "X", default_value_t = 1.0)]
    pub speed: f64,
    /// Send only the frames of this CAN interface of the recording
    #[arg(long, value_name = "NAME")]
    pub interface: Option<String>,
    #[arg(long, hide = true)]
    pub force: bool,
}

/// Options of `ucom send`.
#[derive(Args, Debug)]
pub(crate) struct SendArgs {
    /// Frames in the format of candump: ID#DATA.
    ///
    /// Examples are 240#, 1C1#0202, 12345678#11 and 123#R
    #[arg(value_name = "FRAME", required = true)]
    pub frames: Vec<String>,
    /// Also send frames that change boards or keep them running.
    ///
    /// For example, these frames reset, number, program, start or move boards
    #[arg(long)]
    pub intrusive: bool,
}

/// Options of `ucom decode`.
#[derive(Args, Debug)]
pub(crate) struct DecodeArgs {
    /// Recording, or - for stdin.
    ///
    /// On stdin, the command reads a candump log, or only frames such as 141#2100
    #[arg(default_value = "-")]
    pub file: PathBuf,
    /// Decode the live bus instead
    #[arg(long)]
    pub live: bool,
    /// End after this number of frames
    #[arg(long, value_name = "N")]
    pub count: Option<u64>,
    /// Decode only the frames of this CAN interface of the recording
    #[arg(long, value_name = "NAME", conflicts_with = "live")]
    pub interface: Option<String>,
}

/// Options of `ucom probe`.
#[derive(Args, Debug)]
pub(crate) struct ProbeArgs {
    /// Write the profile to this file (default: stdout)
    #[arg(long, env = "UCOM_PROBE_OUT", value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Reset and number the chain to measure more properties.
    ///
    /// The command can measure some properties only while it numbers the boards
    #[arg(long)]
    pub init: bool,
    /// Start a control loop to test heartbeats.
    ///
    /// The command measures which heartbeats of the PC keep a board running. The outputs stay safe
    #[arg(long)]
    pub alive: bool,
    /// Find the checksum algorithm of Program IDs with this image.
    ///
    /// A board must have this image in its flash
    #[arg(long, env = "UCOM_IMAGE", value_name = "FILE")]
    pub image: Option<PathBuf>,
    #[command(flatten)]
    pub overwrite: OverwriteArgs,
    #[command(flatten)]
    pub force: ForceArgs,
}

/// Options of `ucom conformance`.
#[derive(Args, Debug)]
pub(crate) struct ConformanceArgs {
    /// Board number, list, range, or all
    #[arg(value_name = "BOARDS", default_value = "all")]
    pub boards: Boards,
    /// Add tests that reset and number the chain.
    ///
    /// These tests also set and clear status bits. This option needs all boards
    #[arg(long)]
    pub init: bool,
    /// Add tests that start applications and control loops.
    ///
    /// The outputs stay safe. The tests take about 80 s per board
    #[arg(long)]
    pub run: bool,
    /// Add tests that program the named board with this image.
    ///
    /// You must name exactly one board
    #[arg(long, value_name = "IMAGE")]
    pub program: Option<PathBuf>,
    /// Require this flash number of the board, with --program.
    ///
    /// Default: the flash number in the inventory
    #[arg(long, value_name = "ID", value_parser = super::boards::flash_id)]
    pub flash_id: Option<u16>,
    /// Read the flash numbers from this inventory file.
    ///
    /// `ucom init` writes this file
    #[arg(long, env = "UCOM_INVENTORY", value_name = "FILE", default_value = "ucom-inventory.toml")]
    pub inventory: PathBuf,
    /// Run only these tests, for example D-T10,D-T11
    #[arg(long, value_name = "TESTS", value_delimiter = ',')]
    pub only: Vec<String>,
    /// Test even if another PC controls the bus.
    ///
    /// With --init, --run or --program, the command refuses to test running boards, even with --force
    #[arg(long)]
    pub force: bool,
}

/// Options of `ucom dbc`.
#[derive(Args, Debug)]
pub(crate) struct DbcArgs {
    /// Board number, list, range, all, or none
    #[arg(value_name = "BOARDS", default_value = "all")]
    pub boards: Boards,
    /// Write this file (default: stdout)
    #[arg(long, env = "UCOM_DBC_OUT", value_name = "FILE")]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub cache: CacheArgs,
    #[command(flatten)]
    pub overwrite: OverwriteArgs,
    /// Accepted for older scripts, without effect
    #[arg(long, hide = true)]
    pub force: bool,
}

/// Options of `ucom explain`.
#[derive(Args, Debug)]
pub(crate) struct ExplainArgs {
    /// Word as shown on the screen, or the number of an error.
    ///
    /// Without a word, the command lists all words
    pub word: Vec<String>,
}
