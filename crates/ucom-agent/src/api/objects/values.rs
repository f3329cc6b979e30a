//! Values of boards by name. Values have units if the signal table contains the units.
use serde_json::Value;
use ucom_host::files::Signal;
use ucom_host::master::Life;
use ucom_host::master::io::{Kind, ParValue};
use utoipa::ToSchema;

use crate::snapshot::{BusSnapshot, Values};

/// Age from which the outputs of a board are outdated, in µs.
const OLD_US: u64 = 500_000;

/// Values of a board.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(crate) struct ValuesObject {
    /// Number of the board.
    pub board: u8,
    /// Age of its outputs, s; missing before the first outputs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub age_s: Option<f64>,
    /// `true` if the outputs are not current: they are older than 0.5 s, or the board is late, lost, rebooted or not in its control
    /// loop.
    pub stale: bool,
    /// Sensor outputs; empty before the first outputs.
    pub outputs: Vec<ValueObject>,
    /// Controller inputs as last set, or with their initial values. An input has no value if this agent has neither set
    /// nor read it since the application started.
    pub inputs: Vec<ValueObject>,
    /// Parameters as last written by this agent. A parameter has no value if this agent has not written it since the
    /// application started, because boards cannot report their parameters.
    pub parameters: Vec<ValueObject>,
}

/// Value of a signal.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(crate) struct ValueObject {
    /// Name of the signal.
    pub name: String,
    /// Index in the buffer.
    pub index: usize,
    /// Value as the signal table defines it: a number in its unit, `true` or `false`, or a word as text. Missing if the
    /// value is not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Value>)]
    pub value: Option<Value>,
    /// Value with its unit, for people.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub text: Option<String>,
    /// Unit of the signal, if the signal table has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// Smallest value, in its unit, if the signal table has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min: Option<f64>,
    /// Largest value, in its unit, if the signal table has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max: Option<f64>,
}

impl ValueObject {
    /// Returns the value of a signal for the word that a board has sent.
    pub(crate) fn of(name: &str, index: usize, signal: Option<&Signal>, word: Option<u16>) -> Self {
        let value = |word: u16| signal.map_or_else(|| Value::from(word as i16), |signal| signal.json(word));
        let unit = signal.filter(|signal| signal.known && !signal.unit.is_empty());
        Self {
            name: name.to_owned(),
            index,
            value: word.map(value),
            text: word.map(|word| signal.map_or_else(|| word.to_string(), |s| s.text_with_unit(word))),
            unit: unit.map(|signal| signal.unit.clone()),
            min: signal.and_then(|signal| signal.min),
            max: signal.and_then(|signal| signal.max),
        }
    }
}

impl ValuesObject {
    pub(crate) fn of(snapshot: &BusSnapshot, values: &Values) -> Self {
        let (known, now_us) = (&values.known, snapshot.clock_us());
        let board = snapshot.boards.get(known.board);
        let list = |kind: Kind, words: Vec<Option<u16>>| {
            let (names, signals) = (known.names.names(kind), known.signals.all(kind));
            let value = |(index, word): (usize, Option<u16>)| {
                let name = names.get(index).map_or("", String::as_str);
                ValueObject::of(name, index, signals.get(index), word)
            };
            words.into_iter().enumerate().map(value).collect()
        };
        let outputs = values.outputs.as_ref();
        let age_us = outputs.map(|outputs| now_us.saturating_sub(outputs.time_us));
        let runs =
            board.is_some_and(|b| b.is_known() && b.life != Life::Late && b.admin.is_none_or(|a| a.run));
        let parameter = |value: &ParValue| match value {
            ParValue::Assumed(word) => Some(*word),
            ParValue::Unknown => None,
        };
        Self {
            board: known.board,
            age_s: age_us.map(|us| us as f64 * 1e-6),
            stale: !runs || age_us.is_none_or(|us| us > OLD_US),
            outputs: list(
                Kind::So,
                outputs.map(|o| o.words.iter().copied().map(Some).collect()).unwrap_or_default(),
            ),
            inputs: list(Kind::Ci, values.inputs.clone()),
            parameters: list(Kind::Par, values.parameters.iter().map(parameter).collect()),
        }
    }
}

#[cfg(test)]
mod tests {
    use ucom::Profile;

    use super::*;

    #[test]
    fn a_value_has_the_limits_of_its_signal_where_it_has_some() {
        let bare = Signal::bare(&Profile::default());
        let limited = Signal { min: Some(-45.0), max: Some(45.0), ..bare.clone() };
        let limits = |signal| {
            let value = ValueObject::of("position", 0, signal, None);
            (value.min, value.max)
        };
        assert_eq!(limits(Some(&limited)), (Some(-45.0), Some(45.0)));
        assert_eq!((limits(Some(&bare)), limits(None)), ((None, None), (None, None)));
    }
}
