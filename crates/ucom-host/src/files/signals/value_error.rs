//! Errors that occur when a value is converted to a signal's word.
/// Reasons why a value cannot be written to a signal.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ValueError {
    /// The value is too large or too small.
    #[error("{given} is outside {min}..{max}{}", space(unit))]
    Range {
        /// Text that the user wrote.
        given: String,
        /// Smallest allowed value.
        min: String,
        /// Largest allowed value.
        max: String,
        /// Unit of the limits.
        unit: String,
        /// Requested value as a number in this unit.
        value: f64,
        /// Limit that the value exceeds.
        limit: f64,
    },
    /// The unit of the value differs from the signal's unit.
    #[error("{given}: {}", if unit.is_empty() { "the unit of the signal is not known".into() } else { format!("the unit of the signal is {unit}") })]
    Unit {
        /// Text that the user wrote.
        given: String,
        /// Unit of the signal.
        unit: String,
    },
    /// The value is a number without a unit, which could be the raw word or a value in the signal's unit.
    #[error("{given}: {}", no_unit(unit, choices))]
    NoUnit {
        /// Text that the user wrote.
        given: String,
        /// Unit of the signal. The unit is empty if the table scales the signal but has no unit for it.
        unit: String,
        /// Possible meanings of the number, each with its word.
        choices: String,
    },
    /// The signal cannot represent the value, because the value lies between two words.
    #[error("{given}: the signal has whole numbers only")]
    Fraction {
        /// Text that the user wrote.
        given: String,
    },
    /// The signal is a switch, but the value is not 0, 1, on or off.
    #[error("{given}: the signal has the values on and off only")]
    Switch {
        /// Text that the user wrote.
        given: String,
    },
    /// The value is a number or a switch, but the meaning of the signal is not known.
    #[error(
        "{given}: the signal table does not contain this program, so only a word (0x0000 to 0xFFFF) is valid"
    )]
    Meaning {
        /// Text that the user wrote.
        given: String,
    },
    /// The value is on or off, but the signal is a number.
    #[error("{given}: the signal is a number")]
    NoSwitch {
        /// Text that the user wrote.
        given: String,
    },
}

pub(super) fn space(unit: &str) -> String {
    if unit.is_empty() { String::new() } else { format!(" {unit}") }
}

fn no_unit(unit: &str, choices: &str) -> String {
    let cause = match unit.is_empty() {
        true => "the table has a scale but no unit for this signal",
        false => "the unit is missing",
    };
    let choices = if choices.is_empty() { String::new() } else { format!(": {choices}") };
    let remedy = match unit.is_empty() {
        true => "; to give values, add a unit to the table (unit = \"ratio\")",
        false => "",
    };
    format!("{cause}{choices}{remedy}")
}
