//! Signal of an input, output or parameter: conversion between word and value (D-11).
use serde::Deserialize;
use serde_json::{Value, json};

use super::value_error::space;
use super::{SignalValue, ValueError};
use ucom::Profile;

/// Number type of a signal's word.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SignalType {
    /// The word is a signed number.
    #[default]
    Int16,
    /// The word is an unsigned number.
    Uint16,
    /// The word is a set of bits, displayed as `0x0000`. Such a signal has no scale.
    Hex,
    /// The word means off (0) or on (1). Such a signal has no scale.
    Bool,
}

/// Meaning of a signal's word. The value in the signal's unit is `word × scale + offset`.
#[derive(Clone, Debug, PartialEq)]
pub struct Signal {
    /// Number type of the signal's word.
    pub kind: SignalType,
    /// Change of the value, in the signal's unit, for one step of the word.
    pub scale: f64,
    /// Value that the word 0 represents, in the signal's unit.
    pub offset: f64,
    /// Unit such as `deg`; empty if the signal has no unit.
    pub unit: String,
    /// Smallest allowed value, in the signal's unit.
    pub min: Option<f64>,
    /// Largest allowed value, in the signal's unit.
    pub max: Option<f64>,
    /// `true` if a signal table has an entry for the signal; otherwise the signal's word is raw.
    pub known: bool,
    /// `true` if the signal table has no entry for the program. In this case, the signal accepts only raw words.
    pub raw_only: bool,
}

/// Relative error that is allowed for floating-point arithmetic.
const SLACK: f64 = 1e-9;

impl Signal {
    /// Creates a signal that no signal table contains. The value of this signal is the raw word, signed or unsigned as the profile defines.
    pub fn bare(profile: &Profile) -> Self {
        let kind = if profile.pd_signed { SignalType::Int16 } else { SignalType::Uint16 };
        Self {
            kind,
            scale: 1.0,
            offset: 0.0,
            unit: String::new(),
            min: None,
            max: None,
            known: false,
            raw_only: false,
        }
    }

    fn plain(&self) -> bool {
        self.scale == 1.0 && self.offset == 0.0
    }

    /// Returns `true` if the signal's word is a signed number.
    pub fn signed(&self) -> bool {
        self.kind == SignalType::Int16
    }

    /// Returns the smallest and the largest number that the signal's word can represent.
    fn words(&self) -> (i32, i32) {
        match self.kind {
            SignalType::Int16 => (-32768, 32767),
            SignalType::Uint16 | SignalType::Hex => (0, 65535),
            SignalType::Bool => (0, 1),
        }
    }

    fn number(&self, word: u16) -> i32 {
        if self.signed() { i32::from(word as i16) } else { i32::from(word) }
    }

    fn scaled(&self, number: i32) -> f64 {
        f64::from(number) * self.scale + self.offset
    }

    /// Returns the number of decimals that are needed to distinguish the values of two neighbouring words.
    fn digits(&self) -> usize {
        let written = |x: f64| format!("{x}").split_once('.').map_or(0, |(_, digits)| digits.len());
        let enough = (-self.scale.abs().log10()).ceil().max(0.0) as usize + 2;
        written(self.scale).max(written(self.offset)).min(enough)
    }

    fn written(&self, value: f64) -> String {
        let text = format!("{value:.*}", self.digits());
        // Rounding can result in a negative zero, whose sign is removed.
        let zero = text.starts_with('-') && text.chars().all(|c| "-0.".contains(c));
        if zero { text.trim_start_matches('-').into() } else { text }
    }

    /// Returns the word as a value in the signal's unit, without the unit: `15.50`, `-20`, `0x00FF`, `on`.
    pub fn text(&self, word: u16) -> String {
        match self.kind {
            SignalType::Bool => if word == 0 { "off" } else { "on" }.into(),
            SignalType::Hex => format!("0x{word:04X}"),
            _ => self.written(self.scaled(self.number(word))),
        }
    }

    /// Returns the value as text, followed by the unit.
    pub fn text_with_unit(&self, word: u16) -> String {
        self.text(word) + &space(&self.unit)
    }

    /// Returns the value as JSON: a number in the signal's unit, or true or false.
    pub fn json(&self, word: u16) -> Value {
        match self.kind {
            SignalType::Bool => json!(word != 0),
            SignalType::Hex => json!(word),
            _ if self.plain() => json!(self.number(word)),
            _ => self.text(word).parse::<f64>().map_or(Value::Null, |n| json!(n)),
        }
    }

    /// Returns the smallest and the largest allowed value, in the signal's unit.
    pub fn range(&self) -> (f64, f64) {
        let (low, high) = self.words();
        let (a, b) = (self.scaled(low), self.scaled(high));
        let (low, high) = (a.min(b), a.max(b));
        (self.min.map_or(low, |min| min.max(low)), self.max.map_or(high, |max| max.min(high)))
    }

    /// Returns the limits of the signal as text.
    pub fn limits(&self) -> (String, String) {
        if self.kind == SignalType::Hex {
            return ("0x0000".into(), "0xFFFF".into());
        }
        let text = |limit: f64, own: Option<f64>| {
            let text = self.written(limit);
            // A limit of the signal table that no word can represent exactly is displayed as in the table.
            let odd = own == Some(limit) && text.parse() != Ok(limit);
            if odd { limit.to_string() } else { text }
        };
        let (low, high) = self.range();
        (text(low, self.min), text(high, self.max))
    }

    /// Returns the smallest and the largest word whose values are within the limits, as numbers. If no word is within
    /// the limits, the first number is larger than the second.
    pub(super) fn allowed(&self) -> (i32, i32) {
        let (low, high) = self.words();
        let steps = |limit: f64| (limit - self.offset) / self.scale;
        let slack = |steps: f64| SLACK * (1.0 + steps.abs());
        let (min, max) = if self.scale < 0.0 { (self.max, self.min) } else { (self.min, self.max) };
        let from = min.map(steps).map(|s| (s - slack(s)).ceil() as i32);
        let to = max.map(steps).map(|s| (s + slack(s)).floor() as i32);
        (from.map_or(low, |from| from.max(low)), to.map_or(high, |to| to.min(high)))
    }

    /// Returns `true` if a value is within the limits, with a tolerance for floating-point arithmetic.
    fn within(&self, value: f64) -> bool {
        let slack = |limit: f64| SLACK * (limit.abs().max(value.abs()) + self.scale.abs());
        let below = self.min.is_some_and(|min| value < min - slack(min));
        let above = self.max.is_some_and(|max| value > max + slack(max));
        !below && !above
    }

    /// Returns the value that is sent, with its unit, if no word can represent the requested value exactly; returns
    /// `None` otherwise.
    pub fn rounded(&self, given: &SignalValue, word: u16) -> Option<String> {
        let SignalValue::Number { value, .. } = given else { return None };
        let sent = self.scaled(self.number(word));
        let same = (sent - value).abs() <= SLACK * (value.abs() + self.scale.abs());
        (!same).then(|| self.text_with_unit(word))
    }

    /// Returns the word that is sent for a value. If the signal has a scale, the word with the nearest value is sent,
    /// but never a word beyond the limits.
    ///
    /// # Errors
    /// Returns an error if the value is beyond a limit, or has another unit or type. A fraction is also an error if
    /// the signal has no scale.
    pub fn word(&self, given: &SignalValue) -> Result<u16, ValueError> {
        let text = || given.to_string();
        let number = match (given, self.kind) {
            (SignalValue::Raw(word), SignalType::Bool) if *word > 1 => {
                return Err(ValueError::Switch { given: text() });
            }
            // A raw word is sent unchanged, even if the signal has a scale. The limits also apply to raw words.
            (SignalValue::Raw(word), _) => {
                let number = self.number(*word);
                if !self.within(self.scaled(number)) {
                    return Err(self.outside(given, self.scaled(number)));
                }
                number
            }
            _ if self.raw_only => return Err(ValueError::Meaning { given: text() }),
            (SignalValue::Switch(on), SignalType::Bool) => i32::from(*on),
            (SignalValue::Switch(_), _) => return Err(ValueError::NoSwitch { given: text() }),
            (SignalValue::Number { value, unit }, kind) => {
                if !unit.is_empty() && *unit != self.unit {
                    return Err(ValueError::Unit { given: text(), unit: self.unit.clone() });
                }
                // A number without a unit is refused if the table has a unit or a scale for the signal. The number
                // would be a scaled value with the signal table, and a raw word without it.
                if unit.is_empty() && self.known && (!self.unit.is_empty() || !self.plain()) {
                    return Err(self.no_unit(*value, given));
                }
                let steps = (value - self.offset) / self.scale;
                if kind == SignalType::Bool && steps != 0.0 && steps != 1.0 {
                    return Err(ValueError::Switch { given: text() });
                }
                if self.plain() && steps.fract() != 0.0 {
                    return Err(ValueError::Fraction { given: text() });
                }
                let (low, high) = self.words();
                let nearest = steps.round();
                if !(f64::from(low)..=f64::from(high)).contains(&nearest) || !self.within(*value) {
                    return Err(self.outside(given, *value));
                }
                let (from, to) = self.allowed();
                (nearest as i32).max(from).min(to)
            }
        };
        Ok(number as u16)
    }

    /// Returns the error for a number without a unit. The error contains the two possible meanings of the number, each with its exact word.
    fn no_unit(&self, value: f64, given: &SignalValue) -> ValueError {
        let unit = self.unit.clone();
        let mut choices = Vec::new();
        let mut scaled = None;
        if !unit.is_empty() {
            choices.push(match self.word(&SignalValue::Number { value, unit: unit.clone() }) {
                Ok(word) => {
                    scaled = Some(word);
                    format!("`{given}{unit}` is the word 0x{word:04X}")
                }
                Err(error) => error.to_string(),
            });
        }
        let (low, high) = self.words();
        if value.fract() == 0.0 && (f64::from(low)..=f64::from(high)).contains(&value) {
            let word = value as i32 as u16;
            // Without a scale, both meanings are the same word.
            if scaled != Some(word) && self.word(&SignalValue::Raw(word)).is_ok() {
                choices.push(format!("the word {given} is `0x{word:04X}` ({})", self.text_with_unit(word)));
            }
        }
        ValueError::NoUnit { given: given.to_string(), unit, choices: choices.join("; ") }
    }

    /// Returns the error for a value that is out of the limits; `value` is in the signal's unit.
    fn outside(&self, given: &SignalValue, value: f64) -> ValueError {
        let (min, max) = self.limits();
        let (low, high) = self.range();
        let (limit, shown) = if value < low { (low, &min) } else { (high, &max) };
        // Removes the digits that floating-point arithmetic adds.
        let limit = shown.parse().unwrap_or(limit);
        ValueError::Range { given: given.to_string(), min, max, unit: self.unit.clone(), value, limit }
    }
}

#[cfg(test)]
mod tests;
