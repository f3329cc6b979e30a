//! Errors of values for signals.
/// Reasons why a value cannot be written to a signal.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ValueError {
    /// Too large or too small.
    #[error("{given} is outside {min}..{max}{}", space(unit))]
    Range {
        /// Given text.
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
    /// The unit differs from the signal's.
    #[error("{given}: {}", if unit.is_empty() { "it has no unit that is known here".into() } else { format!("its unit is {unit}") })]
    Unit {
        /// Given text.
        given: String,
        /// The signal's unit.
        unit: String,
    },
    /// A bare number that could be the word or a value in the signal's unit.
    #[error("{given}: {}, or the word itself as 0x0000", no_unit(given, unit))]
    NoUnit {
        /// Given text.
        given: String,
        /// Unit of the signal; empty: the table scales the signal and names no unit.
        unit: String,
    },
    /// A value between two words.
    #[error("{given}: it is a whole number")]
    Fraction {
        /// Given text.
        given: String,
    },
    /// A value other than 0, 1, on or off.
    #[error("{given}: it is on or off")]
    Switch {
        /// Given text.
        given: String,
    },
    /// A number or a switch without a known meaning here.
    #[error(
        "{given}: the signal table knows nothing of this program, so only the word itself (0x0000 to 0xFFFF) can be given"
    )]
    Meaning {
        /// Given text.
        given: String,
    },
    /// On or off for a signal that is a number.
    #[error("{given}: it is a number")]
    NoSwitch {
        /// Given text.
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
