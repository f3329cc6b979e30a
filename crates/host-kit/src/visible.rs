//! Text from a bus, a file or a client, in a form that a terminal shows and does not execute.
use std::borrow::Cow;
use std::fmt::Write as _;

/// Returns `true` for a character that a terminal does not show: a control character, or a mark that changes the
/// direction of the text after it. Such a mark makes a text look like another text.
pub fn is_hidden(c: char) -> bool {
    let directs =
        matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    c.is_control() || directs
}

/// Replaces each hidden character, except line ends and tabs, by its code, for example `\u001b`.
///
/// Without this function, a board's description or a file could change the title of the terminal, its colours or the
/// clipboard by escape sequences. A JSON text keeps its value, because JSON has the same escape sequences.
pub fn visible(text: &str) -> Cow<'_, str> {
    replaced(text, |c| is_hidden(c) && !matches!(c, '\n' | '\t'))
}

/// Like [`visible`], for a text that must stay in its line, such as a cell of a table. Also replaces line ends and tabs.
pub fn visible_in_line(text: &str) -> Cow<'_, str> {
    replaced(text, is_hidden)
}

fn replaced(text: &str, hidden: impl Fn(char) -> bool + Copy) -> Cow<'_, str> {
    if !text.contains(hidden) {
        return text.into();
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if hidden(c) {
            // Writing to a string cannot fail.
            let _ = write!(out, "\\u{:04x}", u32::from(c));
        } else {
            out.push(c);
        }
    }
    out.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hidden_characters_are_shown_as_codes() {
        let board = "X\u{1b}[31mR\u{1b}]0;title\u{7}\u{9b}1mZ";
        assert_eq!(visible(board), "X\\u001b[31mR\\u001b]0;title\\u0007\\u009b1mZ");
        assert_eq!(visible("anna\u{202e}gnp\r\u{7f}"), "anna\\u202egnp\\u000d\\u007f");
        assert_eq!(visible_in_line("a\n1\tb"), "a\\u000a1\\u0009b");
        // Lines, tabs and the letters of all languages stay.
        for plain in ["", "joint 1:\t0.2 N·m\nµ ✓ é 関節 🦾"] {
            assert!(matches!(visible(plain), Cow::Borrowed(text) if text == plain), "{plain:?}");
        }
    }

    #[test]
    fn the_value_of_a_json_text_stays_the_same() {
        let all: String = (0..=0x2100).filter_map(char::from_u32).collect();
        let json = serde_json::to_string(&[all.as_str()]).expect("a text");
        let shown = visible(&json);
        assert!(!shown.contains(is_hidden), "{shown:?}");
        let read: [String; 1] = serde_json::from_str(&shown).expect("it is JSON");
        assert_eq!(read, [all]);
    }
}
