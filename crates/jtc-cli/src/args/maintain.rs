//! `jtc monitor`, `clear`, `reset`, `gripper`, `recover`, `jog`: looking at a controller and leading it back.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::{AcceptArgs, LinkArgs};

/// Options of `jtc monitor`.
#[derive(Args, Debug)]
pub struct MonitorArgs {
    #[command(flatten)]
    pub link: LinkArgs,
    /// End after so many statuses
    #[arg(long, value_name = "N")]
    pub count: Option<u64>,
}

/// Options of `jtc clear`.
#[derive(Args, Debug)]
pub struct ClearArgs {
    #[command(flatten)]
    pub link: LinkArgs,
    /// Clear the memory of errors that occurred, too
    #[arg(long)]
    pub occurred: bool,
}

/// Options of `jtc reset`.
#[derive(Args, Debug)]
pub struct ResetArgs {
    /// Joints, counted from 1: 2, or 1,3
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = clap::value_parser!(u8).range(1..=6))]
    pub joints: Vec<u8>,
    /// The gripper
    #[arg(long)]
    pub gripper: bool,
    /// All joints and the gripper
    #[arg(long)]
    pub all: bool,
    /// Do not ask: the arm may lose torque
    #[arg(long)]
    pub yes: bool,
    /// A bit mask, as older versions took it: refused, with what to type instead
    #[arg(hide = true, value_name = "MASK")]
    pub mask: Option<String>,
    #[command(flatten)]
    pub link: LinkArgs,
}

/// Options of `jtc gripper`.
#[derive(Args, Debug)]
pub struct GripperArgs {
    /// The pump
    pub pump: Switch,
    #[command(flatten)]
    pub link: LinkArgs,
}

/// On or off.
#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
pub enum Switch {
    /// On.
    On,
    /// Off.
    Off,
}

/// Options of `jtc recover`.
#[derive(Args, Debug)]
pub struct RecoverArgs {
    #[command(flatten)]
    pub link: LinkArgs,
    /// Arm file whose friction, gains and arm model the controller is given, all three
    #[arg(long, value_name = "FILE")]
    pub arm: Option<PathBuf>,
    /// Give the controller's own defaults, those of its built-in arm, when it misses parameters
    #[arg(long)]
    pub defaults: bool,
    #[command(flatten)]
    pub accept: AcceptArgs,
}

/// Options of `jtc jog`.
#[derive(Args, Debug)]
pub struct JogArgs {
    /// Joint, counted from 1; without it the keys of the terminal jog
    #[arg(value_name = "JOINT", value_parser = clap::value_parser!(u8).range(1..=6), requires = "rate")]
    pub joint: Option<u8>,
    /// Velocity, rad/s
    #[arg(value_name = "RATE", allow_negative_numbers = true)]
    pub rate: Option<f64>,
    /// The rate is in degrees a second
    #[arg(long)]
    pub deg: bool,
    /// End after so many seconds
    #[arg(long, value_name = "S")]
    pub duration: Option<f64>,
    #[command(flatten)]
    pub link: LinkArgs,
}
