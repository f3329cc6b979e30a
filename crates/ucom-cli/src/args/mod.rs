//! The command line: commands, options, their environment variables and examples.

mod boards;
mod firmware;
mod options;
mod serve;
mod variables;

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use cli_kit::variables::on_off;

pub use boards::{Assignment, Boards};
pub use firmware::{Addresses, RepairArgs, UpdateArgs};
pub use options::*;
pub use serve::ServeArgs;
pub use variables::VARIABLES;

/// Motor boards on a CAN bus from your terminal.
#[derive(Debug, Parser)]
#[command(
    name = "ucom",
    version,
    about = "UCoM motor boards on a CAN bus: number, look at, update, move and simulate a chain of them",
    after_help = "Examples:\n  ucom sim                                     a simulated head of ten boards; prints its bus\n  \
                  export UCOM_BUS=socketcand:127.0.0.1:29536/can0\n  \
                  ucom scan                                    who is there; changes nothing\n  \
                  ucom init                                    reset, number the chain, write an inventory\n  \
                  ucom update 3 firmware.hex                   check, program, verify\n  \
                  ucom --json info | jq .boards[0].program_id  for programs\n\n\
                  A bus: socketcan:can0, slcan:/dev/ttyACM0@1000000, socketcand:HOST:PORT/can0, multicast:ADDR:PORT.\n\
                  Options that name a place, a file or a format can be set by environment variables, see `ucom COMMAND --help`.\n\
                  Exit codes: 0 done, 1 a board reported an error, 2 wrong usage or unreadable input, 3 no answer,\n\
                  4 refused by a check (nothing was sent or moved), 5 failed while running.",
    max_term_width = 100,
    propagate_version = true,
    disable_help_subcommand = true
)]
pub struct Cli {
    /// Print one JSON object (streams: one a line) instead of text
    #[arg(long, global = true, env = "UCOM_JSON", value_parser = on_off, help_heading = "Common")]
    pub json: bool,
    #[command(flatten)]
    pub link: LinkArgs,
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// Which bus, and how its boards read the protocol.
#[derive(Args, Clone, Debug)]
pub struct LinkArgs {
    /// The bus, as socketcan:can0 or socketcand:127.0.0.1:29536/can0
    #[arg(long, global = true, env = "UCOM_BUS", value_name = "URL", help_heading = "Common")]
    pub bus: Option<String>,
    /// How the boards read the protocol, TOML; `ucom help profile` shows the form, `ucom probe` makes one
    #[arg(long, global = true, env = "UCOM_PROFILE", value_name = "FILE", help_heading = "Common")]
    pub profile: Option<PathBuf>,
    /// What the words of inputs, outputs and parameters mean, TOML; default: ucom-edges.toml, where it is there; see
    /// `ucom help edges`
    #[arg(long, global = true, env = "UCOM_EDGES", value_name = "FILE", help_heading = "Common")]
    pub edges: Option<PathBuf>,
}

/// Go on where a check of the bus would refuse.
#[derive(Args, Clone, Copy, Debug)]
pub struct ForceArgs {
    /// Go on where a check of the bus would refuse: another PC on it, a running board, bus load
    #[arg(long)]
    pub force: bool,
}

/// Files that are there already.
#[derive(Args, Clone, Copy, Debug)]
pub struct OverwriteArgs {
    /// Write over output files that are there already
    #[arg(long)]
    pub overwrite: bool,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// A simulated chain of boards on a bus that others can join
    #[command(
        after_help = "Examples:\n  ucom sim\n  ucom sim --boards 5 --flash-ids 0x21,0x42,0x63,0x04,0x7F --listen 127.0.0.1:0\n  \
                            ucom sim --chain head.toml --faults faults.toml --seed 7\n\n\
                            `ucom help sim` shows the form of chain files, `ucom help faults` that of fault files."
    )]
    Sim(SimArgs),
    /// Boards on the bus; asks only, changes nothing
    #[command(after_help = "Examples:\n  ucom scan\n  ucom --json scan | jq '.boards | length'")]
    Scan,
    /// Reset all boards, number them along the chain, write an inventory
    #[command(after_help = "Examples:\n  ucom init\n  ucom init --inventory head.toml\n\n\
                            An inventory that is there already is compared: a board in another place is an error.")]
    Init(InitArgs),
    /// What boards report about themselves
    #[command(after_help = "Examples:\n  ucom info\n  ucom info 3\n  ucom --json info 1-4")]
    Info(BoardsArgs),
    /// Status bits: show, set, clear
    #[command(
        after_help = "Examples:\n  ucom status\n  ucom status 2 --set ASTART\n  ucom status all --clear OPINIT,ASTART\n  \
                            ucom status 1 --raw 00:40\n\n\
                            Bits: MSTART ASTART MCARUN EXLRUN INIT PROG OPINIT IPINIT; MCARUN, EXLRUN and IPINIT cannot be set.\n\
                            --raw sends one PC_SETSTATUS as it is: new = (old & ~MASK) | VALUE, so value bits outside the mask\n\
                            are set, too. It is not repeated; `all` is one broadcast frame. What the rules expect of it is\n\
                            shown beside what came of it; another result ends with exit code 1. Running boards: only with --force."
    )]
    Status(StatusArgs),
    /// Reset boards: outputs safe, numbers forgotten
    #[command(
        after_help = "Examples:\n  ucom reset          all boards; `ucom init` numbers them again\n  ucom reset 2"
    )]
    Reset(ResetArgs),
    /// Stop the application and enter the exloader with programming enabled
    #[command(after_help = "Examples:\n  ucom xreset 2\n  ucom xreset all")]
    Xreset(ActArgs),
    /// Start the application of boards; nothing moves before `ucom run`
    #[command(after_help = "Examples:\n  ucom start all\n  ucom start 1,3")]
    Start(ActArgs),
    /// Stop control and application of boards
    #[command(after_help = "Examples:\n  ucom stop all\n  ucom stop 2 --control-only")]
    Stop(StopArgs),
    /// Program boards: check, transfer twice, verify by reading back
    #[command(
        after_help = "Examples:\n  ucom update 3 firmware.hex --flash-id 0x63\n  ucom update all firmware.bin --start\n  \
                            ucom update 1-4 firmware.s19 --dry-run\n  ucom update 1-4 firmware.hex --group\n  \
                            ucom update 3 app.hex --exloader loader.hex\n  ucom update 3 program.hex --data data.hex\n  \
                            ucom update 3 raw.bin --expect-program-id 0x4B3F\n\n\
                            Image formats: raw binary, Intel HEX, Motorola S-record, recognised by their content. What the addresses\n\
                            of records count, bytes or words, is seen from records that follow each other; --addresses names it. Whether two\n\
                            files are sent is the profile's matter: `prog.plan`, see `ucom help profile`.\n\
                            `all` are the boards that answer and those of the inventory: one that is missing is reported.\n\
                            A board shows Program ID and date only, not its load address or other memories. It is up to date if the\n\
                            inventory says, too, that an update wrote the same bytes to the same address; the date may be another one\n\
                            unless --date names it. Without such an entry it is program-up-to-date: nothing is sent, and nothing is\n\
                            verified; --rewrite writes it, --unverified accepts it. With --data, --exloader or --second it is always written.\n\
                            Exit codes: 0 verified, or already up to date (or written where the profile leaves nothing to verify,\n\
                            with --unverified; 5 without it); 1 the board reported an error before anything was erased; 3 no answer;\n\
                            4 refused, program-up-to-date, or cancelled before anything was erased; 5 failed or cancelled after\n\
                            something was erased.\n\
                            A bus that fails is 3 before and 5 after that. The outcome of each board is in the report:\n\
                            not-started, cancelled, up-to-date, program-up-to-date, incomplete, unknown, written, verified or running."
    )]
    Update(UpdateArgs),
    /// Give one board its number back when it no longer answers, without a reset of the others
    #[command(after_help = "Examples:\n  ucom repair 3\n  ucom repair 3 --flash-id 0x63\n\n\
                            The pins of all other boards are low meanwhile, so that none of them can take the number; the flash\n\
                            number must be the one that is named or that the inventory has.\n\
                            Exit codes: 0 done; 2 which board is meant is not known; 3 no answer; 4 another board stands there,\n\
                            could take the number or has taken it.")]
    Repair(RepairArgs),
    /// Names of inputs, outputs and parameters, and initial inputs
    #[command(
        after_help = "Examples:\n  ucom io 1\n  ucom --json io all\n  ucom io 1 --fresh\n  ucom io all --template ucom-edges.toml\n\n\
                            A template begins a signal table: types, scales and units of all names; `ucom help edges`."
    )]
    Io(IoArgs),
    /// Controller inputs by name: show the initial ones, or set some
    #[command(
        after_help = "Examples:\n  ucom ci 1\n  ucom ci 1 set_position=1500\n  ucom ci 1 set_position=1500 --for 3\n\n\
                            With --for the board runs under supervision for so long and moves; `ucom run` is for more."
    )]
    Ci(CiArgs),
    /// Parameters by name: show the names, or set some
    #[command(
        after_help = "Examples:\n  ucom par 1\n  ucom par 1 kp=120 current_max=1500\n  ucom par all --save head.yaml\n  \
                            ucom par --apply head.yaml --dry-run\n  ucom par 1-3 --apply head.yaml\n\n\
                            The protocol cannot read parameters back: what was written just now is marked as assumed, what\n\
                            was written before is only remembered. `ucom help params` shows the form of parameter files."
    )]
    Par(ParArgs),
    /// Sensor outputs of running boards, live; only listens
    #[command(
        after_help = "Examples:\n  ucom so 1\n  ucom so 1 --count 100 --csv > so.csv\n  ucom --json so all --count 10"
    )]
    So(SoArgs),
    /// Start boards and keep them running under supervision until Ctrl-C
    #[command(
        after_help = "Examples:\n  ucom run all\n  ucom run 1,2 --active --ci 1.set_position=1500\n  ucom run all --params head.yaml --active\n\n\
                            On stdin: `ci 1 set_position=-500`, `par 1 kp=80`, `active on`, `active off`, `stop`.\n\
                            Ctrl-C stops control, then applications, in reverse order. A run of which no board is left in its control loop\n\
                            ends after 3 s with exit code 5; with --on-lost report a lost board is waited for."
    )]
    Run(RunArgs),
    /// Own the bus for many clients: an API by HTTP; one commands at a time, everyone can stop
    #[command(after_help = "Examples:\n  ucom serve --bus socketcan:can0\n  ucom serve --sim --boards 3\n  \
                            curl http://127.0.0.1:8781/api/boards\n  curl -X POST http://127.0.0.1:8781/api/stop\n\n\
                            The commands of this program do not go through an agent: what they do on its bus meets a competing master.\n\
                            Ctrl-C stops what the agent has started.\n\
                            Exit codes: 0 ended, 2 the address or a file cannot be used, 3 the bus is gone.")]
    Serve(ServeArgs),
    /// Live view of boards, bus load and foreign frames; asks once, then listens
    #[command(after_help = "Examples:\n  ucom monitor\n  ucom --json monitor --count 5\n\n\
                            Keys: s stops the control loops of all boards, r asks the boards again, arrows, PageUp, PageDown,\n\
                            Home and End scroll, q ends. The terminal needs 40 columns and 12 rows.\n\
                            Status bits where room is short, a dot where one is not set: M MSTART, A ASTART, R MCARUN, X EXLRUN,\n\
                            I INIT, P PROG, o OPINIT, i IPINIT. On wider terminals they are words.")]
    Monitor(MonitorArgs),
    /// Write the frames of the bus to a file: candump log, FZI-CAN or MCAP
    #[command(
        after_help = "Examples:\n  ucom record bus.log\n  ucom record bus.mcap --for 10\n  ucom record - | ucom decode -\n\n\
                            By the ending: .log candump -L, .fzi FZI-CAN 1.2, .mcap MCAP; `-` is a candump log on stdout."
    )]
    Record(RecordArgs),
    /// Send the frames of a recording with their original timing
    #[command(after_help = "Examples:\n  ucom replay bus.log\n  ucom replay bus.log --intrusive\n\n\
                            Frames that reset, number, program, start or move boards are left out without --intrusive.")]
    Replay(ReplayArgs),
    /// Send single frames as they are
    #[command(
        after_help = "Examples:\n  ucom send 240#                     who is there? (PC_REPORT to all)\n  ucom send 1C1#0202 201# --intrusive\n\n\
                            In the order given. Frames that reset, number, program, start or move boards are refused (4) without\n\
                            --intrusive, and then none is sent. What boards answer: ucom decode --live, in another terminal."
    )]
    Send(SendArgs),
    /// Frames in words: a file, stdin or the live bus
    #[command(
        after_help = "Examples:\n  ucom decode bus.log\n  echo '141#2100011934126E38' | ucom decode -\n  ucom decode --live"
    )]
    Decode(DecodeArgs),
    /// Measure how the boards read the protocol, and write a profile
    #[command(
        after_help = "Examples:\n  ucom probe\n  ucom probe --init --out boards.toml\n  ucom probe --image firmware.hex"
    )]
    Probe(ProbeArgs),
    /// Test whether boards follow the protocol page; by default only asks
    #[command(
        after_help = "Examples:\n  ucom conformance\n  ucom conformance 1 --run\n  ucom conformance 1 --flash-id 0x21 --program firmware.hex\n  \
                            ucom --json conformance all --init --only D-T1,D-T4\n\n\
                            Without options only harmless requests leave, and applications that run are left alone. Each test is\n\
                            one of the project's acceptance tests; it shows what was sent, what was expected and what came.\n\
                            With --init, --run and --program boards are put back as they were found, also after Ctrl-C or an error:\n\
                            numbers, ASTART, applications (with the parameters of a start). --run takes about 80 s a board.\n\
                            Exit codes: 0 all passed or were skipped, 1 some failed or a board is not as it was found,\n\
                            3 a board does not answer, 4 refused, 5 cancelled."
    )]
    Conformance(ConformanceArgs),
    /// What is wrong with bus, chain and boards, with the next command
    #[command(after_help = "Examples:\n  ucom doctor\n  ucom --json doctor")]
    Doctor,
    /// What a word of a screen means: a status bit, a state, an error, an event
    #[command(
        after_help = "Examples:\n  ucom explain\n  ucom explain OPINIT\n  ucom explain DSP_ERROR_FLASH\n  ucom explain left-loop"
    )]
    Explain(ExplainArgs),
    /// A DBC file for other CAN tools, with the names of the boards' inputs, outputs and parameters
    #[command(
        after_help = "Examples:\n  ucom dbc --out chain.dbc\n  ucom dbc 1-4 > chain.dbc\n  ucom dbc none > messages.dbc"
    )]
    Dbc(DbcArgs),
    /// A page about profiles, signal tables, parameter files, simulated chains or faults
    #[command(after_help = "Examples:\n  ucom help profile\n  ucom help params\n  ucom help faults")]
    Help {
        /// The page; without it this program's own help
        topic: Option<Topic>,
    },
    /// Completions for a shell, on stdout
    #[command(
        after_help = "Examples:\n  ucom completions bash > ~/.local/share/bash-completion/completions/ucom"
    )]
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Manual pages, one file a command
    #[command(after_help = "Examples:\n  ucom man --out ~/.local/share/man/man1")]
    Man {
        /// Directory for the pages; without it the main page goes to stdout
        #[arg(long, env = "UCOM_MAN_DIR", value_name = "DIR")]
        out: Option<PathBuf>,
    },
}

impl Command {
    /// Whether it changes something on the boards: then a result that nobody can read is a fault of the run, not of the command line.
    pub fn acts(&self) -> bool {
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
pub enum Topic {
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

    /// docs/commands-ucom.md; `UPDATE_DOCS=1` writes it again.
    #[test]
    fn the_page_of_the_commands_is_made_from_them() {
        let opening = "Made from the command line's own definition, as `ucom COMMAND --help` and the manual pages are. The variable in brackets sets an option \
                       where it is not typed. What commands print when something is wrong: [troubles](troubles.md); what a word means: [codes](codes.md).";
        test_kit::page::whole("commands-ucom.md", &cli_kit::reference::markdown::<Cli>(opening));
    }

    #[test]
    fn the_command_line_is_sound_and_has_an_example_for_each_command() {
        Cli::command().debug_assert();
        for sub in Cli::command().get_subcommands() {
            let help = sub.get_after_help().map(ToString::to_string).unwrap_or_default();
            assert!(help.contains("Examples:"), "{} has no example", sub.get_name());
        }
    }
}
