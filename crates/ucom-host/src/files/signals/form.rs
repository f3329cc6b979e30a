//! TOML form of a signal table, and the valid ranges of the numbers in it.

use serde::Deserialize;
use std::collections::BTreeMap;

use super::value::may_follow;
use super::{Signal, SignalType};

/// Largest scale and largest offset of a signal. The smallest scale is the inverse of this limit. With these limits, every displayed value
/// can be represented as a number.
pub(super) const LARGEST: f64 = 1e9;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    #[serde(default)]
    pub(super) program: Vec<FileProgram>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FileProgram {
    #[serde(default, deserialize_with = "one_or_many")]
    pub(super) program_id: Vec<u16>,
    #[serde(default)]
    pub(super) name: String,
    #[serde(default)]
    pub(super) ci: BTreeMap<String, FileSignal>,
    #[serde(default)]
    pub(super) so: BTreeMap<String, FileSignal>,
    #[serde(default)]
    pub(super) par: BTreeMap<String, FileSignal>,
}

#[derive(Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct FileSignal {
    #[serde(rename = "type")]
    pub(super) kind: SignalType,
    pub(super) scale: f64,
    pub(super) offset: f64,
    pub(super) unit: String,
    pub(super) min: Option<f64>,
    pub(super) max: Option<f64>,
}

impl Default for FileSignal {
    fn default() -> Self {
        Self { kind: SignalType::Int16, scale: 1.0, offset: 0.0, unit: String::new(), min: None, max: None }
    }
}

/// Reads one Program ID or a list of Program IDs: `0x1234` or `[0x1234, 0x4B3F]`. With an untagged enum, the position of an error in the
/// file would be lost.
fn one_or_many<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Vec<u16>, D::Error> {
    struct Ids;
    impl<'de> serde::de::Visitor<'de> for Ids {
        type Value = Vec<u16>;

        fn expecting(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
            f.write_str("a Program ID, 0x0000 to 0xFFFF, or a list of them")
        }

        fn visit_i64<E: serde::de::Error>(self, n: i64) -> Result<Vec<u16>, E> {
            let id = u16::try_from(n);
            id.map(|id| vec![id]).map_err(|_| E::invalid_value(serde::de::Unexpected::Signed(n), &self))
        }

        fn visit_seq<A: serde::de::SeqAccess<'de>>(self, mut list: A) -> Result<Vec<u16>, A::Error> {
            let mut ids = Vec::new();
            while let Some(id) = list.next_element()? {
                ids.push(id);
            }
            Ok(ids)
        }
    }
    deserializer.deserialize_any(Ids)
}

impl FileSignal {
    pub(super) fn check(self) -> Result<Signal, String> {
        let Self { kind, scale, offset, unit, min, max } = self;
        if matches!(kind, SignalType::Hex | SignalType::Bool) {
            if scale != 1.0 || offset != 0.0 || min.is_some() || max.is_some() {
                return Err("hex and bool have no scale, offset, min and max".into());
            }
        } else if !(1.0 / LARGEST..=LARGEST).contains(&scale.abs()) {
            return Err(format!("scale = {scale} is out of range: its magnitude must be 1e-9 to 1e9"));
        }
        if let Some(wrong) =
            [Some(offset), min, max].into_iter().flatten().find(|x| !x.is_finite() || x.abs() > LARGEST)
        {
            return Err(format!("{wrong} is outside -1e9..1e9"));
        }
        if let (Some(min), Some(max)) = (min, max)
            && min > max
        {
            return Err(format!("min = {min} is above max = {max}"));
        }
        if unit.chars().count() > 16 || unit.chars().any(|c| c.is_control() || c == '"') {
            return Err(format!(
                "unit {unit:?} is not valid, expected at most 16 characters without a quotation mark"
            ));
        }
        if !may_follow(&unit) || unit.trim() != unit {
            return Err(format!("unit {unit:?} cannot follow a number"));
        }
        let signal = Signal { kind, scale, offset, unit, min: None, max: None, known: true, raw_only: false };
        let ((low, high), (least, most)) = (signal.range(), signal.limits());
        let beyond = |x: &f64| !(low - 0.5 * scale.abs()..=high + 0.5 * scale.abs()).contains(x);
        for (key, limit) in [("min", min), ("max", max)] {
            if let Some(limit) = limit.filter(beyond) {
                return Err(format!("{key} = {limit} is outside {least}..{most}, the range of the word"));
            }
        }
        let signal = Signal { min, max, ..signal };
        let (from, to) = signal.allowed();
        if from > to {
            let (min, max) = signal.limits();
            return Err(format!("no word lies between min = {min} and max = {max}"));
        }
        Ok(signal)
    }
}

/// Rewords a message of the TOML library for the author of the table.
pub(super) fn people(words: &str) -> String {
    let terms = [
        ("duplicate key", "the key has two entries"),
        ("expected f64", "expected a number, as 0.1"),
        ("expected struct FileSignal", "expected a signal, as { scale = 0.1 }"),
        ("expected struct FileProgram", "expected a program, as [[program]]"),
        ("expected a map", "expected signals by their names"),
        ("expected a sequence", "expected a list: [[program]] has two brackets"),
        ("expected a string", "expected text in quotation marks"),
    ];
    terms.iter().fold(words.to_owned(), |text, (theirs, ours)| text.replace(theirs, ours))
}
