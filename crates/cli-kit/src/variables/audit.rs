//! Audit of all options of a command line: the environment variable of each option must be of an allowed kind.

use std::collections::BTreeMap;

use clap::{Arg, ArgAction, Command, CommandFactory};

use super::Variables;

/// Reason why an option is allowed to have an environment variable.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Kind {
    /// Name of a port, a bus, an address, a host or a folder.
    Place,
    /// Name of a file that the command reads, or of a file that belongs to the machine or the chain of boards.
    File,
    /// Name of a file or folder that one command writes.
    Output,
    /// Format of the output.
    Format,
    /// Bit rate of the serial line.
    Line,
    /// Limit of time or disk space of one command, which does not change a motion.
    Limit,
    /// Setting of a simulator.
    Simulator,
    /// Safety option that makes a command send less.
    Caution,
}

/// Value names of options that name a port, address, folder or file.
const PLACES: [&str; 11] = [
    "FILE",
    "FILE.mcap",
    "FILE.html",
    "IMAGE",
    "DIR",
    "PATH",
    "URL",
    "HOST",
    "HOST:PORT",
    "ADDRESS:PORT",
    "ORIGIN",
];

/// Returns all faults of the environment variables of a command line. The list is empty if no faults exist.
/// `allowed` lists each variable with the reason why it is allowed. `without` lists options that name a file and
/// still have no variable, for example `update --data`.
pub fn faults<Cli: CommandFactory>(
    prefix: &str,
    variables: &Variables,
    allowed: &[(&str, Kind)],
    without: &[&str],
) -> Vec<String> {
    let mut root = Cli::command();
    root.build();
    let mut options = Vec::new();
    collect(&root, "", &mut options);
    let mut faults = Vec::new();
    let mut seen: BTreeMap<String, (String, &Arg)> = BTreeMap::new();
    for (typed, arg) in &options {
        let names_place = value_name(arg).is_some_and(|name| PLACES.contains(&name.as_str()));
        let Some(variable) = arg.get_env().map(|name| name.to_string_lossy().into_owned()) else {
            if names_place && !without.contains(&typed.as_str()) && !arg.is_hide_set() {
                faults.push(format!("{typed}: it names a place or a file and has no variable"));
            }
            continue;
        };
        if without.contains(&typed.as_str()) {
            faults.push(format!("{typed}: it is listed as one without a variable, and has {variable}"));
        }
        let Some((_, kind)) = allowed.iter().find(|(name, _)| *name == variable) else {
            faults.push(format!("{typed}: {variable} is not in the list of allowed variables"));
            continue;
        };
        if !variable.starts_with(prefix) {
            faults.push(format!("{typed}: {variable} does not begin with {prefix}"));
        }
        if let Some(why) = misfit(*kind, arg, names_place) {
            faults.push(format!("{typed}: {variable} is listed as {kind:?}, but {why}"));
        }
        match seen.get(&variable) {
            Some((other, first)) if !mean_the_same(*kind, first, arg) => {
                faults.push(format!("{variable} has two meanings: {other} and {typed}"));
            }
            Some(_) => {}
            None => drop(seen.insert(variable, (typed.clone(), arg))),
        }
    }
    faults.extend(lists(&root, variables, allowed, without, &options, &seen));
    faults
}

/// Finds entries of `allowed` and `without` that match no option or variable.
fn lists(
    root: &Command,
    variables: &Variables,
    allowed: &[(&str, Kind)],
    without: &[&str],
    options: &[(String, &Arg)],
    seen: &BTreeMap<String, (String, &Arg)>,
) -> Vec<String> {
    let mut faults = Vec::new();
    for (variable, _) in allowed.iter().filter(|(name, _)| !seen.contains_key(*name)) {
        faults.push(format!("no option has the allowed variable {variable}"));
    }
    for option in without.iter().filter(|one| options.iter().all(|(typed, _)| typed != *one)) {
        faults.push(format!("no option {option} exists"));
    }
    let commands = commands(root);
    for retired in variables.retired {
        let mut of_variable = variables.retired.iter().filter(|other| other.variable == retired.variable);
        if !of_variable
            .any(|one| commands.iter().any(|(words, command)| one.option_of(command, words).is_some()))
        {
            faults.push(format!(
                "no option had {}: {} --{}",
                retired.variable, retired.command, retired.option
            ));
        }
    }
    for (words, command) in &commands {
        let of_command = |retired: &&super::Retired| !words.is_empty() && retired.command == words.as_str();
        for retired in variables.retired.iter().filter(of_command) {
            let mut options = command.get_arguments().filter(|arg| arg.get_long() == Some(retired.option));
            if options.any(|arg| arg.get_env() == Some(retired.variable.as_ref())) {
                faults.push(format!(
                    "{words} --{}: it reads {}, which is retired",
                    retired.option, retired.variable
                ));
            }
        }
    }
    for words in variables.offline {
        if commands.iter().all(|(name, _)| name != words) {
            faults.push(format!("no command {words} exists"));
        }
    }
    faults
}

/// Returns the reason why the variable of an option cannot be of this kind. Returns `None` if it can.
fn misfit(kind: Kind, arg: &Arg, names_place: bool) -> Option<&'static str> {
    let is_flag = matches!(arg.get_action(), ArgAction::SetTrue | ArgAction::SetFalse);
    match kind {
        Kind::File | Kind::Output if is_flag || !names_place => Some("its value is not a file or folder"),
        Kind::Line | Kind::Limit if is_flag => Some("it has no value"),
        Kind::Caution if !is_flag => Some("it has a value"),
        _ if is_flag && arg.get_value_parser().type_id() != clap::builder::ValueParser::bool().type_id() => {
            Some("it is not an on/off option")
        }
        _ => None,
    }
}

/// Returns `true` if two commands use the same variable for the same option.
fn mean_the_same(kind: Kind, one: &Arg, other: &Arg) -> bool {
    let help = |arg: &Arg| arg.get_help().map(ToString::to_string);
    one.get_long() == other.get_long()
        && value_name(one) == value_name(other)
        && (!matches!(kind, Kind::Output | Kind::Limit) || help(one) == help(other))
}

fn value_name(arg: &Arg) -> Option<String> {
    let names = arg.get_value_names().filter(|_| arg.get_action().takes_values())?;
    names.first().map(ToString::to_string)
}

/// Collects all options of a command line, each with the words of its command, for example `update --data`. The
/// function collects a global option only once.
fn collect<'a>(command: &'a Command, words: &str, options: &mut Vec<(String, &'a Arg)>) {
    for arg in command.get_arguments().filter(|arg| words.is_empty() || !arg.is_global_set()) {
        if let Some(long) = arg.get_long() {
            options.push((format!("{words} --{long}").trim().to_owned(), arg));
        }
    }
    for sub in command.get_subcommands() {
        collect(sub, format!("{words} {}", sub.get_name()).trim(), options);
    }
}

/// Returns all commands with the words that select them.
fn commands(root: &Command) -> Vec<(String, &Command)> {
    fn walk<'a>(command: &'a Command, words: &str, all: &mut Vec<(String, &'a Command)>) {
        all.push((words.to_owned(), command));
        for sub in command.get_subcommands() {
            walk(sub, format!("{words} {}", sub.get_name()).trim(), all);
        }
    }
    let mut all = Vec::new();
    walk(root, "", &mut all);
    all
}
