//! Where words go: results to stdout as text or JSON, progress and logs to stderr.

use std::io::{IsTerminal, Write};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;
use serde_json::json;

/// Why the first result that was lost could not be printed. A command goes on without its output; its exit code says so in the end.
static LOST: OnceLock<String> = OnceLock::new();
/// A write to stdout has failed, for whatever reason.
static GONE: AtomicBool = AtomicBool::new(false);

/// How a command speaks.
#[derive(Clone, Copy, Debug)]
pub struct Output {
    program: &'static str,
    json: bool,
}

impl Output {
    /// The program's name before what went wrong; text, or JSON objects.
    pub fn new(program: &'static str, json: bool) -> Self {
        Self { program, json }
    }

    /// JSON was asked for.
    pub fn is_json(&self) -> bool {
        self.json
    }

    /// A result as it is printed: `value` as one line of JSON, or the text.
    pub fn words(&self, value: &impl Serialize, text: impl FnOnce() -> String) -> String {
        if self.json {
            serde_json::to_string(value)
                .unwrap_or_else(|e| json!({ "error": { "message": e.to_string() } }).to_string())
        } else {
            text()
        }
    }

    /// Prints a result: `value` as one line of JSON, or the text.
    pub fn result(&self, value: &impl Serialize, text: impl FnOnce() -> String) {
        let line = self.words(value, text);
        Self::bytes(format!("{}\n", line.trim_end()).as_bytes());
    }

    /// Prints a result that is a file of its own, as it is.
    pub fn bytes(bytes: &[u8]) {
        let mut stdout = std::io::stdout().lock();
        if let Err(e) = stdout.write_all(bytes).and_then(|()| stdout.flush()) {
            Self::lose(&e);
        }
    }

    /// Remembers why something that was meant for stdout was lost. A reader that has gone (`… | head`) has seen what it wanted: that is no loss.
    pub fn lose(why: &std::io::Error) {
        GONE.store(true, Ordering::Relaxed);
        if why.kind() != std::io::ErrorKind::BrokenPipe {
            let _ = LOST.set(why.to_string());
        }
    }

    /// Nothing printed from now on is read: a command that only prints may end.
    pub fn gone() -> bool {
        GONE.load(Ordering::Relaxed)
    }

    /// Why a result could not be printed, where that was so: the command did its work, and nobody can read of it.
    pub fn lost() -> Option<&'static str> {
        LOST.get().map(String::as_str)
    }

    /// One line of a log. A terminal that has gone is no reason to leave a machine alone: what cannot be printed is dropped.
    pub fn note(&self, text: impl std::fmt::Display) {
        let _ = writeln!(std::io::stderr().lock(), "{text}");
    }

    /// A bar on stderr; invisible where stderr is no terminal.
    pub fn bar(&self, total: u64, what: &str) -> ProgressBar {
        let bar = ProgressBar::with_draw_target(Some(total), target());
        let style = ProgressStyle::with_template("{msg:8} {wide_bar:.cyan/dim} {pos:>5}/{len} {elapsed:>5}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("━╸─"));
        bar.set_message(what.to_owned());
        bar
    }

    /// A bar of bytes on stderr, with the words of its owner behind it.
    pub fn bytes_bar(&self, total: u64, what: &str) -> ProgressBar {
        let bar = ProgressBar::with_draw_target(Some(total), target());
        let style =
            ProgressStyle::with_template("{prefix:9} {bar:32.cyan/dim} {bytes:>9} of {total_bytes}  {msg}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("━╸─"));
        bar.set_prefix(what.to_owned());
        bar
    }

    /// Prints why a command failed: the exit code, a short name for programs, what happened, what to do next.
    pub fn failure(&self, exit: u8, code: &str, message: &str, hint: &str) {
        if self.json {
            let error = json!({ "code": code, "message": message, "hint": hint, "exit": exit });
            let _ = writeln!(std::io::stdout().lock(), "{}", json!({ "error": error }));
        }
        self.note(format_args!("{}: {message}", self.program));
        if !hint.is_empty() {
            self.note(format_args!("{:1$}  {hint}", "", self.program.len()));
        }
    }
}

fn target() -> ProgressDrawTarget {
    if std::io::stderr().is_terminal() { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() }
}

/// A number with so many decimals; one that rounds to zero has no sign.
pub fn figure(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$}");
    match text.strip_prefix('-') {
        Some(zero) if zero.bytes().all(|b| matches!(b, b'0' | b'.')) => zero.to_owned(),
        _ => text,
    }
}

/// Rows as a text table; words to the left, columns whose head begins with `>` (figures) to the right.
pub fn table(head: &[&str], rows: &[Vec<String>]) -> String {
    let right: Vec<bool> = head.iter().map(|h| h.starts_with('>')).collect();
    let head: Vec<&str> = head.iter().map(|h| h.trim_start_matches('>')).collect();
    let width = |i: usize| {
        let cells = rows.iter().filter_map(|r| r.get(i)).map(|c| c.chars().count());
        cells.chain([head[i].chars().count()]).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..head.len()).map(width).collect();
    let line = |cells: &[String]| {
        let mut text = String::new();
        for (i, (cell, w)) in cells.iter().zip(&widths).enumerate() {
            let room = w - cell.chars().count().min(*w);
            let space = " ".repeat(room);
            let gap = if i == 0 { "" } else { "   " };
            text += &if right[i] { format!("{gap}{space}{cell}") } else { format!("{gap}{cell}{space}") };
        }
        text.trim_end().to_owned()
    };
    let head: Vec<String> = head.iter().map(|h| (*h).to_owned()).collect();
    let mut text = line(&head) + "\n";
    for row in rows {
        text += &(line(row) + "\n");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_figure_that_rounds_to_zero_has_no_sign() {
        let all = [(-0.0004, 3), (-0.0, 1), (-0.4, 0), (-0.0006, 3), (-1.0, 0), (2.5, 1)];
        assert_eq!(all.map(|(v, d)| figure(v, d)), ["0.000", "0.0", "0", "-0.001", "-1", "2.5"]);
    }
}
