//! The `jtc` command: parses the arguments, calls the libraries and prints the results. The command writes results to stdout, and progress
//! and logs to stderr.
#![forbid(unsafe_code)]

mod args;
mod ask;
mod commands;
mod failure;
mod keys;
mod limits;
mod link;
mod operator;
mod progress;
#[cfg(unix)]
mod serve;
mod tape;

use std::process::ExitCode;

use cli_kit::{Output, exit};

use args::Cli;

fn main() -> ExitCode {
    let cli: Cli = match cli_kit::usage::parse_with("jtc", &args::VARIABLES, &args::MEANT) {
        Ok(cli) => cli,
        Err(code) => return code,
    };
    let out = Output::new("jtc", cli.json);
    let moves = cli.command.moves();
    let done = commands::run(cli.command, &out);
    if let Err(failure) = &done
        && !failure.is_shown()
    {
        out.failure(failure);
    }
    Output::finish();
    match done {
        Ok(()) => match Output::lost() {
            None => ExitCode::SUCCESS,
            Some(why) => {
                let exit = if moves { exit::FAULT } else { exit::USAGE };
                out.note(format_args!("jtc: the result could not be printed: {why}"));
                ExitCode::from(exit)
            }
        },
        Err(failure) => {
            if let Some(why) = Output::lost().filter(|_| failure.is_shown()) {
                out.note(format_args!("jtc: the result could not be printed: {why}"));
            }
            ExitCode::from(exit::of(failure.kind))
        }
    }
}
