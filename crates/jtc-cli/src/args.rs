//! Command line of `jtc`, with commands, options, environment variables and examples. Each group of commands has a separate file for its
//! options.

mod arm;
mod bench;
mod firmware;
mod log;
mod maintain;
mod motion;
mod offline;
mod params;
mod payload;
mod plan;
mod serve;
mod sim;
mod variables;

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};
use cli_kit::variables::on_off;

pub(crate) use arm::{ArmCommand, ImportArgs};
pub(crate) use bench::BenchCommand;
pub(crate) use firmware::{FirmwareCommand, FlashArgs, ImageArgs};
pub(crate) use log::LogCommand;
pub(crate) use maintain::{ClearArgs, GripperArgs, JogArgs, MonitorArgs, RecoverArgs, ResetArgs, Switch};
pub(crate) use motion::{
    CheckArgs, ContinueArgs, ExecuteArgs, ResumeArgs, RunArgs, TeachCommand, TrajCommand,
};
pub(crate) use offline::{DynamicsArgs, DynamicsKind, ExampleArgs, ExplainArgs, HelpArgs, ReportArgs};
pub(crate) use params::{AcceptArgs, FrictionKind, ParamsCommand};
pub(crate) use payload::PayloadCommand;
pub(crate) use plan::{MoveArgs, PlanArgs, PoseCommand, Target};
pub(crate) use serve::ServeArgs;
pub(crate) use sim::{DemoArgs, SimArgs, SimSpeed, SimSupport};
pub(crate) use variables::VARIABLES;

/// Command line of the joint trajectory controller.
#[derive(Debug, Parser)]
#[command(
    name = "jtc",
    version,
    about = "Simulate, set up, run and monitor a six-axis arm",
    after_help = "Examples:\n  \
        jtc demo                              run a complete example on the built-in simulator\n  \
        jtc sim --serial /tmp/jtc             simulate a controller at a serial port\n  \
        jtc --json status --port /tmp/jtc     print one status as JSON\n  \
        jtc traj run motion.csv --approach    check, upload and execute a trajectory\n\n\
        With --json, a command writes its result to stdout as JSON. Some commands also write events to \
        stderr while they run (see `jtc help events`).\n\n\
        You can write --json, --port and --baud before or after the command.\n\n\
        Environment variables can set options for ports, addresses, files and formats (see `jtc COMMAND \
        --help`).\n\n\
        `jtc explain` explains the states of the controller (for example HoldPos) and all error codes.\n\n\
        `jtc serve` starts an agent. An agent is a server that shares the port of a controller among many \
        programs.\n\n\
        A controller with the protocol extensions of this project reports its firmware, arm and limits. `jtc \
        info` shows whether the controller has these extensions.\n\n\
        Exit codes:\n  \
        0  done\n  \
        1  the controller reported an error\n  \
        2  wrong usage or unreadable input\n  \
        3  no connection to the controller\n  \
        4  refused by a check (nothing was sent or moved)\n  \
        5  fault while running",
    max_term_width = 100,
    propagate_version = true,
    disable_help_subcommand = true
)]
pub(crate) struct Cli {
    /// Print JSON instead of text.
    ///
    /// A command with continuous output, such as `jtc monitor`, prints one object per line
    #[arg(long, global = true, env = "JTC_JSON", value_parser = on_off, help_heading = "Common")]
    pub json: bool,
    /// Set the serial port, before the command
    #[arg(long, global = true, hide = true, value_name = "PATH")]
    pub port: Option<String>,
    /// Set the rate of the port, before the command
    #[arg(long, global = true, hide = true, value_name = "N",
          value_parser = clap::value_parser!(u32).range(300..=15_000_000))]
    pub baud: Option<u32>,
    /// Command to run.
    #[command(subcommand)]
    pub command: Command,
}

/// Options that select the controller.
#[derive(Args, Clone, Debug)]
pub(crate) struct LinkArgs {
    /// Use this serial port, or the agent at http://HOST:PORT.
    ///
    /// Default: the only serial port that the command finds
    #[arg(long, env = "JTC_PORT", value_name = "PATH", help_heading = "Link")]
    pub port: Option<String>,
    /// Use this token file of the agent.
    ///
    /// If the file does not exist, `jtc serve` creates it. Default: the token file of the agent on this computer
    #[arg(long, env = "JTC_TOKEN_FILE", value_name = "FILE", help_heading = "Link")]
    pub token_file: Option<std::path::PathBuf>,
    /// Trust the certificates in this PEM file for https:// agents.
    ///
    /// Default for an agent on this computer: the certificate of this agent. Default for other agents: the certificates
    /// of the operating system
    #[arg(long, env = "JTC_TLS_CA", value_name = "FILE", help_heading = "Link")]
    pub tls_ca: Option<std::path::PathBuf>,
    /// Set the rate of the port, Bd (300 to 15000000)
    #[arg(long, env = "JTC_BAUD", value_name = "N", default_value_t = 115_200, help_heading = "Link",
          value_parser = clap::value_parser!(u32).range(300..=15_000_000))]
    pub baud: u32,
}

/// Option for existing output files.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct OverwriteArgs {
    /// Overwrite existing output files
    #[arg(long, alias = "force")]
    pub overwrite: bool,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Run a complete example on the built-in simulator
    #[command(
        after_help = "The command starts a simulated controller and sends the parameters of the arm. Then it \
        uploads and executes a trajectory, and writes a report.\n\n\
        Examples:\n  \
        jtc demo\n  \
        jtc demo --out /tmp/demo --speed realtime"
    )]
    Demo(DemoArgs),
    /// Simulate a controller, drives and arm at a pseudo-terminal
    #[command(after_help = "Examples:\n  \
        jtc sim --serial /tmp/jtc\n  \
        jtc sim --serial /tmp/jtc --arm my-arm.toml --seed 7\n  \
        jtc sim --serial /tmp/jtc --speed max --no-throttle\n  \
        jtc sim --serial /tmp/jtc --faults faults.toml\n  \
        jtc sim --serial /tmp/jtc --record sim.mcap\n  \
        jtc sim --serial /tmp/jtc --support stand --gear-stiffness 20000\n\n\
        --record writes up to 40 MB per minute as .mcap, or 50 MB per minute as .csv. The simulator opens \
        the file before it starts. You can read the file while the simulator writes it. If the simulator is \
        killed, the last 0.2 s can be missing from the file. If the disk is full, the simulator prints an \
        error at once. The simulation continues, and its exit code at the end is 5.\n\n\
        The simulator reads these commands from stdin, one per line:\n  \
        push 3 12 0.5    push joint 3 (counted from 1) with 12 N·m for 0.5 s\n  \
        hand lead.csv    in Teaching, move the arm along this trajectory file, like a person")]
    Sim(SimArgs),
    /// Share the port of a controller among many clients
    #[command(
        after_help = "The command runs an agent. The agent keeps the port open, and forwards the requests of \
            its clients to the controller. Many clients can read at the same time. Only one client at a time \
            can move the arm or change settings. Every client can stop the arm.\n\n\
            Other commands use the agent with --port http://HOST:PORT. A command also uses the agent if an \
            agent of the same user has opened the serial port of the command.\n\n\
            Clients on this computer can read, stop and pause without a token. All other requests need the \
            operator's token from the token file. Only the owner of this file can read it.\n\n\
            Examples:\n  \
            jtc serve --sim\n  \
            jtc serve --port /dev/ttyUSB0\n  \
            jtc status --port http://127.0.0.1:8780\n  \
            curl -X POST http://127.0.0.1:8780/api/stop\n  \
            jtc serve --sim --record recordings --record-limit 500MB\n\n\
            --record writes each motion to a separate file. During the motion, the name of the file is \
            NAME.part.mcap. After the motion, the name is NAME.mcap. You can read the file at any time. If \
            the disk is full, the agent reports an error, but does not delay any command. The agent records \
            again when the disk has free space."
    )]
    Serve(ServeArgs),
    /// List serial ports, and show why a port cannot be used
    #[command(after_help = "Examples:\n  jtc ports\n  jtc --json ports")]
    Ports,
    /// Find faults of link, bus and setup; suggest the next command
    #[command(after_help = "Examples:\n  jtc doctor\n  jtc doctor --port /dev/ttyUSB0")]
    Doctor(LinkArgs),
    /// Show the present status of the controller
    #[command(after_help = "Examples:\n  jtc status\n  jtc --json status | jq .joints[0].position_rad")]
    Status(LinkArgs),
    /// Show firmware, arm, missing parameters and last boot cause
    #[command(after_help = "The hash is a checksum of all parameters that determine the motion of the arm: \
            model, gains, friction and settings. Controllers with the same hash have the same parameters. A \
            controller without the protocol extensions reports only its status. The command then shows only \
            its state and its missing parameters.\n\n\
            Examples:\n  \
            jtc info\n  \
            jtc --json info | jq -r .hash")]
    Info(LinkArgs),
    /// Show a live view of the controller and the joints
    #[command(after_help = "The terminal needs at least 40 columns and 12 rows. At the top, the view shows \
            problems and the next command to use.\n\n\
            Press s to stop a motion on its path. Press q to quit. The arrow keys, PageUp, PageDown, Home \
            and End scroll the view.\n\n\
            Examples:\n  \
            jtc monitor\n  \
            jtc --json monitor --count 100 > statuses.jsonl")]
    Monitor(MonitorArgs),
    /// Import, check, show and transfer arm files
    #[command(subcommand)]
    Arm(ArmCommand),
    /// Send and show friction, gains and arm model
    #[command(subcommand)]
    Params(ParamsCommand),
    /// Declare joints absent if a bench has only some drives
    #[command(subcommand)]
    Bench(BenchCommand),
    /// List, flash and verify the firmware of the boards
    #[command(subcommand)]
    Firmware(FirmwareCommand),
    /// Set, clear and show the payload at the flange
    #[command(subcommand)]
    Payload(PayloadCommand),
    /// Plan the fastest motion through waypoints; nothing is sent
    #[command(
        after_help = "A waypoint file is CSV, or JSON with the same keys (see `jtc help files`). Define each \
            waypoint by joint positions, by a named pose, or by position and orientation of the flange. The \
            columns are:\n  \
            q1..q6 or q1_deg..q6_deg       joint positions, rad or degrees\n  \
            pose                           name of a pose from the arm file\n  \
            x,y,z                          position of the flange, m\n  \
            qx,qy,qz,qw or roll,pitch,yaw  orientation of the flange, rad\n  \
            leg                            type of the path to this waypoint: joint, line, via or arc\n  \
            t                              time of the waypoint, s (optional)\n\n\
            By default, the arm stops at each waypoint. --blend rounds a corner if a rounded corner is \
            faster than a stop. By default, the path between two waypoints is a straight line in joint \
            space. With --line, or with `line` in the column `leg`, the flange moves along a straight line. \
            With `arc` in the column `leg`, the flange moves along an arc through the previous waypoint. \
            This previous waypoint must have `via` in the column `leg`. --blend-m rounds the corners between \
            lines and arcs.\n\n\
            The motion uses at most 98 % of the limits of velocity and acceleration. The torque of each \
            joint, computed with the arm model, stays below its torque limit minus the margin (--margin). By \
            default, the acceleration needs at least 100 ms to rise from 0 to its limit. The command writes \
            a trajectory only if it passes the check of `jtc traj check`.\n\n\
            The margin is a reserve for masses and friction that the arm model does not contain. If gravity \
            and friction leave less torque than the margin, the motion uses only a quarter of the remaining \
            torque. In this case, the command prints a note with the joint. If the margin is below 10 %, the \
            command prints a warning.\n\n\
            Examples:\n  \
            jtc plan waypoints.csv -o cycle.csv\n  \
            jtc plan waypoints.csv -o cycle.csv --blend 0.1 --speed 50 --report cycle.html\n  \
            jtc plan poses-of-flange.csv -o lines.csv --line --blend-m 0.02\n  \
            jtc plan cycle.json --arm my-arm.toml -o cycle.csv --payload 2,0,0,0.08"
    )]
    Plan(PlanArgs),
    /// Move to joint positions, a named pose or a flange pose
    #[command(
        after_help = "The arm moves from its present position to the target on a straight line in joint \
            space. With --line, the flange moves along a straight line. Before the command sends anything, \
            it checks the limits of velocity, acceleration, jerk and torque. The command does not check for \
            obstacles.\n\n\
            The command executes the motion like `jtc traj run`, with the same report and exit codes. On a \
            terminal, press space to pause and resume, and s to stop. Press + and - to change the speed. \
            Ctrl-C stops the arm on its path. `jtc help plan` explains --margin.\n\n\
            Examples:\n  \
            jtc move --to home --arm my-arm.toml\n  \
            jtc move --to 0,0.5,-1,0,0.5,0\n  \
            jtc move --to 0,30,-60,0,30,0 --deg --speed 20\n  \
            jtc move --to-flange 0.6,0.3,0.4,0,0,0 --line --speed 20"
    )]
    Move(MoveArgs),
    /// Save, list and remove named positions of the arm file
    #[command(subcommand)]
    Pose(PoseCommand),
    /// Stop on the path, and end the motion
    #[command(after_help = motion::STOP_EXAMPLES, aliases = ["halt", "estop", "e-stop", "abort"])]
    Stop(LinkArgs),
    /// Check, upload and execute a trajectory, then report
    #[command(after_help = motion::RUN_EXAMPLES)]
    Run(RunArgs),
    /// Check, run, pause, resume and stop trajectories
    #[command(subcommand)]
    Traj(TrajCommand),
    /// Move the arm by hand, and record its motion
    #[command(subcommand)]
    Teach(TeachCommand),
    /// Read the flight recorder (log of the time before an error)
    #[command(subcommand)]
    Log(LogCommand),
    /// Clear errors of the controller and all nodes
    #[command(after_help = "Examples:\n  jtc clear\n  jtc clear --occurred")]
    Clear(ClearArgs),
    /// Reset drives or the gripper; the arm can lose its torque
    #[command(
        after_help = "If you reset one or more joints, the whole arm loses its torque. During a motion \
            and in Teaching, a reset of joints is refused. After a reset of the gripper alone, the arm keeps \
            its torque. A reset of the gripper switches off the pump.\n\n\
            Examples:\n  \
            jtc reset --joints 3          reset joint 3\n  \
            jtc reset --joints 1,3 --yes  reset joints 1 and 3 without a question\n  \
            jtc reset --gripper\n  \
            jtc reset --all"
    )]
    Reset(ResetArgs),
    /// Switch the vacuum pump of the gripper on or off
    #[command(after_help = "Examples:\n  jtc gripper on\n  jtc gripper off")]
    Gripper(GripperArgs),
    /// Switch off the torque at rest; an arm without brakes falls
    #[command(
        after_help = "An arm without holding brakes falls. Support the arm first. The controller returns to \
            the state Init, and you must send the parameters again. On a terminal, the command first asks \
            for confirmation. With --yes, the command does not ask. Without a terminal, the command needs \
            --yes.\n\n\
            Examples:\n  \
            jtc disable\n  \
            jtc disable --yes"
    )]
    Disable {
        /// Do not ask (the arm loses its torque)
        #[arg(long)]
        yes: bool,
        #[command(flatten)]
        link: LinkArgs,
    },
    /// Jog joints with keys, or one joint at a given velocity
    #[command(
        after_help = "Without JOINT and RATE, use the keys of the terminal. The keys 1 to 6 select a joint. \
            Hold the left or right arrow key to move the selected joint. The up and down arrow keys change \
            the velocity (0.01 to 0.5 rad/s). Press q to quit.\n\n\
            The arm begins to stop at most 0.2 s after the last key press. A terminal repeats the key \
            presses while you hold a key. The arm also begins to stop 0.2 s after the last message of the \
            command, for example if the command is killed. The stop takes at most 0.52 s if the drives have \
            enough torque. Joints stop before their position limits. You can jog only in the state HoldPos, \
            and not while a motion is paused.\n\n\
            Examples:\n  \
            jtc jog\n  \
            jtc jog 3 0.1                  move joint 3 at 0.1 rad/s until Ctrl-C\n  \
            jtc jog 3 -5 --deg --duration 2"
    )]
    Jog(JogArgs),
    /// Bring the controller to HoldPos, and report each step
    #[command(
        after_help = "In the state HoldPos, the controller holds the arm at rest. The command reports the \
            source of the parameters that each step uses. The command does not resume an interrupted \
            motion.\n\n\
            With --arm FILE, the command sends friction, gains and arm model of this file to the controller. \
            These values replace the parameters of the controller. If the controller already holds the arm, \
            the command does not send the file, and the controller keeps its parameters.\n\n\
            With --defaults, the controller uses its default parameters, but only if parameters are missing. \
            The default parameters are the parameters of the stored arm. If the controller has not stored an \
            arm, they are the parameters of the built-in arm. Without --arm and --defaults, the controller \
            keeps its friction, gains and model. If friction, gains or model are missing, the command then \
            refuses the recovery.\n\n\
            Examples:\n  \
            jtc recover\n  \
            jtc recover --arm my-arm.toml\n  \
            jtc recover --defaults"
    )]
    Recover(RecoverArgs),
    /// Compute the dynamics of an arm for each line of stdin
    #[command(
        after_help = "For each line of numbers on stdin, the command prints one line of numbers to stdout. \
            With `inverse`, an input line contains positions q1..q6 (rad), velocities qd1..qd6 (rad/s) and \
            accelerations qdd1..qdd6 (rad/s²). With `forward`, the last six numbers are torques (N·m). With \
            `mass`, the line contains only q1..q6. Results have 17 significant digits.\n\n\
            Examples:\n  \
            echo 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 | jtc dynamics inverse\n  \
            echo 0 0.5 0 0 0 0 | jtc dynamics mass --arm my-arm.urdf"
    )]
    Dynamics(DynamicsArgs),
    /// Explain an error or status code
    #[command(
        after_help = "Examples:\n  jtc explain\n  jtc explain start-position-mismatch\n  jtc explain HoldPos\n  jtc explain 8"
    )]
    Explain(ExplainArgs),
    /// Write example files of trajectories, an arm and faults
    #[command(after_help = "Examples:\n  jtc example\n  jtc example motion\n  jtc example arm -o /tmp")]
    Example(ExampleArgs),
    /// Show the help of a command, or a page about file formats
    #[command(after_help = "Examples:\n  \
            jtc help files      show the formats of trajectories, arms, friction and recordings\n  \
            jtc help faults     show the faults that the simulator can inject\n  \
            jtc help events     show the events that commands report to programs\n  \
            jtc help traj run")]
    Help(HelpArgs),
    /// Decode frames from hex or a raw serial capture on stdin
    #[command(after_help = "Examples:\n  echo 9B 0E 00 06 A3 47 | jtc decode\n  jtc decode < capture.bin")]
    Decode,
    /// Make the report page and picture of a recording
    #[command(
        after_help = "Examples:\n  jtc report run.mcap\n  jtc report run.csv --arm my-arm.toml --out run.html"
    )]
    Report(ReportArgs),
    /// Print shell completions to stdout
    #[command(
        after_help = "Examples:\n  jtc completions bash > ~/.local/share/bash-completion/completions/jtc"
    )]
    Completions {
        /// Shell to print completions for
        shell: clap_complete::Shell,
    },
    /// Write manual pages, one file per command
    #[command(after_help = "Examples:\n  jtc man --out ~/.local/share/man/man1")]
    Man {
        /// Write the pages to this directory.
        ///
        /// Without this option, the command prints the main page to stdout
        #[arg(long, env = "JTC_MAN_DIR", value_name = "DIR")]
        out: Option<PathBuf>,
    },
}

/// Words that users may type by mistake instead of a command, each with the correct command.
pub(crate) const MEANT: [(&str, &str); 15] = [
    ("pause", "jtc traj pause"),
    ("hold", "jtc traj pause"),
    ("resume", "jtc traj resume"),
    ("check", "jtc traj check FILE"),
    ("replay", "jtc traj replay RECORDING"),
    ("continue", "jtc traj continue RUN"),
    ("start", "jtc run FILE"),
    ("execute", "jtc run FILE"),
    ("upload", "jtc run FILE"),
    (
        "home",
        "jtc move --to home --arm FILE` (`jtc pose list` shows the poses of the arm file), or `jtc move --to 0,0,0,0,0,0",
    ),
    ("goto", "jtc move --to Q1,Q2,Q3,Q4,Q5,Q6"),
    ("kill", "jtc stop"),
    ("end", "jtc stop"),
    ("version", "jtc --version"),
    ("connect", "jtc status"),
];

impl Command {
    /// Returns `true` if the command moves the arm or records a motion by hand. The result of such a command cannot be
    /// repeated.
    pub(crate) fn moves(&self) -> bool {
        matches!(
            self,
            Command::Demo(_)
                | Command::Jog(_)
                | Command::Move(_)
                | Command::Run(_)
                | Command::Traj(TrajCommand::Run(_) | TrajCommand::Replay { .. } | TrajCommand::Continue(_))
                | Command::Teach(TeachCommand::Record { .. })
        )
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    /// Compares docs/commands-jtc.md with the definition of the command line. With `UPDATE_DOCS=1`, writes the page
    /// again.
    #[test]
    fn the_page_of_the_commands_is_made_from_them() {
        let opening = "This page is generated from the definition of the command line, like `jtc help COMMAND` and the manual pages. The variable \
                       in brackets sets an option that you do not type. [Troubles](troubles.md) shows the messages of commands about \
                       faults, and [codes](codes.md) explains each code.";
        test_kit::page::whole("commands-jtc.md", &cli_kit::reference::markdown::<Cli>(opening));
    }

    #[test]
    fn the_command_line_is_sound_and_has_an_example_for_each_command() {
        Cli::command().debug_assert();
        cli_kit::testing::check_help_is_wrapped_once(&Cli::command());
        fn walk(command: &clap::Command, path: &str) {
            for sub in command.get_subcommands() {
                let path = format!("{path} {}", sub.get_name());
                if sub.has_subcommands() {
                    walk(sub, &path);
                } else {
                    let help = sub.get_after_help().map(ToString::to_string).unwrap_or_default();
                    assert!(help.contains("Examples:"), "{path} has no example");
                }
            }
        }
        walk(&Cli::command(), "jtc");
    }

    #[test]
    fn each_command_of_a_next_step_is_there() {
        cli_kit::testing::check_commands_of_next_steps(&Cli::command());
    }
}
