//! Tests of the conversion between words and values (D-11).
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
    // The conversion refuses a value that no word of this signal can represent.
    for wrong in ["32768", "40000", "65535", "-32769", "1.5", "3 deg", "on"] {
        assert!(word(&signal, wrong).is_err(), "{wrong}");
    }
    assert_eq!((word(&unsigned, "65535"), word(&unsigned, "0")), (Ok(65535), Ok(0)));
    assert!(word(&unsigned, "-1").is_err() && word(&unsigned, "65536").is_err());
}

/// If the signal table has no entry for the program, only raw words are accepted, because the unit of a number is not
/// known.
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
    // The number could be the raw word or a value in the signal's unit, so it is refused.
    let message = word(&angle, "15").unwrap_err().to_string();
    assert_eq!(
        message,
        "15: the unit is missing: `15deg` is the word 0x05DC; the word 15 is `0x000F` (0.15 deg)"
    );
    let current = signal(SignalType::Int16, 1.0, 0.0, "mA");
    let message = word(&current, "120").unwrap_err().to_string();
    assert_eq!(message, "120: the unit is missing: `120mA` is the word 0x0078");
    // The message never proposes a value that is outside the limits, or a word that the user did not type.
    let narrow = Signal { min: Some(-60.0), max: Some(60.0), ..angle.clone() };
    let message = |text: &str| word(&narrow, text).unwrap_err().to_string();
    assert_eq!(
        message("61"),
        "61: the unit is missing: 61 deg is outside -60.00..60.00 deg; the word 61 is `0x003D` (0.61 deg)"
    );
    assert_eq!(message("7000"), "7000: the unit is missing: 7000 deg is outside -60.00..60.00 deg");
    assert_eq!(message("-0.5"), "-0.5: the unit is missing: `-0.5deg` is the word 0xFFCE");
    assert!(word(&angle, "0").is_err());
    // The conversion never scales a raw word.
    assert_eq!(word(&angle, "0x0010"), Ok(16));
    let message = word(&angle, "400 deg").unwrap_err().to_string();
    assert_eq!(message, "400 deg is outside -327.68..327.67 deg");
    assert!(word(&angle, "15 rad").unwrap_err().to_string().contains("the unit of the signal is deg"));
    let warm = signal(SignalType::Uint16, 0.1, -40.0, "°C");
    assert_eq!((warm.text(643), word(&warm, "24.3°C")), ("24.3".into(), Ok(643)));
    let down = signal(SignalType::Int16, -0.5, 0.0, "");
    assert_eq!((down.text(3), down.limits().0), ("-1.5".into(), "-16383.5".into()));
    // Without the signal table, the number would be the raw word; with the table, it would be scaled. The signal has
    // no unit that could show the difference, so only a raw word is accepted.
    let message = word(&down, "2").unwrap_err().to_string();
    assert!(
        message.starts_with("2: the table has a scale but no unit for this signal")
            && message.contains("the word 2 is `0x0002` (-1.0)"),
        "{message}"
    );
    assert_eq!(word(&down, "0x0002"), Ok(2));
    // The table does not scale this signal, so a number gives the same word with and without the table.
    assert_eq!(word(&signal(SignalType::Int16, 1.0, 0.0, ""), "2"), Ok(2));
}

#[test]
fn d11_limits_of_the_table_hold_for_every_form() {
    let signal = Signal { min: Some(0.0), max: Some(10.0), ..signal(SignalType::Int16, 0.01, 0.0, "A") };
    assert_eq!(word(&signal, "10 A"), Ok(1000));
    assert_eq!(word(&signal, "10.01 A").unwrap_err().to_string(), "10.01 A is outside 0.00..10.00 A");
    assert!(word(&signal, "0x03E9").is_err() && word(&signal, "-0.01A").is_err());
}

/// For any step size, no value beyond a limit is accepted, and no word beyond a limit is sent.
#[test]
fn d11_rounding_never_leaves_the_limits() {
    let coarse = Signal { max: Some(150.0), ..signal(SignalType::Int16, 100.0, 0.0, "mA") };
    for wrong in ["199.9mA", "150.1mA", "0x0002"] {
        let message = word(&coarse, wrong).unwrap_err().to_string();
        assert_eq!(message, format!("{} is outside -3276800..150 mA", wrong.parse::<SignalValue>().unwrap()));
    }
    assert_eq!(
        (word(&coarse, "150mA"), word(&coarse, "149mA"), word(&coarse, "40mA")),
        (Ok(1), Ok(1), Ok(0))
    );
    let down = Signal { min: Some(-150.0), ..signal(SignalType::Int16, -100.0, 0.0, "A") };
    assert_eq!((word(&down, "-150A"), word(&down, "-151A").is_err()), (Ok(1), true));
    // The rounding errors of fractions do not make a value exceed its limit.
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
    assert_eq!((rounded("0.04A"), rounded("0.3 A"), rounded("0x0003")), (Some("0.0 A".into()), None, None));
    assert_eq!(rounded("-1234.56 A"), Some("-1234.6 A".into()));
}

#[test]
fn d11_switches_and_bits() {
    let switch = signal(SignalType::Bool, 1.0, 0.0, "");
    assert_eq!((word(&switch, "on"), word(&switch, "0"), word(&switch, "1")), (Ok(1), Ok(0), Ok(1)));
    for wrong in ["2", "0x0007"] {
        assert!(word(&switch, wrong).unwrap_err().to_string().contains("on and off only"), "{wrong}");
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
    /// The word that is sent is within the limits, and no allowed word is nearer to the requested value.
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

    /// The conversion of a word's displayed text results in the same word again.
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
