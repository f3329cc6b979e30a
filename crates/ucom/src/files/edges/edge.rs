//! One input, output or parameter: what its word means, both ways (D-11).

use std::prelude::v1::*;

use serde::Deserialize;
use serde_json::{Value, json};

use super::Given;
use crate::Profile;

/// What kind of number a word is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum EdgeType {
    /// Signed.
    #[default]
    Int16,
    /// Unsigned.
    Uint16,
    /// Bits, shown as 0x0000; has no scale.
    Hex,
    /// Off (0) or on (1); has no scale.
    Bool,
}

/// What the word of an edge means: `word × scale + offset`, in a unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Edge {
    /// What kind of number the word is.
    pub kind: EdgeType,
    /// Units for each step of the word.
    pub scale: f64,
    /// What the word 0 means, in units.
    pub offset: f64,
    /// As `deg`; empty: none.
    pub unit: String,
    /// Smallest value that may be written, in units.
    pub min: Option<f64>,
    /// Largest value that may be written, in units.
    pub max: Option<f64>,
    /// A table says so; otherwise it is a bare word.
    pub known: bool,
}

/// Why a value cannot be written to an edge.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ValueError {
    /// Too large or too small.
    #[error("{given} is outside {min}..{max}{}", space(unit))]
    Range {
        /// What was given.
        given: String,
        /// Smallest value.
        min: String,
        /// Largest value.
        max: String,
        /// Their unit.
        unit: String,
    },
    /// Given in another unit than the edge's.
    #[error("{given}: {}", if unit.is_empty() { "it has no unit that is known here".into() } else { format!("its unit is {unit}") })]
    Unit {
        /// What was given.
        given: String,
        /// The edge's unit.
        unit: String,
    },
    /// Between two words.
    #[error("{given}: it is a whole number")]
    Fraction {
        /// What was given.
        given: String,
    },
    /// Not 0 or 1, on or off.
    #[error("{given}: it is on or off")]
    Switch {
        /// What was given.
        given: String,
    },
    /// On or off, but the edge is a number.
    #[error("{given}: it is a number")]
    NoSwitch {
        /// What was given.
        given: String,
    },
}

fn space(unit: &str) -> String {
    if unit.is_empty() { String::new() } else { format!(" {unit}") }
}

impl Edge {
    /// An edge that no table knows: a bare word, signed or not by the profile.
    pub fn bare(profile: &Profile) -> Self {
        let kind = if profile.pd_signed { EdgeType::Int16 } else { EdgeType::Uint16 };
        Self { kind, scale: 1.0, offset: 0.0, unit: String::new(), min: None, max: None, known: false }
    }

    fn plain(&self) -> bool {
        self.scale == 1.0 && self.offset == 0.0
    }

    /// Whether the word is a signed number.
    pub fn signed(&self) -> bool {
        self.kind == EdgeType::Int16
    }

    /// Range of the word as a number.
    fn words(&self) -> (i32, i32) {
        match self.kind {
            // Whoever thinks of a bare word as unsigned is not sent away.
            EdgeType::Int16 | EdgeType::Uint16 if !self.known => (-32768, 65535),
            EdgeType::Int16 => (-32768, 32767),
            EdgeType::Uint16 | EdgeType::Hex => (0, 65535),
            EdgeType::Bool => (0, 1),
        }
    }

    fn number(&self, word: u16) -> i32 {
        if self.signed() { i32::from(word as i16) } else { i32::from(word) }
    }

    fn scaled(&self, number: i32) -> f64 {
        f64::from(number) * self.scale + self.offset
    }

    /// Digits behind the point that tell two neighbouring words apart.
    fn digits(&self) -> usize {
        let written = |x: f64| format!("{x}").split_once('.').map_or(0, |(_, digits)| digits.len());
        let enough = (-self.scale.abs().log10()).ceil().max(0.0) as usize + 2;
        written(self.scale).max(written(self.offset)).min(enough)
    }

    fn written(&self, value: f64) -> String {
        let text = format!("{value:.*}", self.digits());
        // Rounding may leave a sign on nothing.
        let zero = text.starts_with('-') && text.chars().all(|c| "-0.".contains(c));
        if zero { text.trim_start_matches('-').into() } else { text }
    }

    /// The word as a value in the edge's unit, without the unit: `15.50`, `-20`, `0x00FF`, `on`.
    pub fn text(&self, word: u16) -> String {
        match self.kind {
            EdgeType::Bool => if word == 0 { "off" } else { "on" }.into(),
            EdgeType::Hex => format!("0x{word:04X}"),
            _ => self.written(self.scaled(self.number(word))),
        }
    }

    /// The same with the unit behind it.
    pub fn text_with_unit(&self, word: u16) -> String {
        self.text(word) + &space(&self.unit)
    }

    /// The value for programs: a number in the edge's unit, or true and false.
    pub fn json(&self, word: u16) -> Value {
        match self.kind {
            EdgeType::Bool => json!(word != 0),
            EdgeType::Hex => json!(word),
            _ if self.plain() => json!(self.number(word)),
            _ => self.text(word).parse::<f64>().map_or(Value::Null, |n| json!(n)),
        }
    }

    /// Smallest and largest value that may be written, in units.
    pub fn range(&self) -> (f64, f64) {
        let (low, high) = self.words();
        let (a, b) = (self.scaled(low), self.scaled(high));
        let (low, high) = (a.min(b), a.max(b));
        (self.min.map_or(low, |min| min.max(low)), self.max.map_or(high, |max| max.min(high)))
    }

    /// The same as text.
    pub fn limits(&self) -> (String, String) {
        if self.kind == EdgeType::Hex {
            return ("0x0000".into(), "0xFFFF".into());
        }
        let (low, high) = self.range();
        (self.written(low), self.written(high))
    }

    /// The word for a value. Between two words the nearer one is taken where the edge has a scale.
    pub fn word(&self, given: &Given) -> Result<u16, ValueError> {
        let text = || given.to_string();
        let number = match (given, self.kind) {
            // The word itself goes whatever the type is; limits hold for it, too.
            (Given::Raw(word), _) => self.number(*word),
            (Given::Switch(on), EdgeType::Bool) => i32::from(*on),
            (Given::Switch(_), _) => return Err(ValueError::NoSwitch { given: text() }),
            (Given::Number { value, unit }, kind) => {
                if !unit.is_empty() && *unit != self.unit {
                    return Err(ValueError::Unit { given: text(), unit: self.unit.clone() });
                }
                let steps = (value - self.offset) / self.scale;
                if kind == EdgeType::Bool && steps != 0.0 && steps != 1.0 {
                    return Err(ValueError::Switch { given: text() });
                }
                if self.plain() && steps.fract() != 0.0 {
                    return Err(ValueError::Fraction { given: text() });
                }
                let (low, high) = self.words();
                let nearest = steps.round();
                if !(f64::from(low)..=f64::from(high)).contains(&nearest) {
                    return Err(self.outside(given));
                }
                nearest as i32
            }
        };
        let value = self.scaled(number);
        // What the nearest word misses is no violation.
        let step = self.scale.abs() * 0.5 * (1.0 + 1e-9);
        let below = self.min.is_some_and(|min| value < min - step);
        let above = self.max.is_some_and(|max| value > max + step);
        if (below || above) && !matches!(self.kind, EdgeType::Bool | EdgeType::Hex) {
            return Err(self.outside(given));
        }
        Ok(number as u16)
    }

    fn outside(&self, given: &Given) -> ValueError {
        let (min, max) = self.limits();
        ValueError::Range { given: given.to_string(), min, max, unit: self.unit.clone() }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn edge(kind: EdgeType, scale: f64, offset: f64, unit: &str) -> Edge {
        Edge { kind, scale, offset, unit: unit.into(), known: true, ..Edge::bare(&Profile::default()) }
    }

    fn word(edge: &Edge, text: &str) -> Result<u16, ValueError> {
        edge.word(&text.parse().unwrap())
    }

    #[test]
    fn d11_a_bare_word_is_signed_unless_the_profile_says_otherwise() {
        let edge = Edge::bare(&Profile::default());
        assert_eq!((edge.text(0xFFEC), edge.json(0xFFEC)), ("-20".into(), json!(-20)));
        let unsigned = Edge::bare(&Profile { pd_signed: false, ..Profile::default() });
        assert_eq!(unsigned.text(0xFFEC), "65516");
        assert_eq!(
            (word(&edge, "65535"), word(&edge, "-32768"), word(&edge, "0xFFEC")),
            (Ok(65535), Ok(32768), Ok(65516))
        );
        for wrong in ["65536", "-32769", "1.5", "3 deg", "on"] {
            assert!(word(&edge, wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn d11_scale_offset_and_unit() {
        let angle = edge(EdgeType::Int16, 0.01, 0.0, "deg");
        assert_eq!(word(&angle, "15.5"), Ok(1550));
        assert_eq!(word(&angle, "-15.504 deg"), Ok(-1550_i16 as u16));
        assert_eq!(angle.text_with_unit(0xFFFF), "-0.01 deg");
        assert_eq!(angle.json(1550), json!(15.5));
        // The word itself is never scaled.
        assert_eq!(word(&angle, "0x0010"), Ok(16));
        let said = word(&angle, "400").unwrap_err().to_string();
        assert_eq!(said, "400 is outside -327.68..327.67 deg");
        assert!(word(&angle, "15 rad").unwrap_err().to_string().contains("its unit is deg"));
        let warm = edge(EdgeType::Uint16, 0.1, -40.0, "°C");
        assert_eq!((warm.text(643), word(&warm, "24.3")), ("24.3".into(), Ok(643)));
        let down = edge(EdgeType::Int16, -0.5, 0.0, "");
        assert_eq!((down.text(3), down.limits().0), ("-1.5".into(), "-16383.5".into()));
    }

    #[test]
    fn d11_limits_of_the_table_hold_for_every_form() {
        let edge = Edge { min: Some(0.0), max: Some(10.0), ..edge(EdgeType::Int16, 0.01, 0.0, "A") };
        assert_eq!(word(&edge, "10"), Ok(1000));
        assert_eq!(word(&edge, "10.01").unwrap_err().to_string(), "10.01 is outside 0.00..10.00 A");
        assert!(word(&edge, "0x03E9").is_err() && word(&edge, "-0.01").is_err());
    }

    #[test]
    fn d11_switches_and_bits() {
        let switch = edge(EdgeType::Bool, 1.0, 0.0, "");
        assert_eq!((word(&switch, "on"), word(&switch, "0"), word(&switch, "1")), (Ok(1), Ok(0), Ok(1)));
        assert!(word(&switch, "2").unwrap_err().to_string().contains("on or off"));
        assert_eq!((switch.text(1), switch.json(0)), ("on".into(), json!(false)));
        let bits = edge(EdgeType::Hex, 1.0, 0.0, "");
        assert_eq!(
            (bits.text(0x8001), word(&bits, "0x8001"), word(&bits, "32769")),
            ("0x8001".into(), Ok(0x8001), Ok(0x8001))
        );
        assert!(word(&bits, "-1").is_err());
    }

    proptest! {
        /// What is shown of a word gives that word again.
        #[test]
        fn d11_text_gives_the_word_again(w: u16, kind in 0..4_usize, exponent in -6..4_i32, mantissa in 1..100_u32, negative: bool, offset in -1000..1000_i32) {
            let kind = [EdgeType::Int16, EdgeType::Uint16, EdgeType::Hex, EdgeType::Bool][kind];
            let sign = if negative { -1.0 } else { 1.0 };
            let scale = sign * f64::from(mantissa) * 10_f64.powi(exponent);
            let edge = match kind {
                EdgeType::Hex | EdgeType::Bool => edge(kind, 1.0, 0.0, ""),
                _ => edge(kind, scale, f64::from(offset) / 10.0, "u"),
            };
            let w = if kind == EdgeType::Bool { w & 1 } else { w };
            prop_assert_eq!(edge.word(&edge.text_with_unit(w).parse().unwrap()), Ok(w), "{}", edge.text(w));
        }
    }
}
