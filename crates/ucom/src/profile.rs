//! Compatibility profile: the board's interpretation of points that the published description leaves open.
//!
//! Each decision about such a point has a profile key, so that this crate can also work with a board that interprets the description
//! differently. [`KEYS`] lists the profile keys with default, range and meaning; [`Profile`] contains their values.

mod keys;
mod values;

pub use keys::{KEYS, Key, Kind, Profile};
pub use values::{AliveMode, Broadcast, CiLatch, Endian, HeaderForm, OnLost, Plan, ReportMode};
pub(crate) use values::{Value, words};

use crate::function::Sequence;

/// Reasons why a value or a complete profile is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProfileError {
    /// The profile has no key with this name.
    UnknownKey,
    /// The value of a key is outside the key's range.
    Value(&'static Key),
    /// Two values of the profile contradict each other. The error text contains both keys and the reason.
    Contradiction(&'static str),
}

impl core::fmt::Display for ProfileError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::UnknownKey => f.write_str("unknown key"),
            Self::Value(key) => write!(f, "{} must be {}", key.name, key.range),
            Self::Contradiction(why) => f.write_str(why),
        }
    }
}

impl core::error::Error for ProfileError {}

impl Profile {
    /// Sets one key of the profile from text. The text is a number, one of the words of the key, or `yes`/`no`.
    pub fn set(&mut self, key: &str, value: &str) -> Result<(), ProfileError> {
        let key = KEYS.iter().find(|known| known.name == key).ok_or(ProfileError::UnknownKey)?;
        if (key.set)(self, value) { Ok(()) } else { Err(ProfileError::Value(key)) }
    }

    /// Checks that the values of the profile can be used together. Values of two keys can contradict each other even if each value is in
    /// its range.
    pub const fn check(&self) -> Result<(), ProfileError> {
        let contradiction = if self.addr_first == 0 && matches!(self.addr_broadcast, Broadcast::Zero) {
            "addr.first and addr.broadcast cannot both be 0: the first board would receive all broadcasts"
        } else if self.alive_pc_lost <= self.alive_pc_period {
            "alive.pc_lost must be longer than alive.pc_period, or every board stops at once"
        } else if self.alive_dsp_lost <= self.alive_dsp_period {
            "alive.dsp_lost must be longer than alive.dsp_period, or every board counts as lost"
        } else {
            return Ok(());
        };
        Err(ProfileError::Contradiction(contradiction))
    }

    /// Returns the number that the PC uses for broadcasts; `None` if the profile has no broadcast number (D-04).
    pub const fn broadcast_number(&self) -> Option<Sequence> {
        match self.addr_broadcast {
            Broadcast::Zero => Some(Sequence::ZERO),
            Broadcast::ThirtyOne => Some(Sequence::MAX),
            Broadcast::None => None,
        }
    }

    /// Returns the address that boards without a number use to receive and to send. This address is the broadcast number, or 0 if the
    /// profile has no broadcast number (D-04, D-06).
    pub const fn unnumbered(&self) -> Sequence {
        match self.broadcast_number() {
            Some(number) => number,
            None => Sequence::ZERO,
        }
    }

    /// Returns `true` if a board can have this number.
    pub const fn is_board(&self, number: Sequence) -> bool {
        let broadcast = match self.broadcast_number() {
            Some(broadcast) => broadcast.number() == number.number(),
            None => false,
        };
        number.number() as u32 >= self.addr_first && !broadcast
    }

    /// Returns the numbers that boards can have, in the order of the chain.
    pub fn board_numbers(&self) -> impl Iterator<Item = Sequence> + use<> {
        let profile = *self;
        Sequence::all().filter(move |number| profile.is_board(*number))
    }

    /// Returns the value of a 16-bit process word whose signal has no stated type. The key `pd.signed` of the
    /// profile defines whether the word is signed (D-11).
    pub const fn process_value(&self, word: u16) -> i32 {
        if self.pd_signed { word as i16 as i32 } else { word as i32 }
    }

    /// Returns the value of the key `string.max`, limited to 512, which is the upper limit of the key.
    pub const fn string_limit(&self) -> usize {
        if self.string_max > 512 { 512 } else { self.string_max as usize }
    }

    /// Returns the value of the key `string.gap` in microseconds.
    pub const fn string_gap_us(&self) -> u64 {
        self.string_gap as u64 * 1000
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;
    use std::string::ToString;
    use std::vec::Vec;

    /// The default of every key equals the default in the table and is within the range of the key. The text of each default can be parsed
    /// again.
    #[test]
    fn keys_and_defaults_agree() {
        let mut profile = Profile::default();
        let names: BTreeSet<_> = KEYS.iter().map(|key| key.name).collect();
        assert_eq!(names.len(), KEYS.len());
        for key in KEYS {
            let written = key.value(&profile).to_string();
            assert_eq!(written, key.default, "{}", key.name);
            assert_eq!(profile.set(key.name, &written), Ok(()), "{}", key.name);
            assert!(!key.doc.is_empty() && !key.range.is_empty());
            assert_eq!(profile.set(key.name, "nonsense"), Err(ProfileError::Value(key)));
        }
        assert_eq!(profile, Profile::default());
        assert_eq!(profile.set("prog.chksum", "crc16"), Err(ProfileError::UnknownKey));
        assert_ne!(KEYS[0], KEYS[1]);
        assert_eq!(ProfileError::UnknownKey.to_string(), "unknown key");
        let refused = profile.set("addr.first", "2").unwrap_err();
        assert_eq!(refused.to_string(), "addr.first must be 0 or 1");
        assert_eq!(std::format!("{refused:?}"), "Value(addr.first)");
        assert_eq!(ProfileError::Contradiction("why").to_string(), "why");
        assert_eq!(profile.check(), Ok(()));
    }

    /// The profile keys include the published parameters, with their published names.
    #[test]
    fn d03_the_listed_parameters_are_all_there() {
        let listed = "bitrate 1000000 · endian little · prog.endian little · addr.first 1 · addr.broadcast 0 · \
            report.mode flash7 · report.window 1000 · init.ack_timeout 100 · info.timeout 100 · string.gap 100 · \
            string.count_includes_header no · string.max 512 · chain.auto_opinit no · xreset.wait 500 · \
            xreset.keeps_init yes · start.timeout 2000 · admin.timeout 100 · prog.plan verify-write · \
            prog.header v1 · prog.checksum crc16 · prog.date fat · prog.frame_gap_us 200 · \
            prog.ready_timeout 1000 · prog.erase_timeout 10000 · prog.attempts 3 · so.period 10 · ci.period 20 · \
            ci.latch frame · pd.short_last no · alive.mode broadcast · alive.pc_period 500 · \
            alive.dsp_period 1000 · alive.pc_lost 1500 · alive.dsp_lost 3000 · on_lost stop-all · load.limit 70";
        for entry in listed.split('·') {
            let (name, default) = entry.trim().split_once(' ').unwrap();
            let key = KEYS.iter().find(|key| key.name == name).unwrap_or_else(|| panic!("{name}"));
            assert_eq!(key.default, default, "{name}");
        }
    }

    #[test]
    fn d04_numbers_of_boards() {
        let numbers = |first, broadcast| {
            let profile = Profile { addr_first: first, addr_broadcast: broadcast, ..Profile::default() };
            let numbers: Vec<_> = profile.board_numbers().map(Sequence::number).collect();
            (numbers[0], numbers[numbers.len() - 1], profile.unnumbered().number())
        };
        assert_eq!(numbers(1, Broadcast::Zero), (1, 31, 0));
        assert_eq!(numbers(0, Broadcast::ThirtyOne), (0, 30, 31));
        assert_eq!(numbers(1, Broadcast::None), (1, 31, 0));
        let both = Profile { addr_first: 0, ..Profile::default() };
        assert!(matches!(both.check(), Err(ProfileError::Contradiction(_))));
    }

    #[test]
    fn d11_process_words_are_signed() {
        let profile = Profile::default();
        assert_eq!([0x05DC, 0xFFEC, 0x8000].map(|word| profile.process_value(word)), [1500, -20, -32768]);
        let unsigned = Profile { pd_signed: false, ..profile };
        assert_eq!(unsigned.process_value(0xFFEC), 65516);
    }

    /// The protocol page mentions every profile key.
    #[test]
    fn d00_the_protocol_page_names_every_key() {
        let page = include_str!("../../../docs/protocol-ucom.md");
        let missing: Vec<_> =
            KEYS.iter().filter(|key| !page.contains(&std::format!("`{}`", key.name))).collect();
        assert!(missing.is_empty(), "{missing:?}");
    }

    #[test]
    fn d50_lost_times_are_longer_than_periods() {
        let bad = Profile { alive_pc_lost: 500, ..Profile::default() };
        assert!(bad.check().is_err());
    }
}
