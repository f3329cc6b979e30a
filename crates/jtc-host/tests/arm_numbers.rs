//! The tests change one number of an arm file at a time: they remove the number, duplicate it, or reverse its sign.
//! The reader must detect each change.
use std::ops::Range;

use jtc_host::arm::{Arm, Source};

const AVENA: &str = include_str!("../../../arms/avena.toml");

/// Number in the file.
struct Number {
    /// Position in the file.
    at: Range<usize>,
    /// Key of the number.
    key: &'static str,
}

/// Returns the numbers of the file, except the format version, in order.
fn numbers() -> Vec<Number> {
    let mut all = Vec::new();
    let mut begin = 0;
    for line in AVENA.split_inclusive('\n') {
        let code = line.split('#').next().unwrap_or_default();
        let mut key = code.split('=').next().unwrap_or_default().trim();
        let mut from = code.find('=').map_or(code.len(), |at| at + 1);
        while let Some(length) = code[from..].find(|c: char| !(c.is_alphanumeric() || "._-+\"".contains(c))) {
            let word = &code[from..from + length];
            if word.parse::<f64>().is_ok() {
                all.push(Number { at: begin + from..begin + from + length, key });
            } else if word.starts_with(|c: char| c.is_alphabetic()) {
                key = word;
            }
            from += length + 1;
        }
        begin += line.len();
    }
    all.retain(|number| number.key != "format");
    all
}

/// Returns the file with the text in this range replaced.
fn with(at: Range<usize>, text: &str) -> String {
    [&AVENA[..at.start], text, &AVENA[at.end..]].concat()
}

/// Returns the line that contains a number.
fn line_of(number: &Number) -> Range<usize> {
    let start = AVENA[..number.at.start].rfind('\n').map_or(0, |at| at + 1);
    let end = AVENA[number.at.end..].find('\n').map_or(AVENA.len(), |at| number.at.end + at + 1);
    start..end
}

/// Returns the file without the number and without the separators around the number.
fn without(number: &Number) -> String {
    let line = line_of(number);
    let (before, after) = (&AVENA[line.start..number.at.start], &AVENA[number.at.end..line.end]);
    if let Some(pair) = before.rfind("{ ").or(before.rfind(", ")).filter(|_| before.contains('{')) {
        // In an inline table, the key, the number and their comma are removed.
        let pair = before.rfind(", ").unwrap_or(pair) + 2;
        return with(line.start + pair..number.at.end + after.find([',', ' ']).unwrap_or(0) + 1, "");
    }
    if before.contains('[') {
        let more = after.find(|c| c != ',' && c != ' ').unwrap_or(0);
        return with(number.at.start..number.at.end + more, "");
    }
    with(line, "")
}

#[test]
fn a_number_that_is_left_out_is_missed() {
    for number in numbers() {
        let (text, changed) = (&AVENA[number.at.clone()], without(&number));
        match Arm::parse(&changed) {
            Err(e) => {
                let e = e.to_string();
                let named = e.contains(number.key) || e.contains("line ") || e.contains(" values, expected ");
                assert!(named, "{} {text}: {e}", number.key);
            }
            // If the reader replaces a missing number by a default, it must list the default or warn. A missing rotor
            // inertia must be recorded as not given.
            Ok(arm) => {
                let default = arm.values().iter().any(|v| v.name == number.key && v.from == Source::Default);
                let listed = default || arm.warnings.iter().any(|w| w.problem.contains(number.key));
                assert!(listed || arm.rotors_given.contains(&false), "{} {text}", number.key);
            }
        }
    }
}

#[test]
fn a_number_that_is_given_twice_is_refused() {
    for number in numbers() {
        let (text, line) = (&AVENA[number.at.clone()], line_of(&number));
        let beside = with(number.at.clone(), &format!("{text}, {text}"));
        let again = with(line.start..line.start, &AVENA[line.clone()]);
        let pair = with(number.at.clone(), &format!("{text}, {} = {text}", number.key));
        for changed in [beside, again, pair] {
            let e = Arm::parse(&changed).expect_err(number.key).to_string();
            let named = e.contains(number.key) || e.contains("line ") || e.contains(" values, expected ");
            assert!(named || e.contains("place"), "{} {text}: {e}", number.key);
        }
    }
}

/// The reader either rejects a number with the opposite sign or accepts it. If it accepts the number, all other
/// values of the arm stay the same.
#[test]
fn a_number_of_the_other_sign_is_refused_or_is_what_differs() {
    let avena = Arm::parse(AVENA).unwrap();
    for number in numbers() {
        let text = &AVENA[number.at.clone()];
        let value: f64 = text.parse().unwrap();
        // The arm uses polynomials, so its friction tables are not used. Their axes are only checked for increasing
        // values.
        let unused = ["temperature_c", "velocity_rad_s"].contains(&number.key);
        match Arm::parse(&with(number.at.clone(), &(-value).to_string())) {
            Ok(arm) if value != 0.0 && !unused => {
                let differences = arm.differences(&avena);
                assert_eq!(differences.len(), 1, "{} {text}: {differences:?}", number.key);
                assert_eq!((differences[0].file, differences[0].device), (-value, value), "{}", number.key);
                if ["kp", "ki", "kd"].contains(&number.key) {
                    let beyond = arm.parameter_set().beyond(&arm.config());
                    assert!(beyond.is_some(), "no controller takes a negative {}", number.key);
                }
            }
            _ => {}
        }
    }
}
