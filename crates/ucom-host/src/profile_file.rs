//! Profile files: TOML with the keys of [`KEYS`].

use std::fmt::Write;

use ucom::Profile;
use ucom::profile::{KEYS, Kind, ProfileError};

/// Reasons why the reader refuses a profile file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ProfileFileError {
    /// The text of the file is not TOML.
    #[error("profile: {0}")]
    Toml(String),
    /// The profile has no key with this name.
    #[error("profile: unknown key `{key}`{}; the keys are: {}", near(.nearest), known())]
    UnknownKey {
        /// Key in the file.
        key: String,
        /// Existing key that is most similar to the key in the file.
        nearest: Option<&'static str>,
    },
    /// The value of a key is outside the key's range.
    #[error("profile: {key} = {value} is not valid, expected {range}; see `ucom help profile`")]
    Value {
        /// Key to which the value belongs.
        key: &'static str,
        /// Value in the file.
        value: String,
        /// Values that the key allows.
        range: &'static str,
    },
    /// Values of several keys contradict each other.
    #[error("profile: {0}")]
    Contradiction(&'static str),
}

fn near(nearest: &Option<&'static str>) -> String {
    nearest.map(|name| format!(", did you mean `{name}`?")).unwrap_or_default()
}

fn known() -> String {
    KEYS.iter().map(|key| key.name).collect::<Vec<_>>().join(", ")
}

fn unknown(key: &str) -> ProfileFileError {
    let nearest = host_kit::nearest(key, KEYS.iter().map(|known| known.name), 0.75);
    ProfileFileError::UnknownKey { key: key.to_string(), nearest }
}

/// Flattens nested tables: `a.b = 1` and `[a] b = 1` define one key.
fn flatten(prefix: &str, table: toml::Table, out: &mut Vec<(String, toml::Value)>) {
    for (name, value) in table {
        let name = if prefix.is_empty() { name } else { format!("{prefix}.{name}") };
        match value {
            toml::Value::Table(table) if !KEYS.iter().any(|key| key.name == name) => {
                if table.is_empty() && !KEYS.iter().any(|key| key.name.starts_with(&format!("{name}."))) {
                    out.push((name, toml::Value::Table(table)));
                } else {
                    flatten(&name, table, out);
                }
            }
            value => out.push((name, value)),
        }
    }
}

/// Reads and writes a profile as a file.
pub trait ProfileFile: Sized {
    /// Reads a profile from TOML. A key that is missing in the file keeps its default.
    ///
    /// # Errors
    ///
    /// Returns an error if the text is not TOML, a key is unknown, or a value is out of range. Each error message lists the allowed values.
    fn from_toml(text: &str) -> Result<Self, ProfileFileError>;

    /// Returns all keys of the profile as TOML, each with its meaning in a comment.
    fn to_toml(&self) -> String;
}

impl ProfileFile for Profile {
    fn from_toml(text: &str) -> Result<Self, ProfileFileError> {
        let table: toml::Table =
            text.parse().map_err(|e: toml::de::Error| ProfileFileError::Toml(e.to_string()))?;
        let mut entries = Vec::new();
        flatten("", table, &mut entries);
        let mut profile = Self::default();
        for (name, value) in entries {
            let text = match &value {
                toml::Value::String(text) => text.clone(),
                other => other.to_string(),
            };
            match profile.set(&name, &text) {
                Ok(()) => {}
                Err(ProfileError::Value(key)) => {
                    return Err(ProfileFileError::Value {
                        key: key.name,
                        value: value.to_string(),
                        range: key.range,
                    });
                }
                Err(_) => return Err(unknown(&name)),
            }
        }
        match profile.check() {
            Err(ProfileError::Contradiction(why)) => Err(ProfileFileError::Contradiction(why)),
            _ => Ok(profile),
        }
    }

    fn to_toml(&self) -> String {
        let mut text =
            String::from("# Compatibility profile. Every key may be left out; see `ucom help profile`.\n");
        for key in KEYS {
            let value = key.value(self).to_string();
            let value = match key.kind {
                Kind::Number => value,
                Kind::YesNo => (value == "yes").to_string(),
                Kind::Word => format!("\"{value}\""),
            };
            let _ = write!(text, "\n# {} {}.\n{} = {value}\n", key.doc, capital(key.range), key.name);
        }
        text
    }
}

fn capital(text: &str) -> String {
    let mut characters = text.chars();
    characters.next().map(|first| first.to_uppercase().chain(characters).collect()).unwrap_or_default()
}

/// Returns the text of `ucom help profile`: every key with its default, range, rule and meaning.
pub fn profile_help() -> String {
    let mut text = String::from(
        "The published description of the protocol leaves some details open. A profile defines these details\n\
         for the boards on a bus. The format of `--profile FILE` is TOML. All keys are optional. Unknown keys\n\
         are an error. `a.b = 1` and `[a]` with `b = 1` have the same meaning. `ucom probe` measures the keys\n\
         that it can find out from real boards. Below, each key has its default. Numbers such as D-03 refer\n\
         to docs/protocol-ucom.md.\n",
    );
    for key in KEYS {
        let _ = write!(text, "\n{} = {}\n    {} {}.\n", key.name, key.default, key.doc, capital(key.range));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use ucom::profile::{Broadcast, Endian, ReportMode};

    #[test]
    fn a_written_profile_reads_back() {
        let mut profile = Profile::default();
        assert_eq!(Profile::from_toml(&profile.to_toml()), Ok(profile));
        for (key, value) in [
            ("endian", "big"),
            ("addr.broadcast", "31"),
            ("addr.first", "0"),
            ("report.mode", "all4"),
            ("chain.auto_opinit", "yes"),
            ("prog.plan", "pmem-xmem"),
            ("alive.pc_lost", "2500"),
        ] {
            profile.set(key, value).unwrap();
        }
        assert_eq!(Profile::from_toml(&profile.to_toml()), Ok(profile));
    }

    #[test]
    fn d10_both_forms_of_keys() {
        let profile =
            Profile::from_toml("endian = 'big'\n[report]\nmode = 'seq'\n[addr]\nbroadcast = 31").unwrap();
        assert_eq!((profile.endian, profile.report_mode), (Endian::Big, ReportMode::Seq));
        assert_eq!(profile.addr_broadcast, Broadcast::ThirtyOne);
        assert_eq!(Profile::from_toml("prog.endian = 'big'").unwrap().prog_endian, Endian::Big);
        assert_eq!(Profile::from_toml(""), Ok(Profile::default()));
    }

    #[test]
    fn unknown_keys_are_an_error_that_helps() {
        let error = Profile::from_toml("report.mod = 'seq'").unwrap_err();
        let text = error.to_string();
        assert!(
            text.contains("`report.mod`, did you mean `report.mode`?") && text.contains("load.limit"),
            "{text}"
        );
        for bad in ["zzz = 1", "prog = 1", "[zzz]", "endian.x = 1", "[prog.plan]\nx = 1"] {
            assert!(Profile::from_toml(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn values_out_of_range_are_an_error_that_helps() {
        for (bad, part) in [
            ("string.max = 513", "8 to 512"),
            ("so.period = -1", "1 to 60000"),
            ("so.period = 1.5", "1 to 60000"),
            ("endian = 'middle'", "little or big"),
            ("prog.attempts = 99999999999", "1 to 10"),
            ("chain.auto_opinit = 1", "yes or no"),
            ("addr.first = 0", "cannot both be 0"),
        ] {
            let text = Profile::from_toml(bad).unwrap_err().to_string();
            assert!(text.contains(part), "{text}");
        }
        assert!(matches!(Profile::from_toml("x = = 2"), Err(ProfileFileError::Toml(_))));
    }

    #[test]
    fn help_names_every_key_and_its_range() {
        let help = profile_help();
        for key in KEYS {
            assert!(help.contains(&format!("\n{} = {}\n", key.name, key.default)), "{}", key.name);
        }
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(text in "\\PC{0,80}") {
            crate::files::fuzzing::profile(text.as_bytes());
        }
    }
}
