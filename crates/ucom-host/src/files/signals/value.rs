//! Value that a user writes on a command line or in a parameter file.
use core::fmt;
use core::str::FromStr;

/// Longest unit of a value, in bytes.
const UNIT_MAX: usize = 32;

/// A value that is not assigned to a signal yet.
#[derive(Clone, Debug, PartialEq)]
pub enum SignalValue {
    /// `0x05DC`: a raw word, for any type and scale of the signal.
    Raw(u16),
    /// Number, with or without a unit. With a unit, as in `15.5 deg`, it is a value in the signal's unit. Without a
    /// unit, it is a value of a signal that has no unit. Without a signal table, it is the word as a number.
    Number {
        /// Number in the text.
        value: f64,
        /// Unit after the number; empty if the text has no unit.
        unit: String,
    },
    /// Switch: `on`, `off`, `true`, `false`, `yes`, `no`.
    Switch(bool),
}

/// Reasons why a text is not a valid value.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SignalValueError {
    /// The text is hexadecimal, but not a 16-bit word.
    #[error("\"{0}\" is not a 16-bit word, expected 0x0000 to 0xFFFF")]
    Hex(String),
    /// The text does not have the form of a value.
    #[error(
        "\"{0}\" is not a value, expected a number (15.5deg, or 15.5 if the signal has no unit), a word \
         (0x05DC), on or off"
    )]
    Form(String),
}

impl FromStr for SignalValue {
    type Err = SignalValueError;

    fn from_str(text: &str) -> Result<Self, SignalValueError> {
        let text = text.trim();
        match text.to_ascii_lowercase().as_str() {
            "on" | "true" | "yes" => return Ok(Self::Switch(true)),
            "off" | "false" | "no" => return Ok(Self::Switch(false)),
            _ => {}
        }
        if let Some(digits) = text.strip_prefix("0x").or(text.strip_prefix("0X")) {
            let hex = digits.chars().all(|c| c.is_ascii_hexdigit());
            let word = u16::from_str_radix(digits, 16).ok().filter(|_| hex);
            return word.map(Self::Raw).ok_or_else(|| SignalValueError::Hex(text.into()));
        }
        let wrong = || SignalValueError::Form(text.into());
        // Rust reads words like "inf" and "nan" as numbers, but users do not mean numbers by these words.
        if !text.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c)) || text.len() > 64 {
            return Err(wrong());
        }
        // The number is the longest valid number at the start of the text. The remainder of the text is the unit.
        let ends = (1..=text.len()).rev().filter(|end| text.is_char_boundary(*end));
        let mut parts = ends.map(|end| text.split_at(end));
        let (value, unit) =
            parts.find_map(|(n, unit)| number(n).map(|n| (n, unit.trim()))).ok_or_else(wrong)?;
        if !may_follow(unit) || unit.len() > UNIT_MAX {
            return Err(wrong());
        }
        // Some programming languages accept numbers such as 0o10 and -0x10. The reader refuses them, because it would
        // otherwise read the number 0 with a unit.
        let mut letters = unit.chars();
        let joined = !text.contains(char::is_whitespace);
        if joined
            && letters.next().is_some_and(|c| c.is_ascii_alphabetic())
            && letters.next().is_some_and(|c| c.is_ascii_hexdigit())
            && unit.contains(|c: char| c.is_ascii_digit())
        {
            return Err(wrong());
        }
        Ok(Self::Number { value, unit: unit.into() })
    }
}

/// Returns `true` if a reader cannot mistake the unit after a number for a part of the number.
pub(super) fn may_follow(unit: &str) -> bool {
    !unit.starts_with(|c: char| c.is_ascii_digit() || "+-.,_:;'".contains(c))
}

fn number(text: &str) -> Option<f64> {
    let digits = text.trim_start_matches(['+', '-']);
    let begins = digits.starts_with(|c: char| c.is_ascii_digit() || c == '.');
    text.parse::<f64>().ok().filter(|n| n.is_finite() && begins)
}

impl fmt::Display for SignalValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Raw(word) => write!(f, "0x{word:04X}"),
            Self::Number { value, unit } => {
                let size = value.abs();
                // Without the exponent, the number 1e300 would be printed with 300 zeros.
                if *value != 0.0 && !(1e-6..1e15).contains(&size) {
                    write!(f, "{value:e}")?;
                } else {
                    write!(f, "{value}")?;
                }
                if unit.is_empty() { Ok(()) } else { write!(f, " {unit}") }
            }
            Self::Switch(on) => f.write_str(if *on { "on" } else { "off" }),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn number(value: f64, unit: &str) -> Result<SignalValue, SignalValueError> {
        Ok(SignalValue::Number { value, unit: unit.into() })
    }

    #[test]
    fn d11_values_are_words_numbers_with_units_and_switches() {
        let given = |text: &str| text.parse::<SignalValue>();
        assert_eq!(given("0x05DC"), Ok(SignalValue::Raw(1500)));
        assert_eq!(given(" -20 "), number(-20.0, ""));
        assert_eq!(given("15.5deg"), number(15.5, "deg"));
        assert_eq!(given("1e3 mA/deg"), number(1000.0, "mA/deg"));
        assert_eq!(given("3 °C"), number(3.0, "°C"));
        assert_eq!(given("5 e"), number(5.0, "e"));
        assert_eq!(given("Off"), Ok(SignalValue::Switch(false)));
        for wrong in [
            "", "x", "0x10000", "0x", "0x-1", "0x+1", "nan", "inf", "-inf", "1e999", "--3", "1.2.3", "1,5",
            "1 000", "0o10", "-0x10", "0b11", "1:30", "0xFFFFF", "1'000",
        ] {
            assert!(given(wrong).is_err(), "{wrong}");
        }
        assert_eq!(given("5m/s2"), number(5.0, "m/s2"));
        // The unit of this text is longer than the limit of 32 bytes: the character µ has two bytes.
        assert!(given(&format!("0{}", "µ".repeat(31))).is_err());
        for (text, short) in [("1e300", "1e300"), ("-2e-9 A", "-2e-9 A"), ("123456.5", "123456.5")] {
            assert_eq!(given(text).unwrap().to_string(), short);
        }
    }

    proptest! {
        #[test]
        fn any_text_is_a_value_or_an_error(text in any::<String>()) {
            if let Ok(given) = text.parse::<SignalValue>() {
                prop_assert_eq!(given.to_string().parse::<SignalValue>(), Ok(given));
            }
        }
    }
}
