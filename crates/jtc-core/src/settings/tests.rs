extern crate std;
use std::vec::Vec;

use proptest::prelude::*;

use super::*;

#[test]
fn j53_every_setting_is_read_and_set_and_its_default_is_in_its_range() {
    let config = Config::avena();
    let all: Vec<_> = values(&config, 0, false).collect();
    assert_eq!(all.len(), count(false));
    assert_eq!(with_values(&config, all.iter().copied()), Ok(config.clone()));
    // Each setting changes only its own field of the configuration.
    for value in &all {
        let row = setting(value.setting).expect("it is in the table");
        let half = 0.5 * (row.low + row.high);
        let mut changed = config.clone();
        let other = if row.whole { half.round() } else { half };
        row.set(&mut changed, value.joint, other).expect("in range");
        for again in &all {
            let now = setting(again.setting).and_then(|row| row.get(&changed, again.joint));
            let expected = if again == value { other } else { again.value };
            assert_eq!(now, Some(expected), "{} {}", row.name, again.joint);
        }
    }
}

#[test]
fn j53_numbers_and_names_are_unique_and_in_order() {
    for pair in TABLE.windows(2) {
        assert!(pair[0].number < pair[1].number, "{}", pair[1].name);
    }
    for row in &TABLE {
        assert_eq!(named(row.name).map(|found| found.number), Some(row.number));
        assert!(!row.meaning.is_empty() && row.low < row.high);
        assert_eq!(row.of_joint(), row.number < 32, "{}", row.name);
        // Every value of a whole-number setting fits into 16 bits.
        assert!(!row.whole || (row.low >= 0.0 && row.high <= 65_535.0), "{}", row.name);
    }
}

/// The table contains every field of the configuration: it has as many values as the configuration has numbers.
#[test]
fn j53_every_field_has_a_row() {
    let text = std::format!("{:?}", Config::avena());
    let numbers = text
        .split([' ', ',', '[', ']', '{', '}'])
        .filter(|word| word.parse::<f64>().is_ok() || *word == "true" || *word == "false");
    assert_eq!(numbers.count(), count(false));
}

#[test]
fn j53_values_go_on_where_a_page_ended() {
    let config = Config::avena();
    let all: Vec<_> = values(&config, 0, true).collect();
    assert_eq!(all.len(), count(true));
    for first in 0..all.len() + 3 {
        let rest: Vec<_> = values(&config, first, true).collect();
        assert_eq!(rest, all[first.min(all.len())..], "{first}");
    }
}

#[test]
fn j53_what_is_out_of_range_is_refused_and_named() {
    let config = Config::avena();
    let set =
        |setting, joint, value| with_values(&config, [SettingValue { setting, joint, value }].into_iter());
    for row in &TABLE {
        let joint = u8::from(row.of_joint());
        for value in [row.low - 1e-9, row.high * (1.0 + 1e-12) + 1e-12, f64::NAN, f64::INFINITY] {
            let error = set(row.number, joint, value).unwrap_err();
            assert!(matches!(error, SettingError::Value { name, .. } if name == row.name), "{error}");
            assert!(std::format!("{error}").contains(row.name));
        }
        let wrong = if row.of_joint() { [0, 7] } else { [1, 255] };
        for joint in wrong {
            let error = set(row.number, joint, row.low).unwrap_err();
            assert_eq!(error, SettingError::Unknown { setting: row.number, joint });
        }
        if row.whole {
            assert!(set(row.number, joint, row.low + 0.5).is_err());
        }
    }
    assert_eq!(set(200, 0, 1.0), Err(SettingError::Unknown { setting: 200, joint: 0 }));
    // Each of these values is in its range, but the resulting configuration is not valid.
    assert!(matches!(set(1, 1, 2.98), Err(SettingError::Config(ConfigError::Range { joint: 1, .. }))));
    assert!(matches!(set(8, 2, 9.0), Err(SettingError::Config(ConfigError::TorqueScale { joint: 2, .. }))));
    assert!(matches!(set(3, 4, 5.0), Err(SettingError::Config(ConfigError::SpeedScale { joint: 4, .. }))));
}

#[test]
fn j53_the_message_of_an_error_names_the_joint_of_the_setting() {
    let refused = |joint, name| SettingError::Value { name, joint, value: 120.0, low: 5.0, high: 100.0 };
    assert_eq!(
        std::format!("{}", refused(0, "gravity")),
        "gravity: 120 is not a valid value, expected 5 to 100"
    );
    assert_eq!(
        std::format!("{}", refused(2, "torque")),
        "joint 2, torque: 120 is not a valid value, expected 5 to 100"
    );
}

/// A principal moment of this payload (1 kg·m²) exceeds the sum of the other two (0.2 kg·m²), so the payload is not
/// valid. The check of the moments takes too long during a motion, so another setting must not cause this check.
#[test]
fn j07_j60_a_payload_is_checked_only_when_it_changes() {
    let payload = Payload { mass: 1.0, com: [0.0; 3], inertia: [1.0, 0.0, 0.0, 0.1, 0.0, 0.1] };
    let speed = SettingValue { setting: SPEED, joint: 0, value: 0.5 };
    let config = Config { payload, ..Config::avena() };
    assert!(with_values(&config, [speed].into_iter()).is_ok());
    let refused = with_values(&Config::avena(), payload_values(&payload));
    assert!(matches!(refused, Err(SettingError::Payload(_))), "{refused:?}");
}

proptest! {
    /// If the controller accepts settings, the resulting configuration is valid, and the settings read back
    /// unchanged.
    #[test]
    fn j53_what_is_taken_reads_back(
        changes in prop::collection::vec((0usize..200, 0.0..1.0f64), 1..20),
    ) {
        let config = Config::avena();
        let all: Vec<_> = values(&config, 0, false).collect();
        let list: Vec<_> = changes.iter().map(|&(i, share)| {
            let at = all[i % all.len()];
            let row = setting(at.setting).expect("it is in the table");
            let value = row.low + share * (row.high - row.low);
            SettingValue { value: if row.whole { value.round() } else { value }, ..at }
        }).collect();
        if let Ok(next) = with_values(&config, list.iter().copied()) {
            prop_assert!(next.check().is_ok());
            for (i, set) in list.iter().enumerate() {
                let last = !list[i + 1..].iter().any(|v| (v.setting, v.joint) == (set.setting, set.joint));
                let now = setting(set.setting).and_then(|row| row.get(&next, set.joint));
                prop_assert!(!last || now == Some(set.value));
            }
        }
    }
}
