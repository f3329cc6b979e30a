//! Command-line parsing, which reports wrong usage as JSON if JSON was requested.

use std::ffi::{OsStr, OsString};
use std::io::Write;
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use clap::error::{ContextKind, ContextValue, ErrorKind};

use crate::variables::{Variables, on_off};
use crate::{Failure, Output, error_object, exit, print_within};

/// Longest wait until the reader has read the text that is printed before the command begins.
const PRINT_TIMEOUT: Duration = Duration::from_millis(500);

/// Parses the command line of this process. If this is not possible, prints help, version or wrong usage, and returns
/// the exit code. If `--json` or its variable requests JSON, wrong usage is printed as one JSON object on stdout, in
/// addition to the text on stderr. Variables that set an option of the command are listed on stderr.
pub fn parse<Cli: Parser>(program: &'static str, variables: &Variables) -> Result<Cli, ExitCode> {
    parse_with(program, variables, &[])
}

/// Like [`parse`]. The list `meant` contains words that users try as commands, each with the command to use.
pub fn parse_with<Cli: Parser>(
    program: &'static str,
    variables: &Variables,
    meant: &[(&str, &str)],
) -> Result<Cli, ExitCode> {
    let typed: Vec<OsString> = std::env::args_os().skip(1).collect();
    let value = |name: &str| std::env::var_os(name);
    let mut command = Cli::command();
    let read = command.try_get_matches_from_mut(std::env::args_os()).and_then(|matches| {
        let cli = Cli::from_arg_matches(&matches).map_err(|e| e.format(&mut command))?;
        Ok((cli, matches))
    });
    let out = Output::new(program, json_is_asked(typed.iter(), value(variables.json).as_deref()));
    let mut e = match read {
        Ok((cli, matches)) => {
            let report = variables.report(program, &command, &matches, value);
            if let Some(refused) = report.refused {
                out.failure(&refused);
                return Err(ExitCode::from(exit::of(refused.kind)));
            }
            let lines: Vec<String> = report.ignored.into_iter().chain(report.in_effect).collect();
            if !lines.is_empty() {
                // The lines are printed with a timeout, because a blocked stderr must not delay a Stop.
                print_within(PRINT_TIMEOUT, move || lines.iter().for_each(|line| out.log(line)));
            }
            return Ok(cli);
        }
        Err(e) => e,
    };
    name_what_is_meant(&mut e, meant);
    let shown = e.print().and_then(|()| std::io::stdout().flush());
    if !e.use_stderr() {
        let _ = shown.inspect_err(Output::lose);
        let Some(why) = Output::lost() else { return Err(ExitCode::SUCCESS) };
        let _ = writeln!(std::io::stderr(), "{program}: the help could not be printed: {why}");
        return Err(ExitCode::from(exit::USAGE));
    }
    let lines = variables.report_error(program, &command, &e, &typed, value);
    lines.iter().for_each(|line| out.note(line));
    if out.is_json() {
        let (message, hint) = words(&e, program);
        let hint =
            [hint].into_iter().chain(lines).filter(|part| !part.is_empty()).collect::<Vec<_>>().join("; ");
        let error = error_object(&Failure::usage(message).next(hint));
        Output::bytes(format!("{}\n", serde_json::json!({ "error": error })).as_bytes());
    }
    Err(ExitCode::from(exit::USAGE))
}

/// If the list `meant` contains the word, replaces the suggestion of the parser by the command to use.
fn name_what_is_meant(e: &mut clap::Error, meant: &[(&str, &str)]) {
    let Some(ContextValue::String(word)) = e.get(ContextKind::InvalidSubcommand) else { return };
    let word = word.to_lowercase();
    if let Some((_, command)) = meant.iter().find(|(known, _)| *known == word) {
        e.remove(ContextKind::SuggestedSubcommand);
        e.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![format!("use `{command}`").into()]));
    }
}

/// Returns `true` if the command line contains the option, or if the variable has a value that means "on".
fn json_is_asked<'a>(words: impl Iterator<Item = &'a OsString>, variable: Option<&OsStr>) -> bool {
    let by_variable = variable.is_some_and(|v| on_off(&v.to_string_lossy()) == Ok(true));
    let mut options = words.take_while(|word| *word != "--");
    by_variable || options.any(|word| word == "--json")
}

/// Extracts the error and the hint from the message of the parser.
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
            let words: Vec<OsString> = words.iter().map(OsString::from).collect();
            json_is_asked(words.iter(), variable.map(OsStr::new))
        };
        assert!(asked(&["traj", "rum", "--json"], None) && asked(&["x"], Some("1")));
        assert!(!asked(&["decode", "--", "--json"], None) && !asked(&[], Some("false")) && !asked(&[], None));
    }
}
