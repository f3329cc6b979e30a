//! Writes a parameter file. Requested values become entries in the file; all other signals become comments.

use crate::files::signals::{Signal, SignalType, SignalValue};
use crate::files::text::quoted;
use crate::master::io::{IoDescription, Kind, short};
use std::fmt::Write;

/// Board whose values are saved in a parameter file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SavedBoard {
    /// Board number.
    pub number: u8,
    /// Flash number of the board.
    pub flash_number: u16,
    /// Name of the board in the inventory; empty if the inventory has no name.
    pub name: String,
    /// Program ID of the board.
    pub program_id: u16,
    /// Description with the names of the board's signals.
    pub description: IoDescription,
    /// Parameters of the board, in the order of the buffer.
    pub par: Vec<SavedSignal>,
    /// Inputs of the board, in the order of the buffer.
    pub ci: Vec<SavedSignal>,
}

/// Signal of a board whose values are saved.
#[derive(Clone, Debug, PartialEq)]
pub struct SavedSignal {
    /// Type, scale, offset and unit of the signal's word.
    pub signal: Signal,
    /// Requested word; `None` if the signal is written as a comment.
    pub word: Option<u16>,
    /// Remark after the entry in the file. For a requested word, the remark contains the time at which the word was
    /// written to the board.
    pub remark: String,
}

/// Returns the text of a parameter file.
pub fn params_text(boards: &[SavedBoard]) -> String {
    let mut text = String::from(
        "# Parameters of boards; `ucom help params` explains the form, `ucom par --apply FILE` writes them.\n\
         # These are requested values. The values of a board cannot be read: names without a value are comments.\n\
         boards:\n",
    );
    if boards.is_empty() {
        return text.replace("boards:\n", "boards: []\n");
    }
    for board in boards {
        let _ = writeln!(text, "  - board: {}", board.number);
        let _ = writeln!(text, "    flash_number: 0x{:04X}", board.flash_number);
        if !board.name.is_empty() {
            let _ = writeln!(text, "    name: {}", quoted(&board.name));
        }
        let _ = writeln!(
            text,
            "    program_id: 0x{:04X}{}",
            board.program_id,
            comment(&board.description.description)
        );
        for (kind, title, signals) in [(Kind::Par, "par", &board.par), (Kind::Ci, "ci", &board.ci)] {
            if signals.is_empty() {
                continue;
            }
            let _ = writeln!(text, "    {title}:");
            for (i, saved) in signals.iter().enumerate() {
                line(&mut text, board, kind, i, saved);
            }
        }
    }
    text
}

fn line(text: &mut String, board: &SavedBoard, kind: Kind, i: usize, saved: &SavedSignal) {
    let key = key(&board.description, kind, i);
    let (low, high) = saved.signal.limits();
    let unit = if saved.signal.unit.is_empty() { String::new() } else { format!(" {}", saved.signal.unit) };
    let remark = if saved.remark.is_empty() { String::new() } else { format!("; {}", saved.remark) };
    let limits = format!("{low}..{high}{unit}{remark}");
    let _ = match saved.word {
        Some(word) => {
            let value = value(&saved.signal, word);
            let meaning = if value.starts_with("0x") && saved.signal.kind != SignalType::Hex {
                format!("{}; ", saved.signal.text_with_unit(word))
            } else {
                String::new()
            };
            writeln!(text, "      {key}: {value}{}", comment(&(meaning + &limits)))
        }
        None => writeln!(text, "      # {key}:{}", comment(&limits).replacen("   #", "  #", 1)),
    };
}

/// Returns the text that a parameter file contains for a 16-bit word: a number with a unit, on or off, or the raw
/// word. A number without a unit could result in another word if the file is read with another signal table or
/// without one. A reader without the table refuses a number with a unit.
fn value(signal: &Signal, word: u16) -> String {
    let raw = format!("0x{word:04X}");
    let text = match signal.kind {
        SignalType::Bool if signal.known && word <= 1 => return signal.text(word),
        SignalType::Int16 | SignalType::Uint16 if signal.known && !signal.unit.is_empty() => {
            signal.text_with_unit(word)
        }
        _ => return raw,
    };
    // Writes the raw word if the text of the value does not convert back to this word, because of rounding or a
    // limit.
    if text.parse::<SignalValue>().map(|given| signal.word(&given)) != Ok(Ok(word)) {
        return raw;
    }
    let plain = |c: char| c.is_ascii_alphanumeric() || " .-/%^*_°µ²³Ω".contains(c);
    if text.chars().all(plain) { text } else { quoted(&text) }
}

/// Returns a remark for the end of a line in the file. Texts of boards may contain any characters, so control characters and line
/// separators are replaced by blanks.
fn comment(words: &str) -> String {
    let one_line: String = words.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    let one_line = one_line.replace(['\u{2028}', '\u{2029}', '\u{FEFF}', '\u{FFFE}', '\u{FFFF}'], " ");
    if one_line.trim().is_empty() { String::new() } else { format!("   # {}", one_line.trim()) }
}

/// Longest implicit key that YAML allows (1.2.2, section 7.4.2), in characters, including quotes and escapes.
const KEY_MAX: usize = 1024;

/// Returns the shortest unambiguous name of a signal in the file. If a YAML key cannot contain the name, the function returns the signal's
/// index.
fn key(description: &IoDescription, kind: Kind, i: usize) -> String {
    let means = |name: &str| description.find(0, kind, name).is_ok_and(|found| usize::from(found) == i);
    let full = description.names(kind).get(i).map_or("", String::as_str);
    // Another signal can have the name `#1`, which looks like an index. Therefore `#` characters are added until the
    // index differs from every name.
    let numbers = (1..=description.names(kind).len() + 1).map(|n| "#".repeat(n) + &i.to_string());
    let names = [short(full), full].into_iter().filter(|name| !name.is_empty()).map(str::to_owned);
    let fits = |name: &str| quoted(name).chars().count() <= KEY_MAX;
    let name = names.chain(numbers).find(|name| fits(name) && means(name)).unwrap_or_default();
    let word = name.starts_with(|c: char| c.is_ascii_alphabetic())
        && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    // These words have a special meaning in YAML, so they must be quoted as keys.
    let taken = ["null", "true", "false", "yes", "no", "on", "off", "y", "n"];
    if word && !taken.contains(&name.to_ascii_lowercase().as_str()) { name } else { quoted(&name) }
}
