//! Simulated bus member that answers frames by a rule. Each test defines its own rule for the answers.

use ucom::Frame;

use super::bench::{Member, frame};

/// Bus member that answers a frame by a rule. The first answer is due 300 µs after the frame that it answers. Each further answer is due 1
/// µs after the previous answer.
pub(super) struct Answering<A> {
    answers: A,
    out: Vec<(u64, Frame)>,
}

impl<A: FnMut(&str) -> &'static [&'static str]> Answering<A> {
    pub(super) fn new(answers: A) -> Self {
        Self { answers, out: Vec::new() }
    }
}

impl<A: FnMut(&str) -> &'static [&'static str]> Member for Answering<A> {
    fn poll(&mut self, now: u64) -> Option<Frame> {
        self.out.first().filter(|(at, _)| *at <= now).map(|(_, frame)| *frame)
    }
    fn sent(&mut self, _: u64, _: &Frame) {
        self.out.remove(0);
    }
    fn deadline(&self) -> u64 {
        self.out.first().map_or(u64::MAX, |(at, _)| *at)
    }
    fn receive(&mut self, now: u64, received: &Frame) {
        let answers = (self.answers)(&received.to_string());
        self.out.extend((now + 300..).zip(answers.iter().map(|text| frame(text))));
    }
}
