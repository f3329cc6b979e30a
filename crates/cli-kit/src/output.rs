//! Output of a command: results to stdout as text or JSON, progress and logs to stderr.
//!
//! With JSON, a long command prints events to stderr while it works, one object per line with the key `event`. Stdout
//! contains only the result of the command. A blocked reader does not block a command: events wait in a queue, and
//! excess events are dropped.

use std::io::{IsTerminal, Write};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::Instant;

use host_kit::{visible, visible_in_line};
use indicatif::ProgressBar;
use serde::Serialize;
use serde_json::{Value, json};

use crate::bar::{self, suspended};
use crate::lines::Lines;
use crate::stdout;
use crate::{Failure, error_object};

/// Events of this process that wait until the reader accepts them. Empty if the process does not stream events.
static STREAM: OnceLock<Mutex<Stream>> = OnceLock::new();

/// Lines of an event stream, and the start time of the stream.
struct Stream {
    lines: Lines,
    began: Instant,
}

/// Output format of a command.
#[derive(Clone, Copy, Debug)]
pub struct Output {
    program: &'static str,
    json: bool,
}

impl Output {
    /// Creates an output. The name `program` is printed before errors; `json` selects JSON objects instead of text.
    pub fn new(program: &'static str, json: bool) -> Self {
        Self { program, json }
    }

    /// Returns `true` if JSON was requested.
    pub fn is_json(&self) -> bool {
        self.json
    }

    /// Starts the event stream. The command then prints events as they occur, and prints notes as events. Does nothing
    /// unless JSON was requested.
    pub fn stream(&self) -> std::io::Result<()> {
        if self.json && STREAM.get().is_none() {
            let _ = STREAM.set(Mutex::new(Stream { lines: Lines::stderr()?, began: Instant::now() }));
        }
        Ok(())
    }

    /// Prints an event, with the seconds since the stream began. Does nothing without an event stream.
    pub fn event(&self, name: &str, value: Value) {
        let Some(stream) = STREAM.get() else { return };
        let stream = stream.lock().unwrap_or_else(PoisonError::into_inner);
        let time_s = (stream.began.elapsed().as_secs_f64() * 1e3).round() / 1e3;
        let mut event = json!({ "event": name, "time_s": time_s });
        if let (Some(event), Value::Object(value)) = (event.as_object_mut(), value) {
            event.extend(value);
        }
        stream.lines.push(event.to_string());
    }

    /// Prints the waiting lines of the event stream as long as the reader accepts them.
    pub fn finish() {
        let Some(stream) = STREAM.get() else { return };
        stream.lock().unwrap_or_else(PoisonError::into_inner).lines.finish();
    }

    /// Formats a result: `value` as one line of JSON, or the text.
    pub fn words(&self, value: &impl Serialize, text: impl FnOnce() -> String) -> String {
        if self.json {
            serde_json::to_string(value)
                .unwrap_or_else(|e| json!({ "error": { "message": e.to_string() } }).to_string())
        } else {
            text()
        }
    }

    /// Prints a result: `value` as one line of JSON, or the text. On a terminal, the text is wrapped between words.
    pub fn result(&self, value: &impl Serialize, text: impl FnOnce() -> String) {
        let width = if self.json { None } else { stdout_width() };
        let line = within(&visible(&self.words(value, text)), width);
        Self::bytes(format!("{}\n", line.trim_end()).as_bytes());
    }

    /// Prints a result that is a complete file, without changes.
    pub fn bytes(bytes: &[u8]) {
        suspended(|| {
            let mut stdout = std::io::stdout().lock();
            if let Err(e) = stdout.write_all(bytes).and_then(|()| stdout.flush()) {
                stdout::lose(&e);
            }
        });
    }

    /// Stores the reason why output to stdout was lost. A reader that has disconnected (`… | head`) has read enough, so
    /// the function does not store this case as a loss.
    pub fn lose(why: &std::io::Error) {
        stdout::lose(why);
    }

    /// Returns `true` if no reader accepts further output. A command that only prints can then end.
    pub fn gone() -> bool {
        stdout::is_gone()
    }

    /// Returns the reason why a result could not be printed, or `None` if the result was printed. If a reason is
    /// returned, the command was successful, but the user cannot read the result.
    pub fn lost() -> Option<&'static str> {
        stdout::lost()
    }

    /// Prints one line of a log. If the terminal is lost, the line is dropped without an error, so that the command
    /// continues to control its machine.
    pub fn note(&self, text: impl std::fmt::Display) {
        if STREAM.get().is_some() {
            self.event("note", json!({ "text": text.to_string().trim() }));
            return;
        }
        let text = within(&visible(&text.to_string()), bar::stderr_width());
        suspended(|| drop(writeln!(std::io::stderr().lock(), "{text}")));
    }

    /// Prints one line of a log before the command begins. With JSON, the line has the form of an event `note`,
    /// because the command may print events later.
    pub(crate) fn log(&self, text: &str) {
        if !self.json {
            return self.note(text);
        }
        let event = json!({ "event": "note", "time_s": 0.0, "text": text }).to_string();
        suspended(|| drop(writeln!(std::io::stderr().lock(), "{}", visible(&event))));
    }

    /// Creates a progress bar on stderr, which is invisible if stderr is not a terminal.
    pub fn bar(&self, total: u64, what: &str) -> ProgressBar {
        bar::of_steps(total, what)
    }

    /// Creates a progress bar of bytes on stderr, with the text that the caller sets below the bar.
    pub fn bytes_bar(&self, total: u64, what: &str) -> ProgressBar {
        bar::of_bytes(total, what)
    }

    /// Creates a progress bar on stderr for a motion of `total_ms` milliseconds. Below the bar are the text that the
    /// caller sets, and the key help `keys`.
    pub fn motion_bar(&self, total_ms: u64, what: &str, keys: &str) -> ProgressBar {
        bar::of_motion(total_ms, what, keys)
    }

    /// Prints the reason why a command failed.
    pub fn failure(&self, failure: &Failure) {
        if self.json {
            let error = json!({ "error": error_object(failure) }).to_string();
            let _ = writeln!(std::io::stdout().lock(), "{}", visible(&error));
        }
        self.warn(&failure.message, &failure.next.to_string());
    }

    /// Prints an error and the next step, in the same form as at the end of a command. On a terminal, the text is wrapped between
    /// words.
    pub fn warn(&self, message: &str, hint: &str) {
        let width = bar::stderr_width();
        self.note(hanging(&format!("{}: ", self.program), message, width));
        if !hint.is_empty() {
            self.note(hanging(&" ".repeat(self.program.len() + 2), hint, width));
        }
    }
}

/// Wraps long lines between words. Rows of tables stay unchanged.
fn within(text: &str, width: Option<u16>) -> String {
    let Some(width) = width.filter(|width| *width >= 16) else { return text.to_owned() };
    let lines = text.lines().map(|line| {
        let words = line.trim_start();
        let head = &line[..line.len() - words.len()];
        let fits = line.chars().count() <= usize::from(width);
        if fits || words.contains("  ") || head.len() + 16 > usize::from(width) {
            line.to_owned()
        } else {
            hanging(head, words, Some(width + 1))
        }
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// Formats text after a heading. Further lines are aligned with the start of the text in the first line. The text is
/// unchanged if the width is unknown.
fn hanging(head: &str, text: &str, width: Option<u16>) -> String {
    let Some(room) = width.and_then(|w| w.checked_sub(head.len() as u16 + 1)).filter(|room| *room >= 16)
    else {
        return format!("{head}{text}");
    };
    let lines = text.lines().flat_map(|line| crate::view::wrapped(line, room)).collect::<Vec<_>>();
    format!("{head}{}", lines.join(&format!("\n{:1$}", "", head.len())))
}

/// Formats a number with `digits` decimals. A number that rounds to zero has no sign.
pub fn figure(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$}");
    match text.strip_prefix('-') {
        Some(zero) if zero.bytes().all(|b| matches!(b, b'0' | b'.')) => zero.to_owned(),
        _ => text,
    }
}

/// Returns the number of columns of the terminal on stdout; `None` if stdout is not a terminal.
fn stdout_width() -> Option<u16> {
    std::io::stdout().is_terminal().then(|| crossterm::terminal::size().ok()).flatten().map(|size| size.0)
}

/// Formats rows as a text table. Words are aligned to the left. Columns whose heading begins with `>` (numbers) are
/// aligned to the right. If the terminal is too narrow for all columns, the columns that do not fit follow below, with
/// the first column repeated.
pub fn table(head: &[&str], rows: &[Vec<String>]) -> String {
    table_within(head, rows, stdout_width())
}

fn table_within(head: &[&str], rows: &[Vec<String>], width: Option<u16>) -> String {
    let text = whole_table(head, rows);
    let widest = text.lines().map(|line| line.chars().count()).max().unwrap_or(0);
    let Some(width) = width.filter(|width| usize::from(*width) < widest) else { return text };
    // Selects as many columns as fit to the right of the first column, but at least one.
    for count in (2..head.len()).rev() {
        let rest: Vec<usize> = (count..head.len()).collect();
        let pick = |columns: &[usize]| {
            let head: Vec<&str> = columns.iter().map(|c| head[*c]).collect();
            let cell = |row: &Vec<String>, c: &usize| row.get(*c).cloned().unwrap_or_default();
            let rows: Vec<Vec<String>> =
                rows.iter().map(|row| columns.iter().map(|c| cell(row, c)).collect()).collect();
            (head, rows)
        };
        let (first_head, first_rows) = pick(&(0..count).collect::<Vec<_>>());
        let first = whole_table(&first_head, &first_rows);
        if count == 2 || first.lines().all(|line| line.chars().count() <= usize::from(width)) {
            let (rest_head, rest_rows) = pick(&[vec![0], rest].concat());
            return format!("{first}\n{}", table_within(&rest_head, &rest_rows, Some(width)));
        }
    }
    text
}

fn whole_table(head: &[&str], rows: &[Vec<String>]) -> String {
    // A text from a bus or a file must not look like another row.
    let rows: Vec<Vec<String>> =
        rows.iter().map(|row| row.iter().map(|cell| visible_in_line(cell).into_owned()).collect()).collect();
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
    for row in &rows {
        text += &(line(row) + "\n");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notes_are_broken_between_words_and_rows_of_tables_are_not() {
        assert_eq!(within("  one two three four five", Some(20)), "  one two three four\n  five");
        assert_eq!(within("one   two   three   four", Some(20)), "one   two   three   four");
        assert_eq!(within("one two three four five", None), "one two three four five");
    }

    /// On a narrow terminal, columns that do not fit are shown below, and no column is truncated.
    #[test]
    fn columns_without_room_come_below() {
        let rows = [vec!["joint 1".into(), "0.201".into(), "0.773".into(), "12".into()]];
        let head = ["", ">RMS", ">max", ">share %"];
        assert_eq!(table_within(&head, &rows, None).lines().count(), 2);
        let narrow =
            "            RMS     max\njoint 1   0.201   0.773\n\n          share %\njoint 1        12\n";
        assert_eq!(table_within(&head, &rows, Some(24)), narrow);
    }

    #[test]
    fn what_is_wrong_is_broken_between_words_below_its_head() {
        assert_eq!(
            hanging("jtc: ", "joint 3 does not answer", Some(22)),
            "jtc: joint 3 does not\n     answer"
        );
        assert_eq!(hanging("jtc: ", "joint 3 does not answer", None), "jtc: joint 3 does not answer");
    }

    #[test]
    fn a_figure_that_rounds_to_zero_has_no_sign() {
        let all = [(-0.0004, 3), (-0.0, 1), (-0.4, 0), (-0.0006, 3), (-1.0, 0), (2.5, 1)];
        assert_eq!(all.map(|(v, d)| figure(v, d)), ["0.000", "0.0", "0", "-0.001", "-1", "2.5"]);
    }
}
