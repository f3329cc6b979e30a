//! Fenced blocks of a page, and the comments that specify how the test runs each block.

use std::ops::Range;

/// Kind of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Commands after `$ `, each followed by its output.
    Console,
    /// Commands without output.
    Sh,
    /// Text that is typed into a running program.
    Text,
}

/// Block that the test uses when it runs the page.
#[derive(Clone, Debug)]
pub struct Block {
    /// Kind of the block.
    pub kind: Kind,
    /// Line number of the opening fence, counted from 1.
    pub line: usize,
    /// Byte range in the page that contains the lines of the block without the fences.
    pub body: Range<usize>,
    /// Text between the fences of the block.
    pub text: String,
    /// Options in the comment directly above the block.
    notes: Vec<String>,
    /// Program in the `commands` comment of the page, if there is one.
    page: Option<String>,
}

impl Block {
    /// Returns the text after `key:` in the comment of the block.
    pub fn note(&self, key: &str) -> Option<&str> {
        self.notes.iter().find_map(|note| note.strip_prefix(key)?.strip_prefix(':')).map(str::trim)
    }

    /// Returns `true` if one of the options in the comment is `words`.
    pub fn says(&self, words: &str) -> bool {
        self.notes.iter().any(|note| note == words)
    }

    /// Returns the program whose tests run the block.
    pub fn program(&self) -> Option<&str> {
        self.note("program").or(self.page.as_deref())
    }
}

/// Returns the text of a one-line comment.
fn comment(line: &str) -> Option<&str> {
    line.trim().strip_prefix("<!--")?.strip_suffix("-->").map(str::trim)
}

/// Returns the blocks of a page in order. Omits blocks that tests generate, between `<!-- … begin -->` and
/// `<!-- … end -->`, and texts that the reader does not type.
pub fn blocks(page: &str) -> Vec<Block> {
    let named = page.lines().filter_map(comment).find_map(|text| text.strip_prefix("commands:"));
    let named = named.map(|name| name.trim().to_owned());
    let (mut found, mut generated, mut at) = (Vec::new(), false, 0);
    let mut above = "";
    let mut open: Option<(&str, usize, usize, Vec<String>)> = None;
    for (line, text) in (1..).zip(page.split_inclusive('\n')) {
        let trimmed = text.trim();
        match &open {
            None => {
                if let Some(words) = comment(trimmed) {
                    generated = words.ends_with(" begin") || (generated && !words.ends_with(" end"));
                }
                if let Some(kind) = trimmed.strip_prefix("```") {
                    let notes = comment(above).unwrap_or_default().split(';');
                    let notes = notes.map(|note| note.trim().to_owned()).filter(|note| !note.is_empty());
                    open = Some((kind, line, at + text.len(), notes.collect()));
                }
            }
            Some(_) if trimmed == "```" => {
                let (kind, line, begin, notes) = open.take().expect("it is open");
                let kind = match kind {
                    "console" => Some(Kind::Console),
                    "sh" => Some(Kind::Sh),
                    "text" if notes.iter().any(|note| note.starts_with("typed:")) => Some(Kind::Text),
                    _ => None,
                };
                if let Some(kind) = kind.filter(|_| !generated) {
                    let text = page[begin..at].to_owned();
                    found.push(Block { kind, line, body: begin..at, text, notes, page: named.clone() });
                }
            }
            Some(_) => {}
        }
        if !trimmed.is_empty() {
            above = trimmed;
        }
        at += text.len();
    }
    found
}

/// Command of a block and its output on the page.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Step {
    /// Command that the test types; empty if the block shows later output of a running program.
    pub command: String,
    /// Output lines below the command.
    pub shown: Vec<String>,
}

impl Block {
    /// Returns the commands of the block. A line after `> ` continues the previous command.
    pub fn steps(&self) -> Vec<Step> {
        let mut steps: Vec<Step> = Vec::new();
        for line in self.text.lines() {
            let command = match self.kind {
                Kind::Console => line.strip_prefix("$ "),
                Kind::Sh => Some(line).filter(|line| !line.trim().is_empty()),
                Kind::Text => Some(line),
            };
            match (command, steps.last_mut()) {
                (Some(command), _) => steps.push(Step { command: command.to_owned(), shown: Vec::new() }),
                (None, _) if self.kind == Kind::Sh => {}
                (None, Some(step)) if step.shown.is_empty() && (line == ">" || line.starts_with("> ")) => {
                    step.command += "\n";
                    step.command += line[1..].strip_prefix(" ").unwrap_or_default();
                }
                (None, Some(step)) => step.shown.push(line.to_owned()),
                (None, None) => steps.push(Step { command: String::new(), shown: vec![line.to_owned()] }),
            }
        }
        steps
    }
}

/// Returns the text of a console block that contains these steps.
pub(super) fn written(steps: &[Step]) -> String {
    let mut text = String::new();
    for step in steps {
        for (n, line) in step.command.lines().enumerate() {
            text += if n == 0 { "$ " } else { "> " };
            text += line;
            text.truncate(text.trim_end_matches(' ').len());
            text.push('\n');
        }
        for line in &step.shown {
            text += line;
            text.push('\n');
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: &str = "<!-- commands: jtc -->\n# A\n\n<!-- not run: needs a port -->\n```sh\njtc status\n```\n\n\
                        <!-- terminal: sim; in tests: --speed max -->\n```console\n$ cat > a <<END\n> b\n> END\n$ jtc x\nc\n$ d\n```\n\n\
                        <!-- a begin -->\n```console\n$ e\n```\n<!-- a end -->\n```toml\nf\n```\n";

    #[test]
    fn blocks_have_the_notes_above_them() {
        let found = blocks(PAGE);
        assert_eq!(found.len(), 2, "{found:?}");
        assert_eq!(found[0].note("not run"), Some("needs a port"));
        assert_eq!((found[0].line, found[0].program()), (5, Some("jtc")));
        assert_eq!(
            (found[1].note("terminal"), found[1].note("in tests")),
            (Some("sim"), Some("--speed max"))
        );
        assert_eq!(&PAGE[found[1].body.clone()], found[1].text);
    }

    #[test]
    fn steps_are_commands_with_what_they_print() {
        let steps = blocks(PAGE)[1].steps();
        let commands: Vec<&str> = steps.iter().map(|step| step.command.as_str()).collect();
        assert_eq!(commands, ["cat > a <<END\nb\nEND", "jtc x", "d"]);
        assert_eq!(steps[1].shown, ["c"]);
        assert_eq!(written(&steps), blocks(PAGE)[1].text);
    }
}
