//! Detects the format of an image file if no format option is set. Intel HEX and S-records are detected by their first line; other content
//! is accepted as raw bytes only if it cannot be text.
//!
//! If the reader accepted a text as raw bytes, an update would write the text to the board and report it as verified. The board would then
//! have no program. Therefore the reader reads raw bytes only from a `.bin` file without printable text. With the option for raw bytes, the
//! reader also accepts files with other names, and text in a `.bin` file. The reader never reads records as raw bytes, even if the records
//! are damaged.

use super::{Format, ImageError, segments::lines};
use std::path::Path;

/// Minimum percentage of printable bytes in content that is treated as a text.
const TEXT_PERCENT: usize = 90;
/// Minimum percentage of hexadecimal digits in a line that the reader considers to be a complete or damaged record.
const HEX_PERCENT: usize = 80;
const MARKED_PERCENT: usize = 50;
/// Number of characters of a text that an error message shows.
const SHOWN: usize = 24;

/// Byte order marks that editors write before a text, and their encodings.
const MARKS: [(&[u8], &str); 3] =
    [(b"\xEF\xBB\xBF", "UTF-8"), (b"\xFF\xFE", "UTF-16"), (b"\xFE\xFF", "UTF-16")];

impl Format {
    /// Detects the format of an image file by its content. The first line that is a record determines the format; content without records
    /// is raw bytes.
    pub fn detect(content: &[u8]) -> Self {
        record_form(content).unwrap_or(Self::Bin)
    }

    /// Returns the format of a file if no option sets it. Only the content of a `.bin` file can be raw bytes; a text is never raw bytes.
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

    /// Checks a file that an option declares as raw bytes. The check refuses executables and records, and accepts a text only from a `.bin`
    /// file.
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

    /// Returns the format of image files with this extension.
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

/// Returns the line number, as text, of the first complete or damaged record. The content can be a text in any
/// encoding, with missing or damaged characters. The function returns `None` if the content is not a text, or if the
/// text has no such record.
fn record_place(content: &[u8]) -> Option<String> {
    // Removes bytes that are not letters: zeros of two-byte encodings, padding, and end marks of old systems.
    let letters: Vec<u8> = content.iter().copied().filter(|b| !matches!(b, 0 | 0x1A)).collect();
    let letters = MARKS.iter().find_map(|(mark, _)| letters.strip_prefix(*mark)).unwrap_or(&letters);
    let mut lines = lines(letters);
    let first = lines.clone().next();
    let found = if is_text(letters) { lines.find(|(_, line)| was_record(line)) } else { first };
    let (line, _) = found.filter(|(_, line)| was_record(line))?;
    Some(format!("line {line}"))
}

/// Returns `true` if the line is a complete or damaged record: it has at least 8 hexadecimal digits and hardly any
/// other characters. If the line is the mark of a record (`:` or `S`) followed only by letters and digits, it is
/// enough that half of the characters are hexadecimal digits.
fn was_record(line: &[u8]) -> bool {
    let digits = line.iter().filter(|b| b.is_ascii_hexdigit()).count();
    let percent = match line {
        [b':' | b'S', rest @ ..] if rest.iter().all(u8::is_ascii_alphanumeric) => MARKED_PERCENT,
        _ => HEX_PERCENT,
    };
    digits >= 8 && digits * 100 >= line.len() * percent
}

/// Returns the record format of the first line that is a record. The function ignores the lines before this record.
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

/// Returns `true` if nearly all of the content is printable text with one or two bytes per character.
fn is_text(content: &[u8]) -> bool {
    let printed = |b: &&u8| b.is_ascii_graphic() || matches!(b, b' ' | b'\t' | b'\r' | b'\n');
    let share = |printed: usize, of: usize| of > 0 && printed * 100 >= of * TEXT_PERCENT;
    if share(content.iter().filter(printed).count(), content.len()) {
        return true;
    }
    // In UTF-8, letters beyond ASCII are allowed, but control characters are not.
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

/// Returns the beginning of a text, for an error message.
fn start(content: &[u8]) -> String {
    let text = String::from_utf8_lossy(content);
    let shown: String = text.chars().filter(|c| !c.is_control() || *c == ' ').take(SHOWN).collect();
    shown.trim().to_owned()
}
