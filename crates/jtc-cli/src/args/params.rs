//! `jtc params`: options for the parameters of a controller, and the parameters that cannot be sent in a frame.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

use super::LinkArgs;

/// `jtc params …`
#[derive(Debug, Subcommand)]
pub(crate) enum ParamsCommand {
    /// Send friction, gains and arm model from files
    #[command(after_help = "The command accepts these files:\n  \
            TOML or URDF               an arm\n  \
            FricPolynomialCoeffs.csv   friction coefficients, one row per joint\n  \
            FricTableJointN.csv        friction tables, six files\n  \
            PidParamJointN.csv         gains, six files\n\n\
            You can name several files. If you name a directory, the command searches the directory for \
            these files. The command uses FricTableJointN.csv or PidParamJointN.csv only if it finds the \
            files of all six joints.\n\n\
            The command does not send limits, gravity and rotor inertia of an arm file. If these values \
            differ from the values of the controller, the command sends nothing, unless you use \
            --accept-device-limits. `jtc arm push` sends the complete arm.\n\n\
            Examples:\n  \
            jtc params push my-arm.toml\n  \
            jtc params push arm.urdf FricPolynomialCoeffs.csv PidParamJoint*.csv")]
    Push {
        /// Files or directories
        #[arg(required = true, value_name = "FILE")]
        files: Vec<PathBuf>,
        /// Choose the kind of friction if the files have both kinds
        #[arg(long, value_enum, default_value_t = FrictionKind::Polynomial)]
        friction: FrictionKind,
        #[command(flatten)]
        accept: AcceptArgs,
        #[command(flatten)]
        link: LinkArgs,
    },
    /// Make the controller use its default parameters
    #[command(after_help = "The default parameters are the parameters of the stored arm. If the controller \
        has not stored an arm, they are the parameters of the built-in arm.\n\n\
        Examples:\n  \
        jtc params use-defaults")]
    UseDefaults(LinkArgs),
    /// Show the parameters of a file or of the built-in arm
    #[command(
        after_help = "Without a file, the command shows the built-in arm. With --port, the command also \
            shows which parameters are missing in the controller.\n\n\
        Examples:\n  \
        jtc params show\n  \
        jtc params show my-arm.urdf"
    )]
    Show {
        /// Files or directories
        #[arg(value_name = "FILE")]
        files: Vec<PathBuf>,
        /// Ask the controller at this port for its missing parameters
        #[arg(long, env = "JTC_PORT", value_name = "PATH")]
        port: Option<String>,
        /// Set the rate of the port, Bd
        #[arg(long, env = "JTC_BAUD", value_name = "N", default_value_t = 115_200)]
        baud: u32,
    },
}

/// Kinds of friction compensation.
#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
pub enum FrictionKind {
    /// Send the coefficients c0..c5.
    Polynomial,
    /// Send the table of torque over speed and temperature.
    Table,
}

/// Option to accept values of an arm file that no frame can send to the controller.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct AcceptArgs {
    /// Continue even if limits, gravity or rotor inertia differ.
    ///
    /// The controller then uses its own values, not the values of the arm file. Before a motion, the command compares
    /// the whole arm if the controller reports its arm. The option then also accepts differences in masses, gains and
    /// friction
    #[arg(long)]
    pub accept_device_limits: bool,
}
