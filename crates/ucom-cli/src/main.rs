//! The program `ucom`: parses the command line, calls the libraries, and prints. The program writes results to
//! stdout, and progress and logs to stderr.
#![forbid(unsafe_code)]

mod args;
mod cache;
mod commands;
mod interrupt;
mod session;
mod shape;

use std::process::ExitCode;
use std::time::Duration;

use cli_kit::{Output, exit, print_within};

use args::Cli;

/// Maximum wait for a blocked reader when the program ends.
const PRINT_TIMEOUT: Duration = Duration::from_secs(1);

fn main() -> ExitCode {
    let cli: Cli = match cli_kit::usage::parse("ucom", &args::VARIABLES) {
        Ok(cli) => cli,
        Err(code) => return code,
    };
    let out = Output::new("ucom", cli.json);
    let acts = cli.command.acts();
    match commands::run(cli.command, &cli.link, &out) {
        Ok(()) => match Output::lost() {
            None => ExitCode::SUCCESS,
            Some(why) => {
                let exit = if acts { exit::FAULT } else { exit::USAGE };
                let text = format!("ucom: the result could not be printed: {why}");
                print_within(PRINT_TIMEOUT, move || out.note(text));
                ExitCode::from(exit)
            }
        },
        Err(failure) => {
            let exit = exit::of(failure.kind);
            if !failure.is_shown() {
                // If earlier output blocks stdout, the program cannot print JSON there. The program then prints the
                // failure as text on stderr.
                let out = if cli_kit::stdout_is_stuck() { Output::new("ucom", false) } else { out };
                print_within(PRINT_TIMEOUT, move || out.failure(&failure));
            }
            ExitCode::from(exit)
        }
    }
}
