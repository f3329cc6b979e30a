//! The emulated controller board behind a pseudo-terminal, with simulated drives on its joint bus.
#![forbid(unsafe_code)]

#[path = "../../../../crates/jtc-cli/src/serve/frames.rs"]
#[allow(dead_code)] // the simulator's use of it is wider
mod frames;
mod live;
mod log;
#[path = "../../../../crates/jtc-cli/src/serve/pty.rs"]
#[allow(dead_code)]
mod pty;

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::{Parser, ValueEnum};
use openjtc_emulator::{Board, BoardConfig, Elf, Port};

use live::{Live, Speed};
use log::DefmtLog;
use pty::Pty;

/// Boots the firmware of the controller board in an emulator, with simulated drives and arm on the joint bus and one of its
/// serial ports on a pseudo-terminal: `JTC_PORT=PATH jtc status` and all other commands work with it.
#[derive(Parser)]
#[command(version)]
struct Args {
    /// The firmware, as `cargo build --release` in firmware/ makes it.
    elf: PathBuf,
    /// Symbolic link that names the pseudo-terminal; without it the name of the terminal itself is printed.
    #[arg(long, value_name = "PATH")]
    serial: Option<PathBuf>,
    /// Serial port of the board: 2 or 3 (that of the ST-LINK).
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u8).range(2..=3))]
    usart: u8,
    /// Rate of the host's side of the line, bit/s; without it always that of the firmware.
    #[arg(long, value_name = "BD")]
    baud: Option<u32>,
    /// Virtual time follows the clock, or runs as fast as it can.
    #[arg(long, value_name = "SPEED", default_value = "realtime")]
    speed: SpeedArg,
    /// Seed of the arm's deviations and of what RAM holds at first.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Print the firmware's defmt log on stderr; needs the program defmt-print.
    #[arg(long)]
    defmt: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum SpeedArg {
    Realtime,
    Max,
}

fn main() -> ExitCode {
    match run(&Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("openjtc-emulate: {e}");
            ExitCode::FAILURE
        }
    }
}

fn run(args: &Args) -> Result<(), Box<dyn std::error::Error>> {
    let bytes = std::fs::read(&args.elf).map_err(|e| {
        format!("{}: {e}; build it with `cargo build --release` in firmware/", args.elf.display())
    })?;
    let elf = Elf::parse(&bytes).map_err(|e| format!("{}: {e}", args.elf.display()))?;
    let log = if args.defmt { Some(DefmtLog::new(&args.elf)?) } else { None };
    let mut config = BoardConfig { seed: args.seed, ..BoardConfig::default() };
    config.sim.seed = args.seed;
    let board = Board::new(elf, &config);
    let port = if args.usart == 2 { Port::Usart2 } else { Port::Usart3 };
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        signal_hook::flag::register_conditional_shutdown(signal, 130, Arc::clone(&stop))?;
        signal_hook::flag::register(signal, Arc::clone(&stop))?;
    }
    let terminal = Pty::open(args.serial.as_deref())?;
    let speed = match args.speed {
        SpeedArg::Realtime => Speed::Realtime,
        SpeedArg::Max => Speed::Max,
    };
    Live::new(board, port, args.baud, terminal, speed, log).run(&stop)
}
