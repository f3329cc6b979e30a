//! The emulated controller board with a pseudo-terminal as its serial port, and with simulated drives on its joint bus.
#![forbid(unsafe_code)]

#[path = "../../../../crates/jtc-cli/src/serve/frames.rs"]
#[allow(dead_code)] // the simulator uses more items of this module
mod frames;
mod live;
mod log;
#[path = "../../../../crates/jtc-cli/src/serve/pty.rs"]
#[allow(dead_code)]
mod pty;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::{Parser, ValueEnum};
use jtc_host::arm::Arm;
use jtc_sim::SimConfig;
use openjtc_emulator::flash::{BANK2, BANK2_SIZE, Bank2};
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
    /// The arm that is on the bus, as an arm file; without it the default one.
    #[arg(long, value_name = "FILE")]
    arm: Option<PathBuf>,
    /// File that bank 2 of the flash is kept in, where the stored arm is: read at the start when it is there, written at the
    /// end, as if the power had gone then.
    #[arg(long, value_name = "FILE")]
    bank2: Option<PathBuf>,
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
    if let Some(path) = &args.arm {
        let arm = Arm::load(path)?;
        config.sim = SimConfig::new(arm.config(), &arm.parameters());
    }
    config.sim.seed = args.seed;
    if let Some(path) = &args.bank2 {
        config.bank2 = kept(path)?;
    }
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
    let mut live = Live::new(board, port, args.baud, terminal, speed, log);
    live.run(&stop)?;
    if let Some(path) = &args.bank2 {
        let bank = live.cut_power(args.seed);
        std::fs::write(path, bank.bytes(BANK2, BANK2_SIZE as usize)).map_err(|e| named(path, &e))?;
    }
    Ok(())
}

/// Returns the contents of bank 2 from the file of an earlier session, or an empty bank if the file does not exist.
fn kept(path: &Path) -> Result<Bank2, String> {
    match std::fs::read(path) {
        Ok(bytes) if bytes.len() == BANK2_SIZE as usize => Ok(Bank2::from_bytes(&bytes)),
        Ok(bytes) => Err(format!("{}: {} bytes, bank 2 has {BANK2_SIZE}", path.display(), bytes.len())),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(Bank2::default()),
        Err(e) => Err(named(path, &e)),
    }
}

fn named(path: &Path, error: &std::io::Error) -> String {
    format!("{}: {error}", path.display())
}
