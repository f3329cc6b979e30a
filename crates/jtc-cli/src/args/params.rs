//! `jtc params`: what a controller is given, and what of it no frame carries.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

use super::LinkArgs;

/// `jtc params …`
#[derive(Debug, Subcommand)]
pub enum ParamsCommand {
    /// Send what the files hold: an arm file (TOML, URDF) or CSV files of friction and gains
    #[command(
        after_help = "Files: an arm as TOML or URDF; FricPolynomialCoeffs.csv (a row a joint); six FricTableJointN.csv;\n\
                            six PidParamJointN.csv. Several may be named; a directory is searched for them. Files of single joints\n\
                            count only when all six are named. Limits, gravity and rotor inertia of an arm file are in no frame:\n\
                            where they differ from the controller's own, nothing is sent unless --accept-device-limits is given.\n\nExamples:\n  \
                            jtc params push my-arm.toml\n  jtc params push arm.urdf FricPolynomialCoeffs.csv PidParamJoint*.csv"
    )]
    Push {
        /// Files or directories
        #[arg(required = true, value_name = "FILE")]
        files: Vec<PathBuf>,
        /// Which friction to send where files hold both
        #[arg(long, value_enum, default_value_t = FrictionKind::Polynomial)]
        friction: FrictionKind,
        #[command(flatten)]
        accept: AcceptArgs,
        #[command(flatten)]
        link: LinkArgs,
    },
    /// Let the controller use its defaults
    #[command(after_help = "Examples:\n  jtc params use-defaults")]
    UseDefaults(LinkArgs),
    /// What a file holds (default: the built-in arm), and what the controller still misses when one is connected
    #[command(after_help = "Examples:\n  jtc params show\n  jtc params show my-arm.urdf")]
    Show {
        /// Files or directories
        #[arg(value_name = "FILE")]
        files: Vec<PathBuf>,
        /// Serial port of a controller to ask what it misses
        #[arg(long, env = "JTC_PORT", value_name = "PATH")]
        port: Option<String>,
        /// Rate of the port, Bd
        #[arg(long, env = "JTC_BAUD", value_name = "N", default_value_t = 115_200)]
        baud: u32,
    },
}

/// Kinds of friction compensation.
#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
pub enum FrictionKind {
    /// Coefficients c0..c5.
    Polynomial,
    /// Torque over speed and temperature.
    Table,
}

/// What of an arm file a controller cannot be given.
#[derive(Args, Clone, Copy, Debug)]
pub struct AcceptArgs {
    /// Go on although the controller uses other limits, gravity or rotor inertia than the arm file gives
    #[arg(long)]
    pub accept_device_limits: bool,
}
