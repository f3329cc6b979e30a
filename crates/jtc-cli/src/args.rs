//! The command line: commands, options, their environment variables and examples. The options of each group of commands are in a
//! file of their own.

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

pub use arm::{ArmCommand, ImportArgs};
pub use bench::BenchCommand;
pub use firmware::{FirmwareCommand, FlashArgs, ImageArgs};
pub use log::LogCommand;
pub use maintain::{ClearArgs, GripperArgs, JogArgs, MonitorArgs, RecoverArgs, ResetArgs, Switch};
pub use motion::{CheckArgs, ContinueArgs, ExecuteArgs, ResumeArgs, RunArgs, TeachCommand, TrajCommand};
pub use offline::{DynamicsArgs, DynamicsKind, ExampleArgs, ExplainArgs, HelpArgs, ReportArgs};
pub use params::{AcceptArgs, FrictionKind, ParamsCommand};
pub use payload::PayloadCommand;
pub use plan::{MoveArgs, PlanArgs, PoseCommand, Target};
pub use serve::ServeArgs;
pub use sim::{DemoArgs, SimArgs, SimSpeed, SimSupport};
pub use variables::VARIABLES;

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
                  With --json the result is on stdout; commands that take their time send events to stderr: `jtc help events`.\n\
                  --json, --port and --baud may stand before or after the command.\n\
                  Options that name a place, a file or a format can be set by environment variables, see `jtc COMMAND --help`.\n\
                  Exit codes: 0 done, 1 the controller reported an error, 2 wrong usage or unreadable input,\n\
                  3 no link, 4 refused by a check (nothing was sent or moved), 5 fault while running.",
    max_term_width = 100,
    propagate_version = true,
    disable_help_subcommand = true
)]
pub struct Cli {
    /// Print one JSON object (streams: one a line) instead of text
    #[arg(long, global = true, env = "JTC_JSON", value_parser = on_off, help_heading = "Common")]
    pub json: bool,
    /// Serial port, for commands that have one; it may stand before the command, too
    #[arg(long, global = true, hide = true, value_name = "PATH")]
    pub port: Option<String>,
    /// Rate of the port, likewise
    #[arg(long, global = true, hide = true, value_name = "N",
          value_parser = clap::value_parser!(u32).range(300..=15_000_000))]
    pub baud: Option<u32>,
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// Which controller.
#[derive(Args, Clone, Debug)]
pub struct LinkArgs {
    /// Serial port, or http://HOST:PORT of an agent; default: the only port found
    #[arg(long, env = "JTC_PORT", value_name = "PATH", help_heading = "Link")]
    pub port: Option<String>,
    /// Token file of the agent; default: that of an agent of this computer
    #[arg(long, env = "JTC_TOKEN_FILE", value_name = "FILE", help_heading = "Link")]
    pub token_file: Option<std::path::PathBuf>,
    /// Certificates, PEM, that an agent at https:// is trusted by; default: its own where it runs on this computer, else those of the system
    #[arg(long, env = "JTC_TLS_CA", value_name = "FILE", help_heading = "Link")]
    pub tls_ca: Option<std::path::PathBuf>,
    /// Rate of the port, Bd
    #[arg(long, env = "JTC_BAUD", value_name = "N", default_value_t = 115_200, help_heading = "Link",
          value_parser = clap::value_parser!(u32).range(300..=15_000_000))]
    pub baud: u32,
}

/// Files that are there already.
#[derive(Args, Clone, Copy, Debug)]
pub struct OverwriteArgs {
    /// Write over output files that are there already
    #[arg(long, alias = "force")]
    pub overwrite: bool,
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
                            jtc sim --serial /tmp/jtc --faults faults.toml\n  \
                            jtc sim --serial /tmp/jtc --record sim.mcap\n  \
                            jtc sim --serial /tmp/jtc --support stand --gear-stiffness 20000\n\n\
                            --record takes up to 40 MB a minute as .mcap, 50 MB as .csv, and is opened before anything runs. The file can be\n\
                            read while it grows, and after a killed simulator up to its last 0.2 s. If the disk is full, that is reported at\n\
                            once, the simulation goes on, and ends with exit code 5.\n\nLines on the standard input are \
                            events:\n  push 3 12 0.5    joint 3 (counted from 1) is pushed by 12 N·m for 0.5 s\n  \
                            hand lead.csv    a hand leads the arm along the positions of a trajectory file while it is taught"
    )]
    Sim(SimArgs),
    /// Own the port for all clients: many look, one at a time commands, and everyone can stop
    #[command(
        after_help = "Every other command goes through the agent with --port http://…, and by itself where its port is the one that an\n\
                            agent of this user owns. Reading, stopping and pausing need no token on this computer; commanding needs the\n\
                            operator's token of the token file, which only its owner can read.\n\n\
                            Examples:\n  jtc serve --sim\n  jtc serve --port /dev/ttyUSB0\n  jtc status --port http://127.0.0.1:8780\n  \
                            curl -X POST http://127.0.0.1:8780/api/stop\n  jtc serve --sim --record recordings --record-limit 500MB\n\n\
                            --record writes each motion into a file of its own, NAME.part.mcap until it is over and NAME.mcap then; both are\n\
                            readable at any time. A full disk never holds up a command: that is reported, and recording goes on when there is room."
    )]
    Serve(ServeArgs),
    /// Serial ports found, and why one cannot be used
    #[command(after_help = "Examples:\n  jtc ports\n  jtc --json ports")]
    Ports,
    /// What is wrong with link, bus and set-up, with the next command
    #[command(after_help = "Examples:\n  jtc doctor\n  jtc doctor --port /dev/ttyUSB0")]
    Doctor(LinkArgs),
    /// One decoded status
    #[command(after_help = "Examples:\n  jtc status\n  jtc --json status | jq .joints[0].position_rad")]
    Status(LinkArgs),
    /// Who the controller is: firmware, arm in use, what is missing, why it started last
    #[command(
        after_help = "The hash is that of all that decides how the arm moves: model, gains, friction, settings. On a device without\n\
                            extensions only what a status carries is shown.\n\nExamples:\n  jtc info\n  jtc --json info | jq -r .hash"
    )]
    Info(LinkArgs),
    /// Live view of the controller and the joints
    #[command(
        after_help = "On a terminal of at least 40 columns and 12 rows; s stops a motion on its path, arrows, PageUp, PageDown, Home\n\
                            and End scroll, q ends. What is wrong and the next command stand first.\n\nExamples:\n  jtc monitor\n  jtc --json monitor --count 100 > statuses.jsonl"
    )]
    Monitor(MonitorArgs),
    /// Arm files
    #[command(subcommand)]
    Arm(ArmCommand),
    /// Friction, gains and arm model
    #[command(subcommand)]
    Params(ParamsCommand),
    /// Work on a bench: joints that are not there
    #[command(subcommand)]
    Bench(BenchCommand),
    /// Firmware of the controller's boards: what is installed, putting it onto a board, proving what runs
    #[command(subcommand)]
    Firmware(FirmwareCommand),
    /// What the arm carries at its flange
    #[command(subcommand)]
    Payload(PayloadCommand),
    /// Plan a motion through waypoints, as fast as the limits allow; nothing is sent
    #[command(
        after_help = "A waypoint file is CSV with the columns q1..q6 (rad) or q1_deg..q6_deg, `pose` (a name from the arm file), or\n\
                            x,y,z (m) with qx,qy,qz,qw or roll,pitch,yaw of the flange, and `t` (s) where times are given; or JSON with\n\
                            the same keys: `jtc help files`. The arm stops at each waypoint; --blend rounds\n\
                            the corners where that is faster than a stop. Legs are straight in joint space; with --line, or where the column\n\
                            `leg` asks for it, the flange keeps to straight lines and arcs, and --blend-m rounds their corners.\n\
                            Limits are those of velocity and acceleration (98 % of them), torque by the arm model less --margin, and\n\
                            jerk (the highest acceleration within 100 ms). What comes out passed the check of `jtc traj check`.\n\
                            The margin is for masses and friction that the model does not know. Where gravity and friction leave less of a limit,\n\
                            the motion uses a quarter of what they leave, and a note names the joint. A margin below 10 % is warned of.\n\nExamples:\n  \
                            jtc plan waypoints.csv -o cycle.csv\n  jtc plan waypoints.csv -o cycle.csv --blend 0.1 --speed 50 --report cycle.html\n  \
                            jtc plan poses-of-flange.csv -o lines.csv --line --blend-m 0.02\n  \
                            jtc plan cycle.json --arm my-arm.toml -o cycle.csv --payload 2,0,0,0.08"
    )]
    Plan(PlanArgs),
    /// Move to joint positions, a pose of the arm file or one of the flange, from where the arm is
    #[command(
        after_help = "Straight in joint space, or with --line so that the flange keeps to a straight line, within the limits of velocity,\n\
                            acceleration, jerk and torque, checked before anything is sent; nobody looks for obstacles. It runs and ends as\n\
                            `jtc traj run` does: on a terminal space pauses and resumes, s stops, + and - change the speed; Ctrl-C stops on the path.\n\
                            --margin is that of `jtc plan`.\n\nExamples:\n  \
                            jtc move --to home --arm my-arm.toml\n  jtc move --to 0,0.5,-1,0,0.5,0\n  \
                            jtc move --to 0,30,-60,0,30,0 --deg --speed 20\n  jtc move --to-flange 0.6,0.3,0.4,0,0,0 --line --speed 20"
    )]
    Move(MoveArgs),
    /// Named positions in the arm file
    #[command(subcommand)]
    Pose(PoseCommand),
    /// Stop on the path and end the execution
    #[command(after_help = motion::STOP_EXAMPLES, aliases = ["halt", "estop", "e-stop", "abort"])]
    Stop(LinkArgs),
    /// Check, upload, execute, follow, report
    #[command(after_help = motion::RUN_EXAMPLES)]
    Run(RunArgs),
    /// Trajectories: check, run, pause, resume, stop
    #[command(subcommand)]
    Traj(TrajCommand),
    /// Teaching: move the arm by hand
    #[command(subcommand)]
    Teach(TeachCommand),
    /// The flight recorder: what happened in the seconds before an error
    #[command(subcommand)]
    Log(LogCommand),
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
    /// Torque off at rest, back to Init: the drives go limp, and the parameters have to be given again
    #[command(
        after_help = "An arm without holding brakes falls: support it first. On a terminal this is asked; --yes answers.\n\n\
                            Examples:\n  jtc disable\n  jtc disable --yes"
    )]
    Disable {
        /// Do not ask: the arm loses its torque
        #[arg(long)]
        yes: bool,
        #[command(flatten)]
        link: LinkArgs,
    },
    /// Move single joints: with keys, or one for as long as the command lives
    #[command(
        after_help = "On a terminal: 1 to 6 select a joint, hold the left or right arrow to move it, up and down change the rate, q ends.\n\
                            The arm begins to stop 0.2 s after the last key, or the last sign of life of this command, and stands within 0.5 s. Joints stop before the\n\
                            ends of their ranges. Only in HoldPos, not beside a paused path.\n\nExamples:\n  jtc jog\n  \
                            jtc jog 3 0.1                  joint 3 at 0.1 rad/s until Ctrl-C\n  jtc jog 3 -5 --deg --duration 2"
    )]
    Jog(JogArgs),
    /// The whole way back to HoldPos, naming each step and whose numbers it uses; resumes no motion
    #[command(
        after_help = "--arm FILE gives friction, gains and arm model of that file to a controller that does not hold the arm, also\n\
                            in place of others that it was given before; where the arm is held, those given before stay, and it is reported.\n\
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
        after_help = "Examples:\n  jtc explain\n  jtc explain start-position-mismatch\n  jtc explain HoldPos\n  jtc explain 8"
    )]
    Explain(ExplainArgs),
    /// Files to try: trajectories, an arm, faults
    #[command(after_help = "Examples:\n  jtc example\n  jtc example motion\n  jtc example arm -o /tmp")]
    Example(ExampleArgs),
    /// The forms of files, or the help of a command
    #[command(
        after_help = "Examples:\n  jtc help files      trajectories, arms, friction, recordings, with an example each\n  \
                            jtc help faults     what can go wrong in the simulator\n  \
                            jtc help events     what a command reports to programs while it works\n  jtc help traj run"
    )]
    Help(HelpArgs),
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
        #[arg(long, env = "JTC_MAN_DIR", value_name = "DIR")]
        out: Option<PathBuf>,
    },
}

/// Words that people try, with the command to use.
pub const MEANT: [(&str, &str); 15] = [
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
    /// It moves the arm, or records a person moving it: its result cannot be had again.
    pub fn moves(&self) -> bool {
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
    use host_kit::{Action, FrontEnd};

    use super::*;

    /// docs/commands-jtc.md; `UPDATE_DOCS=1` writes it again.
    #[test]
    fn the_page_of_the_commands_is_made_from_them() {
        let opening = "Made from the command line's own definition, as `jtc help COMMAND` and the manual pages are. The variable in brackets sets an option \
                       where it is not typed. What commands print when something is wrong: [troubles](troubles.md); what a code means: [codes](codes.md).";
        test_kit::page::whole("commands-jtc.md", &cli_kit::reference::markdown::<Cli>(opening));
    }

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
            }
        }
        walk(&Cli::command(), "jtc");
    }

    /// Words in capitals stand for what a person chooses.
    #[test]
    fn each_command_of_a_next_step_is_there() {
        for action in Action::ALL {
            let name = action.name(FrontEnd::Command);
            let Some(words) = name.strip_prefix("jtc ") else {
                assert!(name.starts_with("--"), "{name} is neither a command nor an option");
                continue;
            };
            let all = Cli::command();
            let mut command = &all;
            for word in words.split(' ').take_while(|word| word.chars().all(|c| c.is_lowercase() || c == '-'))
            {
                let found = match word.strip_prefix("--") {
                    Some(option) => command.get_arguments().any(|arg| arg.get_long() == Some(option)),
                    None => match command.find_subcommand(word) {
                        Some(sub) => {
                            command = sub;
                            true
                        }
                        None => false,
                    },
                };
                assert!(found, "{name}: {word}");
            }
        }
    }
}
