//! The command line: commands, options, their environment variables and examples.

use std::path::PathBuf;

use clap::builder::FalseyValueParser;
use clap::{Args, Parser, Subcommand, ValueEnum};

/// The joint trajectory controller from your terminal.
#[derive(Debug, Parser)]
#[command(
    name = "jtc",
    version,
    about = "Joint trajectory controller: simulate, set up, run and look at a six-axis arm",
    after_help = "Examples:\n  jtc demo                              the main job on the built-in simulator\n  \
                  jtc sim --serial /tmp/jtc             a simulated controller behind a serial port\n  \
                  jtc --json status --port /tmp/jtc     one status, for programs\n  \
                  jtc traj run motion.csv --approach    check, upload, execute, report\n\n\
                  Every option can be set by an environment variable, see `jtc COMMAND --help`.\n\
                  Exit codes: 0 done, 1 the controller reported an error, 2 wrong usage or unreadable input,\n\
                  3 no link, 4 refused by a check (nothing was sent or moved), 5 fault while running.",
    max_term_width = 100,
    propagate_version = true,
    disable_help_subcommand = true
)]
pub struct Cli {
    /// Print one JSON object (streams: one a line) instead of text
    #[arg(long, global = true, env = "JTC_JSON", value_parser = FalseyValueParser::new(), help_heading = "Common")]
    pub json: bool,
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// Which controller.
#[derive(Args, Clone, Debug)]
pub struct LinkArgs {
    /// Serial port; default: the only one found
    #[arg(long, env = "JTC_PORT", value_name = "PATH", help_heading = "Link")]
    pub port: Option<String>,
    /// Rate of the port, Bd
    #[arg(long, env = "JTC_BAUD", value_name = "N", default_value_t = 115_200, help_heading = "Link",
          value_parser = clap::value_parser!(u32).range(300..=15_000_000))]
    pub baud: u32,
}

/// What of an arm file a controller cannot be given.
#[derive(Args, Clone, Copy, Debug)]
pub struct AcceptArgs {
    /// Go on although the controller uses other limits, gravity or rotor inertia than the arm file says
    #[arg(long, env = "JTC_ACCEPT_DEVICE_LIMITS", value_parser = FalseyValueParser::new())]
    pub accept_device_limits: bool,
}

/// Files that are there already.
#[derive(Args, Clone, Copy, Debug)]
pub struct ForceArgs {
    /// Write over output files that are there already
    #[arg(long, env = "JTC_FORCE", value_parser = FalseyValueParser::new())]
    pub force: bool,
}

/// How fast virtual time runs.
#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
pub enum SimSpeed {
    /// As a real arm.
    Realtime,
    /// As fast as this computer can.
    Max,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// The main job on the built-in simulator: parameters, upload, execution, report
    #[command(after_help = "Examples:\n  jtc demo\n  jtc demo --out /tmp/demo --speed realtime")]
    Demo(DemoArgs),
    /// A simulated controller with drives and arm behind a pseudo-terminal
    #[command(
        after_help = "Examples:\n  jtc sim --serial /tmp/jtc\n  jtc sim --serial /tmp/jtc --arm my-arm.toml --seed 7\n  \
                            jtc sim --serial /tmp/jtc --speed max --no-throttle\n  \
                            jtc sim --serial /tmp/jtc --faults faults.toml\n\nLines on the standard input are \
                            events:\n  push 3 12 0.5    joint 3 (counted from 1) is pushed by 12 N·m for 0.5 s\n  \
                            hand lead.csv    a hand leads the arm along the positions of a trajectory file while it is taught"
    )]
    Sim(SimArgs),
    /// Serial ports found, and why one cannot be used
    #[command(after_help = "Examples:\n  jtc ports\n  jtc --json ports")]
    Ports,
    /// What is wrong with link, bus and set-up, with the next command
    #[command(after_help = "Examples:\n  jtc doctor\n  jtc doctor --port /dev/ttyUSB0")]
    Doctor(LinkArgs),
    /// One decoded status
    #[command(after_help = "Examples:\n  jtc status\n  jtc --json status | jq .joints[0].position_rad")]
    Status(LinkArgs),
    /// Live view of the controller and the joints
    #[command(after_help = "Examples:\n  jtc monitor\n  jtc --json monitor --count 100 > statuses.jsonl")]
    Monitor(MonitorArgs),
    /// Friction, gains and arm model
    #[command(subcommand)]
    Params(ParamsCommand),
    /// Trajectories: check, run, pause, resume, stop
    #[command(subcommand)]
    Traj(TrajCommand),
    /// Teaching: move the arm by hand
    #[command(subcommand)]
    Teach(TeachCommand),
    /// Clear errors of the controller and all nodes
    #[command(after_help = "Examples:\n  jtc clear\n  jtc clear --occurred")]
    Clear(ClearArgs),
    /// Reset nodes of the joint bus; the arm loses torque, also when only one joint is named
    #[command(
        after_help = "Examples:\n  jtc reset --joints 3          joint 3 only\n  jtc reset --joints 1,3 --yes  does not ask, \
                            also where the arm is held\n  jtc reset --gripper\n  jtc reset --all"
    )]
    Reset(ResetArgs),
    /// Vacuum pump of the gripper
    #[command(after_help = "Examples:\n  jtc gripper on\n  jtc gripper off")]
    Gripper(GripperArgs),
    /// The whole way back to HoldPos, saying each step and whose numbers it uses; resumes no motion
    #[command(
        after_help = "--arm FILE gives friction, gains and arm model of that file to a controller that does not hold the arm, also\n\
                            in place of others that it was given before; where the arm is held, those given before stay, and it is said.\n\
                            --defaults gives those of the arm that is built into the controller, only where some are missing. Without\n\
                            either, a controller that has all three keeps them, and one that has not is refused.\n\nExamples:\n  \
                            jtc recover\n  jtc recover --arm my-arm.toml\n  jtc recover --defaults"
    )]
    Recover(RecoverArgs),
    /// Dynamics of an arm: a line of numbers in, a line of numbers out
    #[command(
        after_help = "Each line on stdin holds q1..q6 qd1..qd6 qdd1..qdd6 (rad, rad/s, rad/s²); forward: torques (N·m)\n\
                            in the last six; mass: q1..q6 only. Numbers come out with 17 significant digits.\n\nExamples:\n  \
                            echo 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 | jtc dynamics inverse\n  \
                            echo 0 0.5 0 0 0 0 | jtc dynamics mass --arm my-arm.urdf"
    )]
    Dynamics(DynamicsArgs),
    /// A page about an error or status code
    #[command(
        after_help = "Examples:\n  jtc explain\n  jtc explain start-position-mismatch\n  jtc explain 8"
    )]
    Explain(ExplainArgs),
    /// Decode frames: hex or a raw serial capture on stdin
    #[command(after_help = "Examples:\n  echo 9B 0E 00 06 A3 47 | jtc decode\n  jtc decode < capture.bin")]
    Decode,
    /// Make the report page and picture of a recording
    #[command(
        after_help = "Examples:\n  jtc report run.mcap\n  jtc report run.csv --arm my-arm.toml --out run.html"
    )]
    Report(ReportArgs),
    /// Completions for a shell, on stdout
    #[command(
        after_help = "Examples:\n  jtc completions bash > ~/.local/share/bash-completion/completions/jtc"
    )]
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Manual pages, one file a command
    #[command(after_help = "Examples:\n  jtc man --out ~/.local/share/man/man1")]
    Man {
        /// Directory for the pages; without it the main page goes to stdout
        #[arg(long, env = "JTC_OUT", value_name = "DIR")]
        out: Option<PathBuf>,
    },
}

/// Options of `jtc demo`.
#[derive(Args, Debug)]
pub struct DemoArgs {
    /// Directory for recording, report and picture
    #[arg(long, env = "JTC_OUT", value_name = "DIR", default_value = "demo")]
    pub out: PathBuf,
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
    /// Arm to simulate, TOML or URDF; default: the built-in one
    #[arg(long, env = "JTC_ARM", value_name = "FILE")]
    pub arm: Option<PathBuf>,
    /// Rate of the simulated line, Bd: it is as slow as a real one
    #[arg(long, env = "JTC_BAUD", value_name = "N", default_value_t = 115_200,
          value_parser = clap::value_parser!(u32).range(300..=15_000_000))]
    pub baud: u32,
    /// Bytes take no time on the line
    #[arg(long, env = "JTC_NO_THROTTLE", value_parser = FalseyValueParser::new())]
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
}

/// Options of `jtc monitor`.
#[derive(Args, Debug)]
pub struct MonitorArgs {
    #[command(flatten)]
    pub link: LinkArgs,
    /// End after so many statuses
    #[arg(long, env = "JTC_COUNT", value_name = "N")]
    pub count: Option<u64>,
}

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
        #[arg(long, env = "JTC_FRICTION", value_enum, default_value_t = FrictionKind::Polynomial)]
        friction: FrictionKind,
        #[command(flatten)]
        accept: AcceptArgs,
        #[command(flatten)]
        link: LinkArgs,
    },
    /// Tell the controller to use its defaults
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

/// What a trajectory is checked against.
#[derive(Args, Clone, Debug)]
pub struct CheckArgs {
    /// Arm whose limits and masses count, TOML or URDF; default: the built-in one
    #[arg(long, env = "JTC_ARM", value_name = "FILE")]
    pub arm: Option<PathBuf>,
    /// Run slower, in percent of the trajectory's own speed
    #[arg(long, env = "JTC_SPEED_PERCENT", value_name = "PCT", default_value_t = 100.0)]
    pub speed: f64,
}

impl Command {
    /// It moves the arm, or records a person moving it: its result cannot be had again.
    pub fn moves(&self) -> bool {
        matches!(
            self,
            Command::Demo(_)
                | Command::Traj(TrajCommand::Run(_))
                | Command::Teach(TeachCommand::Record { .. })
        )
    }
}

/// `jtc traj …`
#[derive(Debug, Subcommand)]
pub enum TrajCommand {
    /// Limits at and between points, torques by the arm model; nothing is sent
    #[command(
        after_help = "Examples:\n  jtc traj check motion.csv\n  jtc --json traj check motion.yaml --arm my-arm.toml"
    )]
    Check {
        /// CSV, JSON or trajectory_msgs/JointTrajectory as YAML or JSON
        file: PathBuf,
        #[command(flatten)]
        check: CheckArgs,
    },
    /// What a file holds
    #[command(after_help = "Examples:\n  jtc traj info motion.csv")]
    Info {
        /// CSV, JSON or trajectory_msgs/JointTrajectory as YAML or JSON
        file: PathBuf,
    },
    /// Check, upload, execute, follow, report
    #[command(
        after_help = "On a terminal space pauses and resumes, s stops. Ctrl-C stops on the path, then ends; a second one ends at once.\n\
                            Output files are opened before anything moves.\n\nExamples:\n  jtc traj run motion.csv --approach\n  \
                            jtc traj run motion.csv --speed 10 --record run.mcap"
    )]
    Run(RunArgs),
    /// Pause on the path
    #[command(after_help = "Examples:\n  jtc traj pause")]
    Pause(LinkArgs),
    /// Go on after a pause; refused when nothing is paused
    #[command(after_help = "Examples:\n  jtc traj resume")]
    Resume(LinkArgs),
    /// Stop on the path and end the execution
    #[command(after_help = "Examples:\n  jtc traj stop")]
    Stop(LinkArgs),
}

/// Options of `jtc traj run`.
#[derive(Args, Debug)]
pub struct RunArgs {
    /// CSV, JSON or trajectory_msgs/JointTrajectory as YAML or JSON
    pub file: PathBuf,
    #[command(flatten)]
    pub link: LinkArgs,
    #[command(flatten)]
    pub check: CheckArgs,
    /// Move to the first point before
    #[arg(long, env = "JTC_APPROACH", value_parser = FalseyValueParser::new())]
    pub approach: bool,
    /// Points of a segment; default: short enough for the CRC to be strong
    #[arg(long, env = "JTC_POINTS_PER_SEGMENT", value_name = "N")]
    pub points_per_segment: Option<usize>,
    /// Record the motion, .mcap or .csv
    #[arg(long, env = "JTC_RECORD", value_name = "FILE")]
    pub record: Option<PathBuf>,
    /// Write the report page, .html
    #[arg(long, env = "JTC_REPORT", value_name = "FILE")]
    pub report: Option<PathBuf>,
    #[command(flatten)]
    pub force: ForceArgs,
    #[command(flatten)]
    pub accept: AcceptArgs,
}

/// `jtc teach …`
#[derive(Debug, Subcommand)]
pub enum TeachCommand {
    /// Gravity compensation only: the arm can be moved by hand
    #[command(after_help = "Examples:\n  jtc teach on")]
    On(LinkArgs),
    /// Hold the pose
    #[command(after_help = "Examples:\n  jtc teach off")]
    Off(LinkArgs),
    /// Record a motion by hand as a trajectory file, until Ctrl-C
    #[command(
        after_help = "Examples:\n  jtc teach record motion.csv\n  jtc teach record motion.csv --duration 20"
    )]
    Record {
        /// Trajectory file to write, CSV
        file: PathBuf,
        #[command(flatten)]
        force: ForceArgs,
        #[command(flatten)]
        link: LinkArgs,
        /// End after so many seconds
        #[arg(long, env = "JTC_DURATION", value_name = "S")]
        duration: Option<f64>,
    },
}

/// Options of `jtc clear`.
#[derive(Args, Debug)]
pub struct ClearArgs {
    #[command(flatten)]
    pub link: LinkArgs,
    /// Clear the memory of errors that occurred, too
    #[arg(long, env = "JTC_OCCURRED", value_parser = FalseyValueParser::new())]
    pub occurred: bool,
}

/// Options of `jtc reset`.
#[derive(Args, Debug)]
pub struct ResetArgs {
    /// Joints, counted from 1: 2, or 1,3
    #[arg(long, env = "JTC_JOINTS", value_name = "LIST", value_delimiter = ',', value_parser = clap::value_parser!(u8).range(1..=6))]
    pub joints: Vec<u8>,
    /// The gripper
    #[arg(long, env = "JTC_GRIPPER", value_parser = FalseyValueParser::new())]
    pub gripper: bool,
    /// All joints and the gripper
    #[arg(long, env = "JTC_ALL", value_parser = FalseyValueParser::new())]
    pub all: bool,
    /// Do not ask: the arm may lose torque
    #[arg(long, env = "JTC_YES", value_parser = FalseyValueParser::new())]
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
    #[arg(long, env = "JTC_ARM", value_name = "FILE")]
    pub arm: Option<PathBuf>,
    /// Give the controller's own defaults, those of its built-in arm, when it misses parameters
    #[arg(long, env = "JTC_DEFAULTS", value_parser = FalseyValueParser::new())]
    pub defaults: bool,
    #[command(flatten)]
    pub accept: AcceptArgs,
}

/// Options of `jtc dynamics`.
#[derive(Args, Debug)]
pub struct DynamicsArgs {
    /// What to compute
    pub what: DynamicsKind,
    /// Arm, TOML or URDF; default: the built-in one
    #[arg(long, env = "JTC_ARM", value_name = "FILE")]
    pub arm: Option<PathBuf>,
    /// Gravity in the base frame, m/s²; default: the arm file's
    #[arg(long, env = "JTC_GRAVITY", value_name = "X,Y,Z", value_parser = gravity, allow_hyphen_values = true)]
    pub gravity: Option<[f64; 3]>,
    /// Count the drives' reflected rotor inertias of the arm file, too
    #[arg(long, env = "JTC_ROTORS", value_parser = FalseyValueParser::new())]
    pub rotors: bool,
}

/// Kinds of dynamics.
#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
pub enum DynamicsKind {
    /// Torques of a motion.
    Inverse,
    /// Accelerations of torques.
    Forward,
    /// Mass matrix, row by row.
    Mass,
}

/// Options of `jtc explain`.
#[derive(Args, Debug)]
pub struct ExplainArgs {
    /// Name or number of the code, or `faults` for the form of fault files; without it: the list
    pub code: Option<String>,
}

/// Options of `jtc report`.
#[derive(Args, Debug)]
pub struct ReportArgs {
    /// Recording, .mcap or .csv
    pub file: PathBuf,
    /// Page to write; default: beside the recording
    #[arg(long, env = "JTC_OUT", value_name = "FILE")]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub force: ForceArgs,
    /// Arm whose limits count, for recordings that do not say (CSV)
    #[arg(long, env = "JTC_ARM", value_name = "FILE")]
    pub arm: Option<PathBuf>,
}

fn gravity(text: &str) -> Result<[f64; 3], String> {
    let values: Vec<f64> =
        text.split(',').filter_map(|v| v.trim().parse().ok()).filter(|v: &f64| v.is_finite()).collect();
    let count = text.split(',').count();
    match <[f64; 3]>::try_from(values) {
        Ok(values) if count == 3 => Ok(values),
        _ => Err("three numbers with commas between them, as 0,0,-9.81".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_sound_and_has_an_example_for_each_command() {
        Cli::command().debug_assert();
        fn walk(command: &clap::Command, path: &str) {
            for sub in command.get_subcommands() {
                let path = format!("{path} {}", sub.get_name());
                if sub.has_subcommands() {
                    walk(sub, &path);
                } else {
                    let help = sub.get_after_help().map(ToString::to_string).unwrap_or_default();
                    assert!(help.contains("Examples:"), "{path} has no example");
                }
                for arg in sub.get_arguments().filter(|a| a.get_long().is_some()) {
                    let env = arg.get_env().map(|e| e.to_string_lossy().into_owned()).unwrap_or_default();
                    assert!(env.starts_with("JTC_"), "{path} --{}: no variable", arg.get_long().unwrap());
                }
            }
        }
        walk(&Cli::command(), "jtc");
    }

    #[test]
    fn gravity_is_checked() {
        assert_eq!(gravity("0,0,-9.81"), Ok([0.0, 0.0, -9.81]));
        assert!(gravity("0,0").is_err() && gravity("0,0,x").is_err() && gravity("0,0,1,2").is_err());
    }
}
