//! `jtc demo` and `jtc sim`: the simulator.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use cli_kit::variables::on_off;

use super::OverwriteArgs;

/// How fast virtual time runs.
#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
pub enum SimSpeed {
    /// As a real arm.
    Realtime,
    /// As fast as this computer can.
    Max,
}

/// Options of `jtc demo`.
#[derive(Args, Debug)]
pub struct DemoArgs {
    /// Directory for recording, report and picture
    #[arg(long, env = "JTC_DEMO_DIR", value_name = "DIR", default_value = "demo")]
    pub out: PathBuf,
    #[command(flatten)]
    pub overwrite: OverwriteArgs,
    /// How fast virtual time runs
    #[arg(long, env = "JTC_SPEED", value_enum, default_value_t = SimSpeed::Max)]
    pub speed: SimSpeed,
}

/// Options of `jtc sim`.
#[derive(Args, Debug)]
pub struct SimArgs {
    /// Path that becomes a symbolic link to the pseudo-terminal; default: its own name is printed
    #[arg(long, env = "JTC_SERIAL", value_name = "PATH")]
    pub serial: Option<PathBuf>,
    /// Arm to simulate, TOML or URDF, which the controller has stored where the file is complete; default: the built-in one
    #[arg(long, env = "JTC_ARM", value_name = "FILE")]
    pub arm: Option<PathBuf>,
    /// What the simulated arm carries at its flange, and the controller is not given: kg, or kg and its place in the flange frame in m
    #[arg(long, env = "JTC_SIM_PAYLOAD", value_name = "KG[,X,Y,Z]", value_parser = super::payload::carried)]
    pub payload: Option<jtc_core::Payload>,
    /// File that keeps a stored arm, as the flash of a board does: read at the start, written by `jtc arm push --store`
    #[arg(long, env = "JTC_STORE_FILE", value_name = "FILE")]
    pub store: Option<PathBuf>,
    /// Rate of the simulated line, Bd: it is as slow as a real one
    #[arg(long, env = "JTC_BAUD", value_name = "N", default_value_t = 115_200,
          value_parser = clap::value_parser!(u32).range(300..=15_000_000))]
    pub baud: u32,
    /// Bytes take no time on the line
    #[arg(long, env = "JTC_NO_THROTTLE", value_parser = on_off)]
    pub no_throttle: bool,
    /// How fast virtual time runs
    #[arg(long, env = "JTC_SPEED", value_enum, default_value_t = SimSpeed::Realtime)]
    pub speed: SimSpeed,
    /// Seed of all that is drawn by chance: the same seed gives the same bytes
    #[arg(long, env = "JTC_SEED", value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Faults to inject, TOML; `jtc explain faults` shows the form
    #[arg(long, env = "JTC_FAULTS", value_name = "FILE")]
    pub faults: Option<PathBuf>,
    /// Put the joint bus on a CAN URL too, as multicast:239.74.163.2:43113
    #[arg(long, env = "JTC_BUS", value_name = "URL")]
    pub bus: Option<String>,
    /// Record every millisecond from power-up on, .mcap or .csv: commanded and measured positions, velocities, torques, states
    #[arg(long, env = "JTC_SIM_RECORD", value_name = "FILE")]
    pub record: Option<PathBuf>,
    #[command(flatten)]
    pub overwrite: OverwriteArgs,
}
