//! Test support that runs a command in the same way as a user, with or without a terminal.

#[cfg(unix)]
mod screen;
#[cfg(unix)]
mod terminal;

use std::io::Write;
use std::process::{Child, Command, Stdio};

use host_kit::{Action, FrontEnd};
use serde_json::Value;

#[cfg(unix)]
pub use screen::Picture;
#[cfg(unix)]
pub use terminal::Terminal;

/// Checks that each paragraph of prose below the help of a command is one line, because clap wraps each line to the
/// width of the terminal. Lines that begin with a space are examples or tables.
///
/// # Panics
///
/// Panics if a paragraph has several lines.
pub fn check_help_is_wrapped_once(command: &clap::Command) {
    for help in [command.get_after_help(), command.get_after_long_help(), command.get_long_about()] {
        let text = help.map(ToString::to_string).unwrap_or_default();
        let is_prose = |line: &str| !line.is_empty() && !line.starts_with(' ');
        for (line, next) in text.lines().zip(text.lines().skip(1)) {
            let broken = is_prose(line) && !line.ends_with(':') && is_prose(next);
            assert!(!broken, "{}: a line break within a paragraph:\n{line}\n{next}", command.get_name());
        }
    }
    command.get_subcommands().for_each(check_help_is_wrapped_once);
}

/// Checks that the command line has every command and option that the next step of an error can name ([`Action`]). In
/// these names, words in capitals stand for a value that the user chooses.
///
/// # Panics
///
/// Panics if the command line does not have such a command or option.
pub fn check_commands_of_next_steps(program: &clap::Command) {
    let own = format!("{} ", program.get_name());
    let commands = Action::ALL.iter().map(|action| action.name(FrontEnd::Command));
    for (name, words) in commands.filter_map(|name| Some((name, name.strip_prefix(&own)?))) {
        let is_typed = |word: &&str| word.chars().all(|c| c.is_lowercase() || c == '-');
        let mut command = program;
        for word in words.split(' ').take_while(is_typed) {
            let found = match word.strip_prefix("--") {
                Some(option) => command.get_arguments().any(|arg| arg.get_long() == Some(option)),
                None => match command.find_subcommand(word) {
                    Some(sub) => {
                        command = sub;
                        true
                    }
                    None => word == "all",
                },
            };
            assert!(found, "{name}: {word}");
        }
    }
}

/// Output of a command and its exit code.
pub struct CommandOutput {
    /// Exit code of the command; −1 if a signal ended the command.
    pub code: i32,
    /// Text that the command printed to stdout.
    pub out: String,
    /// Text that the command printed to stderr.
    pub err: String,
}

impl CommandOutput {
    /// Returns the result of the command: the last line of stdout as one JSON object. Panics if the line is not JSON.
    pub fn json(&self) -> Value {
        let error = |e| panic!("{e}: stdout is {:?}, stderr {:?}", self.out, self.err);
        serde_json::from_str(self.out.trim().lines().last().unwrap_or_default()).unwrap_or_else(error)
    }

    /// Returns the lines of stderr as JSON objects. Panics if a line is not JSON.
    pub fn events(&self) -> Vec<Value> {
        let parse = |line| serde_json::from_str(line).unwrap_or_else(|e| panic!("{e}: {line:?}"));
        self.err.lines().map(parse).collect()
    }

    /// Returns the output if the command ended with this exit code. Panics if the exit code is different.
    pub fn ends(self, code: i32) -> Self {
        assert_eq!(self.code, code, "stdout: {}\nstderr: {}", self.out, self.err);
        self
    }
}

/// Returns a program that runs without environment variables that begin with `prefix`.
pub fn program(path: &str, prefix: &str) -> Command {
    let mut command = Command::new(path);
    for (name, _) in std::env::vars().filter(|(name, _)| name.starts_with(prefix)) {
        command.env_remove(name);
    }
    command
}

/// Runs a command with these arguments and this stdin, and waits for its end.
pub fn run(mut command: Command, words: &[&str], stdin: &str) -> CommandOutput {
    let pipes = command.args(words).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = pipes.spawn().expect("it starts");
    // The write fails if the command ends without reading its stdin; this is not an error.
    child.stdin.take().expect("stdin").write_all(stdin.as_bytes()).ok();
    ended(child)
}

/// Waits for the end of a started command and returns its output.
pub fn ended(child: Child) -> CommandOutput {
    let output = child.wait_with_output().expect("it ends");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    CommandOutput {
        code: output.status.code().unwrap_or(-1),
        out: text(&output.stdout),
        err: text(&output.stderr),
    }
}

/// Sends a signal to a process that the test started. The name is an option of `kill`, such as `-INT`.
pub fn signal(child: &Child, name: &str) {
    Command::new("kill").args([name, &child.id().to_string()]).status().expect("kill");
}
