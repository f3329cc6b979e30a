//! `jtc arm`: arm files, and the arm of a controller.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::{AcceptArgs, LinkArgs, OverwriteArgs};

/// `jtc arm …`
#[derive(Debug, Subcommand)]
pub enum ArmCommand {
    /// Make an arm file from a robot description (URDF); what had to be turned or guessed is listed
    #[command(
        after_help = "The arm is six revolute or continuous joints in a chain. Where more joints move (a gripper,\n\
                      a seventh axis, a second arm), --joints or --tip selects the six; the others are\n\
                      held at 0. Rotor inertia, gains, acceleration limit and more are in no URDF: starting\n\
                      values are proposed by rules that are written into the file, and marked there.\n\nExamples:\n  \
                      jtc arm import ur5.urdf -o ur5.toml\n  \
                      jtc arm import z1.urdf --joints joint1,joint2,joint3,joint4,joint5,joint6 -o z1.toml\n  \
                      jtc arm import two-arms.urdf --tip left_tool0 -o left.toml"
    )]
    Import(ImportArgs),
    /// Whether an arm is physical, complete, held by its drives and taken by the controller
    #[command(
        after_help = "Exit code 4: the controller would refuse it. 0: it would not; warnings may be there, among\n\
                      them what is only proposed and poses in which gravity is more than a drive can hold.\n\nExamples:\n  \
                      jtc arm check ur5.toml\n  jtc --json arm check ur5.toml | jq .findings[].what"
    )]
    Check {
        /// Arm file (TOML) or robot description (URDF)
        file: PathBuf,
    },
    /// All numbers of an arm, with unit, range, default and where each comes from; without a file, of the controller's arm
    #[command(after_help = "Examples:\n  jtc arm show ur5.toml\n  jtc arm show ur5.toml --deg\n  \
                            jtc --json arm show ur5.toml | jq '.values[] | select(.from == \"proposed\")'")]
    Show {
        /// Arm file (TOML) or robot description (URDF); without it the controller is asked
        file: Option<PathBuf>,
        /// Angles in degrees
        #[arg(long)]
        deg: bool,
        #[command(flatten)]
        link: LinkArgs,
    },
    /// Give the controller the whole arm: settings, gains, friction, model and name; read it back and compare
    #[command(
        after_help = "Settings change while the controller is in Init or Error only: `jtc disable` takes the torque off.\n\
                      --store keeps the arm over a loss of power; the controller is then in Init, and `jtc params use-defaults` or\n\
                      `jtc recover --defaults` puts the stored arm in use.\n\
                      A controller without extensions takes friction, gains and model only; where its own limits, gravity or\n\
                      rotor inertia differ, nothing is sent unless --accept-device-limits is given.\n\nExamples:\n  \
                      jtc arm push my-arm.toml\n  jtc arm push my-arm.toml --store"
    )]
    Push {
        /// Arm file (TOML) or robot description (URDF)
        file: PathBuf,
        /// Keep it over a loss of power
        #[arg(long)]
        store: bool,
        #[command(flatten)]
        accept: AcceptArgs,
        #[command(flatten)]
        link: LinkArgs,
    },
    /// The controller's arm as a file
    #[command(after_help = "Examples:\n  jtc arm pull -o board.toml")]
    Pull {
        /// Arm file to write
        #[arg(short, long, env = "JTC_PULL_OUT", value_name = "FILE")]
        out: PathBuf,
        #[command(flatten)]
        overwrite: OverwriteArgs,
        #[command(flatten)]
        link: LinkArgs,
    },
    /// What of an arm file differs from the controller's arm; exit code 4 if anything does
    #[command(
        after_help = "Examples:\n  jtc arm diff my-arm.toml\n  jtc --json arm diff my-arm.toml | jq .differences"
    )]
    Diff {
        /// Arm file (TOML) or robot description (URDF)
        file: PathBuf,
        #[command(flatten)]
        link: LinkArgs,
    },
}

/// Options of `jtc arm import`.
#[derive(Args, Debug)]
pub struct ImportArgs {
    /// Robot description
    #[arg(value_name = "URDF")]
    pub urdf: PathBuf,
    /// Arm file to write
    #[arg(short, long, env = "JTC_IMPORT_OUT", value_name = "FILE")]
    pub out: PathBuf,
    /// The six joints that move, base to wrist
    #[arg(long, value_name = "A,B,C,D,E,F", value_delimiter = ',')]
    pub joints: Option<Vec<String>>,
    /// The link that is the flange
    #[arg(long, value_name = "LINK")]
    pub tip: Option<String>,
    #[command(flatten)]
    pub overwrite: OverwriteArgs,
}
