//! What extension requests return: a frame that waits on each line, and which lines have asked of late (J-50, J-51).
use jtc_wire::{ANSWER_MAX, Answer, DataStatus, Response};

use crate::HOST_LINES;

/// Ticks after an extension request in which the line receives every data status.
const KNOWN_MS: u16 = 10_000;

/// One line.
#[derive(Clone, Debug)]
struct Line {
    /// Ticks left in which its host is known to understand data status 7 and 8.
    known_ms: u16,
    /// Bytes that wait.
    len: usize,
    frame: [u8; ANSWER_MAX],
}

/// All lines.
#[derive(Clone, Debug)]
pub(crate) struct Answers {
    lines: [Line; HOST_LINES],
    /// The line whose frame was given out last.
    sent: usize,
    /// Bytes of it.
    sent_len: usize,
}

impl Answers {
    pub const fn new() -> Self {
        let lines = [const { Line { known_ms: 0, len: 0, frame: [0; ANSWER_MAX] } }; HOST_LINES];
        Self { lines, sent: 0, sent_len: 0 }
    }

    /// A tick is over.
    pub fn tick(&mut self) {
        for line in &mut self.lines {
            line.known_ms = line.known_ms.saturating_sub(1);
        }
    }

    /// An extension request came on this line.
    pub fn asked(&mut self, line: usize) {
        if let Some(line) = self.lines.get_mut(line) {
            line.known_ms = KNOWN_MS;
        }
    }

    /// A record as the host of this line understands it: existing hosts know no data status above 6 (J-51).
    pub fn record_for(&self, line: usize, record: Response) -> Response {
        let known = self.lines.get(line).is_some_and(|line| line.known_ms > 0);
        match record.data {
            DataStatus::NotAllowed | DataStatus::StartPositionMismatch if !known => {
                Response { data: DataStatus::IncorrectValue, ..record }
            }
            _ => record,
        }
    }

    /// An answer on this line has not been sent.
    pub fn waits(&self, line: usize) -> bool {
        self.lines.get(line).is_some_and(|line| line.len > 0)
    }

    /// Puts an answer on a line, in place of one that has not been sent yet.
    pub fn put(&mut self, line: usize, answer: &Answer<'_>) {
        if let Some(line) = self.lines.get_mut(line) {
            line.len = answer.emit(&mut line.frame).unwrap_or(0);
        }
    }

    /// The line whose answer is to be sent now, one after the other.
    pub fn send(&mut self) -> Option<usize> {
        for offset in 1..=HOST_LINES {
            let n = (self.sent + offset) % HOST_LINES;
            if let Some(line) = self.lines.get_mut(n).filter(|line| line.len > 0) {
                (self.sent, self.sent_len) = (n, core::mem::take(&mut line.len));
                return Some(n);
            }
        }
        None
    }

    /// The frame of that line.
    pub fn frame(&self) -> &[u8] {
        self.lines.get(self.sent).and_then(|line| line.frame.get(..self.sent_len)).unwrap_or(&[])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use jtc_wire::FrameType;

    fn arm(bytes: &[u8]) -> Answer<'_> {
        Answer::Arm { offset: 0, total: 9, bytes }
    }

    #[test]
    fn j51_status_7_and_8_are_6_where_no_extension_was_asked_for_in_10_s() {
        for data in DataStatus::ALL {
            let record = Response::good(FrameType::PidParam, data, 126);
            let old = matches!(data, DataStatus::NotAllowed | DataStatus::StartPositionMismatch);
            let translated = if old { DataStatus::IncorrectValue } else { data };
            let mut answers = Answers::new();
            let sent = |answers: &Answers| [0, 1].map(|line| answers.record_for(line, record).data);
            assert_eq!(sent(&answers), [translated; 2]);
            answers.asked(1);
            for ms in 0..10_000 {
                assert_eq!(sent(&answers), [translated, data], "{ms} ms");
                answers.tick();
            }
            assert_eq!(sent(&answers), [translated; 2]);
        }
    }

    #[test]
    fn j50_an_answer_goes_once_to_the_line_that_asked() {
        let mut answers = Answers::new();
        assert_eq!((answers.send(), answers.frame()), (None, &[][..]));
        answers.put(0, &arm(&[1, 2]));
        answers.put(1, &arm(&[3]));
        answers.put(0, &arm(&[7]));
        answers.put(5, &arm(&[9]));
        let mut sent = [answers.send(), None];
        assert_eq!((answers.frame().len(), answers.frame()[8]), (11, if sent[0] == Some(0) { 7 } else { 3 }));
        sent[1] = answers.send();
        sent.sort();
        assert_eq!(sent, [Some(0), Some(1)]);
        assert_eq!(answers.send(), None);
    }
}
