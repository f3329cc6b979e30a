//! Shortening of text from clients before it is logged or sent back.
use std::borrow::Cow;

use serde_json::Value;

/// Longest text from a client (a path, a Host, an Origin) in a log line or an answer, in
/// characters.
const FOREIGN_MAX: usize = 200;
/// Longest text in a line of the command log, in characters.
const LOGGED_MAX: usize = 1000;

/// Returns at most the first 200 characters of a text.
pub(crate) fn cut(text: &str) -> Cow<'_, str> {
    cut_at(text, FOREIGN_MAX)
}

/// Returns the first and the last 200 characters of a message that may contain long text from a client.
pub(crate) fn cut_middle(text: &str) -> Cow<'_, str> {
    let length = text.chars().count();
    if length <= 2 * FOREIGN_MAX {
        return text.into();
    }
    let end: String = text.chars().skip(length - FOREIGN_MAX).collect();
    format!("{}{end}", cut(text)).into()
}

/// Shortens each text of a log line.
pub(crate) fn cut_texts(value: &mut Value) {
    match value {
        Value::String(text) => {
            if let Cow::Owned(short) = cut_at(text, LOGGED_MAX) {
                *text = short;
            }
        }
        Value::Array(values) => values.iter_mut().for_each(cut_texts),
        Value::Object(values) => values.values_mut().for_each(cut_texts),
        Value::Null | Value::Bool(_) | Value::Number(_) => {}
    }
}

fn cut_at(text: &str, most: usize) -> Cow<'_, str> {
    match text.char_indices().nth(most) {
        Some((end, _)) => format!("{}…", text.get(..end).unwrap_or_default()).into(),
        None => text.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_cut_between_characters_and_short_ones_stay() {
        for letter in ["a", "ä", "🦾", "\u{0}", "\u{202e}"] {
            for length in [0, 1, 199, 200, 201, 399, 400, 401, 65_000] {
                let text = letter.repeat(length);
                let short = cut(&text);
                let marked = usize::from(length > FOREIGN_MAX);
                assert_eq!(short.chars().count(), length.min(FOREIGN_MAX) + marked, "{length} {letter:?}");
                assert_eq!(*short == text, length <= FOREIGN_MAX);
                let ends = cut_middle(&text).chars().count();
                assert_eq!(ends, if length > 2 * FOREIGN_MAX { 2 * FOREIGN_MAX + 1 } else { length });
            }
        }
        let message = format!("unknown field `{}`, expected `name`", "x".repeat(10_000));
        let short = cut_middle(&message);
        assert!(short.starts_with("unknown field `x") && short.ends_with("x`, expected `name`"), "{short}");
    }

    #[test]
    fn texts_of_a_line_are_cut_wherever_they_are() {
        let long = "x".repeat(70_000);
        let mut line = serde_json::json!({ "a": long, "b": [1, { "c": long }], "d": "short", "e": null });
        cut_texts(&mut line);
        let text = line.to_string();
        assert!(text.len() < 2200 && text.contains("short"), "{text}");
    }
}
