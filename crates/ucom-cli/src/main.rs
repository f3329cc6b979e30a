//! The `ucom` command: parses, calls the libraries, prints. Results go to stdout, progress and logs to stderr.
#![forbid(unsafe_code)]

mod args;
mod cache;
mod commands;
mod driver;
mod failure;
mod link;
mod shape;
mod values;
mod words;
mod written;

use std::process::ExitCode;

use clap::Parser;
use cli_kit::Output;

use args::Cli;

fn main() -> ExitCode {
    // clap itself ends wrong usage with exit code 2.
    let cli = Cli::parse();
    let out = Output::new("ucom", cli.json);
    match commands::run(cli.command, &cli.link, &out) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            if !failure.printed {
                out.failure(failure.exit, &failure.code, &failure.message, &failure.hint);
            }
            ExitCode::from(failure.exit)
        }
    }
}
