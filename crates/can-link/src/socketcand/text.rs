//! Parsing and writing of the texts of the socketcand protocol, `< WORD WORD … >`.

use std::fmt::Write;
use std::time::Duration;

use crate::{CanFrame, ErrorState, Id};

/// Classes of error frames (Linux, `can/error.h`): `CAN_ERR_BUSOFF` and `CAN_ERR_RESTARTED`.
pub(crate) const CLASS_BUS_OFF: u32 = 0x40;
pub(crate) const CLASS_RESTARTED: u32 = 0x100;

/// Request of a client.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Request<'a> {
    Open(&'a str),
    RawMode,
    BcmMode,
    Echo,
    Send(CanFrame),
    /// A `send` request that does not contain a valid frame.
    BadSend,
    Other,
}

impl<'a> Request<'a> {
    pub(crate) fn parse(message: &'a str) -> Self {
        let mut words = message.split_ascii_whitespace();
        let request = match words.next() {
            Some("open") => match words.next() {
                Some(name) => Self::Open(name),
                None => Self::Other,
            },
            Some("rawmode") => Self::RawMode,
            Some("bcmmode") => Self::BcmMode,
            Some("echo") => Self::Echo,
            Some("send") => return send(words).map_or(Self::BadSend, Self::Send),
            _ => Self::Other,
        };
        if words.next().is_some() { Self::Other } else { request }
    }
}

/// Parses the words `ID LENGTH BYTE …` that follow `send`.
fn send<'a>(mut words: impl Iterator<Item = &'a str>) -> Option<CanFrame> {
    let id = id(words.next()?)?;
    let len = words.next().filter(|word| word.len() == 1 && is_hex(word))?;
    let len = usize::from_str_radix(len, 16).ok()?;
    let data = bytes::<8>(words)?;
    CanFrame::classic(id, data.get(..len).filter(|_| data.len() == len)?).ok()
}

/// A message of a server.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Reply<'a> {
    Hi,
    Ok,
    Frame(CanFrame),
    /// An error frame with its class bits (Linux, `can/error.h`).
    ErrorFrame(u32),
    /// The server refuses a request.
    Refused(&'a str),
    Other,
}

impl<'a> Reply<'a> {
    pub(crate) fn parse(message: &'a str) -> Self {
        let message = message.trim_ascii();
        let (kind, rest) = message.split_once(' ').unwrap_or((message, ""));
        let words = rest.split_ascii_whitespace();
        let reply = match kind {
            "hi" => Some(Self::Hi),
            "ok" => Some(Self::Ok),
            "frame" => classic_frame(words).map(Self::Frame),
            "fdframe" => fd_frame(words).map(Self::Frame),
            "error" => Some(error_class(words).map_or(Self::Refused(rest.trim_ascii()), Self::ErrorFrame)),
            _ => None,
        };
        reply.unwrap_or(Self::Other)
    }
}

/// Parses the words `ID TIME DATA` that follow `frame`.
fn classic_frame<'a>(mut words: impl Iterator<Item = &'a str>) -> Option<CanFrame> {
    let id = id(words.next()?)?;
    words.next().filter(|word| is_time(word))?;
    CanFrame::classic(id, &bytes::<8>(words)?).ok()
}

/// Parses the words `ID FLAGS TIME DATA` that follow `fdframe`. Servers with CAN FD send this message.
fn fd_frame<'a>(mut words: impl Iterator<Item = &'a str>) -> Option<CanFrame> {
    let id = id(words.next()?)?;
    let flags = words.next().filter(|word| word.len() <= 2 && is_hex(word))?;
    let flags = u8::from_str_radix(flags, 16).ok()?;
    words.next().filter(|word| is_time(word))?;
    // Bit 0 is the bit rate switch (Linux, `can.h`).
    Some(CanFrame::fd(id, &bytes::<64>(words)?).ok()?.with_brs(flags & 1 != 0))
}

/// Parses `CLASS TIME` or only `CLASS`. Returns `None` for other words, which are the text of a refusal.
fn error_class<'a>(mut words: impl Iterator<Item = &'a str>) -> Option<u32> {
    let class = words.next().filter(|word| word.len() <= 8 && is_hex(word))?;
    if let Some(time) = words.next() {
        let alone = words.next().is_none();
        Some(time).filter(|time| alone && is_time(time))?;
    }
    u32::from_str_radix(class, 16).ok()
}

/// Parses an identifier: up to three digits mean 11 bits, more digits mean 29 bits.
fn id(word: &str) -> Option<Id> {
    if !is_hex(word) || word.len() > 8 {
        return None;
    }
    let value = u32::from_str_radix(word, 16).ok()?;
    if word.len() <= 3 { Id::standard(value).ok() } else { Id::extended(value).ok() }
}

/// Parses bytes in hexadecimal: one word with all bytes, or one word per byte. A single byte without a leading zero
/// is also accepted.
fn bytes<'a, const MOST: usize>(words: impl Iterator<Item = &'a str>) -> Option<Vec<u8>> {
    let mut found = Vec::new();
    for word in words {
        if !is_hex(word) || (word.len() > 1 && word.len() % 2 == 1) {
            return None;
        }
        for at in (0..word.len()).step_by(2) {
            let digits = &word[at..word.len().min(at + 2)];
            found.push(u8::from_str_radix(digits, 16).ok()?);
        }
        if found.len() > MOST {
            return None;
        }
    }
    Some(found)
}

/// Returns `true` if the word has only hexadecimal digits; Rust's own conversion would also accept a sign.
fn is_hex(word: &str) -> bool {
    !word.is_empty() && word.bytes().all(|byte| byte.is_ascii_hexdigit())
}

fn is_time(word: &str) -> bool {
    word.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.') && word.parse::<f64>().is_ok()
}

/// Returns `true` if the protocol can transmit the frame. The protocol can transmit only classic data frames.
pub(crate) fn has_form(frame: &CanFrame) -> bool {
    !frame.is_fd() && !frame.is_remote()
}

/// Appends `< frame … >` with the time since 1970.
///
/// The bytes have no blanks between them, because python-can reads only the first word. A frame without bytes has two
/// blanks in sequence, because python-can would otherwise not find the empty word.
pub(crate) fn push_frame(text: &mut String, frame: &CanFrame, time: Duration) {
    let (s, us) = (time.as_secs(), time.subsec_micros());
    let written = write!(text, "< frame {} {s}.{us:06} ", frame.id()).and_then(|()| {
        frame.data().iter().try_for_each(|byte| write!(text, "{byte:02X}"))?;
        text.write_str(" >")
    });
    written.expect("a String takes everything");
}

/// Appends `< error CLASS TIME >` for a controller that became bus-off or has recovered. Other states would need data
/// bytes in the error frame, which the protocol does not transmit.
pub(crate) fn push_state(text: &mut String, state: ErrorState, time: Duration) {
    let class = match state {
        ErrorState::BusOff => CLASS_BUS_OFF,
        ErrorState::Active => CLASS_RESTARTED,
        _ => return,
    };
    let (s, us) = (time.as_secs(), time.subsec_micros());
    write!(text, "< error {class:03X} {s}.{us:06} >").expect("a String takes everything");
}

/// Appends `< send … >`.
pub(crate) fn push_send(text: &mut String, frame: &CanFrame) {
    let written = write!(text, "< send {} {:X} ", frame.id(), frame.len()).and_then(|()| {
        let mut gap = "";
        for byte in frame.data() {
            write!(text, "{gap}{byte:02X}")?;
            gap = " ";
        }
        text.write_str(" >")
    });
    written.expect("a String takes everything");
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(id: u32, data: &[u8]) -> CanFrame {
        CanFrame::classic(Id::standard(id).unwrap(), data).unwrap()
    }

    fn extended(id: u32, data: &[u8]) -> CanFrame {
        CanFrame::classic(Id::extended(id).unwrap(), data).unwrap()
    }

    /// The parser must accept requests as python-can 4.6.1 writes them: without leading zeros, and with two blanks
    /// for a message without data.
    #[test]
    fn requests_of_python_can_are_understood() {
        for (text, request) in [
            (" open can0 ", Request::Open("can0")),
            ("open can0", Request::Open("can0")),
            (" rawmode ", Request::RawMode),
            (" echo ", Request::Echo),
            (" send 281 0  ", Request::Send(frame(0x281, &[]))),
            (" send 1C1 2 2 f ", Request::Send(frame(0x1C1, &[2, 15]))),
            (
                " send 00000281 8 0 1 2 3 4 5 6 ff ",
                Request::Send(extended(0x281, &[0, 1, 2, 3, 4, 5, 6, 255])),
            ),
            (" send 1C1 2 0102 ", Request::Send(frame(0x1C1, &[1, 2]))),
        ] {
            assert_eq!(Request::parse(text), request);
        }
    }

    #[test]
    fn requests_that_are_no_frames_are_none() {
        for text in [
            "send",
            "send 281",
            "send 281 1",
            "send 281 9 1 2 3 4 5 6 7 8 9",
            "send 281 1 1 2",
            "send 800 0",
            "send 20000000 0",
            "send 000000281 0",
            "send +81 0",
            "send 281 +1 1",
            "send 281 1 +1",
            "send 281 1 100",
            "send 281 1 g",
            "send 281 01 1",
            "send 281 0x1 1",
        ] {
            assert_eq!(Request::parse(text), Request::BadSend, "{text}");
        }
        for text in ["", " ", "open", "open a b", "rawmode 1", "isotpmode", "OPEN can0"] {
            assert_eq!(Request::parse(text), Request::Other, "{text}");
        }
    }

    #[test]
    fn messages_of_servers_are_understood() {
        for (text, reply) in [
            (" hi ", Reply::Hi),
            (" ok ", Reply::Ok),
            (" frame 123 23.424242 11 22 33 44 ", Reply::Frame(frame(0x123, &[0x11, 0x22, 0x33, 0x44]))),
            (" frame 123 23.424242 11223344 ", Reply::Frame(frame(0x123, &[0x11, 0x22, 0x33, 0x44]))),
            (" frame 123 23.424242  ", Reply::Frame(frame(0x123, &[]))),
            (" frame 123 23.424242 ", Reply::Frame(frame(0x123, &[]))),
            (" frame 00000123 1.0 1 2 ", Reply::Frame(extended(0x123, &[1, 2]))),
            (" error 008 1.000000 ", Reply::ErrorFrame(8)),
            (" error 20000040 ", Reply::ErrorFrame(0x2000_0040)),
            (" error could not open bus ", Reply::Refused("could not open bus")),
            (" error bad command ", Reply::Refused("bad command")),
            (" frame 123 x 11 ", Reply::Other),
            (" frame 123 1.0 112 ", Reply::Other),
            (" frame 123 1.0 112233445566778899 ", Reply::Other),
            (" frame 123 inf 11 ", Reply::Other),
            (" stat 1 2 3 4 ", Reply::Other),
        ] {
            assert_eq!(Reply::parse(text), reply, "{text}");
        }
        let fd = CanFrame::fd(Id::standard(0x12).unwrap(), &[7; 12]).unwrap();
        let text = "fdframe 012 01 1.0 070707070707070707070707";
        assert_eq!(Reply::parse(text), Reply::Frame(fd));
        assert_eq!(Reply::parse(&text.replace(" 01 ", " 00 ")), Reply::Frame(fd.with_brs(false)));
    }

    /// python-can 4.6.1 needs exactly these texts. With a single blank, python-can raises an IndexError. With blanks
    /// between the bytes, python-can reads only one byte.
    #[test]
    fn frames_are_written_as_python_can_reads_them() {
        for (frame, line, send) in [
            (frame(0x680, &[]), "< frame 680 12.000345  >", "< send 680 0  >"),
            (frame(5, &[1, 0xAB]), "< frame 005 12.000345 01AB >", "< send 005 2 01 AB >"),
            (
                extended(5, &[9; 8]),
                "< frame 00000005 12.000345 0909090909090909 >",
                "< send 00000005 8 09 09 09 09 09 09 09 09 >",
            ),
        ] {
            let mut text = String::new();
            push_frame(&mut text, &frame, Duration::from_micros(12_000_345));
            assert_eq!(text, line);
            let mut text = String::new();
            push_send(&mut text, &frame);
            assert_eq!(text, send);
        }
    }

    /// Error frames must have the format that socketcand writes and python-can 4.6.1 reads: three digits for the
    /// class, followed by the time.
    #[test]
    fn bus_off_and_the_way_back_are_error_frames() {
        let time = Duration::from_micros(12_000_345);
        for (state, line) in [
            (ErrorState::BusOff, "< error 040 12.000345 >"),
            (ErrorState::Active, "< error 100 12.000345 >"),
            (ErrorState::Passive, ""),
        ] {
            let mut text = String::new();
            push_state(&mut text, state, time);
            assert_eq!(text, line);
        }
    }
}
