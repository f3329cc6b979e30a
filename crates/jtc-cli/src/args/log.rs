//! `jtc log`: options for the flight recorder.

use std::path::PathBuf;

use clap::Subcommand;

use super::{LinkArgs, OverwriteArgs};

/// `jtc log …`
#[derive(Debug, Subcommand)]
pub(crate) enum LogCommand {
    /// Read the flight recorder, and report the first error
    #[command(
        after_help = "The report shows the first error, and the events before and after this error.\n\n\
            The flight recorder is a memory in the controller. This memory contains every control cycle (tick, 1 ms) \
            of the last seconds (at least 2 s), and stops 0.3 s after the first error. The stopped log \
            survives a reset, and stays in the controller until `jtc log clear`. `jtc clear` does not delete \
            the log. A new log replaces a log without any commanded torque as soon as the torque is on. You \
            can read the log while the arm moves. The flight recorder pauses while you read.\n\n\
            The command computes each tick again, with the code of the controller and the present arm of the \
            controller. If the controller recorded the log with another arm, set the file of that arm with \
            --arm.\n\n\
            -o writes a recording that Foxglove and PlotJuggler can plot. The file also contains the log, \
            for `jtc log replay`.\n\n\
            Examples:\n  \
            jtc log fetch\n  \
            jtc log fetch -o fault.mcap --report fault.html"
    )]
    Fetch {
        /// Write the recording to this .mcap file
        #[arg(short, long, env = "JTC_LOG_OUT", value_name = "FILE.mcap")]
        out: Option<PathBuf>,
        /// Write the report page to this .html file
        #[arg(long, env = "JTC_LOG_REPORT", value_name = "FILE.html")]
        report: Option<PathBuf>,
        /// Use this arm instead of the present arm of the controller
        #[arg(long, env = "JTC_ARM", value_name = "FILE")]
        arm: Option<PathBuf>,
        #[command(flatten)]
        overwrite: OverwriteArgs,
        #[command(flatten)]
        link: LinkArgs,
    },
    /// Clear the log, and restart the flight recorder
    #[command(after_help = "Examples:\n  jtc log clear")]
    Clear {
        #[command(flatten)]
        link: LinkArgs,
    },
    /// Replay a fetched log, and name the first tick that differs
    #[command(
        after_help = "The command computes each tick again with the code of the controller, and compares the \
            result with the log. Exit code 4 means that a tick differs, or that the command could not \
            compute any tick.\n\n\
            Examples:\n  \
            jtc log replay fault.mcap\n  \
            jtc --json log replay fault.mcap | jq .difference"
    )]
    Replay {
        /// Recording from `jtc log fetch`
        file: PathBuf,
        /// Use this arm instead of the arm in the recording
        #[arg(long, env = "JTC_ARM", value_name = "FILE")]
        arm: Option<PathBuf>,
    },
}
