//! Extracts the prose of a file: comments and strings of a program, or paragraphs of a page.
use ra_ap_rustc_lexer::{FrontmatterAllowed, LiteralKind, TokenKind, tokenize};

/// Comment, string or paragraph of a file, joined into one line.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Text {
    pub words: String,
    /// Positions in `words` at which the lines of the file begin, with the line numbers of these lines.
    lines: Vec<(usize, usize)>,
}

impl Text {
    /// Returns the number of the line that contains this byte of `words`.
    pub(super) fn line_at(&self, offset: usize) -> usize {
        // The pattern of a mark may begin at the end of the previous sentence, up to two bytes before the line.
        let before = |(start, _): &&(usize, usize)| *start <= offset + 2;
        self.lines.iter().rev().find(before).map_or(1, |(_, number)| *number)
    }

    fn push(&mut self, line: &str, number: usize) {
        if !self.words.is_empty() {
            self.words.push(' ');
        }
        self.lines.push((self.words.len(), number));
        self.words.push_str(line.trim());
    }
}

/// Returns the prose of a file with this extension.
pub(super) fn of(source: &str, extension: &str) -> Vec<Text> {
    let prose: fn(&str) -> Option<&str> = match extension {
        "rs" => return rust(source),
        "md" => |line| Some(line),
        "py" | "pyi" | "toml" => |line| comment_or_prose(line, "# "),
        _ => |line| comment_or_prose(line, "// "),
    };
    paragraphs((1..).zip(source.lines().map(prose)))
}

/// Joins consecutive lines outside fenced code into one text. Each list item begins a new text.
fn paragraphs<'a>(lines: impl Iterator<Item = (usize, Option<&'a str>)>) -> Vec<Text> {
    let (mut texts, mut open, mut fenced) = (Vec::new(), Text::default(), false);
    for (number, line) in lines {
        let line = line.map(str::trim);
        let fence = line.is_some_and(|line| line.starts_with("```"));
        fenced ^= fence;
        let prose = line.filter(|line| !fenced && !fence && !line.is_empty());
        let begins = prose.is_none_or(|line| line.starts_with(['-', '|', '#', '*']));
        if begins && !open.words.is_empty() {
            texts.push(std::mem::take(&mut open));
        }
        if let Some(line) = prose {
            open.push(line.trim_start_matches(['-', '|', '#', '*', ' ']), number);
        }
    }
    texts.extend((!open.words.is_empty()).then_some(open));
    texts
}

/// Returns the text after `mark` in a line. If the line has no `mark` but looks like prose, returns the complete
/// line, because it may belong to a longer comment or a docstring.
fn comment_or_prose<'a>(line: &'a str, mark: &str) -> Option<&'a str> {
    let line = line.trim();
    match line.split_once(mark) {
        Some((_, comment)) => Some(comment),
        None => Some(line.trim_matches('"')).filter(|line| is_prose(line)),
    }
}

/// Returns `true` if at least three quarters of the line are words.
fn is_prose(line: &str) -> bool {
    let words =
        line.split_whitespace().filter(|word| word.chars().all(|c| c.is_alphabetic() || ",.'’".contains(c)));
    let count = line.split_whitespace().count();
    count >= 4 && 4 * words.count() >= 3 * count
}

fn rust(source: &str) -> Vec<Text> {
    let (mut texts, mut comment, mut at, mut number) = (Vec::new(), Vec::new(), 0, 1);
    for token in tokenize(source, FrontmatterAllowed::No) {
        let text = &source[at..at + token.len as usize];
        match token.kind {
            TokenKind::LineComment { .. } => {
                comment.push((number, Some(text.trim_start_matches(['/', '!']))));
            }
            TokenKind::Whitespace => {}
            kind => {
                texts.extend(paragraphs(comment.drain(..)));
                if let TokenKind::Literal {
                    kind: LiteralKind::Str { .. } | LiteralKind::RawStr { .. }, ..
                } = kind
                {
                    let words = text.trim_matches(['r', '#', '"']);
                    if words.split_whitespace().count() >= 3 {
                        let lines = words.lines().enumerate();
                        texts.extend(paragraphs(
                            lines.map(|(i, line)| (number + i, Some(line.trim_end_matches('\\')))),
                        ));
                    }
                }
            }
        }
        at += token.len as usize;
        number += text.matches('\n').count();
    }
    texts.extend(paragraphs(comment.drain(..)));
    texts
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(source: &str, extension: &str) -> Vec<String> {
        of(source, extension).into_iter().map(|text| text.words).collect()
    }

    #[test]
    fn comments_and_strings_of_a_program_are_texts_and_its_words_are_not() {
        let source = "//! Stops\n//! the arm.\n//!\n//! ```\n//! where\n//! ```\nfn a<T>() where T: Copy {\n    b(\"one two \\\n      three\", 'c');\n}\n";
        assert_eq!(words(source, "rs"), ["Stops the arm.", "one two three"]);
        assert_eq!(of(source, "rs")[0].line_at(7), 2);
    }

    #[test]
    fn paragraphs_of_a_page_are_texts() {
        let page = "# Title\n\nOne\ntwo.\n- item\n\n```sh\ncode\n```\nlast\n";
        assert_eq!(words(page, "md"), ["Title", "One two.", "item", "last"]);
    }

    #[test]
    fn comments_of_python_and_typescript_are_texts() {
        assert_eq!(words("x = 1  # Stops it.\ny = x\n", "py"), ["Stops it."]);
        assert_eq!(words("\"\"\"Stop the arm on its path.\"\"\"\n", "py"), ["Stop the arm on its path."]);
        assert_eq!(words("const a = 1; // Stops it.\nb();\n", "ts"), ["Stops it."]);
    }
}
