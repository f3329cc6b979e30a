//! `jtc monitor`, `clear`, `reset`, `gripper`, `recover`, `jog`: options to monitor and recover a controller.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::{AcceptArgs, LinkArgs};

/// Options of `jtc monitor`.
#[derive(Args, Debug)]
pub(crate) struct MonitorArgs {
    #[command(flatten)]
    pub link: LinkArgs,
    /// End after this number of status messages
    #[arg(long, value_name = "N")]
    pub count: Option<u64>,
}

/// Options of `jtc clear`.
#[derive(Args, Debug)]
pub(crate) struct ClearArgs {
    #[command(flatten)]
    pub link: LinkArgs,
    /// Also clear the flags of earlier errors
    #[arg(long)]
    pub occurred: bool,
}

/// Options of `jtc reset`.
#[derive(Args, Debug)]
pub(crate) struct ResetArgs {
    /// Reset these joints, counted from 1, for example 2 or 1,3
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = clap::value_parser!(u8).range(1..=6))]
    pub joints: Vec<u8>,
    /// Reset the gripper
    #[arg(long)]
    pub gripper: bool,
    /// Reset all joints and the gripper
    #[arg(long)]
    pub all: bool,
    /// Do not ask (the arm can lose torque)
    #[arg(long)]
    pub yes: bool,
    /// Old bit mask (refused; the error names the replacement)
    #[arg(hide = true, value_name = "MASK")]
    pub mask: Option<String>,
    #[command(flatten)]
    pub link: LinkArgs,
}

/// Options of `jtc gripper`.
#[derive(Args, Debug)]
pub(crate) struct GripperArgs {
    /// State of the pump
    pub pump: Switch,
    #[command(flatten)]
    pub link: LinkArgs,
}

/// On or off.
#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
pub(crate) enum Switch {
    /// Switch the pump on.
    On,
    /// Switch the pump off.
    Off,
}

/// Options of `jtc recover`.
#[derive(Args, Debug)]
pub(crate) struct RecoverArgs {
    #[command(flatten)]
    pub link: LinkArgs,
    /// Send friction, gains and arm model of this arm file
    #[arg(long, value_name = "FILE")]
    pub arm: Option<PathBuf>,
    /// Use the controller's defaults if parameters are missing
    #[arg(long)]
    pub defaults: bool,
    #[command(flatten)]
    pub accept: AcceptArgs,
}

/// Options of `jtc jog`.
#[derive(Args, Debug)]
pub(crate) struct JogArgs {
    /// Joint, counted from 1 (1 to 6).
    ///
    /// Without a joint, jog with the keys of the terminal
    #[arg(value_name = "JOINT", value_parser = clap::value_parser!(u8).range(1..=6), requires = "rate")]
    pub joint: Option<u8>,
    /// Velocity, rad/s (negative: opposite direction)
    #[arg(value_name = "RATE", allow_negative_numbers = true)]
    pub rate: Option<f64>,
    /// Read the rate as degrees per second
    #[arg(long)]
    pub deg: bool,
    /// End after this time, s
    #[arg(long, value_name = "S")]
    pub duration: Option<f64>,
    #[command(flatten)]
    pub link: LinkArgs,
}
