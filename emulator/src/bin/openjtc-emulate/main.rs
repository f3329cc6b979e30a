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

/// Emulate the controller board with simulated drives and arm.
///
/// The program boots the firmware of the controller board in an emulator. The drives and the arm on the joint bus are
/// simulated. A pseudo-terminal is connected to one serial port of the board: `JTC_PORT=PATH jtc status` and all other
/// commands of `jtc` work with this pseudo-terminal.
#[derive(Parser)]
#[command(version)]
struct Args {
    /// Firmware of the board, an ELF file.
    ///
    /// `cargo build --release` in firmware/ builds this file
    elf: PathBuf,
    /// Make this path a symbolic link to the pseudo-terminal.
    ///
    /// By default, the program prints the name of the pseudo-terminal
    #[arg(long, value_name = "PATH")]
    serial: Option<PathBuf>,
    /// Use this serial port of the board, 2 or 3 (ST-LINK).
    ///
    /// USART3 is the serial port that the ST-LINK of the board connects to USB
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u8).range(2..=3))]
    usart: u8,
    /// Set the bit rate of the host, bit/s.
    ///
    /// By default, the host always has the same bit rate as the firmware
    #[arg(long, value_name = "BD")]
    baud: Option<u32>,
    /// Set the speed of virtual time.
    ///
    /// `realtime` follows the clock of this computer, and `max` runs as fast as this computer can
    #[arg(long, value_name = "SPEED", default_value = "realtime")]
    speed: SpeedArg,
    /// Set the seed of random numbers.
    ///
    /// The seed determines the deviations of the simulated arm, and the contents of the RAM at power-up
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Simulate the arm of this file (default: the built-in arm)
    #[arg(long, value_name = "FILE")]
    arm: Option<PathBuf>,
    /// Keep bank 2 of the flash in this file.
    ///
    /// Bank 2 contains the stored arm. If the file exists, the program reads it at the start. At the end, the program writes
    /// the contents of bank 2 to the file, as after a power failure at that time
    #[arg(long, value_name = "FILE")]
    bank2: Option<PathBuf>,
    /// Print the defmt log of the firmware to stderr.
    ///
    /// This option needs the program `defmt-print`
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
        config.sim = SimConfig::new(arm.config(), &arm.parameters()).with_drive_torques(arm.drive_torque_max);
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
