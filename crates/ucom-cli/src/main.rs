//! The `ucom` command: parses, calls the libraries, prints. Results go to stdout, progress and logs to stderr.
#![forbid(unsafe_code)]

mod args;
mod cache;
mod commands;
mod driver;
mod failure;
mod link;
mod output;
mod shape;
mod signal;
mod words;

use std::process::ExitCode;

use clap::Parser;

use args::Cli;
use output::Output;

fn main() -> ExitCode {
    // clap itself ends wrong usage with exit code 2.
    let cli = Cli::parse();
    let out = Output::new(cli.json);
    match commands::run(cli.command, &cli.link, &out) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            out.failure(&failure);
            ExitCode::from(failure.exit)
        }
    }
}
