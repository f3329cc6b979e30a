//! Terminal of a reader who runs the commands of a page: a shell, and the output of the shell.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use crate::patience::Patience;

/// Mark that the shell prints after each command, followed by the exit code. Commands never print this mark.
const END: &str = "\u{1}end of the command ";

/// A shell, or the program that has replaced the shell.
pub(super) struct Terminal {
    child: Child,
    stdin: ChildStdin,
    lines: Receiver<String>,
}

impl Terminal {
    /// Starts a shell in the folder `folder`. The shell searches commands in `programs` first. The function removes environment
    /// variables that begin with an element of `without`.
    pub(super) fn new(folder: &Path, programs: &Path, without: &[&str]) -> Self {
        let mut shell = Command::new("bash");
        shell.args(["--norc", "--noprofile"]).current_dir(folder);
        for (name, _) in std::env::vars().filter(|(name, _)| without.iter().any(|w| name.starts_with(w))) {
            shell.env_remove(name);
        }
        let path = std::env::var("PATH").unwrap_or_default();
        let state = folder.join(".home");
        std::fs::create_dir_all(&state).expect("a home");
        // The directory is private, because agents store files in it that only their user may read.
        std::fs::set_permissions(&state, std::os::unix::fs::PermissionsExt::from_mode(0o700))
            .expect("rights");
        shell.env("PATH", format!("{}:{path}", programs.display())).env("COLUMNS", "100");
        for name in ["HOME", "XDG_RUNTIME_DIR", "XDG_STATE_HOME", "XDG_CACHE_HOME", "XDG_CONFIG_HOME"] {
            shell.env(name, &state);
        }
        shell.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut child = shell.spawn().expect("bash starts");
        let mut stdin = child.stdin.take().expect("stdin");
        let out = child.stdout.take().expect("stdout");
        let (sender, lines) = channel();
        std::thread::spawn(move || {
            for line in BufReader::new(out).split(b'\n') {
                let Ok(line) = line else { break };
                let line = String::from_utf8_lossy(&line).into_owned();
                if !crate::shows_variables(&line) && sender.send(line).is_err() {
                    break;
                }
            }
        });
        // The shell merges stdout and stderr in their order, as on a screen.
        writeln!(stdin, "exec 2>&1").expect("bash reads");
        Self { child, stdin, lines }
    }

    /// Runs a command until it ends, and returns the output and the exit code of the command.
    ///
    /// # Panics
    /// Panics if the command does not end.
    pub(super) fn run(&mut self, command: &str) -> (Vec<String>, i32) {
        // The command has no stdin; otherwise it would read the line that is typed next. The subshell sets `$?` for the next command.
        let typed = format!("{{ {command}\n}} < /dev/null\n__code=$?; echo \"{END}$__code\"; (exit $__code)");
        self.type_line(&typed);
        let mut printed = Vec::new();
        loop {
            let Some(line) = Patience::begin().receive(&self.lines) else {
                panic!("`{command}` does not end; it printed\n{}", printed.join("\n"))
            };
            // If the output does not end with a line break, the mark is in the last output line.
            if let Some((before, code)) = line.split_once(END) {
                printed.extend(Some(before.to_owned()).filter(|before| !before.is_empty()));
                return (printed, code.trim().parse().expect("a code"));
            }
            printed.push(line);
        }
    }

    /// Replaces the shell by a command that keeps running.
    pub(super) fn start(&mut self, command: &str) {
        self.type_line(&format!("exec {command}"));
    }

    /// Types a line into the terminal.
    pub(super) fn type_line(&mut self, line: &str) {
        writeln!(self.stdin, "{line}").expect("it reads what is typed");
    }

    /// Returns the next output line. Returns `None` at the end of the output, or if no line is printed within the time `within`.
    pub(super) fn line(&mut self, within: Duration) -> Option<String> {
        self.lines.recv_timeout(within).ok()
    }

    /// Returns the output lines up to and including the first line for which `last` returns `true`. Returns all lines if no line
    /// fulfils `last`.
    pub(super) fn lines_until(&mut self, last: impl Fn(&str) -> bool) -> Vec<String> {
        let (mut patience, mut printed) = (Patience::begin(), Vec::new());
        while let Some(line) = patience.receive(&self.lines) {
            let ends = last(&line);
            printed.push(line);
            if ends {
                break;
            }
        }
        printed
    }

    /// Sends Ctrl-C to the program that has replaced the shell.
    pub(super) fn interrupt(&self) {
        Command::new("kill").args(["-INT", &self.child.id().to_string()]).status().expect("kill");
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        self.child.kill().ok();
        self.child.wait().ok();
    }
}
