//! The reference page of a command line in Markdown, generated from the definition of the command line.

use std::fmt::Write as _;

use clap::{Arg, Command, CommandFactory};

/// Returns the reference page of all commands: usage, arguments, options with defaults and variables, and the text
/// below the help. `opening` follows the title of the page.
pub fn markdown<Cli: CommandFactory>(opening: &str) -> String {
    let mut command = Cli::command();
    command.build();
    let name = command.get_name().to_owned();
    let mut page = format!("# Commands of {name}\n\n{opening}\n\n## {name}\n\n");
    one(&command, true, &mut page);
    for sub in subcommands(&command) {
        walk(sub, &format!("{name} {}", sub.get_name()), &mut page);
    }
    page
}

fn subcommands(command: &Command) -> impl Iterator<Item = &Command> {
    command.get_subcommands().filter(|sub| !sub.is_hide_set() && sub.get_name() != "help" || has_options(sub))
}

/// Returns `true` if the program itself defines this `help` command, so that it has arguments. The `help` command
/// that clap adds has no arguments.
fn has_options(command: &Command) -> bool {
    command.get_name() == "help"
        && command.get_subcommands().next().is_none()
        && command.get_after_help().is_some()
}

fn walk(command: &Command, path: &str, page: &mut String) {
    let _ = write!(page, "## {path}\n\n");
    one(command, false, page);
    for sub in subcommands(command) {
        walk(sub, &format!("{path} {}", sub.get_name()), page);
    }
}

/// Writes the purpose of a command, its usage, its arguments and the text below its help.
fn one(command: &Command, top: bool, page: &mut String) {
    if let Some(about) = command.get_about() {
        let _ = write!(page, "{}.\n\n", text(&about.to_string()));
    }
    if let Some(about) = command.get_long_about().filter(|_| command.get_about().is_none()) {
        let _ = write!(page, "{}\n\n", text(&about.to_string()));
    }
    // This code uses the usage text that clap prints on the screen, without its margins.
    let usage = command.clone().render_usage().to_string();
    let usage = usage.trim_start_matches("Usage:").trim();
    let lines: Vec<&str> = usage.lines().map(str::trim).collect();
    let _ = write!(page, "```text\n{}\n```\n\n", lines.join("\n"));
    // Options that every command has are listed only once, at the top of the page.
    let shown = |arg: &&Arg| {
        !arg.is_hide_set()
            && !["help", "version"].contains(&arg.get_id().as_str())
            && (top || !arg.is_global_set())
    };
    let mut rows = String::new();
    for arg in command.get_arguments().filter(shown) {
        let _ = writeln!(rows, "| {} | {} |", names(arg), meaning(arg));
    }
    if !rows.is_empty() {
        let _ = write!(page, "| | |\n|---|---|\n{rows}\n");
    }
    let after = command.get_after_help().map(ToString::to_string).unwrap_or_default();
    for block in after.trim().split("\n\n").filter(|block| !block.is_empty()) {
        // A paragraph with an indented line is an example or a table, and is shown as code.
        let _ = if block.lines().any(|line| line.starts_with(' ')) {
            write!(page, "```text\n{block}\n```\n\n")
        } else {
            write!(page, "{}\n\n", text(block))
        };
    }
}

/// Returns an argument in the form that the user types.
fn names(arg: &Arg) -> String {
    let takes = arg.get_action().takes_values();
    let values: Vec<String> = match arg.get_value_names() {
        Some(names) if takes => names.iter().map(ToString::to_string).collect(),
        _ => Vec::new(),
    };
    let values = values.join(" ");
    if arg.is_positional() {
        return format!(
            "`{}`",
            if values.is_empty() { arg.get_id().as_str().to_uppercase() } else { values }
        );
    }
    let long = arg.get_long().map(|long| format!("--{long}"));
    let short = arg.get_short().map(|short| format!("-{short}"));
    let typed = short.into_iter().chain(long).collect::<Vec<_>>().join(", ");
    format!("`{}`", format!("{typed} {values}").trim())
}

/// Returns the purpose of an argument, its possible values, its default and its environment variable.
fn meaning(arg: &Arg) -> String {
    let help = arg.get_long_help().or_else(|| arg.get_help());
    let mut words = help.map(|help| text(&help.to_string())).unwrap_or_default();
    let takes = arg.get_action().takes_values();
    let possible: Vec<String> =
        arg.get_possible_values().iter().map(|value| format!("`{}`", value.get_name())).collect();
    if takes && !possible.is_empty() && possible.len() <= 12 {
        let _ = write!(words, "; one of {}", possible.join(", "));
    }
    let defaults: Vec<String> =
        arg.get_default_values().iter().map(|value| value.to_string_lossy().into_owned()).collect();
    if takes && !defaults.is_empty() && !arg.is_hide_default_value_set() {
        let _ = write!(words, "; default `{}`", defaults.join(" "));
    }
    if let Some(variable) = arg.get_env() {
        let _ = write!(words, " (`{}`)", variable.to_string_lossy());
    }
    words
}

/// Converts a help text to a line of Markdown. The function escapes special characters, except in code.
fn text(help: &str) -> String {
    let mut out = String::new();
    for (n, part) in help.replace("\n\n", " ").replace('\n', " ").split('`').enumerate() {
        if n > 0 {
            out.push('`');
        }
        if n % 2 == 1 {
            out += &part.replace('|', "\\|");
            continue;
        }
        for c in part.chars() {
            if "|<>*_[]".contains(c) {
                out.push('\\');
            }
            out.push(c);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Command line for the tests.
    #[derive(clap::Parser)]
    #[command(name = "try", about = "Tries things", disable_help_subcommand = true)]
    struct Cli {
        /// Print JSON
        #[arg(long, global = true)]
        json: bool,
        #[command(subcommand)]
        command: Commands,
    }

    #[derive(clap::Subcommand)]
    enum Commands {
        /// Go <there>
        #[command(after_help = "It goes <far>.\n\nExamples:\n  try go")]
        Go {
            /// How fast
            #[arg(long, value_name = "N", default_value_t = 3)]
            speed: u8,
        },
    }

    #[test]
    fn a_page_has_each_command_with_its_options() {
        let page = markdown::<Cli>("Opening.");
        assert!(page.starts_with("# Commands of try\n\nOpening.\n\n## try\n\nTries things."), "{page}");
        assert!(page.contains("## try go\n\nGo \\<there\\>.\n"), "{page}");
        assert!(page.contains("| `--speed N` | How fast; default `3` |"), "{page}");
        assert!(page.contains("\n\nIt goes \\<far\\>.\n\n```text\nExamples:\n  try go\n```"), "{page}");
        assert_eq!(page.matches("--json").count(), 1, "once, and not in each command: {page}");
    }
}
