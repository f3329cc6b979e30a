//! Format of a file without a format option: records by their first line, raw bytes only if they cannot be text.
//!
//! If a text were read as raw bytes, it would be flashed, read back and called verified, and the board would have no program any more.
//! Therefore raw bytes are only read from a `.bin` without printable text. With the option for raw bytes other names are accepted as
//! well, and a text from a `.bin`. Records are never read as raw bytes, not even damaged records.

use super::{Format, ImageError, segments::lines};
use std::path::Path;

/// Percentage of printable bytes from which a content counts as a text.
const TEXT_PERCENT: usize = 90;
/// Percentage of hexadecimal digits from which a line counts as a record, whole or damaged.
const HEX_PERCENT: usize = 80;
const MARKED_PERCENT: usize = 50;
/// Length of the part of a text that is shown, characters.
const SHOWN: usize = 24;

/// Bytes that editors put before a text, and their meaning.
const MARKS: [(&[u8], &str); 3] =
    [(b"\xEF\xBB\xBF", "UTF-8"), (b"\xFF\xFE", "UTF-16"), (b"\xFE\xFF", "UTF-16")];

impl Format {
    /// Detects the format by content: the first line that is a record decides; a content without records is raw bytes.
    pub fn detect(content: &[u8]) -> Self {
        record_form(content).unwrap_or(Self::Bin)
    }

    /// Returns the format of a file of this name, if no option names it: raw bytes only from a `.bin`, and never text.
    pub(super) fn of(name: Option<&Path>, content: &[u8]) -> Result<Self, ImageError> {
        let by_name = extension(name);
        let expected = by_name.as_deref().and_then(Self::by_extension);
        if content.starts_with(b"\x7fELF") {
            return Err(ImageError::Elf);
        }
        let form = record_form(content).or(expected);
        if let Some((_, mark)) = MARKS.iter().find(|(bytes, _)| content.starts_with(bytes))
            && (form.is_some() || is_text(content))
        {
            return Err(ImageError::ByteOrderMark { mark });
        }
        if let Some(form) = form {
            return Ok(form);
        }
        if is_text(content) {
            return Err(ImageError::Text { starts: start(content) });
        }
        if let Some(place) = record_place(content) {
            return Err(ImageError::WasRecords { place });
        }
        match (name, by_name.as_deref()) {
            (None, _) | (Some(_), Some("bin")) => Ok(Self::Bin),
            (Some(name), _) => Err(ImageError::NotBin { name: name.display().to_string() }),
        }
    }

    /// Checks raw bytes that an option requests: never an executable or records, and a text only from a `.bin`.
    pub(super) fn raw(name: Option<&Path>, content: &[u8]) -> Result<Self, ImageError> {
        if content.starts_with(b"\x7fELF") {
            return Err(ImageError::Elf);
        }
        if let Some(place) = record_place(content) {
            return Err(ImageError::WasRecords { place });
        }
        let extension = extension(name);
        match (name, extension.as_deref()) {
            (_, extension) if is_text(content) && extension != Some("bin") => {
                Err(ImageError::RawText { starts: start(content) })
            }
            (Some(name), Some(extension)) if Self::by_extension(extension).is_some() => {
                Err(ImageError::RawName { name: name.display().to_string() })
            }
            _ => Ok(Self::Bin),
        }
    }

    /// Returns the format of files whose names end with this extension.
    fn by_extension(extension: &str) -> Option<Self> {
        match extension {
            "hex" | "ihex" | "ihx" | "h86" => Some(Self::IntelHex),
            "s19" | "s28" | "s37" | "srec" | "srecord" | "mot" | "mhx" => Some(Self::SRecord),
            _ => None,
        }
    }
}

fn extension(name: Option<&Path>) -> Option<String> {
    name.and_then(Path::extension).and_then(|e| e.to_str()).map(str::to_ascii_lowercase)
}

/// Returns the place of the first line that is or may have been a record. The content may be a text in any encoding, with missing or
/// damaged characters. `None`: the content is not a text, or has no such line.
fn record_place(content: &[u8]) -> Option<String> {
    // Texts with two bytes per character, padding, and end marks of old systems.
    let letters: Vec<u8> = content.iter().copied().filter(|b| !matches!(b, 0 | 0x1A)).collect();
    let letters = MARKS.iter().find_map(|(mark, _)| letters.strip_prefix(*mark)).unwrap_or(&letters);
    let mut lines = lines(letters);
    let first = lines.clone().next();
    let found = if is_text(letters) { lines.find(|(_, line)| was_record(line)) } else { first };
    let (line, _) = found.filter(|(_, line)| was_record(line))?;
    Some(format!("line {line}"))
}

/// Returns `true` if nearly all characters of the line are hexadecimal digits, at least 8 as in the shortest records. For a line with the
/// mark of a record half of them suffice.
fn was_record(line: &[u8]) -> bool {
    let digits = line.iter().filter(|b| b.is_ascii_hexdigit()).count();
    let percent = match line {
        [b':' | b'S', rest @ ..] if rest.iter().all(u8::is_ascii_alphanumeric) => MARKED_PERCENT,
        _ => HEX_PERCENT,
    };
    digits >= 8 && digits * 100 >= line.len() * percent
}

/// Returns the form of the first line that is a record, ignoring the lines before it.
fn record_form(content: &[u8]) -> Option<Format> {
    let hex = |digits: &[u8]| digits.len() >= 8 && digits.iter().all(u8::is_ascii_hexdigit);
    let line = |line: &[u8]| {
        let line = MARKS.iter().find_map(|(mark, _)| line.strip_prefix(*mark)).unwrap_or(line);
        match line.trim_ascii() {
            [b':', rest @ ..] if hex(rest) => Some(Format::IntelHex),
            [b'S', b'0'..=b'9', rest @ ..] if hex(rest) => Some(Format::SRecord),
            _ => None,
        }
    };
    content.split(|b| matches!(b, b'\r' | b'\n')).find_map(line)
}

/// Returns `true` if nearly all of the content is printable, with one or two bytes per character.
fn is_text(content: &[u8]) -> bool {
    let printed = |b: &&u8| b.is_ascii_graphic() || matches!(b, b' ' | b'\t' | b'\r' | b'\n');
    let share = |printed: usize, of: usize| of > 0 && printed * 100 >= of * TEXT_PERCENT;
    if share(content.iter().filter(printed).count(), content.len()) {
        return true;
    }
    // UTF-8 letters beyond ASCII have bytes of their own, control characters do not.
    let odd = |c: char| c.is_control() && !c.is_ascii_whitespace();
    if core::str::from_utf8(content).is_ok_and(|text| !text.is_empty() && !text.contains(odd)) {
        return true;
    }
    let wide = |first: usize| {
        let letters = content.iter().skip(first).step_by(2);
        let zeros = content.iter().skip(1 - first).step_by(2).filter(|b| **b == 0).count();
        share(letters.filter(printed).count() + zeros, content.len())
    };
    content.len() >= 8 && (wide(0) || wide(1))
}

/// Returns the beginning of a text.
fn start(content: &[u8]) -> String {
    let text = String::from_utf8_lossy(content);
    let shown: String = text.chars().filter(|c| !c.is_control() || *c == ' ').take(SHOWN).collect();
    shown.trim().to_owned()
}
