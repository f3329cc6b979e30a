//! Simulated bus member that answers each request with the frames in a table.

use std::collections::BTreeMap;

use ucom::Frame;

use super::bench::{MS, Member, frame};

/// Bus member that consists of a table of frames.
#[derive(Default)]
pub(super) struct Script {
    /// Rules of the table: answers and their delays in milliseconds.
    rules: Vec<Rule>,
    due: BTreeMap<(u64, u64), Frame>,
    serial: u64,
    waiting: Option<Frame>,
}

struct Rule {
    ask: Frame,
    /// Number of times that the rule can still be used.
    uses: u32,
    /// Number of requests that the member skips before the rule applies.
    skip: u32,
    answers: Vec<(u64, Frame)>,
}

impl Script {
    /// Adds a rule: the member answers each frame `ask` with `answers`. Each answer is `"ms:frame"` or `"frame"`, for
    /// example `["441#21", "5:482#42"]`.
    pub(super) fn on(self, ask: &str, answers: &[&str]) -> Self {
        self.rule(ask, 0, u32::MAX, answers)
    }

    /// Like [`Self::on`], but the rule applies to the first request only.
    pub(super) fn once(self, ask: &str, answers: &[&str]) -> Self {
        self.rule(ask, 0, 1, answers)
    }

    pub(super) fn rule(mut self, ask: &str, skip: u32, uses: u32, answers: &[&str]) -> Self {
        let answer = |text: &&str| match text.split_once(':') {
            Some((ms, text)) => (ms.parse::<u64>().unwrap() * MS, frame(text)),
            None => (300, frame(text)),
        };
        self.rules.push(Rule { ask: frame(ask), uses, skip, answers: answers.iter().map(answer).collect() });
        self
    }

    /// Adds a frame that the member sends without a request at a time in milliseconds.
    pub(super) fn at(mut self, ms: u64, text: &str) -> Self {
        self.serial += 1;
        self.due.insert((ms * MS, self.serial), frame(text));
        self
    }
}

impl Member for Script {
    fn poll(&mut self, now: u64) -> Option<Frame> {
        if self.waiting.is_none()
            && let Some((&key, &frame)) = self.due.first_key_value()
            && key.0 <= now
        {
            self.due.remove(&key);
            self.waiting = Some(frame);
            return Some(frame);
        }
        None
    }
    fn sent(&mut self, _: u64, _: &Frame) {
        self.waiting = None;
    }
    fn receive(&mut self, now: u64, frame: &Frame) {
        for rule in self.rules.iter_mut().filter(|r| r.ask == *frame && r.uses > 0) {
            if rule.skip > 0 {
                rule.skip -= 1;
                continue;
            }
            rule.uses -= 1;
            for (after, frame) in &rule.answers {
                self.serial += 1;
                self.due.insert((now + after, self.serial), *frame);
            }
            break;
        }
    }
    fn deadline(&self) -> u64 {
        self.due.first_key_value().map_or(u64::MAX, |((at, _), _)| *at)
    }
}
