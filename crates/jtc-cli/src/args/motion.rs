//! `jtc traj` and `jtc teach`: options of the commands that move the arm.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use jtc_host::trajectory::ArmNames;

use super::{AcceptArgs, LinkArgs, OverwriteArgs};

/// Help text of `jtc run` and `jtc traj run`.
pub(super) const RUN_EXAMPLES: &str = "By default, the motion runs at 100 % of the speed in the file. With \
    --approach, the arm first moves to the first point. The approach runs at --speed percent of the limits, \
    but at most at 50 %. Without --speed, the approach runs at 10 % of the limits, or at 25 % in a \
    simulator.\n\n\
    On a terminal, press space to pause and resume, and s to stop. Press + and - to change the speed if the \
    controller has the protocol extensions. Ctrl-C stops the arm on its path, and then ends the command. A \
    second Ctrl-C ends the command at once.\n\n\
    The command opens its output files before the arm moves. If it cannot write the recording, the arm does \
    not move. The command writes the recording during the motion. If the program is killed, the last 0.2 s \
    can be missing from the recording. If the disk becomes full during the motion, the command prints an \
    error at once. The motion continues, and the command ends with exit code 5.\n\n\
    Examples:\n  \
    jtc run motion.csv --approach\n  \
    jtc traj run motion.csv --speed 10 --record run.mcap\n  \
    jtc traj run cycle.csv --approach --repeat 10";

/// Help text of `jtc stop` and `jtc traj stop`.
pub(super) const STOP_EXAMPLES: &str = "The command also works if an agent, or another program of this user, \
    has opened the serial port. Without --port or JTC_PORT, the command stops every arm whose serial port is \
    open in such a program. If no such program runs, the command uses the only serial port that it \
    finds.\n\n\
    When the arm is at rest, the command ends with exit code 0, even if the arm did not move before. The \
    command does not replace the emergency stop.\n\n\
    Examples:\n  \
    jtc stop\n  \
    jtc traj stop --port /dev/ttyUSB0";

/// Options of the check of a trajectory.
#[derive(Args, Clone, Debug)]
pub(crate) struct CheckArgs {
    /// Use the limits and masses of this arm, TOML or URDF.
    ///
    /// Default: the arm of the controller, if the command is connected to a controller that reports its arm. Otherwise,
    /// the default is the built-in arm
    #[arg(long, env = "JTC_ARM", value_name = "FILE")]
    pub arm: Option<PathBuf>,
    /// Set the speed in percent of the file's speed (1 to 200).
    ///
    /// Default: 100. With 50, the motion follows the same path in twice the time
    #[arg(long, value_name = "PCT", allow_hyphen_values = true)]
    pub speed: Option<f64>,
    /// Read the numbers of the file as degrees.
    ///
    /// Use this option for files that do not contain units. CSV columns with the names q1_deg..q6_deg are always in
    /// degrees
    #[arg(long)]
    pub deg: bool,
    /// Order joints by the numbers in their names.
    ///
    /// Use this option for files that name the joints of another arm, for example left_joint_1 to left_joint_6. Without
    /// this option, such files are refused
    #[arg(long)]
    pub joints_by_number: bool,
}

impl CheckArgs {
    /// Returns the speed in percent of the speed in the file.
    pub(crate) fn speed(&self) -> f64 {
        self.speed.unwrap_or(100.0)
    }

    /// Returns the names of the joints that a file must have. Returns `None` if the numbers in the names determine the order.
    pub(crate) fn names_of<'a>(&self, arm: &'a jtc_host::Arm) -> Option<ArmNames<'a>> {
        (!self.joints_by_number).then(|| arm.names())
    }
}

/// `jtc traj …`
#[derive(Debug, Subcommand)]
pub(crate) enum TrajCommand {
    /// Check the limits of a trajectory; nothing is sent
    #[command(
        after_help = "The command checks the limits at the points and between the points. The command \
            computes the torques with the arm model. The torque margin is the smallest unused part of a \
            torque limit during the motion, in percent. If the margin is below 10 %, the command prints a \
            warning.\n\n\
            Examples:\n  \
            jtc traj check motion.csv\n  \
            jtc --json traj check motion.yaml --arm my-arm.toml\n  \
            jtc traj check motion.csv --payload 2,0,0,0.08"
    )]
    Check {
        /// Trajectory file.
        ///
        /// Formats: CSV, JSON, or trajectory_msgs/JointTrajectory as YAML or JSON
        file: PathBuf,
        #[command(flatten)]
        check: CheckArgs,
        /// Check with this payload at the flange, kg.
        ///
        /// X,Y,Z is its position in the flange frame, m. `jtc traj run` uses the payload of the controller
        #[arg(long, value_name = "KG[,X,Y,Z]", value_parser = super::payload::carried, allow_hyphen_values = true)]
        payload: Option<jtc_core::Payload>,
    },
    /// Show the contents of a trajectory file
    #[command(after_help = "Examples:\n  jtc traj info motion.csv")]
    Info {
        /// Trajectory file.
        ///
        /// Formats: CSV, JSON, or trajectory_msgs/JointTrajectory as YAML or JSON
        file: PathBuf,
        /// Read the numbers of the file as degrees.
        ///
        /// Use this option for files that do not contain units
        #[arg(long)]
        deg: bool,
        /// Order joints by the numbers in their names.
        ///
        /// Use this option for files that name the joints of another arm, for example left_joint_1 to left_joint_6. Without
        /// this option, such files are refused
        #[arg(long)]
        joints_by_number: bool,
    },
    /// Check, upload and execute a trajectory, then report
    #[command(after_help = RUN_EXAMPLES)]
    Run(RunArgs),
    /// Run the trajectory or the measured path of a recording
    #[command(
        after_help = "FILE must be a recording (.mcap or .csv). The command refuses all other files. The \
            command works like `jtc traj run`.\n\n\
            An MCAP file of `traj run` or `move` contains the whole trajectory. The command runs the whole \
            trajectory, even if the recorded run was interrupted. To run only the rest of an interrupted \
            run, use `jtc traj continue`. From other recordings, the command runs the recorded part of the \
            last execution, along the commanded path.\n\n\
            With --measured, the command follows the measured positions (one every 40 ms). Use --measured \
            for a motion by hand, because such a motion has no commanded path. If the measured path exceeds \
            the limits or does not end at rest, the command plans a new motion. The new motion follows the \
            measured path, at the same speed or slower. The command prints a note if it plans a new \
            motion.\n\n\
            Examples:\n  \
            jtc traj replay run.mcap --approach\n  \
            jtc traj replay run.csv --speed 50 --record again.mcap\n  \
            jtc traj replay taught.mcap --measured --approach"
    )]
    Replay {
        #[command(flatten)]
        run: RunArgs,
        /// Follow the measured path instead of the commanded path.
        ///
        /// The command uses the last motion by hand in the recording. If the recording does not contain a motion by
        /// hand, the command uses the last execution
        #[arg(long)]
        measured: bool,
    },
    /// Continue an interrupted run
    #[command(
        after_help = "The command continues a run that an error, a stop or a lost link interrupted. The \
            recording of the run contains the last position of the arm. An MCAP file also contains the whole \
            trajectory. For a CSV file, set the trajectory file with --trajectory.\n\n\
            The command continues at the last confirmed position. This is the last position in the \
            recording, or a later position that the controller reports. After an error or a restart of the \
            controller, the arm can be at another position. The command then first moves the arm to the last \
            confirmed position.\n\n\
            The arm starts from rest, and follows the rest of the original path. If the run used --repeat, \
            the command then runs the missing repetitions.\n\n\
            Examples:\n  \
            jtc traj run cycle.csv --record run.mcap\n  \
            jtc traj continue run.mcap\n  \
            jtc traj continue run.csv --trajectory cycle.csv --record rest.mcap"
    )]
    Continue(ContinueArgs),
    /// Pause the motion on its path
    #[command(after_help = "Examples:\n  jtc traj pause")]
    Pause(LinkArgs),
    /// Resume a paused motion
    #[command(after_help = "If no motion is paused, the command ends with an error.\n\n\
            If settings or payload changed during the pause, the rest of the motion can exceed a limit. With \
            --trajectory, the command checks the rest of the motion with the new settings and payload before \
            it sends anything. Without --trajectory, the command does not check the rest of the motion, and \
            prints a note.\n\n\
            Examples:\n  \
            jtc traj resume\n  \
            jtc traj resume --trajectory motion.csv\n  \
            jtc traj resume --trajectory run.mcap")]
    Resume(ResumeArgs),
    /// Stop on the path, and end the motion
    #[command(after_help = STOP_EXAMPLES)]
    Stop(LinkArgs),
    /// Set or show the speed override, in percent (5 to 100)
    #[command(
        after_help = "The override slows down the present motion and later motions. The path does not \
            change. The speed changes gradually. The controller must have the protocol extensions (see `jtc \
            info`). Without a number, the command shows the present override.\n\n\
            Examples:\n  \
            jtc traj speed 30\n  \
            jtc traj speed"
    )]
    Speed {
        /// Speed override in percent (5 to 100)
        #[arg(value_name = "PCT", allow_negative_numbers = true)]
        percent: Option<f64>,
        #[command(flatten)]
        link: LinkArgs,
    },
}

/// Options of `jtc traj run`.
#[derive(Args, Debug)]
pub(crate) struct RunArgs {
    /// Trajectory file.
    ///
    /// Formats: CSV, JSON, or trajectory_msgs/JointTrajectory as YAML or JSON
    pub file: PathBuf,
    #[command(flatten)]
    pub check: CheckArgs,
    /// Move to the first point before the run
    #[arg(long)]
    pub approach: bool,
    /// Set the points per segment (1 to 1500).
    ///
    /// The command uploads a trajectory in segments (at most 100), each with one CRC. By default, segments are short
    /// enough that the CRC detects errors reliably
    #[arg(long, value_name = "N")]
    pub points_per_segment: Option<usize>,
    /// Run the trajectory this number of times (1 to 100000).
    ///
    /// The report contains statistics of the last 1000 runs, and the samples of the last run. If the path does not end
    /// at its first point, you also need --approach
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub repeat: u32,
    #[command(flatten)]
    pub execute: ExecuteArgs,
}

/// Options of `jtc traj resume`.
#[derive(Args, Debug)]
pub(crate) struct ResumeArgs {
    /// Check the rest of this trajectory before the motion resumes.
    ///
    /// Use the trajectory file of the run, or an MCAP recording of the run
    #[arg(long, env = "JTC_TRAJECTORY", value_name = "FILE")]
    pub trajectory: Option<PathBuf>,
    #[command(flatten)]
    pub check: CheckArgs,
    #[command(flatten)]
    pub link: LinkArgs,
}

/// Options of `jtc traj continue`.
#[derive(Args, Debug)]
pub(crate) struct ContinueArgs {
    /// Recording of the interrupted run, .mcap or .csv
    #[arg(value_name = "RUN")]
    pub run: PathBuf,
    /// Use this file as the trajectory of the interrupted run.
    ///
    /// Default: the trajectory in the MCAP recording
    #[arg(long, value_name = "FILE")]
    pub trajectory: Option<PathBuf>,
    /// Set the total number of runs (1 to 100000).
    ///
    /// This number includes the runs that have already finished. Default: the number in the MCAP recording
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub repeat: Option<u32>,
    /// Use the limits and masses of this arm, TOML or URDF.
    ///
    /// Default: the arm of the controller, or the built-in arm if the controller cannot report its arm
    #[arg(long, env = "JTC_ARM", value_name = "FILE")]
    pub arm: Option<PathBuf>,
    /// Order joints by the numbers in their names.
    ///
    /// Use this option for a file of --trajectory that names the joints of another arm
    #[arg(long)]
    pub joints_by_number: bool,
    #[command(flatten)]
    pub execute: ExecuteArgs,
}

/// Options of every command that executes a motion.
#[derive(Args, Clone, Debug)]
pub(crate) struct ExecuteArgs {
    /// Set the reaction of the agent if this program disconnects.
    ///
    /// If this program is killed or loses its connection to the agent, the motion continues, pauses or stops. Default:
    /// continue. This option needs an agent (`jtc serve`)
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
pub(crate) struct RunFiles {
    /// Record the motion to this .mcap or .csv file
    #[arg(long, env = "JTC_RUN_RECORD", value_name = "FILE")]
    pub record: Option<PathBuf>,
    /// Write the report page to this .html file.
    ///
    /// After several runs, the page shows only the last run
    #[arg(long, env = "JTC_RUN_REPORT", value_name = "FILE")]
    pub report: Option<PathBuf>,
    #[command(flatten)]
    pub overwrite: OverwriteArgs,
}

/// `jtc teach …`
#[derive(Debug, Subcommand)]
pub(crate) enum TeachCommand {
    /// Start teaching, so that you can move the arm by hand
    #[command(
        after_help = "During teaching, the controller compensates gravity and a part of the friction, \
        and damps the motion. The controller does not move the arm back to an earlier position.\n\n\
        Examples:\n  \
        jtc teach on"
    )]
    On(LinkArgs),
    /// End teaching, and hold the pose
    #[command(after_help = "Examples:\n  jtc teach off")]
    Off(LinkArgs),
    /// Record a motion by hand as a trajectory, until Ctrl-C
    #[command(
        after_help = "The command writes the file while you move the arm by hand. If the program is killed, \
            the file contains the motion up to that time. If the disk is full, the recording ends at once, \
            and the controller holds the arm. The exit code is then 5.\n\n\
            With --waypoints, the command writes a waypoint file for `jtc plan`, with as few waypoints as \
            possible. All recorded positions are within --tolerance of the straight lines between the \
            waypoints. The command selects the waypoints when the recording ends. During the recording, the \
            file contains all positions of the motion.\n\n\
            Examples:\n  \
            jtc teach record motion.csv\n  \
            jtc teach record motion.csv --duration 20\n  \
            jtc teach record waypoints.csv --waypoints --tolerance 0.02"
    )]
    Record {
        /// Trajectory file to write, CSV
        file: PathBuf,
        #[command(flatten)]
        overwrite: OverwriteArgs,
        #[command(flatten)]
        link: LinkArgs,
        /// End after this time, s
        #[arg(long, value_name = "S")]
        duration: Option<f64>,
        /// Write waypoints instead of the motion
        #[arg(long)]
        waypoints: bool,
        /// Set the tolerance of the waypoints, rad (default 0.01).
        ///
        /// The tolerance is the largest distance of a joint between the recorded motion and the straight lines between the
        /// waypoints
        #[arg(long, value_name = "RAD", requires = "waypoints")]
        tolerance: Option<f64>,
    },
}

impl ExecuteArgs {
    /// Returns the policy for the loss of the client, which is `continue`, `pause` or `stop`. Returns `None` if the
    /// user has not selected a policy.
    pub(crate) fn policy(&self) -> Option<&'static str> {
        ["continue", "pause", "stop"].into_iter().find(|word| self.when_gone.as_deref() == Some(word))
    }
}
