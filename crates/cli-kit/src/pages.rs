//! Shell completions and manual pages, made from the command line's definition.

use std::io::{Result, Write, stdout};
use std::path::Path;

use clap::CommandFactory;

/// Prints the completions of a shell.
pub fn completions<Cli: CommandFactory>(shell: clap_complete::Shell) -> Result<()> {
    let mut command = Cli::command();
    let name = command.get_name().to_owned();
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut command, name, &mut text);
    stdout().write_all(&text)
}

/// Writes a page for each command into a directory, or prints the main one.
pub fn man<Cli: CommandFactory>(dir: Option<&Path>) -> Result<()> {
    let Some(dir) = dir else {
        return clap_mangen::Man::new(Cli::command()).render(&mut stdout());
    };
    std::fs::create_dir_all(dir)?;
    clap_mangen::generate_to(Cli::command(), dir)
}
