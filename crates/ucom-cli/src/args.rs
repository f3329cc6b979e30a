//! Command line of `ucom`: commands, options, their environment variables and examples.

mod boards;
mod firmware;
mod options;
mod serve;
mod variables;

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use cli_kit::variables::on_off;

pub(crate) use boards::{Assignment, Boards};
pub(crate) use firmware::{Addresses, RepairArgs, UpdateArgs};
pub(crate) use options::*;
pub(crate) use serve::ServeArgs;
pub(crate) use variables::VARIABLES;

/// Command line for motor boards on a CAN bus.
#[derive(Debug, Parser)]
#[command(
    name = "ucom",
    version,
    about = "Number, inspect, update, move and simulate UCoM motor boards",
    after_help = "Examples:\n  \
        ucom sim                                     simulate ten boards of a robot head, and print the bus \
        URL\n  \
        export UCOM_BUS=socketcand:127.0.0.1:29536/can0\n  \
        ucom scan                                    list the boards, without changing them\n  \
        ucom init                                    reset and number all boards, and write an inventory\n  \
        ucom update 3 firmware.hex                   check the image, program board 3, and verify\n  \
        ucom --json info | jq .boards[0].program_id  print one value from the JSON output\n\n\
        Examples of bus URLs are socketcan:can0, slcan:/dev/ttyACM0@1000000, socketcand:HOST:PORT/can0 and \
        multicast:ADDR:PORT.\n\n\
        The chain is the sequence of boards along the init wire. `ucom init` gives each board a number, in \
        the order of the chain. The flash number is a fixed number in the flash memory of a board. The \
        inventory is a file with the numbers, names and flash numbers of all boards.\n\n\
        The exloader is the boot loader of a board. The application is the program that the exloader \
        starts.\n\n\
        Environment variables can set options for buses, addresses, files and formats (see `ucom COMMAND \
        --help`).\n\n\
        Exit codes:\n  \
        0  done\n  \
        1  a board reported an error\n  \
        2  wrong usage or unreadable input\n  \
        3  no answer\n  \
        4  refused by a check (nothing was sent or moved)\n  \
        5  failed while running",
    max_term_width = 100,
    propagate_version = true,
    disable_help_subcommand = true
)]
pub(crate) struct Cli {
    /// Print JSON instead of text.
    ///
    /// A command with continuous output, such as `ucom so`, prints one object per line
    #[arg(long, global = true, env = "UCOM_JSON", value_parser = on_off, help_heading = "Common")]
    pub json: bool,
    #[command(flatten)]
    pub link: LinkArgs,
    /// Command to run.
    #[command(subcommand)]
    pub command: Command,
}

/// Options that select the bus and the profile of its boards.
#[derive(Args, Clone, Debug)]
pub(crate) struct LinkArgs {
    /// Use this bus, for example socketcan:can0.
    ///
    /// Another example is socketcand:127.0.0.1:29536/can0
    #[arg(long, global = true, env = "UCOM_BUS", value_name = "URL", help_heading = "Common")]
    pub bus: Option<String>,
    /// Use this profile, TOML.
    ///
    /// A profile describes how the boards interpret the protocol. `ucom help profile` shows the format. `ucom probe`
    /// measures the boards, and writes a profile
    #[arg(long, global = true, env = "UCOM_PROFILE", value_name = "FILE", help_heading = "Common")]
    pub profile: Option<PathBuf>,
    /// Use this signal table, TOML.
    ///
    /// The table contains type, scale and unit of inputs, outputs and parameters (see `ucom help edges`). Default:
    /// ucom-edges.toml, if this file exists
    #[arg(long, global = true, env = "UCOM_EDGES", value_name = "FILE", help_heading = "Common")]
    pub edges: Option<PathBuf>,
}

/// Option that overrides the checks of the bus.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct ForceArgs {
    /// Continue even if a check of the bus fails.
    ///
    /// The command checks that no other PC controls the bus, that the boards do not run, and that the bus load is not
    /// too high
    #[arg(long)]
    pub force: bool,
}

/// Option for existing output files.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct OverwriteArgs {
    /// Overwrite existing output files
    #[arg(long)]
    pub overwrite: bool,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Simulate a chain of boards on a bus for other programs
    #[command(after_help = "Examples:\n  \
            ucom sim\n  \
            ucom sim --boards 5 --flash-ids 0x21,0x42,0x63,0x04,0x7F --listen 127.0.0.1:0\n  \
            ucom sim --chain head.toml --faults faults.toml --seed 7\n\n\
            `ucom help sim` shows the format of chain files, and `ucom help faults` shows the format of fault \
            files.")]
    Sim(SimArgs),
    /// List the boards on the bus, without changing them
    #[command(after_help = "The command only sends queries. Queries do not change the state of a board.\n\n\
        Examples:\n  \
        ucom scan\n  \
        ucom --json scan | jq '.boards | length'")]
    Scan,
    /// Reset and number all boards, and write an inventory
    #[command(after_help = "The command numbers the boards in the order of the chain.\n\n\
        Examples:\n  \
        ucom init\n  \
        ucom init --inventory head.toml\n\n\
        If the inventory already exists, the command compares the boards with it. If the position of a board \
        differs from the inventory, the command reports an error. If you have changed the chain, use \
        --renew.")]
    Init(InitArgs),
    /// Show flash number, program and status of boards
    #[command(after_help = "Examples:\n  ucom info\n  ucom info 3\n  ucom --json info 1-4")]
    Info(BoardsArgs),
    /// Show, set or clear status bits
    #[command(after_help = "Examples:\n  \
        ucom status\n  \
        ucom status 2 --set ASTART\n  \
        ucom status all --clear OPINIT,ASTART\n  \
        ucom status 1 --raw 00:40\n\n\
        The bits are MSTART ASTART MCARUN EXLRUN INIT PROG OPINIT IPINIT. You cannot set MCARUN, EXLRUN and \
        IPINIT. `ucom explain BIT` explains a bit.\n\n\
        --raw sends one PC_SETSTATUS frame unchanged. The board computes its new status as (old & ~MASK) | \
        VALUE. Therefore, the board also sets the bits of VALUE that are outside MASK. The command sends the \
        frame only once. With `all`, it sends one broadcast frame. The command shows the expected status and \
        the actual status. If they differ, the exit code is 1. For running boards, you must use --force.")]
    Status(StatusArgs),
    /// Reset boards (outputs become safe; boards lose their number)
    #[command(after_help = "Examples:\n  \
            ucom reset          reset all boards; `ucom init` numbers them again\n  \
            ucom reset 2")]
    Reset(ResetArgs),
    /// Restart boards in the boot loader, ready for programming
    #[command(after_help = "The command stops the applications of the boards, and starts the boot loader \
        (exloader). Programming is enabled (status bit PROG).\n\n\
        Examples:\n  \
        ucom xreset 2\n  \
        ucom xreset all")]
    Xreset(ActArgs),
    /// Start the application of boards, without moving motors
    #[command(after_help = "A started application does not move motors. To move motors, use `ucom run \
        --active`.\n\n\
        Examples:\n  \
        ucom start all\n  \
        ucom start 1,3")]
    Start(ActArgs),
    /// Stop control loop and application of boards
    #[command(after_help = "Examples:\n  ucom stop all\n  ucom stop 2 --control-only")]
    Stop(StopArgs),
    /// Program boards, and verify the result
    #[command(
        after_help = "The command checks the image, and transfers it twice. With the default profile, the \
            board only checks the image during the first transfer. During the second transfer, it erases its \
            flash, writes the image and reads it back. Then the command verifies the result.\n\n\
            Examples:\n  \
            ucom update 3 firmware.hex --flash-id 0x63\n  \
            ucom update all firmware.bin --start\n  \
            ucom update 1-4 firmware.s19 --dry-run\n  \
            ucom update 1-4 firmware.hex --group\n  \
            ucom update 3 app.hex --exloader loader.hex\n  \
            ucom update 3 program.hex --data data.hex\n  \
            ucom update 3 raw.bin --expect-program-id 0x4B3F\n\n\
            Image formats are raw binary, Intel HEX and Motorola S-record. The command recognises Intel HEX \
            and S-records from the content of the file. Raw binary needs a .bin file, or --raw. The unit of \
            the addresses in records is bytes or words. If the records are without gaps in only one of these \
            units, the command uses this unit. You can set the unit with --addresses. For boards that need \
            two files, set the key `prog.plan` of the profile (see `ucom help profile`).\n\n\
            `all` means the boards that answer and the boards of the inventory. The inventory must contain \
            each board that answers. The command reports each board of the inventory that does not \
            answer.\n\n\
            A board reports only the Program ID (a checksum) and the flash date of its program. Therefore, \
            the command also writes a record of each update to the inventory. A board is up-to-date if it \
            reports the Program ID of the image, and its record contains the same bytes and the same load \
            address. With --date, the flash date must also be the same.\n\n\
            A board is program-up-to-date if it reports the Program ID of the image, but the inventory does \
            not contain a valid record. The command then does not program the board, and the exit code is 4. \
            To write the image, use --rewrite. To accept this state with exit code 0, use --unverified. If \
            the record contains other bytes or another address, the command writes the image. With --data, \
            --exloader or --second, the command always writes the image.\n\n\
            Exit codes:\n  \
            0  verified, already up to date, or accepted by --unverified\n  \
            1  the board reported an error before the flash was erased\n  \
            3  no answer\n  \
            4  refused, program-up-to-date, or cancelled before the flash was erased\n  \
            5  failed or cancelled after the flash was erased, or written but not verified\n\n\
            With some profiles, the command cannot verify the image after the write. If the bus fails before \
            the flash is erased, the exit code is 3. If the bus fails later, the exit code is 5.\n\n\
            The report contains one of these outcomes for each board: not-started, cancelled, up-to-date, \
            program-up-to-date, incomplete, unknown, written, verified or running."
    )]
    Update(UpdateArgs),
    /// Restore the number of one board that has lost its number
    #[command(after_help = "The command does not reset the other boards.\n\n\
        Examples:\n  \
        ucom repair 3\n  \
        ucom repair 3 --flash-id 0x63\n\n\
        Only a board with an active incoming init pin can take a number. During the repair, the command \
        keeps only the outgoing pin of the previous board active. The command switches off the outgoing pins of all \
        other boards. Therefore, only the board to repair can take the number. The board must have the flash \
        number from --flash-id or from the inventory.\n\n\
        Exit codes:\n  \
        0  done\n  \
        2  the flash number of the board is not known\n  \
        3  no answer\n  \
        4  another board is at this position, could take the number, or took the number")]
    Repair(RepairArgs),
    /// Show names of inputs, outputs and parameters
    #[command(after_help = "If the application of a board is started, the command also shows the initial \
            inputs.\n\n\
            Examples:\n  \
            ucom io 1\n  \
            ucom --json io all\n  \
            ucom io 1 --fresh\n  \
            ucom io all --template ucom-edges.toml\n\n\
            A signal table contains type, scale and unit of each signal. The template is a first version \
            with default values. Edit it, and use it with --edges (see `ucom help edges`).")]
    Io(IoArgs),
    /// Show initial controller inputs, or set inputs by name
    #[command(after_help = "Examples:\n  \
            ucom ci 1\n  \
            ucom ci 1 set_position=1500\n  \
            ucom ci 1 set_position=1500 --for 3\n\n\
            With --for, the command starts the board, and supervises it for this time. The motors of the \
            board move. For more options, use `ucom run`.")]
    Ci(CiArgs),
    /// Show the names of parameters, or set parameters by name
    #[command(after_help = "Examples:\n  \
            ucom par 1\n  \
            ucom par 1 kp=120 current_max=1500\n  \
            ucom par all --save head.yaml\n  \
            ucom par --apply head.yaml --dry-run\n  \
            ucom par 1-3 --apply head.yaml\n\n\
            The protocol cannot read parameters from a board. Therefore, the command shows values that it \
            has just written as `assumed`. The command also shows the value that this tool wrote last, with \
            its date. `ucom help params` shows the format of parameter files.")]
    Par(ParArgs),
    /// Show live sensor outputs of running boards
    #[command(after_help = "The command first sends queries to find the boards and the names of their \
            outputs. Then it only listens. The values come from boards that `ucom run` or another PC has \
            started. `ucom decode --live` sends nothing at all.\n\n\
            Examples:\n  \
            ucom so 1\n  \
            ucom so 1 --count 100 --csv > so.csv\n  \
            ucom --json so all --count 10")]
    So(SoArgs),
    /// Start and supervise boards until Ctrl-C
    #[command(after_help = "Examples:\n  \
            ucom run all\n  \
            ucom run 1,2 --active --ci 1.set_position=1500\n  \
            ucom run all --params head.yaml --active\n\n\
            The command accepts these lines on stdin: `ci 1 set_position=-500`, `par 1 kp=80`, `active on`, \
            `active off`, `stop`.\n\n\
            Ctrl-C stops all control loops at once. Then it stops the applications, from the last board to \
            the first. If all boards have left their control loops, the run ends after 3 s with exit code 5. \
            With --on-lost report, the run does not end while a board is lost.")]
    Run(RunArgs),
    /// Share the bus among many clients by HTTP
    #[command(after_help = "The command runs an agent: an HTTP server that forwards the requests of its \
        clients to the boards. Only one client at a time can move or change boards. Every client can stop \
        the boards.\n\n\
        Examples:\n  \
        ucom serve --bus socketcan:can0\n  \
        ucom serve --sim --boards 3\n  \
        curl http://127.0.0.1:8781/api/boards\n  \
        curl -X POST http://127.0.0.1:8781/api/stop\n\n\
        The other `ucom` commands do not use the agent. If they use the bus of an agent, they report that \
        another PC controls the bus.\n\n\
        Ctrl-C stops all boards that the agent has started, and ends the agent.\n\n\
        Exit codes:\n  \
        0  ended\n  \
        2  the address or a file cannot be used\n  \
        3  the bus was lost")]
    Serve(ServeArgs),
    /// Show a live view of boards, bus load and other frames
    #[command(after_help = "The command sends one query (PC_INFO) to each board, and then only listens.\n\n\
        Examples:\n  \
        ucom monitor\n  \
        ucom --json monitor --count 5\n\n\
        Press s to stop the control loops of all boards. Press r to query the boards again. Press q to quit. \
        The arrow keys, PageUp, PageDown, Home and End scroll the view. The terminal needs at least 40 \
        columns and 12 rows.\n\n\
        A wide terminal shows the names of the status bits. A narrow terminal shows each bit as a letter, or \
        as a dot if the bit is not set. The letters are:\n  \
        M MSTART, A ASTART, R MCARUN, X EXLRUN, I INIT, P PROG, o OPINIT, i IPINIT")]
    Monitor(MonitorArgs),
    /// Record the frames of the bus to a file
    #[command(after_help = "Examples:\n  \
            ucom record bus.log\n  \
            ucom record bus.mcap --for 10\n  \
            ucom record - | ucom decode -\n\n\
            The ending of the file name selects the format. Use .log for the format of `candump -L`, .fzi \
            for FZI-CAN 1.2, or .mcap for MCAP. With `-`, the command writes a candump log to stdout.")]
    Record(RecordArgs),
    /// Send the frames of a recording with their original timing
    #[command(after_help = "Examples:\n  \
        ucom replay bus.log\n  \
        ucom replay bus.log --intrusive\n\n\
        Without --intrusive, the command skips all frames that change boards or keep them running. For \
        example, these frames reset, number, program, start or move boards.")]
    Replay(ReplayArgs),
    /// Send single frames unchanged
    #[command(after_help = "Examples:\n  \
            ucom send 240#                     ask all boards to report (PC_REPORT)\n  \
            ucom send 1C1#0202 201# --intrusive\n\n\
            The command sends the frames in the order of the command line. Frames that change boards or keep \
            them running need --intrusive. If the list contains such a frame, and you do not use \
            --intrusive, the command sends nothing and ends with exit code 4. To see the answers of boards, \
            run `ucom decode --live` in another terminal.")]
    Send(SendArgs),
    /// Decode frames of a file, stdin or the live bus
    #[command(
        after_help = "Examples:\n  ucom decode bus.log\n  echo '141#2100011934126E38' | ucom decode -\n  ucom decode --live"
    )]
    Decode(DecodeArgs),
    /// Measure how boards interpret the protocol; write a profile
    #[command(
        after_help = "Examples:\n  ucom probe\n  ucom probe --init --out boards.toml\n  ucom probe --image firmware.hex"
    )]
    Probe(ProbeArgs),
    /// Test that boards follow the protocol
    #[command(after_help = "Examples:\n  \
            ucom conformance\n  \
            ucom conformance 1 --run\n  \
            ucom conformance 1 --flash-id 0x21 --program firmware.hex\n  \
            ucom --json conformance all --init --only D-T1,D-T4\n\n\
            Without options, the command only sends queries. Queries do not change boards, and do not \
            disturb running applications. For each test, the command shows the frames that it sent, the \
            expected result and the actual result.\n\n\
            With --init, --run or --program, the command restores the boards afterwards, even after Ctrl-C \
            or an error. The command restores the numbers and the status bit ASTART. The command also starts \
            the applications again, with the parameters that they have after a start. --run takes about 80 s \
            per board.\n\n\
            Exit codes:\n  \
            0  all tests passed or were skipped\n  \
            1  a test failed, or the command could not restore a board\n  \
            3  a board does not answer\n  \
            4  refused by a check\n  \
            5  cancelled")]
    Conformance(ConformanceArgs),
    /// Find faults of bus, chain and boards; suggest a next command
    #[command(after_help = "Examples:\n  ucom doctor\n  ucom --json doctor")]
    Doctor,
    /// Explain a status bit, a state, an error or an event
    #[command(
        after_help = "Examples:\n  ucom explain\n  ucom explain OPINIT\n  ucom explain DSP_ERROR_FLASH\n  ucom explain left-loop"
    )]
    Explain(ExplainArgs),
    /// Write a DBC file (CAN database) for other CAN tools
    #[command(after_help = "The file contains the names of inputs, outputs and parameters of the boards. \
        With `none`, it contains only the messages of the protocol.\n\n\
        Examples:\n  \
        ucom dbc --out chain.dbc\n  \
        ucom dbc 1-4 > chain.dbc\n  \
        ucom dbc none > messages.dbc")]
    Dbc(DbcArgs),
    /// Show a help page about file formats
    #[command(
        after_help = "The pages are about profiles, signal tables, parameter files, simulated chains and faults.\n\n\
        Examples:\n  \
        ucom help profile\n  \
        ucom help params\n  \
        ucom help faults"
    )]
    Help {
        /// Page to show.
        ///
        /// Without a page, the command shows the help of `ucom`
        topic: Option<Topic>,
    },
    /// Print shell completions to stdout
    #[command(
        after_help = "Examples:\n  ucom completions bash > ~/.local/share/bash-completion/completions/ucom"
    )]
    Completions {
        /// Shell to print completions for
        shell: clap_complete::Shell,
    },
    /// Write manual pages, one file per command
    #[command(after_help = "Examples:\n  ucom man --out ~/.local/share/man/man1")]
    Man {
        /// Write the pages to this directory.
        ///
        /// Without this option, the command prints the main page to stdout
        #[arg(long, env = "UCOM_MAN_DIR", value_name = "DIR")]
        out: Option<PathBuf>,
    },
}

impl Command {
    /// Returns `true` if the command changes boards. If the result of a command that changes boards cannot be printed,
    /// the error is a fault of the run, not of the command line.
    pub(crate) fn acts(&self) -> bool {
        match self {
            Self::Init(_)
            | Self::Reset(_)
            | Self::Xreset(_)
            | Self::Start(_)
            | Self::Stop(_)
            | Self::Repair(_)
            | Self::Run(_)
            | Self::Replay(_)
            | Self::Send(_)
            | Self::Conformance(_) => true,
            Self::Status(args) => args.set.is_some() || args.clear.is_some() || args.raw.is_some(),
            Self::Update(args) => !args.dry_run,
            Self::Ci(args) => !args.values.is_empty() || args.duration.is_some(),
            Self::Par(args) => !args.values.is_empty() || (args.apply.is_some() && !args.dry_run),
            Self::Probe(args) => args.init || args.alive,
            _ => false,
        }
    }
}

/// Pages of `ucom help`.
#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
pub(crate) enum Topic {
    /// Profile files.
    Profile,
    /// Simulated chains.
    Sim,
    /// Fault files.
    Faults,
    /// Signal tables: types, scales and units of process data.
    #[value(name = "edges")]
    Signals,
    /// Parameter files.
    Params,
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    /// Compares docs/commands-ucom.md with the command line; with `UPDATE_DOCS=1`, writes docs/commands-ucom.md.
    #[test]
    fn the_page_of_the_commands_is_made_from_them() {
        let opening = "This page is generated from the definition of the command line, like `ucom COMMAND --help` and the manual pages. The \
                       variable in brackets sets an option that you do not type. [Troubles](troubles.md) shows the messages of \
                       commands about faults, and [codes](codes.md) explains each word.";
        test_kit::page::whole("commands-ucom.md", &cli_kit::reference::markdown::<Cli>(opening));
    }

    #[test]
    fn each_command_of_a_next_step_is_there() {
        cli_kit::testing::check_commands_of_next_steps(&Cli::command());
    }

    #[test]
    fn the_command_line_is_sound_and_has_an_example_for_each_command() {
        Cli::command().debug_assert();
        cli_kit::testing::check_help_is_wrapped_once(&Cli::command());
        for sub in Cli::command().get_subcommands() {
            let help = sub.get_after_help().map(ToString::to_string).unwrap_or_default();
            assert!(help.contains("Examples:"), "{} has no example", sub.get_name());
        }
    }
}
