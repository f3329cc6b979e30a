//! Tests of the stream parser of the device; each test is a sequence of bytes, silences and events.
use jtc_wire::{
    Command, DataStatus, FRAME_MAX, FrameRef, FrameStatus, FrameType, HEADER, KNOWN_US, LinkEvent, Receiver,
    crc16, fixed,
};

use super::{ON, receiver, segment};

/// Event in a short form.
#[derive(Debug, PartialEq)]
enum Received {
    Good(FrameType, usize),
    Bad(u8, FrameStatus, u16),
    /// Run of bytes without a header.
    Noise(FrameStatus, u16),
}
use FrameStatus::*;
use Received::{Bad, Good, Noise};

struct Line {
    receiver: Receiver<Vec<u8>>,
    now: u64,
}

impl Line {
    fn new() -> Self {
        Line { receiver: receiver(), now: 1_000_000 }
    }

    /// Sends all bytes in one call and returns the events that they cause.
    fn send(&mut self, bytes: &[u8]) -> Vec<Received> {
        self.now += 100;
        assert_eq!(self.receiver.push(self.now, bytes), bytes.len());
        self.received()
    }

    fn silence(&mut self, us: u64) -> Vec<Received> {
        self.now += us;
        self.received()
    }

    fn received(&mut self) -> Vec<Received> {
        let mut all = Vec::new();
        while self.receiver.poll(self.now) || self.receiver.busy() {
            match self.receiver.event() {
                Some(LinkEvent::Frame(frame)) => all.push(Good(frame.frame_type, frame.bytes.len())),
                Some(LinkEvent::Bad(r)) => {
                    assert_eq!(r.data, DataStatus::Idle);
                    all.push(Bad(r.frame_type, r.status, r.length));
                }
                Some(LinkEvent::Noise(r)) => {
                    assert_eq!((r.data, r.frame_type), (DataStatus::Idle, 0));
                    all.push(Noise(r.status, r.length));
                }
                None => {}
            }
            self.receiver.release();
            assert!(all.len() <= 2 * FRAME_MAX, "more events than bytes");
        }
        all
    }
}

const GOOD_ON: Received = Good(FrameType::TeachingModeEnable, 6);

#[test]
fn j03_byte_by_byte() {
    let mut line = Line::new();
    for byte in &ON[..5] {
        assert_eq!(line.send(&[*byte]), []);
        assert_eq!(line.silence(4800), []);
        assert!(line.receiver.mid_frame());
    }
    assert_eq!(line.send(&ON[5..]), [GOOD_ON]);
    assert!(!line.receiver.mid_frame());
}

#[test]
fn j03_several_frames_in_one_piece() {
    let mut line = Line::new();
    let bytes = [&ON[..], &segment(500), &fixed::STOP, &fixed::PUMP_ON[..5]].concat();
    let expected = [GOOD_ON, Good(FrameType::Trajectory, 18_014), Good(FrameType::TrajSetExecStatus, 7)];
    assert_eq!(line.send(&bytes), expected);
    assert_eq!(line.send(&fixed::PUMP_ON[5..]), [Good(FrameType::GripperControl, 10)]);
}

#[test]
fn j02_the_longest_frame() {
    let mut line = Line::new();
    // After this short frame, the rest of the buffer is too short for the longest frame. The parser must receive the
    // longest frame nevertheless.
    assert_eq!(line.send(&ON), [GOOD_ON]);
    let frame = segment(1666);
    assert_eq!(line.send(&frame), [Good(FrameType::Trajectory, 59_990)]);
    assert_eq!(line.send(&ON), [GOOD_ON]);
}

#[test]
fn j05_header() {
    let mut line = Line::new();
    assert_eq!(line.send(&[0x00, 0x01, 0x02]), [Noise(IncorrectHeader, 0)]);
    assert_eq!(line.send(&[0x03]), [], "still the same run");
    line.silence(5000);
    assert_eq!(line.send(&[0x04]), [Noise(IncorrectHeader, 0)], "another run");
    for n in [0u16, 1, 5, 60_001, 65_535] {
        line.silence(5000);
        let [high, low] = n.to_be_bytes();
        assert_eq!(line.send(&[HEADER, 0x04, high, low]), [Bad(0, IncorrectHeader, 0)], "n = {n}");
    }
}

#[test]
fn j05_frame_type() {
    let mut line = Line::new();
    for kind in (0x12..0x40).chain(0x48..0x4C).chain(0x4F..=0xFF).chain([0x00, 0x03]) {
        let frame = [HEADER, kind, 0, 6];
        let crc = crc16(&frame).to_be_bytes();
        assert_eq!(line.send(&[&frame[..], &crc].concat()), [Bad(kind, IncorrectFrameType, 0)]);
        line.silence(5000);
    }
}

/// The test also covers fault D16 of the old device: a frame whose length is not permitted for its type must never be
/// executed, even if the CRC is correct.
#[test]
fn j05_length_of_another_type() {
    let mut line = Line::new();
    for kind in FrameType::ALL.into_iter().filter(|t| t.from_host()) {
        for n in (6..700).chain([10_565, 10_567, 59_999, 60_000]).filter(|n| !kind.can_have(*n)) {
            let mut frame = vec![0u8; n];
            frame[..4].copy_from_slice(&[HEADER, kind as u8, (n >> 8) as u8, n as u8]);
            let crc = crc16(&frame[..n - 2]).to_be_bytes();
            frame[n - 2..].copy_from_slice(&crc);
            let received = line.send(&frame);
            assert_eq!(received.first(), Some(&Bad(kind as u8, IncorrectFrameType, n as u16)));
            assert_eq!(received.len(), 1);
            line.silence(5000);
        }
    }
}

#[test]
fn j05_crc() {
    let mut line = Line::new();
    let mut frame = segment(3);
    for at in 4..frame.len() {
        frame[at] ^= 0x40;
        assert_eq!(line.send(&frame), [Bad(4, IncorrectCrc, 122)], "byte {at}");
        frame[at] ^= 0x40;
        assert_eq!(line.send(&frame), [Good(FrameType::Trajectory, 122)], "without a gap");
    }
}

#[test]
fn j05_gap() {
    let mut line = Line::new();
    let frame = segment(100);
    assert_eq!(line.send(&frame[..20]), []);
    assert_eq!(line.silence(4999), []);
    assert_eq!(line.silence(1), [Bad(4, DiscontinuousFrame, 20)]);
    assert_eq!(line.send(&ON), [GOOD_ON]);
    // The parser measures the silence from the last byte, not from the first byte or the last frame.
    for piece in frame.chunks(100) {
        line.silence(4800);
        line.send(piece);
    }
    assert_eq!(line.send(&ON), [GOOD_ON], "the frame was received in the loop");
    // Only the header byte arrives before the gap. The type of the frame is unknown, so the byte counts as noise.
    assert_eq!(line.send(&ON[..1]), []);
    assert_eq!(line.silence(5000), [Noise(DiscontinuousFrame, 1)]);
}

/// The parser must detect a gap even if the bytes after the gap arrive before the next call of `poll`.
#[test]
fn j05_gap_seen_with_the_next_bytes() {
    for (us, expected) in
        [(4999, vec![GOOD_ON]), (5000, vec![Bad(0x0C, DiscontinuousFrame, 4), Noise(IncorrectHeader, 0)])]
    {
        let mut line = Line::new();
        assert_eq!(line.send(&ON[..4]), []);
        line.now += us - 100;
        assert_eq!(line.send(&ON[4..]), expected, "{us} µs");
    }
}

/// The test covers fault D15 of the old device: a glitch of two bytes, and length fields of 0 and 1.
#[test]
fn j07_glitches() {
    let mut line = Line::new();
    assert_eq!(line.send(&[HEADER, 0x0C]), []);
    assert_eq!(line.silence(6000), [Bad(0x0C, DiscontinuousFrame, 2)]);
    assert_eq!(line.send(&[HEADER, 0x0C, 0, 0]), [Bad(0, IncorrectHeader, 0)]);
    assert_eq!(line.send(&ON), [GOOD_ON]);
}

#[test]
fn j03_a_false_header_costs_no_frame() {
    let mut line = Line::new();
    // The header announces 59,990 bytes. The parser treats the following bytes as the body of this frame until a gap.
    assert_eq!(line.send(&[HEADER, 0x04, 0xEA, 0x56]), []);
    assert_eq!(line.send(&ON), []);
    assert_eq!(line.send(&fixed::STOP), []);
    let expected = [Bad(4, DiscontinuousFrame, 17), GOOD_ON, Good(FrameType::TrajSetExecStatus, 7)];
    assert_eq!(line.silence(5000), expected);
}

#[test]
fn j03_a_false_header_that_fills_up_costs_no_frame() {
    let mut line = Line::new();
    let bytes = [&[HEADER, 0x07, 0, 126][..], &ON.repeat(30)].concat();
    let received = line.send(&bytes);
    assert_eq!(received[0], Bad(7, IncorrectCrc, 126));
    assert_eq!(received.len(), 31);
    assert!(received[1..].iter().all(|h| *h == GOOD_ON));
}

/// A frame has lost a byte, and the complete frame follows without a gap. The parser must reject only the damaged
/// frame.
#[test]
fn j03_a_lost_byte_costs_only_its_frame() {
    let frame = segment(10);
    for lost in 4..frame.len() {
        let mut line = Line::new();
        let bytes = [&frame[..lost], &frame[lost + 1..], &frame, &ON].concat();
        let expected = [Bad(4, IncorrectCrc, 374), Good(FrameType::Trajectory, 374), GOOD_ON];
        assert_eq!(line.send(&bytes), expected, "byte {lost}");
    }
}

#[test]
fn j04_one_record_for_a_bad_frame_and_what_follows_it() {
    let mut line = Line::new();
    let mut bad = ON;
    bad[5] ^= 1;
    let bytes = [&bad[..], &[1, 2, 3], &bad, &[HEADER, 0x55], &ON].concat();
    assert_eq!(line.send(&bytes), [Bad(0x0C, IncorrectCrc, 6), GOOD_ON]);
    assert_eq!(line.send(&bad), [Bad(0x0C, IncorrectCrc, 6)]);
    line.silence(5000);
    assert_eq!(line.send(&bad), [Bad(0x0C, IncorrectCrc, 6)]);
}

#[test]
fn j06_oddities_of_existing_hosts() {
    let everything = [0x9B, 0x01, 0x00, 0x06, 0x8F, 0x76];
    let mut line = Line::new();
    assert_eq!(line.send(&everything), [Good(FrameType::ClearCurrentErrors, 6)]);
    let command = Command::parse(FrameRef::new_checked(&everything).expect("a good frame"));
    assert_eq!(command, Ok(Command::ClearCurrentErrors { jtc: true, nodes: 0x7F }));

    let default = [0x9B, 0x0E, 0x00, 0x06, 0xA3, 0x47];
    assert_eq!(line.send(&default), [Good(FrameType::FrictionPolynomial, 6)]);
    let command = Command::parse(FrameRef::new_checked(&default).expect("a good frame"));
    assert_eq!(command, Ok(Command::FrictionPolynomialUseDefault));
}

/// A line becomes plain 2 s after an extension request. For a frame of any length, the time of its first byte
/// determines whether the line was plain.
#[test]
fn j51_a_line_is_plain_where_no_extension_request_came_in_the_2_s_before_a_frame() {
    // Returns a flag for each complete frame: true if the line was plain.
    let plain = |line: &mut Line, bytes: &[u8]| -> Vec<bool> {
        assert_eq!(line.receiver.push(line.now, bytes), bytes.len());
        let mut all = Vec::new();
        while line.receiver.poll(line.now) {
            let received = line.receiver.received(5).expect("an event");
            assert_eq!((received.line, Some(received.event)), (5, line.receiver.event()));
            if matches!(received.event, LinkEvent::Frame(_)) {
                all.push(received.plain);
            }
            line.receiver.release();
        }
        all
    };
    let mut line = Line::new();
    assert_eq!(plain(&mut line, &fixed::STOP), [true], "nothing was asked yet");
    for (after_us, is_plain) in
        [(0, false), (1_000, false), (KNOWN_US, false), (KNOWN_US + 1, true), (60_000_000, true)]
    {
        // The extension request itself shows that its client knows the extensions.
        assert_eq!(plain(&mut line, &fixed::GET_INFO), [false]);
        line.now += after_us;
        assert_eq!(plain(&mut line, &fixed::STOP), [is_plain], "{after_us} \u{b5}s");
        // Only the time of the first byte matters. A frame that takes 4.7 s at 115 200 Bd ends much later.
        assert_eq!(plain(&mut line, &fixed::GET_INFO), [false]);
        line.now += after_us;
        let long = segment(1_500);
        let pieces = long.chunks(46);
        let all: Vec<bool> = pieces
            .flat_map(|piece| {
                line.now += 4_000;
                plain(&mut line, piece)
            })
            .collect();
        assert_eq!(all, [after_us + 4_000 > KNOWN_US]);
    }
    // Damaged or cut-off requests, and bytes that only look like a request, have no effect; valid requests have an effect.
    for (bytes, shows) in [
        (&fixed::GET_INFO[..], true),
        (&fixed::DISABLE, true),
        (&fixed::STORE_ARM, true),
        (&fixed::EXECUTE, false),
        (&fixed::CLEAR_OCCURRED_ERRORS, false),
        (&[0x9B, 0x40, 0, 6, 0xA5, 0xEA], false),
        (&[0x9B, 0x40, 0, 6, 0xA5], false),
        (&[0x40; 50], false),
    ] {
        let mut line = Line::new();
        plain(&mut line, bytes);
        line.now += 10_000;
        assert_eq!(plain(&mut line, &fixed::STOP), [!shows], "{bytes:x?}");
    }
    // Repeats the check above, but after noise and after other frames in the same piece.
    let mut line = Line::new();
    let bytes =
        [&[7, 7, 0x9B][..], &fixed::STOP, &fixed::GET_INFO, &fixed::STOP, &segment(500), &ON].concat();
    assert_eq!(plain(&mut line, &bytes), [true, false, false, false, false]);
}
