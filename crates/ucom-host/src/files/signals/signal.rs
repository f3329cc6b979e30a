//! One input, output or parameter: what its word means, both ways (D-11).
use serde::Deserialize;
use serde_json::{Value, json};

use super::value_error::space;
use super::{SignalValue, ValueError};
use ucom::Profile;

/// What kind of number a word is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SignalType {
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

/// What the word of a signal means: `word × scale + offset`, in a unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Signal {
    /// What kind of number the word is.
    pub kind: SignalType,
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
    /// It comes from a table; otherwise it is a bare word.
    pub known: bool,
    /// There is a table, and it knows nothing of the program: only the word itself can be given.
    pub raw_only: bool,
}

/// What calculating with fractions may lose, as a share.
const SLACK: f64 = 1e-9;

impl Signal {
    /// A signal that no table knows: a bare word, signed or not by the profile.
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

    /// Whether the word is a signed number.
    pub fn signed(&self) -> bool {
        self.kind == SignalType::Int16
    }

    /// Range of the word as a number.
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

    /// Digits behind the point that distinguish two neighbouring words.
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

    /// The word as a value in the signal's unit, without the unit: `15.50`, `-20`, `0x00FF`, `on`.
    pub fn text(&self, word: u16) -> String {
        match self.kind {
            SignalType::Bool => if word == 0 { "off" } else { "on" }.into(),
            SignalType::Hex => format!("0x{word:04X}"),
            _ => self.written(self.scaled(self.number(word))),
        }
    }

    /// The same with the unit behind it.
    pub fn text_with_unit(&self, word: u16) -> String {
        self.text(word) + &space(&self.unit)
    }

    /// The value for programs: a number in the signal's unit, or true and false.
    pub fn json(&self, word: u16) -> Value {
        match self.kind {
            SignalType::Bool => json!(word != 0),
            SignalType::Hex => json!(word),
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
        if self.kind == SignalType::Hex {
            return ("0x0000".into(), "0xFFFF".into());
        }
        let text = |limit: f64, own: Option<f64>| {
            let text = self.written(limit);
            // A limit of the table between two words is shown as it is.
            let odd = own == Some(limit) && text.parse() != Ok(limit);
            if odd { limit.to_string() } else { text }
        };
        let (low, high) = self.range();
        (text(low, self.min), text(high, self.max))
    }

    /// Smallest and largest number of a word whose value is within the limits; the first is larger where there is none.
    pub(super) fn allowed(&self) -> (i32, i32) {
        let (low, high) = self.words();
        let steps = |limit: f64| (limit - self.offset) / self.scale;
        let slack = |steps: f64| SLACK * (1.0 + steps.abs());
        let (min, max) = if self.scale < 0.0 { (self.max, self.min) } else { (self.min, self.max) };
        let from = min.map(steps).map(|s| (s - slack(s)).ceil() as i32);
        let to = max.map(steps).map(|s| (s + slack(s)).floor() as i32);
        (from.map_or(low, |from| from.max(low)), to.map_or(high, |to| to.min(high)))
    }

    /// Whether a value keeps the limits, but for what calculation with fractions loses.
    fn within(&self, value: f64) -> bool {
        let slack = |limit: f64| SLACK * (limit.abs().max(value.abs()) + self.scale.abs());
        let below = self.min.is_some_and(|min| value < min - slack(min));
        let above = self.max.is_some_and(|max| value > max + slack(max));
        !below && !above
    }

    /// What is sent instead of a value that lies between two words, with the unit; `None`: the value itself.
    pub fn rounded(&self, given: &SignalValue, word: u16) -> Option<String> {
        let SignalValue::Number { value, .. } = given else { return None };
        let sent = self.scaled(self.number(word));
        let same = (sent - value).abs() <= SLACK * (value.abs() + self.scale.abs());
        (!same).then(|| self.text_with_unit(word))
    }

    /// The word for a value. Between two words the nearer one is taken where the signal has a scale, but never one beyond
    /// the limits.
    ///
    /// # Errors
    /// A value outside of the limits, in another unit, between two words of a signal without scale, or of another type.
    pub fn word(&self, given: &SignalValue) -> Result<u16, ValueError> {
        let text = || given.to_string();
        let number = match (given, self.kind) {
            (SignalValue::Raw(word), SignalType::Bool) if *word > 1 => {
                return Err(ValueError::Switch { given: text() });
            }
            // The word itself goes whatever the scale is; limits hold for it, too.
            (SignalValue::Raw(word), _) => {
                let number = self.number(*word);
                if !self.within(self.scaled(number)) {
                    return Err(self.outside(given));
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
                // Which of the two a bare number means would hang on what table lies in the directory.
                if unit.is_empty() && self.known && (!self.unit.is_empty() || !self.plain()) {
                    return Err(ValueError::NoUnit { given: text(), unit: self.unit.clone() });
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
                    return Err(self.outside(given));
                }
                let (from, to) = self.allowed();
                (nearest as i32).max(from).min(to)
            }
        };
        Ok(number as u16)
    }

    fn outside(&self, given: &SignalValue) -> ValueError {
        let (min, max) = self.limits();
        ValueError::Range { given: given.to_string(), min, max, unit: self.unit.clone() }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn signal(kind: SignalType, scale: f64, offset: f64, unit: &str) -> Signal {
        Signal { kind, scale, offset, unit: unit.into(), known: true, ..Signal::bare(&Profile::default()) }
    }

    fn word(signal: &Signal, text: &str) -> Result<u16, ValueError> {
        signal.word(&text.parse().unwrap())
    }

    #[test]
    fn d11_a_bare_word_is_signed_unless_the_profile_says_otherwise() {
        let signal = Signal::bare(&Profile::default());
        assert_eq!((signal.text(0xFFEC), signal.json(0xFFEC)), ("-20".into(), json!(-20)));
        let unsigned = Signal::bare(&Profile { pd_signed: false, ..Profile::default() });
        assert_eq!(unsigned.text(0xFFEC), "65516");
        assert_eq!(
            (word(&signal, "32767"), word(&signal, "-32768"), word(&signal, "0xFFEC")),
            (Ok(32767), Ok(32768), Ok(65516))
        );
        // A number that would come back as another one is refused.
        for wrong in ["32768", "40000", "65535", "-32769", "1.5", "3 deg", "on"] {
            assert!(word(&signal, wrong).is_err(), "{wrong}");
        }
        assert_eq!((word(&unsigned, "65535"), word(&unsigned, "0")), (Ok(65535), Ok(0)));
        assert!(word(&unsigned, "-1").is_err() && word(&unsigned, "65536").is_err());
    }

    /// Where a table was given that does not know the program, numbers mean nothing.
    #[test]
    fn d11_without_meaning_only_the_word_itself_is_taken() {
        let signal = Signal { raw_only: true, ..Signal::bare(&Profile::default()) };
        assert_eq!(word(&signal, "0x9C40"), Ok(0x9C40));
        for wrong in ["3", "on"] {
            assert!(matches!(word(&signal, wrong), Err(ValueError::Meaning { .. })), "{wrong}");
        }
    }

    #[test]
    fn d11_scale_offset_and_unit() {
        let angle = signal(SignalType::Int16, 0.01, 0.0, "deg");
        assert_eq!(word(&angle, "15.5deg"), Ok(1550));
        assert_eq!(word(&angle, "-15.504 deg"), Ok(-1550_i16 as u16));
        assert_eq!(angle.text_with_unit(0xFFFF), "-0.01 deg");
        assert_eq!(angle.json(1550), json!(15.5));
        // It could be the word, or a value in the unit.
        let message = word(&angle, "15").unwrap_err().to_string();
        assert_eq!(message, "15: the unit is missing: `15deg`, or the word itself as 0x0000");
        assert!(word(&angle, "0").is_err());
        // The word itself is never scaled.
        assert_eq!(word(&angle, "0x0010"), Ok(16));
        let message = word(&angle, "400 deg").unwrap_err().to_string();
        assert_eq!(message, "400 deg is outside -327.68..327.67 deg");
        assert!(word(&angle, "15 rad").unwrap_err().to_string().contains("its unit is deg"));
        let warm = signal(SignalType::Uint16, 0.1, -40.0, "°C");
        assert_eq!((warm.text(643), word(&warm, "24.3°C")), ("24.3".into(), Ok(643)));
        let down = signal(SignalType::Int16, -0.5, 0.0, "");
        assert_eq!((down.text(3), down.limits().0), ("-1.5".into(), "-16383.5".into()));
        // It would be the word where the table is missing; without a unit there is only the word to be given.
        let message = word(&down, "2").unwrap_err().to_string();
        assert!(
            message.starts_with("2: the table scales it and names no unit") && message.contains("0x0000"),
            "{message}"
        );
        assert_eq!(word(&down, "0x0002"), Ok(2));
        // A number that the table does not scale is the word with it and without.
        assert_eq!(word(&signal(SignalType::Int16, 1.0, 0.0, ""), "2"), Ok(2));
    }

    #[test]
    fn d11_limits_of_the_table_hold_for_every_form() {
        let signal = Signal { min: Some(0.0), max: Some(10.0), ..signal(SignalType::Int16, 0.01, 0.0, "A") };
        assert_eq!(word(&signal, "10 A"), Ok(1000));
        assert_eq!(word(&signal, "10.01 A").unwrap_err().to_string(), "10.01 A is outside 0.00..10.00 A");
        assert!(word(&signal, "0x03E9").is_err() && word(&signal, "-0.01A").is_err());
    }

    /// No value beyond a limit is taken, and no word beyond it is sent, whatever the steps are.
    #[test]
    fn d11_rounding_never_leaves_the_limits() {
        let coarse = Signal { max: Some(150.0), ..signal(SignalType::Int16, 100.0, 0.0, "mA") };
        for wrong in ["199.9mA", "150.1mA", "0x0002"] {
            let message = word(&coarse, wrong).unwrap_err().to_string();
            assert_eq!(
                message,
                format!("{} is outside -3276800..150 mA", wrong.parse::<SignalValue>().unwrap())
            );
        }
        assert_eq!(
            (word(&coarse, "150mA"), word(&coarse, "149mA"), word(&coarse, "40mA")),
            (Ok(1), Ok(1), Ok(0))
        );
        let down = Signal { min: Some(-150.0), ..signal(SignalType::Int16, -100.0, 0.0, "A") };
        assert_eq!((word(&down, "-150A"), word(&down, "-151A").is_err()), (Ok(1), true));
        // What fractions lose is no violation.
        let tenths = Signal { max: Some(0.3), ..signal(SignalType::Int16, 0.1, 0.0, "A") };
        assert_eq!((word(&tenths, "0.3A"), word(&tenths, "0x0003")), (Ok(3), Ok(3)));
        let odd = Signal { min: Some(-0.125), max: Some(3276.65), ..signal(SignalType::Int16, 0.1, 0.0, "") };
        assert_eq!(odd.limits(), ("-0.125".into(), "3276.65".into()));
    }

    #[test]
    fn a_rounded_value_is_reported() {
        let tenths = signal(SignalType::Int16, 0.1, 0.0, "A");
        let rounded = |text: &str| {
            let given = text.parse().unwrap();
            tenths.rounded(&given, tenths.word(&given).unwrap())
        };
        assert_eq!(
            (rounded("0.04A"), rounded("0.3 A"), rounded("0x0003")),
            (Some("0.0 A".into()), None, None)
        );
        assert_eq!(rounded("-1234.56 A"), Some("-1234.6 A".into()));
    }

    #[test]
    fn d11_switches_and_bits() {
        let switch = signal(SignalType::Bool, 1.0, 0.0, "");
        assert_eq!((word(&switch, "on"), word(&switch, "0"), word(&switch, "1")), (Ok(1), Ok(0), Ok(1)));
        for wrong in ["2", "0x0007"] {
            assert!(word(&switch, wrong).unwrap_err().to_string().contains("on or off"), "{wrong}");
        }
        assert_eq!((switch.text(1), switch.json(0)), ("on".into(), json!(false)));
        let bits = signal(SignalType::Hex, 1.0, 0.0, "");
        assert_eq!(
            (bits.text(0x8001), word(&bits, "0x8001"), word(&bits, "32769")),
            ("0x8001".into(), Ok(0x8001), Ok(0x8001))
        );
        assert!(word(&bits, "-1").is_err());
    }

    proptest! {
        /// The word that is sent keeps the limits, and no allowed word is nearer.
        #[test]
        fn d11_the_sent_word_keeps_the_limits(scale in prop::sample::select(vec![-7.0, -0.3, 0.01, 0.3, 1.5, 100.0]), offset in -50..50_i32, a in -2000..2000_i32, b in -2000..2000_i32, value in -2500..2500_i32) {
            let (min, max) = (f64::from(a.min(b)) / 8.0, f64::from(a.max(b)) / 8.0);
            let signal = Signal { min: Some(min), max: Some(max), ..signal(SignalType::Int16, scale, f64::from(offset), "u") };
            let value = f64::from(value) / 8.0;
            let means = |w: i32| f64::from(w) * scale + f64::from(offset);
            let inside = |x: f64| (min - 1e-6..=max + 1e-6).contains(&x);
            let best = (-32768..=32767).map(means).filter(|x| inside(*x)).map(|x| (x - value).abs()).fold(f64::INFINITY, f64::min);
            prop_assume!(best.is_finite());
            match signal.word(&SignalValue::Number { value, unit: "u".into() }) {
                Ok(word) => {
                    let sent = means(i32::from(word as i16));
                    prop_assert!(inside(value) && inside(sent), "{value} {sent}");
                    prop_assert!((sent - value).abs() <= best + 1e-6, "{value} {sent}");
                }
                Err(_) => prop_assert!(!inside(value) || best > scale.abs() / 2.0),
            }
        }

        /// What is shown of a word gives that word again.
        #[test]
        fn d11_text_gives_the_word_again(w: u16, kind in 0..4_usize, exponent in -6..4_i32, mantissa in 1..100_u32, negative: bool, offset in -1000..1000_i32) {
            let kind = [SignalType::Int16, SignalType::Uint16, SignalType::Hex, SignalType::Bool][kind];
            let sign = if negative { -1.0 } else { 1.0 };
            let scale = sign * f64::from(mantissa) * 10_f64.powi(exponent);
            let signal = match kind {
                SignalType::Hex | SignalType::Bool => signal(kind, 1.0, 0.0, ""),
                _ => signal(kind, scale, f64::from(offset) / 10.0, "u"),
            };
            let w = if kind == SignalType::Bool { w & 1 } else { w };
            prop_assert_eq!(signal.word(&signal.text_with_unit(w).parse().unwrap()), Ok(w), "{}", signal.text(w));
        }
    }
}
