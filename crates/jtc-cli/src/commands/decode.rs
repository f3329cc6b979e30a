//! `jtc decode`: decodes the frames of host and controller from hex text, a capture, or raw bytes.

use std::io::Read;

use cli_kit::{Failure, Output};
use jtc_host::port::{Direction, read_capture};
use jtc_wire::{Described, FrameType, Piece, Status, pieces};
use serde_json::{Value, json};

use super::status;

/// Largest number of consecutive invalid bytes that the command shows one by one.
const SHOWN: usize = 32;

/// Decodes the standard input until it ends. Ends with exit code 2 if the input contains no frame.
pub(super) fn decode(out: &Output) -> Result<(), Failure> {
    let mut input = Vec::new();
    std::io::stdin().lock().read_to_end(&mut input)?;
    let mut frames = 0;
    for (label, bytes) in streams(&input)? {
        let mut offset = 0;
        for piece in pieces(&bytes) {
            let (raw, frame) = match piece {
                Piece::Frame(f) => (f.bytes, Some(f.frame_type)),
                Piece::Other(raw) => (raw, None),
            };
            frames += usize::from(frame.is_some());
            print(&label, offset, raw, frame, out);
            offset += raw.len();
        }
    }
    if frames == 0 {
        return Err(Failure::usage("no frame of this protocol in the input")
            .next("pass hex (9B 0E 00 06 A3 47), a capture, or the raw bytes of a serial line"));
    }
    Ok(())
}

fn print(label: &str, offset: usize, raw: &[u8], frame: Option<FrameType>, out: &Output) {
    let words = Described(raw).to_string();
    let mut value = json!({
        "offset": offset,
        "length": raw.len(),
        "frame": frame.map(|t| format!("{t:?}")),
        "type": frame.map(|t| t as u8),
        "text": words,
    });
    if !label.is_empty() {
        value["direction"] = Value::from(label);
    }
    if frame.is_none() {
        value["bytes"] = Value::from(hex(raw));
    }
    if let Some(s) = Status::parse(raw) {
        value["status"] = status::as_json(&s);
        value["response"] = json!({
            "type": s.response.frame_type, "status": s.response.status as u8,
            "data": s.response.data as u8, "length": s.response.length,
        });
    }
    out.result(&value, || {
        let place = if label.is_empty() { format!("{offset:6}") } else { format!("{label:9} {offset:6}") };
        match frame {
            Some(_) => format!("{place}  {words}"),
            None => format!("{place}  {words}\n        {}", hex(&raw[..raw.len().min(SHOWN)])),
        }
    });
}

fn hex(bytes: &[u8]) -> String {
    let all: Vec<String> = bytes.iter().map(|b| format!("{b:02X}")).collect();
    all.join(" ")
}

/// Returns the byte streams of an input with their names. If the input does not mark directions, the result is one
/// stream without a name.
fn streams(input: &[u8]) -> Result<Vec<(String, Vec<u8>)>, Failure> {
    let Some(text) =
        std::str::from_utf8(input).ok().filter(|t| t.chars().all(|c| !c.is_control() || c.is_whitespace()))
    else {
        return Ok(vec![(String::new(), input.to_vec())]);
    };
    if text.lines().any(|l| l.contains('>') || l.contains('<')) {
        let pieces = read_capture(text.as_bytes()).map_err(|e| Failure::usage(format!("capture: {e}")))?;
        let of = |direction| {
            let chosen = pieces.iter().filter(|p| p.direction == direction);
            chosen.flat_map(|p| p.bytes.iter().copied()).collect::<Vec<u8>>()
        };
        return Ok(vec![
            ("to device".into(), of(Direction::ToDevice)),
            ("to host".into(), of(Direction::ToHost)),
        ]);
    }
    Ok(vec![(String::new(), from_hex(text)?)])
}

/// Parses bytes as hex digits, with or without spaces, commas, colons and `0x`.
fn from_hex(text: &str) -> Result<Vec<u8>, Failure> {
    let mut bytes = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or("");
        for word in line.split(|c: char| c.is_whitespace() || ",;:".contains(c)).filter(|w| !w.is_empty()) {
            let digits = word.trim_start_matches("0x").trim_start_matches("0X");
            let wrong = || Failure::usage(format!("line {}: \"{word}\" is not hex", number + 1));
            if digits.is_empty() || digits.len() % 2 != 0 || !digits.bytes().all(|b| b.is_ascii_hexdigit()) {
                return Err(wrong());
            }
            for pair in digits.as_bytes().chunks(2) {
                let pair = std::str::from_utf8(pair).map_err(|_| wrong())?;
                bytes.push(u8::from_str_radix(pair, 16).map_err(|_| wrong())?);
            }
        }
    }
    Ok(bytes)
}
