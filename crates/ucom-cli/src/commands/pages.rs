//! Shell completions and manual pages, made from the command line's definition.

use std::path::Path;

use clap::CommandFactory;

use crate::args::Cli;
use crate::failure::Failure;
use crate::output::Output;

/// Prints the completions of a shell.
pub fn completions(shell: clap_complete::Shell) -> Result<(), Failure> {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "ucom", &mut text);
    print!("{}", String::from_utf8_lossy(&text));
    Ok(())
}

/// Writes a page for each command, or prints the main one.
pub fn man(dir: Option<&Path>, out: &Output) -> Result<(), Failure> {
    let Some(dir) = dir else {
        let mut page = Vec::new();
        clap_mangen::Man::new(Cli::command()).render(&mut page)?;
        print!("{}", String::from_utf8_lossy(&page));
        return Ok(());
    };
    std::fs::create_dir_all(dir)?;
    clap_mangen::generate_to(Cli::command(), dir)?;
    out.note(format!("manual pages written to {}", dir.display()));
    Ok(())
}
