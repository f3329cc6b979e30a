//! Errors of values for signals.
/// Reasons why a value cannot be written to a signal.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ValueError {
    /// The value is too large or too small.
    #[error("{given} is outside {min}..{max}{}", space(unit))]
    Range {
        /// Text of the user.
        given: String,
        /// Smallest value.
        min: String,
        /// Largest value.
        max: String,
        /// Unit of the limits.
        unit: String,
        /// The value as a number in this unit.
        value: f64,
        /// The limit that was exceeded.
        limit: f64,
    },
    /// The unit differs from the signal's unit.
    #[error("{given}: {}", if unit.is_empty() { "the unit of the signal is not known".into() } else { format!("the unit of the signal is {unit}") })]
    Unit {
        /// Text of the user.
        given: String,
        /// The signal's unit.
        unit: String,
    },
    /// A number without a unit, which could be the raw word or a value in the signal's unit.
    #[error("{given}: {}, or give the word as 0x0000", no_unit(given, unit))]
    NoUnit {
        /// Text of the user.
        given: String,
        /// Unit of the signal. Empty if the table scales the signal but has no unit for it.
        unit: String,
    },
    /// The value lies between two words.
    #[error("{given}: the signal has whole numbers only")]
    Fraction {
        /// Text of the user.
        given: String,
    },
    /// The value is not 0, 1, on or off.
    #[error("{given}: the signal has the values on and off only")]
    Switch {
        /// Text of the user.
        given: String,
    },
    /// The value is a number or a switch, but the meaning of the signal is not known.
    #[error(
        "{given}: the signal table does not contain this program, so only a word (0x0000 to 0xFFFF) is valid"
    )]
    Meaning {
        /// Text of the user.
        given: String,
    },
    /// The value is on or off, but the signal is a number.
    #[error("{given}: the signal is a number")]
    NoSwitch {
        /// Text of the user.
        given: String,
    },
}

pub(super) fn space(unit: &str) -> String {
    if unit.is_empty() { String::new() } else { format!(" {unit}") }
}

fn no_unit(given: &str, unit: &str) -> String {
    match unit.is_empty() {
        true => "the table has a scale but no unit for this signal: add a unit to the table (unit = \
                 \"ratio\") and give the value with it"
            .into(),
        false => format!("the unit is missing: give `{given}{unit}`"),
    }
}
