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
    #[error("{given}: {}", if unit.is_empty() { "it has no unit that is known here".into() } else { format!("its unit is {unit}") })]
    Unit {
        /// Text of the user.
        given: String,
        /// The signal's unit.
        unit: String,
    },
    /// A number without a unit, which could be the raw word or a value in the signal's unit.
    #[error("{given}: {}, or the word itself as 0x0000", no_unit(given, unit))]
    NoUnit {
        /// Text of the user.
        given: String,
        /// Unit of the signal. Empty if the table scales the signal but has no unit for it.
        unit: String,
    },
    /// The value lies between two words.
    #[error("{given}: it is a whole number")]
    Fraction {
        /// Text of the user.
        given: String,
    },
    /// The value is not 0, 1, on or off.
    #[error("{given}: it is on or off")]
    Switch {
        /// Text of the user.
        given: String,
    },
    /// The value is a number or a switch, but the meaning of the signal is not known.
    #[error(
        "{given}: the signal table knows nothing of this program, so only the word itself (0x0000 to 0xFFFF) can be given"
    )]
    Meaning {
        /// Text of the user.
        given: String,
    },
    /// The value is on or off, but the signal is a number.
    #[error("{given}: it is a number")]
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
        true => "the table scales it and names no unit: add one to the table (unit = \"ratio\") and give it"
            .into(),
        false => format!("the unit is missing: `{given}{unit}`"),
    }
}
