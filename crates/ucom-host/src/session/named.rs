//! JSON form of the values of boards, with the names of the signals.

use serde_json::{Map, Value, json};

use super::known::Known;
use crate::files::Signal;
use crate::master::io::{Kind, short};

impl Known {
    /// Returns the words of a buffer as a JSON object with signal names as keys. A value is in the signal's unit if a signal table contains
    /// the signal (D-11).
    pub fn values(&self, kind: Kind, words: &[u16]) -> Value {
        named(self.names.names(kind), self.signals.all(kind), words)
    }

    /// Returns the keys of the JSON object, in the order of the buffer.
    pub fn keys(&self, kind: Kind) -> Vec<String> {
        let names = self.names.names(kind);
        keys(names, names.len())
    }

    /// Returns the units of the signals as a JSON object with signal names as keys. Signals without a unit in a
    /// signal table are omitted.
    pub fn units(&self, kind: Kind) -> Value {
        let (names, signals) = (self.names.names(kind), self.signals.all(kind));
        let pairs = keys(names, names.len()).into_iter().zip(signals);
        let known = pairs.filter(|(_, signal)| signal.known && !signal.unit.is_empty());
        Value::Object(known.map(|(key, signal)| (key, json!(signal.unit))).collect::<Map<_, _>>())
    }
}

/// Returns `count` keys of a JSON object. A key is the short name of its signal if that name is unique; otherwise the key is the complete
/// name. If the complete name is not unique either, the key also contains the index.
fn keys(names: &[String], count: usize) -> Vec<String> {
    let once = |all: &mut dyn Iterator<Item = &str>, key: &str| all.filter(|name| *name == key).count() == 1;
    let key = |i: usize| match names.get(i) {
        None => format!("#{i}"),
        Some(name) if once(&mut names.iter().map(|n| short(n)), short(name)) => short(name).to_owned(),
        Some(name) if once(&mut names.iter().map(String::as_str), name) => name.clone(),
        Some(name) => format!("{name}#{i}"),
    };
    (0..count).map(key).collect()
}

/// Returns a JSON object of values with signal names as keys.
fn named(names: &[String], signals: &[Signal], words: &[u16]) -> Value {
    let value =
        |i: usize, word: u16| signals.get(i).map_or_else(|| json!(word as i16), |signal| signal.json(word));
    let values = words.iter().enumerate().map(|(i, word)| value(i, *word));
    Value::Object(keys(names, words.len()).into_iter().zip(values).collect::<Map<_, _>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_equal_names_are_all_there() {
        let names = ["pos [deg]", "pos [rad]", "x", "x", "current [mA]"].map(String::from);
        let all = named(&names, &[], &[1, 2, 3, 4, 5, 6]);
        let keys = json!({ "pos [deg]": 1, "pos [rad]": 2, "x#2": 3, "x#3": 4, "current": 5, "#5": 6 });
        assert_eq!(all, keys);
    }
}
