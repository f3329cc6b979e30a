//! Functions that the fuzz targets call. Each function panics if the tested code violates a property that it
//! guarantees.

use std::time::Duration;

use crate::slcan::line;
use crate::socketcand::splitter::{LONGEST, Splitter};
use crate::socketcand::text::{Reply, Request, push_frame, push_send};
use crate::{CanFrame, SlcanAdapter};

/// Parses a stream of the socketcand protocol in pieces of any length. The pieces must produce the same messages as the
/// whole stream, and memory use must be bounded. A parsed frame that is written again must parse to the same frame.
pub fn socketcand_stream(data: &[u8]) {
    let (cuts, stream) = parts(data);
    let mut splitter = Splitter::new();
    let mut found = Vec::new();
    for mut piece in pieces(cuts, stream) {
        while let Some(message) = splitter.next(&mut piece) {
            found.push(message.to_owned());
        }
    }
    assert_eq!(found, messages_of_the_whole(stream));
    assert!(splitter.capacity() <= LONGEST);
    for message in &found {
        if let Request::Send(frame) = Request::parse(message) {
            let mut text = String::new();
            push_send(&mut text, &frame);
            assert_eq!(Request::parse(inner(&text)), Request::Send(frame));
        }
        if let Reply::Frame(frame) = Reply::parse(message)
            && !frame.is_fd()
        {
            let mut text = String::new();
            push_frame(&mut text, &frame, Duration::from_micros(1_234_567));
            assert_eq!(Reply::parse(inner(&text)), Reply::Frame(frame));
        }
    }
}

fn inner(text: &str) -> &str {
    text.strip_prefix('<').and_then(|text| text.strip_suffix('>')).expect("a message in its brackets")
}

/// Finds messages with a slow and simple algorithm, for comparison with the parser. Each message begins at the last
/// `<` before a `>`.
fn messages_of_the_whole(stream: &[u8]) -> Vec<String> {
    let mut found = Vec::new();
    let mut rest = stream;
    while let Some(end) = rest.iter().position(|byte| *byte == b'>') {
        let before = &rest[..end];
        if let Some(start) = before.iter().rposition(|byte| *byte == b'<') {
            let message = &before[start + 1..];
            if message.len() <= LONGEST && message.is_ascii() {
                found.push(String::from_utf8_lossy(message).into_owned());
            }
        }
        rest = &rest[end + 1..];
    }
    found
}

/// Parses a stream of SLCAN lines in pieces of any length. The line reader and the adapter must produce the same
/// results as for the whole stream. A parsed frame that is written again must parse to the same frame.
pub fn slcan_stream(data: &[u8]) {
    let (cuts, stream) = parts(data);
    let lines = |pieces: &mut dyn Iterator<Item = &[u8]>| {
        let mut lines = line::Lines::new();
        let mut found = Vec::new();
        for mut piece in pieces {
            while let Some(piece) = lines.next(&mut piece) {
                match piece {
                    line::Piece::Line(line) => found.push(line.to_owned()),
                    line::Piece::Bell => found.push("\u{7}".to_owned()),
                }
            }
        }
        found
    };
    let whole = lines(&mut std::iter::once(stream));
    assert_eq!(lines(&mut pieces(cuts, stream)), whole);
    for text in &whole {
        let _ = (line::parse_flags(text), line::parse_state(text));
        if let Some(frame) = line::parse_frame(text) {
            let mut again = String::new();
            line::push_frame(&mut again, &frame);
            assert_eq!(line::parse_frame(again.trim_end_matches('\r')), Some(frame));
        }
    }
    let adapter = |pieces: &mut dyn Iterator<Item = &[u8]>| {
        let mut adapter = SlcanAdapter::new();
        let mut sent: Vec<CanFrame> = Vec::new();
        for piece in pieces {
            adapter.input(piece, |frame| {
                sent.push(*frame);
                !sent.len().is_multiple_of(3)
            });
        }
        (sent, adapter.take_output(), adapter.is_open(), adapter.rates())
    };
    assert_eq!(adapter(&mut pieces(cuts, stream)), adapter(&mut std::iter::once(stream)));
}

/// Splits off the first bytes. The first bytes define how the remaining bytes are cut into pieces.
fn parts(data: &[u8]) -> (&[u8], &[u8]) {
    data.split_at(data.len().min(4))
}

fn pieces<'a>(cuts: &'a [u8], stream: &'a [u8]) -> impl Iterator<Item = &'a [u8]> {
    let mut rest = stream;
    let mut lengths = cuts.iter().cycle();
    std::iter::from_fn(move || {
        let length = usize::from(*lengths.next()?) % 64 + 1;
        let (piece, after) = rest.split_at(rest.len().min(length));
        rest = after;
        (!piece.is_empty()).then_some(piece)
    })
}
