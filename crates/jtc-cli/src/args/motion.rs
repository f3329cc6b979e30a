//! `jtc traj` and `jtc teach`: what moves the arm.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::{AcceptArgs, LinkArgs, OverwriteArgs};

/// Help of `jtc run` and `jtc traj run`.
pub(super) const RUN_EXAMPLES: &str = "The motion runs at 100 % of the file's own speed. An approach runs at --speed, and at half of the limits at most;\n\
                            without --speed at 10 % of the limits, and at 25 % in a simulator.\n\
                            On a terminal space pauses and resumes, s stops; + and - change the speed, where the controller has extensions.\n\
                            Ctrl-C stops on the path, then ends; a second one ends at once.\n\
                            Output files are opened before anything moves. A recording is written while the arm moves, and after a killed\n\
                            program it can be read up to its last 0.2 s. If it cannot be written to before the motion begins, nothing\n\
                            moves; if that happens on the way (full disk), it is reported at once, the motion goes on as it was checked, and\n\
                            the command ends with exit code 5.\n\nExamples:\n  jtc run motion.csv --approach\n  \
                            jtc traj run motion.csv --speed 10 --record run.mcap\n  \
                            jtc traj run cycle.csv --approach --repeat 10";

/// Help of `jtc stop` and `jtc traj stop`.
pub(super) const STOP_EXAMPLES: &str = "The Stop reaches the arm also when an agent or another program of this user has the port. Without --port, or JTC_PORT, it goes to\n\
                            every arm whose port they have, else to the only port found. It ends with exit code 0 when the arm stands, also when\n\
                            nothing was moving. It does not replace the emergency stop.\n\nExamples:\n  jtc stop\n  jtc traj stop --port /dev/ttyUSB0";

/// What a trajectory is checked against.
#[derive(Args, Clone, Debug)]
pub struct CheckArgs {
    /// Arm whose limits and masses count, TOML or URDF; default: the built-in one
    #[arg(long, env = "JTC_ARM", value_name = "FILE")]
    pub arm: Option<PathBuf>,
    /// Speed in percent of the file's own, 1 to 200: 50 takes twice the time, with the same path; default: 100
    #[arg(long, value_name = "PCT", allow_hyphen_values = true)]
    pub speed: Option<f64>,
    /// The numbers of the file are degrees, for files that do not name their unit; a CSV header does with q1_deg..q6_deg
    #[arg(long)]
    pub deg: bool,
}

impl CheckArgs {
    /// Percent of the file's own speed.
    pub fn speed(&self) -> f64 {
        self.speed.unwrap_or(100.0)
    }
}

/// `jtc traj …`
#[derive(Debug, Subcommand)]
pub enum TrajCommand {
    /// Limits at and between points, torques by the arm model; nothing is sent
    #[command(
        after_help = "The torque margin is the smallest share of a torque limit that the motion leaves; below 10 % it is warned of.\n\nExamples:\n  \
                            jtc traj check motion.csv\n  jtc --json traj check motion.yaml --arm my-arm.toml\n  \
                            jtc traj check motion.csv --payload 2,0,0,0.08"
    )]
    Check {
        /// CSV, JSON or trajectory_msgs/JointTrajectory as YAML or JSON
        file: PathBuf,
        #[command(flatten)]
        check: CheckArgs,
        /// What the arm carries at its flange: kg, or kg and its place in the flange frame in m; `traj run` takes that of the controller
        #[arg(long, value_name = "KG[,X,Y,Z]", value_parser = super::payload::carried, allow_hyphen_values = true)]
        payload: Option<jtc_core::Payload>,
    },
    /// What a file holds
    #[command(after_help = "Examples:\n  jtc traj info motion.csv")]
    Info {
        /// CSV, JSON or trajectory_msgs/JointTrajectory as YAML or JSON
        file: PathBuf,
        /// The numbers of the file are degrees, for files that do not name their unit
        #[arg(long)]
        deg: bool,
    },
    /// Check, upload, execute, follow, report
    #[command(after_help = RUN_EXAMPLES)]
    Run(RunArgs),
    /// Run again what a recording is of: its trajectory, or the way that was measured
    #[command(
        after_help = "As `jtc traj run`, which takes recordings too; here any other file is refused. An MCAP file of `traj run` or `move` holds\n\
                            the whole trajectory, which is run also where its run was broken off (`jtc traj continue` runs the rest alone). Of\n\
                            other recordings it is the last execution, along the commanded path as far as it is recorded.\n\n\
                            --measured takes what was measured every 40 ms: of a motion by hand nothing was commanded. Where that is not\n\
                            within the limits, or ends in motion, its way is planned anew, no faster than it was, and a note reports it.\n\nExamples:\n  \
                            jtc traj replay run.mcap --approach\n  jtc traj replay run.csv --speed 50 --record again.mcap\n  \
                            jtc traj replay taught.mcap --measured --approach"
    )]
    Replay {
        #[command(flatten)]
        run: RunArgs,
        /// What was measured: the last motion by hand, or else the last execution
        #[arg(long)]
        measured: bool,
    },
    /// Go on with a run that an error, a stop or a lost link broke off
    #[command(
        after_help = "The recording of that run shows how far it got; an MCAP file holds the whole trajectory as well, for a CSV file\n\
                            --trajectory names it. The rest begins at the last place that is proved: that at which the recording shows the arm, or a\n\
                            later one only where the controller shows that it went on by itself. Where the arm stands elsewhere (after an error,\n\
                            or a controller that was started anew) an approach leads there. The rest speeds up from standstill and follows the\n\
                            same path. Of a run with --repeat those that were not finished are run behind it.\n\n\
                            Examples:\n  jtc traj run cycle.csv --record run.mcap\n  jtc traj continue run.mcap\n  \
                            jtc traj continue run.csv --trajectory cycle.csv --record rest.mcap"
    )]
    Continue(ContinueArgs),
    /// Pause on the path
    #[command(after_help = "Examples:\n  jtc traj pause")]
    Pause(LinkArgs),
    /// Go on after a pause; refused when nothing is paused
    #[command(
        after_help = "Where settings or payload were changed during the pause, what remains of the motion may not be possible any more.\n\
                            --trajectory names what is being run, and it is checked with them before anything is sent. Without it a note\n\
                            reports what is not checked.\n\nExamples:\n  jtc traj resume\n  jtc traj resume --trajectory motion.csv\n  \
                            jtc traj resume --trajectory run.mcap"
    )]
    Resume(ResumeArgs),
    /// Stop on the path and end the execution
    #[command(after_help = STOP_EXAMPLES)]
    Stop(LinkArgs),
    /// Speed override: the speed on the path in percent, while it runs and of what runs later
    #[command(
        after_help = "The path stays the same; the motion gets to the new speed along a ramp. It needs a controller with\n\
                            extensions (`jtc info`). Without a number the present one is shown.\n\nExamples:\n  jtc traj speed 30\n  jtc traj speed"
    )]
    Speed {
        /// 5 to 100
        #[arg(value_name = "PCT", allow_negative_numbers = true)]
        percent: Option<f64>,
        #[command(flatten)]
        link: LinkArgs,
    },
}

/// Options of `jtc traj run`.
#[derive(Args, Debug)]
pub struct RunArgs {
    /// CSV, JSON or trajectory_msgs/JointTrajectory as YAML or JSON
    pub file: PathBuf,
    #[command(flatten)]
    pub check: CheckArgs,
    /// Move to the first point before
    #[arg(long)]
    pub approach: bool,
    /// Points of a segment, 1 to 1500, in at most 100 segments; default: short enough for the CRC to be strong
    #[arg(long, value_name = "N")]
    pub points_per_segment: Option<usize>,
    /// Run it so many times; figures are kept of the last 1000, samples of the last one. A path that does not end where it begins needs --approach
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub repeat: u32,
    #[command(flatten)]
    pub execute: ExecuteArgs,
}

/// Options of `jtc traj resume`.
#[derive(Args, Debug)]
pub struct ResumeArgs {
    /// The trajectory that is paused, as it was run, or a recording of its run that holds it (MCAP)
    #[arg(long, env = "JTC_TRAJECTORY", value_name = "FILE")]
    pub trajectory: Option<PathBuf>,
    #[command(flatten)]
    pub check: CheckArgs,
    #[command(flatten)]
    pub link: LinkArgs,
}

/// Options of `jtc traj continue`.
#[derive(Args, Debug)]
pub struct ContinueArgs {
    /// Recording of the run that was broken off, .mcap or .csv
    #[arg(value_name = "RUN")]
    pub run: PathBuf,
    /// The trajectory that was run, as it was run; default: the one in the recording
    #[arg(long, value_name = "FILE")]
    pub trajectory: Option<PathBuf>,
    /// How often the motion was to be run, those that were finished included; default: as the recording has it (MCAP)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub repeat: Option<u32>,
    /// Arm whose limits and masses count, TOML or URDF; default: that of the controller
    #[arg(long, env = "JTC_ARM", value_name = "FILE")]
    pub arm: Option<PathBuf>,
    #[command(flatten)]
    pub execute: ExecuteArgs,
}

/// What every command takes that executes a motion.
#[derive(Args, Clone, Debug)]
pub struct ExecuteArgs {
    /// What becomes of the motion when this program is killed or loses its agent: through `jtc serve` alone
    #[arg(long, value_name = "POLICY", value_parser = ["continue", "pause", "stop"])]
    pub when_gone: Option<String>,
    #[command(flatten)]
    pub link: LinkArgs,
    #[command(flatten)]
    pub files: RunFiles,
    #[command(flatten)]
    pub accept: AcceptArgs,
}

/// Files that a run writes.
#[derive(Args, Clone, Debug)]
pub struct RunFiles {
    /// Record the motion, .mcap or .csv
    #[arg(long, env = "JTC_RUN_RECORD", value_name = "FILE")]
    pub record: Option<PathBuf>,
    /// Write the report page, .html; of several runs it is that of the last one
    #[arg(long, env = "JTC_RUN_REPORT", value_name = "FILE")]
    pub report: Option<PathBuf>,
    #[command(flatten)]
    pub overwrite: OverwriteArgs,
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
        after_help = "The file is written while the arm is led: a killed program leaves what was led up to then. If it cannot be\n\
                            written to (full disk), the recording ends at once and the arm is held, with exit code 5.\n\n\
                            With --waypoints the file holds as few of the positions as keep the others within --tolerance of the straight legs\n\
                            between them, for `jtc plan`; until the end it holds the motion.\n\n\
                            Examples:\n  jtc teach record motion.csv\n  jtc teach record motion.csv --duration 20\n  \
                            jtc teach record waypoints.csv --waypoints --tolerance 0.02"
    )]
    Record {
        /// Trajectory file to write, CSV
        file: PathBuf,
        #[command(flatten)]
        overwrite: OverwriteArgs,
        #[command(flatten)]
        link: LinkArgs,
        /// End after so many seconds
        #[arg(long, value_name = "S")]
        duration: Option<f64>,
        /// Write waypoints instead of the motion
        #[arg(long)]
        waypoints: bool,
        /// How far the motion may be from the legs between waypoints, rad of the joint that is furthest; default: 0.01
        #[arg(long, value_name = "RAD", requires = "waypoints")]
        tolerance: Option<f64>,
    },
}

impl ExecuteArgs {
    /// The policy in the word of the agent.
    pub fn policy(&self) -> Option<&'static str> {
        ["continue", "pause", "stop"].into_iter().find(|word| self.when_gone.as_deref() == Some(word))
    }
}
