//! Reading the command line, with wrong usage as an answer for programs where they asked for one.

use std::ffi::{OsStr, OsString};
use std::io::Write;
use std::process::ExitCode;

use clap::Parser;
use clap::error::{ContextKind, ContextValue, ErrorKind};

use crate::{Failure, Output, exit};

/// The command line of this process; otherwise help, version or wrong usage is printed, and the exit code is to be returned. Wrong
/// usage is one JSON object on stdout where `--json` or the variable `json_env` asks for JSON, besides the words on stderr.
pub fn parse<Cli: Parser>(program: &'static str, json_env: &str) -> Result<Cli, ExitCode> {
    parse_with(program, json_env, &[])
}

/// Like `parse`. `meant` has words that people try as commands, each with the command to use.
pub fn parse_with<Cli: Parser>(
    program: &'static str,
    json_env: &str,
    meant: &[(&str, &str)],
) -> Result<Cli, ExitCode> {
    Cli::try_parse().map_err(|mut e| {
        name_what_is_meant(&mut e, meant);
        let shown = e.print().and_then(|()| std::io::stdout().flush());
        if !e.use_stderr() {
            let _ = shown.inspect_err(Output::lose);
            let Some(why) = Output::lost() else { return ExitCode::SUCCESS };
            let _ = writeln!(std::io::stderr(), "{program}: the help could not be printed: {why}");
            return ExitCode::from(exit::USAGE);
        }
        if json_is_asked(std::env::args_os().skip(1), std::env::var_os(json_env).as_deref()) {
            let (message, hint) = words(&e, program);
            let error = Failure::usage(message).hint(hint).to_json();
            Output::bytes(format!("{}\n", serde_json::json!({ "error": error })).as_bytes());
        }
        ExitCode::from(exit::USAGE)
    })
}

/// Replaces the parser's guess by the command to use, where a word is known that is no command.
fn name_what_is_meant(e: &mut clap::Error, meant: &[(&str, &str)]) {
    let Some(ContextValue::String(word)) = e.get(ContextKind::InvalidSubcommand) else { return };
    let word = word.to_lowercase();
    if let Some((_, command)) = meant.iter().find(|(known, _)| *known == word) {
        e.remove(ContextKind::SuggestedSubcommand);
        e.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![format!("use `{command}`").into()]));
    }
}

/// The option among the words, as far as options go, or the variable with a value that means yes.
fn json_is_asked(words: impl Iterator<Item = OsString>, variable: Option<&OsStr>) -> bool {
    let no = ["", "0", "n", "no", "f", "false", "off"];
    let by_variable = variable.is_some_and(|v| !no.contains(&v.to_string_lossy().to_lowercase().as_str()));
    by_variable || words.take_while(|word| word != "--").any(|word| word == "--json")
}

/// What is wrong and what helps, from the parser's words.
fn words(e: &clap::Error, program: &str) -> (String, String) {
    if e.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        return ("a command is missing".into(), format!("`{program} --help` lists the commands"));
    }
    let text = e.render().to_string();
    let mut parts = text.split("\n\n").map(|part| part.split_whitespace().collect::<Vec<_>>().join(" "));
    let message = parts.next().unwrap_or_default().trim_start_matches("error: ").to_owned();
    (message, parts.collect::<Vec<_>>().join("; "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_is_asked_for_by_option_or_variable() {
        let asked = |words: &[&str], variable: Option<&str>| {
            json_is_asked(words.iter().map(OsString::from), variable.map(OsStr::new))
        };
        assert!(asked(&["traj", "rum", "--json"], None) && asked(&["x"], Some("1")));
        assert!(!asked(&["decode", "--", "--json"], None) && !asked(&[], Some("false")) && !asked(&[], None));
    }
}
