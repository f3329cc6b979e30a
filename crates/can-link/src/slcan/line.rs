//! Splitting, parsing and writing of the lines of the SLCAN protocol.

use std::fmt::Write;

use crate::{CanFrame, ControllerState, ErrorState, Id};

/// Longest line that is stored. The longest frame (29-bit identifier, 64 bytes, time stamp) has 142 characters.
const LONGEST: usize = 256;
/// Character that ends a line.
pub(crate) const CR: u8 = b'\r';
/// Bell character, which an adapter sends to refuse a command. The bell character is not part of a line.
pub(crate) const BELL: u8 = 7;
/// Number of digits of the time stamp that some adapters append.
const TIME_STAMP: usize = 4;

/// Line or bell character of the stream.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Piece<'a> {
    Line(&'a str),
    Bell,
}

/// Splits a stream into lines, with bounded memory. The stream can arrive in pieces of any length.
pub(crate) struct Lines {
    line: Vec<u8>,
    /// `true` if the line in `line` was already returned.
    complete: bool,
    /// `true` while the reader skips the remaining characters of a line that is too long.
    too_long: bool,
}

impl Lines {
    pub(crate) fn new() -> Self {
        Self { line: Vec::with_capacity(LONGEST), complete: false, too_long: false }
    }

    /// Returns the next line, and removes the bytes of this line from `bytes`.
    pub(crate) fn next<'a>(&'a mut self, bytes: &mut &[u8]) -> Option<Piece<'a>> {
        if self.complete {
            self.complete = false;
            self.line.clear();
        }
        while let Some((&byte, rest)) = bytes.split_first() {
            *bytes = rest;
            match byte {
                BELL => {
                    self.line.clear();
                    self.too_long = false;
                    return Some(Piece::Bell);
                }
                CR if self.too_long || !self.line.is_ascii() => {
                    self.line.clear();
                    self.too_long = false;
                    // A line that is too long must not be treated as an empty line, because an empty line means
                    // "accepted".
                    return Some(Piece::Line("?"));
                }
                CR => {
                    self.complete = true;
                    return str::from_utf8(&self.line).ok().map(Piece::Line);
                }
                // Some adapters send CR LF at the end of a line.
                b'\n' => {}
                _ if self.line.len() == LONGEST => self.too_long = true,
                _ => self.line.push(byte),
            }
        }
        None
    }
}

/// CAN FD payload lengths, in the order of their length codes.
const LENGTHS: [usize; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];

/// Returns the frame in a line (without line end); `None` if the line is not a frame.
pub(crate) fn parse_frame(line: &str) -> Option<CanFrame> {
    let kind = line.chars().next()?;
    let (digits, make): (usize, fn(u32) -> _) = match kind {
        't' | 'r' | 'd' | 'b' => (3, Id::standard),
        'T' | 'R' | 'D' | 'B' => (8, Id::extended),
        _ => return None,
    };
    if !line.bytes().skip(1).all(|byte| byte.is_ascii_hexdigit()) {
        return None;
    }
    let id = make(u32::from_str_radix(line.get(1..1 + digits)?, 16).ok()?).ok()?;
    let code = usize::from_str_radix(line.get(1 + digits..2 + digits)?, 16).ok()?;
    let rest = line.get(2 + digits..)?;
    let len = if matches!(kind, 'r' | 'R') { 0 } else { *LENGTHS.get(code)? };
    if rest.len() != 2 * len && rest.len() != 2 * len + TIME_STAMP {
        return None;
    }
    let byte = |at| u8::from_str_radix(rest.get(at..at + 2)?, 16).ok();
    let data: Vec<u8> = (0..len).map(|at| byte(2 * at)).collect::<Option<_>>()?;
    match kind {
        't' | 'T' => CanFrame::classic(id, &data).ok(),
        'r' | 'R' => CanFrame::remote(id, code).ok(),
        'd' | 'D' => CanFrame::fd(id, &data).ok().map(|frame| frame.with_brs(false)),
        _ => CanFrame::fd(id, &data).ok(),
    }
}

/// Appends the SLCAN line of a frame, including the line end.
pub(crate) fn push_frame(text: &mut String, frame: &CanFrame) {
    let kind = match (frame.is_remote(), frame.is_fd(), frame.is_brs()) {
        (true, ..) => 'r',
        (_, false, _) => 't',
        (_, true, false) => 'd',
        (_, true, true) => 'b',
    };
    let kind = if frame.is_extended() { kind.to_ascii_uppercase() } else { kind };
    // The length of every frame is in the list `LENGTHS`.
    let code = LENGTHS.iter().position(|len| *len == frame.len()).unwrap_or(0);
    let written = write!(text, "{kind}{}{code:X}", frame.id())
        .and_then(|()| frame.data().iter().try_for_each(|byte| write!(text, "{byte:02X}")))
        .and_then(|()| text.write_char('\r'));
    written.expect("a String takes everything");
}

/// Flag bits in the answer to `F`.
const WARNING: u8 = 1 << 2;
const PASSIVE: u8 = 1 << 5;

/// Parses the state in the answer to `F`: `F` and two digits.
pub(crate) fn parse_flags(line: &str) -> Option<ControllerState> {
    let digits = line.strip_prefix('F').filter(|digits| digits.len() == 2 && digits.is_ascii())?;
    let flags = u8::from_str_radix(digits, 16).ok()?;
    let errors = match (flags & PASSIVE != 0, flags & WARNING != 0) {
        (true, _) => ErrorState::Passive,
        (false, true) => ErrorState::Warning,
        (false, false) => ErrorState::Active,
    };
    Some(ControllerState::without_counters(errors))
}

/// Returns the flags for the answer to `F`. The protocol has no flag for bus-off, which is reported as error passive.
pub(crate) fn flags(state: ControllerState) -> u8 {
    match state.errors {
        ErrorState::Unknown | ErrorState::Active => 0,
        ErrorState::Warning => WARNING,
        ErrorState::Passive | ErrorState::BusOff => WARNING | PASSIVE,
    }
}

/// Parses the line of a state change in the form that Linux accepts. Newer adapters send this line without a request.
/// The form is `s`, a letter, then the receive and the transmit error counter with three decimal digits each.
pub(crate) fn parse_state(line: &str) -> Option<ControllerState> {
    let rest = line.strip_prefix('s').filter(|rest| rest.len() == 7 && rest.is_ascii())?;
    let errors = match rest.chars().next()? {
        'a' => ErrorState::Active,
        'w' => ErrorState::Warning,
        'p' => ErrorState::Passive,
        'b' => ErrorState::BusOff,
        _ => return None,
    };
    let number = |text: Option<&str>| {
        let text = text.filter(|text| text.bytes().all(|byte| byte.is_ascii_digit()))?;
        text.parse().ok()
    };
    let (rec, tec) = (number(rest.get(1..4))?, number(rest.get(4..7))?);
    Some(ControllerState { errors, tec: Some(tec), rec: Some(rec) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    use crate::frame::any_frame;

    fn frame(line: &str) -> Option<String> {
        parse_frame(line).map(|frame| format!("{frame:?}"))
    }

    /// The parser must accept the example lines from the LAWICEL manual and from the description of CANable 2.
    #[test]
    fn lines_are_frames() {
        for (line, expected) in [
            ("t1000", "CanFrame(100 #)"),
            ("t10021133", "CanFrame(100 # 11 33)"),
            ("t1002113301F4", "CanFrame(100 # 11 33)"),
            ("T0000010021133", "CanFrame(00000100 # 11 33)"),
            ("r1002", "CanFrame(100 # R2)"),
            ("R1FFFFFFF8", "CanFrame(1FFFFFFF # R8)"),
            ("d1001AB", "CanFrame(100 ## AB)"),
            ("b1009000102030405060708090A0B", "CanFrame(100 ## 00 01 02 03 04 05 06 07 08 09 0A 0B, brs)"),
        ] {
            assert_eq!(frame(line).as_deref(), Some(expected), "{line}");
        }
        for line in [
            "",
            "t",
            "t10",
            "t100",
            "t1009",
            "t100201",
            "t10010",
            "t8000",
            "T200000000",
            "t10z0",
            "t1001-1",
            "z",
            "t100A",
            "r1009",
            "x1000",
            "b158aa7 github.com/x",
            "t\u{e4}000",
        ] {
            assert_eq!(frame(line), None, "{line}");
        }
    }

    #[test]
    fn states_are_understood() {
        assert_eq!(parse_state("sb256256"), Some(ControllerState::of_counters(256, 256)));
        assert_eq!(parse_state("sa057033"), Some(ControllerState::of_counters(33, 57)));
        for line in ["", "s", "sx000000", "sa00000", "sa+57033", "sa0570330"] {
            assert_eq!(parse_state(line), None, "{line}");
        }
        for errors in [ErrorState::Active, ErrorState::Warning, ErrorState::Passive] {
            let state = ControllerState::without_counters(errors);
            assert_eq!(parse_flags(&format!("F{:02X}", flags(state))), Some(state));
        }
        assert_eq!(parse_flags("F"), None);
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

        #[test]
        fn every_frame_survives_any_cut(frames in prop::collection::vec(any_frame(), 1..5), cuts in prop::collection::vec(1..40_usize, 1..20)) {
            let mut text = String::new();
            frames.iter().for_each(|frame| push_frame(&mut text, frame));
            let mut lines = Lines::new();
            let mut found = Vec::new();
            let mut rest = text.as_bytes();
            let mut cuts = cuts.iter().cycle();
            while !rest.is_empty() {
                let (mut piece, after) = rest.split_at(rest.len().min(*cuts.next().unwrap()));
                while let Some(piece) = lines.next(&mut piece) {
                    let Piece::Line(line) = piece else { panic!("no bell") };
                    found.push(parse_frame(line).unwrap());
                }
                rest = after;
            }
            prop_assert_eq!(found, frames);
        }

        #[test]
        fn noise_is_survived_and_what_follows_is_found(noise in prop::collection::vec(any::<u8>(), 0..2000)) {
            let mut lines = Lines::new();
            let mut bytes = &noise[..];
            while let Some(piece) = lines.next(&mut bytes) {
                if let Piece::Line(line) = piece {
                    let _ = (parse_frame(line), parse_state(line), parse_flags(line));
                }
            }
            prop_assert!(lines.line.capacity() <= LONGEST);
            let mut bytes = &b"\rz\r"[..];
            prop_assert!(matches!(lines.next(&mut bytes), Some(Piece::Line(_))));
            prop_assert_eq!(lines.next(&mut bytes), Some(Piece::Line("z")));
        }
    }
}
