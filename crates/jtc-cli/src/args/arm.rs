//! `jtc arm`: options of the commands for arm files, and for the arm of a controller.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::{AcceptArgs, LinkArgs, OverwriteArgs};

/// `jtc arm …`
#[derive(Debug, Subcommand)]
pub(crate) enum ArmCommand {
    /// Make an arm file from a robot description (URDF)
    #[command(after_help = "The command lists all frames that it has rotated, and all values that it has \
        guessed.\n\n\
            The arm must be a chain of six revolute or continuous joints. If the robot has more movable \
            joints (a gripper, a seventh axis, a second arm), select the six joints with --joints or --tip. \
            The other joints stay at position 0.\n\n\
            A URDF does not contain rotor inertia, gains, acceleration limits and other parameters. The \
            command uses rules to compute starting values for these parameters. The arm file contains these \
            rules, and marks the starting values as proposed.\n\n\
            Examples:\n  \
            jtc arm import ur5.urdf -o ur5.toml\n  \
            jtc arm import z1.urdf --joints joint1,joint2,joint3,joint4,joint5,joint6 -o z1.toml\n  \
            jtc arm import two-arms.urdf --tip left_tool0 -o left.toml")]
    Import(ImportArgs),
    /// Check that an arm is physically possible and complete
    #[command(
        after_help = "The command also checks that the drives can hold the arm and that the controller \
            accepts it.\n\n\
            Exit code 0 means that the controller would accept the arm. Exit code 4 means that the \
            controller would refuse it. With exit code 0, the command can still show warnings. Examples of \
            warnings are proposed values, and poses in which a drive cannot hold the arm against \
            gravity.\n\n\
            Examples:\n  \
            jtc arm check ur5.toml\n  \
            jtc --json arm check ur5.toml | jq .findings[].what"
    )]
    Check {
        /// Arm file (TOML) or robot description (URDF)
        file: PathBuf,
    },
    /// Show all parameters of an arm, with unit, range and source
    #[command(
        after_help = "The command shows each value with its unit, range, default and source. Without a file, \
            the command shows the values of the controller's arm.\n\n\
        Examples:\n  \
        jtc arm show ur5.toml\n  \
        jtc arm show ur5.toml --deg\n  \
        jtc --json arm show ur5.toml | jq '.values[] | select(.from == \"proposed\")'"
    )]
    Show {
        /// Arm file (TOML) or robot description (URDF).
        ///
        /// Without a file, the command asks the controller for its arm
        file: Option<PathBuf>,
        /// Show angles in degrees
        #[arg(long)]
        deg: bool,
        #[command(flatten)]
        link: LinkArgs,
    },
    /// Send a complete arm to the controller, and verify it
    #[command(after_help = "The command sends settings, gains, friction, model and name, reads them back, \
            and compares them with the file.\n\n\
            The controller accepts new settings only in Init or Error. Switch off the torque first with `jtc \
            disable`.\n\n\
            With --store, the controller keeps the arm after a loss of power. After the controller has \
            stored the arm, the controller is in Init. Run `jtc params use-defaults` or `jtc recover \
            --defaults` to use the stored arm.\n\n\
            A controller without extensions accepts only friction, gains and model. If the limits, gravity \
            or rotor inertia of such a controller differ from the file, the command sends nothing unless you \
            use --accept-device-limits.\n\n\
            Examples:\n  \
            jtc arm push my-arm.toml\n  \
            jtc arm push my-arm.toml --store")]
    Push {
        /// Arm file (TOML) or robot description (URDF)
        file: PathBuf,
        /// Store the arm in non-volatile memory
        #[arg(long)]
        store: bool,
        #[command(flatten)]
        accept: AcceptArgs,
        #[command(flatten)]
        link: LinkArgs,
    },
    /// Write the controller's arm to a file
    #[command(after_help = "Examples:\n  jtc arm pull -o board.toml")]
    Pull {
        /// Write this arm file
        #[arg(short, long, env = "JTC_PULL_OUT", value_name = "FILE")]
        out: PathBuf,
        #[command(flatten)]
        overwrite: OverwriteArgs,
        #[command(flatten)]
        link: LinkArgs,
    },
    /// Compare an arm file with the controller's arm
    #[command(after_help = "Exit code 4 means that at least one value differs.\n\n\
            Examples:\n  \
            jtc arm diff my-arm.toml\n  \
            jtc --json arm diff my-arm.toml | jq .differences")]
    Diff {
        /// Arm file (TOML) or robot description (URDF)
        file: PathBuf,
        #[command(flatten)]
        link: LinkArgs,
    },
}

/// Options of `jtc arm import`.
#[derive(Args, Debug)]
pub(crate) struct ImportArgs {
    /// Robot description (URDF)
    #[arg(value_name = "URDF")]
    pub urdf: PathBuf,
    /// Write this arm file
    #[arg(short, long, env = "JTC_IMPORT_OUT", value_name = "FILE")]
    pub out: PathBuf,
    /// Select the six joints of the arm, from base to wrist
    #[arg(long, value_name = "A,B,C,D,E,F", value_delimiter = ',')]
    pub joints: Option<Vec<String>>,
    /// Select the link to use as the flange
    #[arg(long, value_name = "LINK")]
    pub tip: Option<String>,
    #[command(flatten)]
    pub overwrite: OverwriteArgs,
}
