//! Environment variables that set options: the values for "on" and "off", a line about the variables that are set, and
//! notes about retired variables.
//!
//! Variables exist only for options that name a port, address, folder, file or format, and for a few options with
//! harmless numbers. Options that move, reset, number, program, enable outputs, set bits, answer a confirmation or
//! override a check have no variable, because a variable stays set for later commands in the shell. `audit` checks
//! these rules for all options of a command line.

#[cfg(feature = "testing")]
pub mod audit;

use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};

use clap::error::{ContextKind, ContextValue};
use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Command};

use crate::Failure;

/// Parses the value of an on/off variable. Letter case is ignored, and an empty value means off, like an unset
/// variable.
pub fn on_off(text: &str) -> Result<bool, String> {
    match text.to_ascii_lowercase().as_str() {
        "1" | "true" | "yes" | "on" => Ok(true),
        "" | "0" | "false" | "no" | "off" => Ok(false),
        _ => Err("expected 1, true, yes or on, or 0, false, no or off".into()),
    }
}

/// Environment variables of a program.
#[derive(Clone, Copy, Debug)]
pub struct Variables {
    /// Environment variable of `--json`.
    pub json: &'static str,
    /// Retired environment variables of the program.
    pub retired: &'static [Retired],
    /// Commands that do not use a device, and therefore do not use the global options of the connection.
    pub offline: &'static [&'static str],
}

/// Retired variable that set an option in an earlier version.
#[derive(Clone, Copy, Debug)]
pub struct Retired {
    /// Name of the retired variable.
    pub variable: &'static str,
    /// Words of the command that has the option. Empty if all commands that have the option are meant.
    pub command: &'static str,
    /// Long name of the option that the variable set.
    pub option: &'static str,
    /// Effect on the command if the retired variable is ignored.
    pub without: Without,
}

/// Effect of an ignored variable on the command.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Without {
    /// Without the variable, the command does less. Therefore the command continues, and prints a note.
    Less,
    /// Without the variable, the command does more or something else, such as a motion at another speed. Therefore
    /// the command is rejected.
    Other,
}

impl Retired {
    /// Creates a retired variable that made a command do more than its default.
    pub const fn less(variable: &'static str, command: &'static str, option: &'static str) -> Self {
        Self { variable, command, option, without: Without::Less }
    }

    /// Creates a retired variable that limited or changed the work of a command.
    pub const fn other(variable: &'static str, command: &'static str, option: &'static str) -> Self {
        Self { variable, command, option, without: Without::Other }
    }

    /// Returns the option that this retired variable set. Returns `None` if the command does not have this option, or
    /// if the option still reads this variable.
    fn option_of<'a>(&self, command: &'a Command, words: &str) -> Option<&'a Arg> {
        let named = self.command.is_empty() || self.command == words;
        let mut options = command.get_arguments().filter(|arg| arg.get_long() == Some(self.option));
        options.find(|arg| named && arg.get_env() != Some(OsStr::new(self.variable)))
    }
}

/// Notes about the environment variables that are set.
#[derive(Debug, Default)]
pub(crate) struct Report {
    /// Line about the variables that set an option of this command.
    pub in_effect: Option<String>,
    /// Lines about ignored variables, one per variable.
    pub ignored: Vec<String>,
    /// Failure if the command would do something else because a variable is ignored.
    pub refused: Option<Failure>,
}

/// Command that the user selected in the parsed command line.
struct Chosen<'a> {
    program: &'static str,
    command: &'a Command,
    /// Words of the command, for example `traj run`.
    words: String,
}

impl Chosen<'_> {
    /// Returns the command as the user typed it, in the quotation marks that the docs use.
    fn typed(&self) -> String {
        format!("`{}`", format!("{} {}", self.program, self.words).trim())
    }
}

impl Variables {
    /// Returns the notes about the environment variables of a parsed command line. `value` returns the value of an
    /// environment variable.
    pub(crate) fn report(
        &self,
        program: &'static str,
        root: &Command,
        matches: &ArgMatches,
        value: impl Fn(&str) -> Option<OsString>,
    ) -> Report {
        let (mut command, mut matches, mut words) = (root, matches, Vec::new());
        let mut used = BTreeMap::new();
        loop {
            for arg in command.get_arguments().filter(|arg| is_set_by_variable(arg, matches)) {
                let variable = arg.get_env().unwrap_or_default().to_string_lossy().into_owned();
                let value = value(&variable).unwrap_or_default();
                used.insert(variable, (shown(&value), arg.is_global_set()));
            }
            let Some((name, below)) = matches.subcommand() else { break };
            let Some(sub) = command.find_subcommand(name) else { break };
            words.push(name);
            (command, matches) = (sub, below);
        }
        let words = words.join(" ");
        if self.offline.contains(&words.as_str()) {
            used.retain(|variable, (_, global)| variable == self.json || !*global);
        }
        let chosen = Chosen { program, command, words };
        let is_typed =
            |arg: &Arg| matches.value_source(arg.get_id().as_str()) == Some(ValueSource::CommandLine);
        let unread = self.unread(&chosen, is_typed, value);
        let in_effect =
            used.iter().map(|(variable, (value, _))| format!("{variable}={value}")).collect::<Vec<_>>();
        Report {
            in_effect: (!in_effect.is_empty())
                .then(|| format!("{program}: from the environment: {}", in_effect.join(", "))),
            refused: unread
                .iter()
                .find(|found| found.without == Without::Other)
                .map(|found| found.refusal(&chosen)),
            ignored: unread.iter().map(|found| found.note(&chosen)).collect(),
        }
    }

    /// Returns the notes about environment variables if the command line could not be parsed. The notes contain the
    /// variables that set an option in the error, and the retired variables.
    pub(crate) fn report_error(
        &self,
        program: &'static str,
        root: &Command,
        error: &clap::Error,
        typed: &[OsString],
        value: impl Fn(&str) -> Option<OsString>,
    ) -> Vec<String> {
        let chosen = chosen(program, root, typed);
        let option = |arg: &Arg| arg.get_long().map(|long| format!("--{long}"));
        let is_typed = |arg: &Arg| {
            let option = option(arg).unwrap_or_default();
            typed.iter().any(|word| word.to_string_lossy().split('=').next() == Some(&option))
        };
        let named = options_in(error);
        let of_root = root.get_arguments().filter(|arg| arg.is_global_set());
        let mut lines = Vec::new();
        for arg in chosen.command.get_arguments().chain(of_root) {
            let (Some(option), Some(variable)) = (option(arg), arg.get_env()) else { continue };
            let variable = variable.to_string_lossy();
            if named.contains(&option)
                && !is_typed(arg)
                && let Some(value) = value(&variable)
            {
                lines.push(format!("{option} is set by the variable {variable}={}", shown(&value)));
            }
        }
        lines.dedup();
        lines.extend(self.unread(&chosen, is_typed, value).iter().map(|found| found.note(&chosen)));
        lines
    }

    /// Returns the retired variables that are set for options of this command. Omits variables that are empty or off,
    /// and variables of options that the user has typed.
    fn unread(
        &self,
        chosen: &Chosen<'_>,
        is_typed: impl Fn(&Arg) -> bool,
        value: impl Fn(&str) -> Option<OsString>,
    ) -> Vec<Unread> {
        let mut all: BTreeMap<&str, Unread> = BTreeMap::new();
        for retired in self.retired {
            let Some(arg) = retired.option_of(chosen.command, &chosen.words) else { continue };
            let Some(value) = value(retired.variable).filter(|value| !value.is_empty()) else { continue };
            let is_off = !arg.get_action().takes_values() && on_off(&value.to_string_lossy()) == Ok(false);
            if is_off || is_typed(arg) {
                continue;
            }
            let option = match arg.get_env() {
                Some(variable) => format!("--{} or {}", retired.option, variable.to_string_lossy()),
                None => format!("--{}", retired.option),
            };
            let found = all.entry(retired.variable).or_insert_with(|| Unread {
                variable: retired.variable,
                value: shown(&value),
                options: Vec::new(),
                without: Without::Less,
            });
            found.options.push(option);
            if retired.without == Without::Other {
                found.without = Without::Other;
            }
        }
        all.into_values().collect()
    }
}

/// Retired variable that is set in the environment.
struct Unread {
    variable: &'static str,
    value: String,
    options: Vec<String>,
    without: Without,
}

impl Unread {
    fn note(&self, chosen: &Chosen<'_>) -> String {
        let Self { variable, value, .. } = self;
        let (program, typed, options) = (chosen.program, chosen.typed(), self.options.join(" or "));
        format!(
            "{program}: {variable}={value} is ignored: {typed} does not read this variable; use {options}"
        )
    }

    fn refusal(&self, chosen: &Chosen<'_>) -> Failure {
        let Self { variable, value, .. } = self;
        Failure::usage(format!(
            "{variable}={value} is set, but {} no longer reads this variable; nothing was sent",
            chosen.typed()
        ))
        .next(format!("use {}, or unset {variable}", self.options.join(" or ")))
    }
}

/// Returns `true` if the option is set by its variable: the user has not typed the option, and an on/off variable has
/// the value "on".
fn is_set_by_variable(arg: &Arg, matches: &ArgMatches) -> bool {
    let id = arg.get_id().as_str();
    arg.get_env().is_some()
        && matches.value_source(id) == Some(ValueSource::EnvVariable)
        && (arg.get_action().takes_values() || matches.get_flag(id))
}

/// Returns the command that the user typed. Other words, such as options, are skipped. The search ends at `--`.
fn chosen<'a>(program: &'static str, root: &'a Command, typed: &[OsString]) -> Chosen<'a> {
    let (mut command, mut words) = (root, Vec::new());
    for word in typed.iter().take_while(|word| *word != "--") {
        if let Some(sub) = command.find_subcommand(word) {
            words.push(sub.get_name());
            command = sub;
        }
    }
    Chosen { program, command, words: words.join(" ") }
}

/// Returns the options that the error message of the parser contains.
fn options_in(error: &clap::Error) -> Vec<String> {
    let mut all = Vec::new();
    for kind in [ContextKind::InvalidArg, ContextKind::PriorArg] {
        match error.get(kind) {
            Some(ContextValue::String(one)) => all.push(one.clone()),
            Some(ContextValue::Strings(several)) => all.extend(several.iter().cloned()),
            _ => {}
        }
    }
    all.iter().filter_map(|shown| shown.split([' ', '=']).next().map(str::to_owned)).collect()
}

/// Returns the value of a variable on one line, without control characters.
fn shown(value: &OsStr) -> String {
    let mut text = String::new();
    for c in value.to_string_lossy().chars() {
        if c.is_control() { text.extend(c.escape_default()) } else { text.push(c) }
    }
    text
}

#[cfg(all(test, feature = "testing"))]
mod tests;
