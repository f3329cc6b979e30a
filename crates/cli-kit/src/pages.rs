//! Shell completions and manual pages, generated from the definition of the command line.

use std::io::Result;
use std::path::Path;

use clap::CommandFactory;

use crate::Output;

/// Prints the completions of the command line for a shell.
pub fn completions<Cli: CommandFactory>(shell: clap_complete::Shell) {
    let mut command = Cli::command();
    let name = command.get_name().to_owned();
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut command, name, &mut text);
    Output::bytes(&text);
}

/// Writes a manual page for each command into a directory, or prints the main page.
pub fn man<Cli: CommandFactory>(dir: Option<&Path>) -> Result<()> {
    let Some(dir) = dir else {
        let mut page = Vec::new();
        clap_mangen::Man::new(Cli::command()).render(&mut page)?;
        Output::bytes(&page);
        return Ok(());
    };
    std::fs::create_dir_all(dir)?;
    clap_mangen::generate_to(Cli::command(), dir)
}
