//! The format of a file that no option names: records by their first line, raw bytes only where they cannot be text.
//!
//! A text that is taken for raw bytes is flashed, read back and called verified, and the board has no program any more.
//! So raw bytes are only taken from a `.bin` without printable text, or when an option names them.

use super::{Format, ImageError};
use std::path::Path;

/// Of so many bytes in a hundred that can be printed, it is a text.
const TEXT_PERCENT: usize = 90;
/// So much of a text is shown, characters.
const SHOWN: usize = 24;

/// Bytes that editors put before a text, and what they mean.
const MARKS: [(&[u8], &str); 3] =
    [(b"\xEF\xBB\xBF", "UTF-8"), (b"\xFF\xFE", "UTF-16"), (b"\xFE\xFF", "UTF-16")];

impl Format {
    /// By content: the first line that is a record decides; what has none is raw bytes.
    pub fn detect(content: &[u8]) -> Self {
        record_form(content).unwrap_or(Self::Bin)
    }

    /// What a file of this name holds, where no option names it: raw bytes only from a `.bin`, and never text.
    pub(super) fn of(name: Option<&Path>, content: &[u8]) -> Result<Self, ImageError> {
        let by_name = name.and_then(Path::extension).and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
        let expected = by_name.as_deref().and_then(|extension| match extension {
            "hex" | "ihex" | "ihx" | "h86" => Some(Self::IntelHex),
            "s19" | "s28" | "s37" | "srec" | "srecord" | "mot" | "mhx" => Some(Self::SRecord),
            _ => None,
        });
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
        match (name, by_name.as_deref()) {
            (None, _) | (Some(_), Some("bin")) => Ok(Self::Bin),
            (Some(name), _) => Err(ImageError::NotBin { name: name.display().to_string() }),
        }
    }
}

/// The form of the first line that is a record, whatever stands before it.
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

/// Nearly all of it can be printed, in one byte a character or in two.
fn is_text(content: &[u8]) -> bool {
    let printed = |b: &&u8| b.is_ascii_graphic() || matches!(b, b' ' | b'\t' | b'\r' | b'\n');
    let share = |printed: usize, of: usize| of > 0 && printed * 100 >= of * TEXT_PERCENT;
    if share(content.iter().filter(printed).count(), content.len()) {
        return true;
    }
    // UTF-8 letters beyond ASCII have bytes of their own, control characters have none.
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

/// How a text begins.
fn start(content: &[u8]) -> String {
    let text = String::from_utf8_lossy(content);
    let shown: String = text.chars().filter(|c| !c.is_control() || *c == ' ').take(SHOWN).collect();
    shown.trim().to_owned()
}
