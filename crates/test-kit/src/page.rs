//! Parts of a document that show the output of commands. A test runs the commands and compares their output with the document.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Maximum number of output lines that the page shows completely.
const LINES_MAX: usize = 12;
/// Numbers of lines that the page shows at the start and at the end of a longer output.
const SHOWN: (usize, usize) = (5, 4);
/// Maximum number of runs of a case whose output depends on timing. If the output of no run matches the page, the case has
/// changed.
const TRIES: usize = 4;

/// Words before a number that identifies an item, such as a joint. The comparison does not replace such a number by
/// `…`.
const KEPT: [&str; 9] =
    ["joint ", "joints ", "board ", "boards ", "number ", "code ", "stop ", "certain: ", "localhost:"];

/// Part of a document that contains command output.
pub struct Page {
    file: PathBuf,
    name: &'static str,
    /// Current text of this part of the document.
    old: String,
    text: String,
}

/// Output of a command (stdout and stderr in their common order) and its exit code.
pub struct Printed {
    /// Exit code.
    pub code: i32,
    /// Combined text of stdout and stderr.
    pub text: String,
}

impl Page {
    /// Opens the part `name` of `docs/FILE`. The part is between `<!-- NAME begin -->` and `<!-- NAME end -->`.
    ///
    /// # Panics
    /// Panics if the document or the marks of the part are missing.
    pub fn new(file: &str, name: &'static str) -> Self {
        let file = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs")).join(file);
        let whole = std::fs::read_to_string(&file).expect("the document is there");
        let (begin, end) = marks(&whole, name);
        Self { file, name, old: whole[begin..end].to_owned(), text: "\n".into() }
    }

    /// Adds a heading above the next cases.
    pub fn group(&mut self, title: &str) {
        let _ = write!(self.text, "## {title}\n\n");
    }

    /// Adds a text to the part unchanged.
    pub fn text(&mut self, text: &str) {
        self.text += text;
    }

    /// Adds a case: the user's mistake, the command, and the output of the command.
    pub fn case(&mut self, title: &str, command: &str, printed: &Printed) {
        self.text += &block(title, command, printed);
    }

    /// Adds a case whose output depends on timing. If the output differs from the document, the case is run again.
    pub fn case_of_a_moment(&mut self, title: &str, command: &str, mut run: impl FnMut() -> Printed) {
        let mut made = String::new();
        for _ in 0..TRIES {
            made = block(title, command, &run());
            if updating() || self.old.contains(&made) {
                break;
            }
            eprintln!("another output this time:\n{made}");
        }
        self.text += &made;
    }

    /// Compares this part with the document, or writes the part if `UPDATE_DOCS=1` is set.
    ///
    /// # Panics
    /// Panics if the document differs. The message contains the first lines that differ.
    pub fn finish(self) {
        if self.old == self.text {
            return;
        }
        if updating() {
            // The function reads the document again, because another test may have written another part in the meantime.
            let whole = std::fs::read_to_string(&self.file).expect("the document is there");
            let (begin, end) = marks(&whole, self.name);
            let new = format!("{}{}{}", &whole[..begin], self.text, &whole[end..]);
            std::fs::write(&self.file, new).expect("the document can be written");
            return;
        }
        let mut lines = self.old.lines().zip(self.text.lines()).enumerate();
        let first = lines.find(|(_, (old, new))| old != new);
        let (line, (old, new)) = first.unwrap_or((0, ("", "one is longer than the other")));
        panic!(
            "{} does not say what the tests have found, first at line {line} of the part `{}`:\n  document: {old}\n  found:    {new}\n\
             look at the difference, then write it again with UPDATE_DOCS=1\n{}",
            self.file.display(),
            self.name,
            self.text
        );
    }
}

/// Compares the part `name` of `docs/FILE` with the text `text`, or writes the part if `UPDATE_DOCS=1` is set.
///
/// # Panics
/// Panics in the same cases as [`Page::new`] and [`Page::finish`].
pub fn part(file: &str, name: &'static str, text: &str) {
    Page { text: text.to_owned(), ..Page::new(file, name) }.finish();
}

/// Checks that the description of an API has each request in `names`, such as `Stop (POST /api/stop)`. A name without
/// a request must be a command.
///
/// # Panics
///
/// Panics if the description does not have a request.
pub fn check_requests<'a>(description: &str, names: impl Iterator<Item = &'a str>) {
    let description: serde_json::Value = serde_json::from_str(description).expect("JSON");
    for name in names {
        let words: Vec<&str> = name.split([' ', '(', ')']).collect();
        let Some(i) = words.iter().position(|word| word.starts_with('/')) else {
            let typed = name.starts_with("jtc ") || name.ends_with(": true");
            assert!(typed, "{name} is neither a request nor a command");
            continue;
        };
        let (method, path) = (words[i - 1].to_lowercase(), words[i]);
        assert!(description["paths"][path][&method].is_object(), "{name}: {method} {path}");
    }
}

/// Compares `docs/FILE` with this text, or writes the file if `UPDATE_DOCS=1` is set.
///
/// # Panics
/// Panics if the document differs. The message contains the first line that differs and the command that updates the document.
pub fn whole(file: &str, text: &str) {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs")).join(file);
    if updating() {
        std::fs::write(&path, text).expect("the document can be written");
        return;
    }
    let old = std::fs::read_to_string(&path).unwrap_or_default();
    if old != text {
        let (mut old, mut new, mut line) = (old.lines(), text.lines(), 1);
        let (was, is) = loop {
            match (old.next(), new.next()) {
                (was, is) if was == is && was.is_some() => line += 1,
                differ => break differ,
            }
        };
        panic!(
            "docs/{file} is old, first at line {line}:\n  document: {}\n  code:     {}\nwrite it again: run this test with UPDATE_DOCS=1",
            was.unwrap_or_default(),
            is.unwrap_or_default()
        );
    }
}

fn updating() -> bool {
    std::env::var_os("UPDATE_DOCS").is_some()
}

fn marks(whole: &str, name: &str) -> (usize, usize) {
    let mark = format!("<!-- {name} begin -->\n");
    let begin = whole.find(&mark).expect("the document has the beginning mark") + mark.len();
    let end = whole.find(&format!("<!-- {name} end -->")).expect("the document has the end mark");
    (begin, end)
}

fn block(title: &str, command: &str, printed: &Printed) -> String {
    let mut text = format!("### {title}\n\n```console\n");
    for line in command.lines() {
        let _ = writeln!(text, "$ {line}");
    }
    let lines: Vec<&str> =
        printed.text.lines().filter(|line| !crate::shows_variables(line)).map(str::trim_end).collect();
    let left_out = if lines.len() > LINES_MAX { lines.len() - SHOWN.0 - SHOWN.1 } else { 0 };
    for (i, line) in lines.iter().enumerate() {
        match i.checked_sub(SHOWN.0) {
            Some(0) if left_out > 0 => {
                let _ = writeln!(text, "  ({left_out} lines more)");
            }
            Some(n) if n < left_out => {}
            _ => {
                let _ = writeln!(text, "{line}");
            }
        }
    }
    let _ = write!(text, "exit code {}\n```\n\n", printed.code);
    text
}

/// Returns the text without the parts that differ from run to run. Tables of measured values are omitted. Numbers are
/// replaced by `…`, except the numbers of joints and boards, and numbers that are part of a name.
pub fn blurred(text: &str) -> String {
    let mut out = String::new();
    for line in text.lines().filter(|line| !is_figures(line)) {
        let mut rest = line;
        while let Some(at) = rest.find(|c: char| c.is_ascii_digit()) {
            let (before, from) = rest.split_at(at);
            let end = from.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(from.len());
            // A full stop at the end of a sentence does not belong to the number.
            let number = from[..end].trim_end_matches('.').len();
            let hex = from
                .strip_prefix("0x")
                .map(|digits| 2 + digits.find(|c: char| !c.is_ascii_hexdigit()).unwrap_or(digits.len()));
            let end = hex.unwrap_or(number);
            let named = KEPT.iter().any(|w| before.ends_with(w));
            // A number before a hyphen and another number is part of a date, which stays unchanged.
            let named = named
                || from[end..].strip_prefix('-').is_some_and(|r| r.starts_with(|c: char| c.is_ascii_digit()));
            let part = before.ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == '-');
            out += before;
            out += if named || part || hex.is_some() { &from[..end] } else { "…" };
            rest = &from[end..];
        }
        out += rest;
        out.push('\n');
    }
    out
}

/// Returns `true` for a row or the head of a table of measured values.
fn is_figures(line: &str) -> bool {
    let words: Vec<&str> = line.split_whitespace().collect();
    let number =
        |w: &&str| w.trim_start_matches(['-', '−']).starts_with(|c: char| c.is_ascii_digit() || c == '–');
    let numbers = words.iter().filter(|w| number(w)).count();
    (line.contains("   ") && numbers >= 4) || line.contains("RMS mrad") || line.contains("commanded rad")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_differs_from_run_to_run_is_blurred() {
        let text = "fault: 1.68 s\njoint 1      0.162      0.373        0.410       17.9\njoint 3: over at point 1479 (1.479 s).\n";
        assert_eq!(blurred(text), "fault: … s\njoint 3: over at point … (… s).\n");
        assert_eq!(
            blurred("board 2: run.csv is v1, 0xF1 in 5 tries"),
            "board 2: run.csv is v1, 0xF1 in … tries\n"
        );
    }

    #[test]
    fn long_output_is_shortened() {
        let text: String = (0..20).map(|i| format!("line {i}\n")).collect();
        let shown = block("a", "jtc x", &Printed { code: 4, text });
        assert!(
            shown.contains("line 4\n  (11 lines more)\nline 16\n") && shown.ends_with("exit code 4\n```\n\n"),
            "{shown}"
        );
    }
}
