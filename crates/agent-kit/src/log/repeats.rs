//! Limit for log lines that clients without a token can cause. The log contains the first of these lines; further
//! lines are only counted.
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use serde_json::Value;

/// Number of lines per kind and sender that are written before repetitions are only counted.
const FIRST: u32 = 10;
/// Interval between log lines that contain a count of repetitions. If a sender causes no line during this time, its
/// next lines are again written in full.
const PERIOD: Duration = Duration::from_secs(60);
/// Number of senders whose log lines are counted separately; the lines of all other senders are counted together.
const SENDERS_MAX: usize = 256;
/// Name in the log for all senders whose lines are counted together.
const OTHERS: &str = "others";

/// Count of log lines of one kind and sender.
struct Count {
    since: Instant,
    written: u32,
    /// Number of log lines that were not written, and the data of the last of these lines.
    more: u64,
    facts: Value,
}

/// Counts of repeated lines by kind and sender.
#[derive(Default)]
pub(super) struct Repeats {
    counts: BTreeMap<(&'static str, String), Count>,
    /// Earliest time at which a log line with a count must be written.
    next: Option<Instant>,
}

impl Repeats {
    /// Counts a log line of this kind and sender. Returns the data of the log line if the line must be written.
    pub(super) fn admit(
        &mut self,
        what: &'static str,
        sender: &str,
        facts: Value,
        now: Instant,
    ) -> Option<Value> {
        let mut key = (what, sender.to_owned());
        if !self.counts.contains_key(&key) && self.counts.len() >= SENDERS_MAX {
            key.1 = OTHERS.to_owned();
        }
        let begun = || Count { since: now, written: 0, more: 0, facts: Value::Null };
        let count = self.counts.entry(key).or_insert_with(begun);
        self.next = Some(self.next.unwrap_or(now + PERIOD).min(count.since + PERIOD));
        if count.written < FIRST {
            count.written += 1;
            return Some(facts);
        }
        count.more += 1;
        count.facts = facts;
        None
    }

    /// Returns the lines with counts that are due at `now`. Each line contains the data of the last repetition, and
    /// the number of repetitions in `times`.
    pub(super) fn due(&mut self, now: Instant) -> Vec<(&'static str, Value)> {
        if self.next.is_none_or(|next| now < next) {
            return Vec::new();
        }
        let mut lines = Vec::new();
        self.counts.retain(|(what, _), count| {
            if now.saturating_duration_since(count.since) < PERIOD {
                return true;
            }
            count.since = now;
            let line = count.line();
            let goes_on = line.is_some();
            lines.extend(line.map(|facts| (*what, facts)));
            goes_on
        });
        self.next = self.counts.values().map(|count| count.since + PERIOD).min();
        lines
    }

    /// Returns the log lines with counts that are not written yet.
    pub(super) fn rest(&mut self) -> Vec<(&'static str, Value)> {
        let counts = std::mem::take(&mut self.counts).into_iter();
        counts.filter_map(|((what, _), mut count)| Some((what, count.line()?))).collect()
    }
}

impl Count {
    /// Returns the log line that reports the number of unwritten lines, if there are unwritten lines.
    fn line(&mut self) -> Option<Value> {
        let times = std::mem::take(&mut self.more);
        let mut facts = self.facts.take();
        facts.as_object_mut().filter(|_| times > 0)?.insert("times".into(), times.into());
        Some(facts)
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    /// For any rate of repetitions, only few log lines are written, and the sum of their counts is the number of all
    /// repetitions.
    #[test]
    fn every_repeat_is_written_or_counted_and_the_lines_are_few() {
        for (senders, rounds, step_ms) in [
            (1, 5, 10),
            (1, 10_000, 1),
            (1, 300, 1_000),
            (3, 5_000, 7),
            (255, 40, 500),
            (2_000, 50, 100),
            (1, 40, 61_000),
        ] {
            let (mut repeats, begin) = (Repeats::default(), Instant::now());
            let (mut lines, mut counted, mut now) = (0_u64, 0, begin);
            let mut written = |lines_now: Vec<(&'static str, Value)>| {
                lines += lines_now.len() as u64;
                counted +=
                    lines_now.iter().map(|(_, facts)| facts["times"].as_u64().unwrap_or(1)).sum::<u64>();
            };
            for _ in 0..rounds {
                now += Duration::from_millis(step_ms);
                for sender in 0..senders {
                    written(repeats.due(now));
                    let line = repeats.admit("refused", &sender.to_string(), json!({ "from": sender }), now);
                    written(line.map(|facts| ("refused", facts)).into_iter().collect());
                }
                assert!(repeats.counts.len() <= SENDERS_MAX + 1);
            }
            written(repeats.rest());
            assert!(repeats.counts.is_empty());
            let case = format!("{senders} senders, {rounds} rounds of {step_ms} ms: {lines} lines");
            assert_eq!(counted, senders * rounds, "{case}");
            let minutes = 2 + rounds * step_ms / 60_000;
            let known = senders.min(SENDERS_MAX as u64 + 1);
            assert!(lines <= known * (u64::from(FIRST) + minutes), "{case}");
        }
    }

    #[test]
    fn a_sender_that_was_quiet_for_a_minute_is_forgotten() {
        let (mut repeats, begin) = (Repeats::default(), Instant::now());
        for _ in 0..FIRST {
            assert!(repeats.admit("refused", "a", json!({}), begin).is_some());
        }
        assert!(repeats.admit("refused", "a", json!({}), begin).is_none());
        assert!(repeats.admit("denied", "a", json!({}), begin).is_some(), "another kind");
        assert_eq!(repeats.due(begin + PERIOD), [("refused", json!({ "times": 1 }))]);
        assert!(repeats.admit("refused", "a", json!({}), begin + PERIOD).is_none(), "it goes on");
        assert_eq!(repeats.due(begin + 2 * PERIOD).len(), 1);
        assert_eq!(repeats.due(begin + 3 * PERIOD), []);
        assert!(repeats.counts.is_empty());
        assert!(repeats.admit("refused", "a", json!({}), begin + 3 * PERIOD).is_some());
    }
}
