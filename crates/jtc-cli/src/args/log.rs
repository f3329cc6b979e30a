//! `jtc log`: the flight recorder.

use std::path::PathBuf;

use clap::Subcommand;

use super::{LinkArgs, OverwriteArgs};

/// `jtc log …`
#[derive(Debug, Subcommand)]
pub enum LogCommand {
    /// Read the flight recorder: what broke first, what came before it and what followed
    #[command(
        after_help = "The controller records every tick, and stops 0.3 s after the first error. The log is kept over a reset and until\n\
                      `jtc log clear`; clearing errors does not clear it. It may be read while the arm moves: recording rests meanwhile.\n\
                      The ticks are run through the controller's own program again, with the arm that the controller has now. Where the\n\
                      log is of another arm, --arm names its file.\n\
                      -o writes a recording that Foxglove and PlotJuggler plot, with the log in it for `jtc log replay`.\n\nExamples:\n  \
                      jtc log fetch\n  jtc log fetch -o fault.mcap --report fault.html"
    )]
    Fetch {
        /// Write the recording here (.mcap)
        #[arg(short, long, env = "JTC_LOG_OUT", value_name = "FILE.mcap")]
        out: Option<PathBuf>,
        /// Write the report page here (.html)
        #[arg(long, env = "JTC_LOG_REPORT", value_name = "FILE.html")]
        report: Option<PathBuf>,
        /// The arm of the log, where it is not the one that the controller has now
        #[arg(long, env = "JTC_ARM", value_name = "FILE")]
        arm: Option<PathBuf>,
        #[command(flatten)]
        overwrite: OverwriteArgs,
        #[command(flatten)]
        link: LinkArgs,
    },
    /// Forget the log, and record anew
    #[command(after_help = "Examples:\n  jtc log clear")]
    Clear {
        #[command(flatten)]
        link: LinkArgs,
    },
    /// Run a fetched log through the controller's program, and name the first tick that differs
    #[command(
        after_help = "Exit code 4: a tick differs, or none could be replayed.\n\nExamples:\n  jtc log replay fault.mcap\n  \
                      jtc --json log replay fault.mcap | jq .difference"
    )]
    Replay {
        /// A file that `jtc log fetch` wrote
        file: PathBuf,
        /// The arm of the log, where it is not the one in the file
        #[arg(long, env = "JTC_ARM", value_name = "FILE")]
        arm: Option<PathBuf>,
    },
}
