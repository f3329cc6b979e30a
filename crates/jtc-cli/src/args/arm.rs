//! `jtc arm`: options of the commands for arm files, and for the arm of a controller.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::{AcceptArgs, LinkArgs, OverwriteArgs};

/// `jtc arm …`
#[derive(Debug, Subcommand)]
pub(crate) enum ArmCommand {
    /// Make an arm file from a robot description (URDF)
    #[command(after_help = "The command prints each frame that it rotated, and each value that it \
        estimated.\n\n\
        The arm must be a chain of six revolute or continuous joints. If the robot has more movable joints \
        (a gripper, a seventh axis, a second arm), select the six joints with --joints or --tip. The command \
        treats the other joints as fixed at position 0.\n\n\
        A URDF contains only some of the parameters. For example, rotor inertia, gains and acceleration \
        limits are missing. The command uses rules to compute starting values for the missing parameters. \
        The arm file contains these rules, and marks the starting values as proposed.\n\n\
        Examples:\n  \
        jtc arm import ur5.urdf -o ur5.toml\n  \
        jtc arm import z1.urdf --joints joint1,joint2,joint3,joint4,joint5,joint6 -o z1.toml\n  \
        jtc arm import two-arms.urdf --tip left_tool0 -o left.toml")]
    Import(ImportArgs),
    /// Check that an arm is physically possible and complete
    #[command(
        after_help = "The command also checks the torques that the drives need to hold the arm, and checks \
            that the controller accepts the arm.\n\n\
            Exit code 0 means that the controller accepts the arm. Exit code 4 means that the controller \
            refuses the arm. The command can also show warnings with exit code 0. For example, it warns \
            about proposed values, and about poses in which a drive cannot hold the arm against gravity.\n\n\
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
        /// Without a file, the command shows the arm of the controller
        file: Option<PathBuf>,
        /// Show angles in degrees
        #[arg(long)]
        deg: bool,
        #[command(flatten)]
        link: LinkArgs,
    },
    /// Send a complete arm to the controller, and verify it
    #[command(
        after_help = "The command sends settings, gains, friction, model and name. Then it reads these \
            values back, and compares them with the file.\n\n\
            The controller accepts new settings only in the states Init and Error. Switch off the torque \
            first with `jtc disable`.\n\n\
            With --store, the controller also keeps the arm without power. After the controller has stored \
            the arm, it is in the state Init. Run `jtc params use-defaults` or `jtc recover --defaults` to \
            use the stored arm.\n\n\
            A controller without the protocol extensions accepts only friction, gains and model. You cannot \
            change its limits, gravity and rotor inertia. If these values differ from the file, the command \
            sends nothing, unless you use --accept-device-limits.\n\n\
            Examples:\n  \
            jtc arm push my-arm.toml\n  \
            jtc arm push my-arm.toml --store"
    )]
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
    /// Use this link of the URDF as the flange
    #[arg(long, value_name = "LINK")]
    pub tip: Option<String>,
    /// Compensate the friction and damping of the URDF.
    ///
    /// By default the file compensates no friction, and has these numbers in comments: they are often made for a simulator, and
    /// too much compensation drives a joint
    #[arg(long)]
    pub friction: bool,
    #[command(flatten)]
    pub overwrite: OverwriteArgs,
}
