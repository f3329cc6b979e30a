//! Answers to extension requests. On each line, one answer can wait to be sent (J-50).
use jtc_wire::{ANSWER_MAX, Answer};

use crate::HOST_LINES;

/// Answer buffer of one serial line.
#[derive(Clone, Debug)]
struct Line {
    /// Length of the answer that waits to be sent.
    len: usize,
    frame: [u8; ANSWER_MAX],
}

/// Answer buffers of all lines.
#[derive(Clone, Debug)]
pub(crate) struct Answers {
    lines: [Line; HOST_LINES],
    /// Index of the line on which the last answer was sent.
    sent: usize,
    /// Length of the last answer that was sent.
    sent_len: usize,
}

impl Answers {
    pub(crate) const fn new() -> Self {
        let lines = [const { Line { len: 0, frame: [0; ANSWER_MAX] } }; HOST_LINES];
        Self { lines, sent: 0, sent_len: 0 }
    }

    /// Returns `true` if an answer on this line has not been sent yet.
    pub(crate) fn waits(&self, line: usize) -> bool {
        self.lines.get(line).is_some_and(|line| line.len > 0)
    }

    /// Stores an answer for a line, and replaces an answer that has not been sent yet.
    pub(crate) fn put(&mut self, line: usize, answer: &Answer<'_>) {
        if let Some(line) = self.lines.get_mut(line) {
            line.len = answer.emit(&mut line.frame).unwrap_or(0);
        }
    }

    /// Returns the index of the line whose answer must be sent now. The lines take turns if several lines have an answer.
    pub(crate) fn send(&mut self) -> Option<usize> {
        for offset in 1..=HOST_LINES {
            let n = (self.sent + offset) % HOST_LINES;
            if let Some(line) = self.lines.get_mut(n).filter(|line| line.len > 0) {
                (self.sent, self.sent_len) = (n, core::mem::take(&mut line.len));
                return Some(n);
            }
        }
        None
    }

    /// Returns the answer that was sent last.
    pub(crate) fn frame(&self) -> &[u8] {
        self.lines.get(self.sent).and_then(|line| line.frame.get(..self.sent_len)).unwrap_or(&[])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arm(bytes: &[u8]) -> Answer<'_> {
        Answer::Arm { offset: 0, total: 9, bytes }
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
