//! `jtc help`: prints a help page or the help of a command.

use clap::CommandFactory;
use cli_kit::{Failure, Output};
use serde_json::json;

use crate::args::{Cli, HelpArgs};

/// Help pages that do not belong to a command.
const PAGES: [(&str, &str); 3] = [
    ("files", jtc_host::example::FORMS),
    ("faults", jtc_sim::FAULT_FILE_HELP),
    ("events", crate::progress::EVENTS_HELP),
];

/// Prints a help page, or the help of the command in `args`.
pub(super) fn help(args: &HelpArgs, out: &Output) -> Result<(), Failure> {
    if let [word] = args.topic.as_slice()
        && let Some((_, text)) = PAGES.iter().find(|(name, _)| name == word)
    {
        out.result(&json!({ "text": text }), || text.trim_end().to_owned());
        return Ok(());
    }
    let mut command = Cli::command();
    command.build();
    let mut at = &mut command;
    for (n, word) in args.topic.iter().enumerate() {
        let known: Vec<String> = at.get_subcommands().map(|c| c.get_name().to_owned()).collect();
        let pages = PAGES.iter().filter(|_| n == 0).map(|(name, _)| (*name).to_owned());
        let list = known.iter().cloned().chain(pages).collect::<Vec<_>>().join(", ");
        at = at.find_subcommand_mut(word).ok_or_else(|| {
            Failure::usage(format!("no help page about \"{word}\""))
                .next(format!("help pages exist for {list}"))
        })?;
    }
    let text = at.render_long_help().to_string();
    out.result(&json!({ "text": text }), || text.trim_end().to_owned());
    Ok(())
}
