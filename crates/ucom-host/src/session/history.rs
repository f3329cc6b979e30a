//! Values that this tool wrote to the parameters of a board, with times. The parameters can have other values now: a
//! restart of the application resets them, and this tool does not always notice a restart. The protocol has no
//! function that reads parameters back (D-35).

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use ucom::{BoardInfo, DateForm};

use super::cache::Cache;

/// A value that was written to a parameter.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize)]
pub struct Written {
    /// Value as a 16-bit word.
    pub word: u16,
    /// Time at which the value was written, in seconds since 1970.
    pub at: u64,
}

/// Values that were last written to the parameters of one board, by index in the buffer.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[serde(default)]
pub struct History {
    program_id: u16,
    date: u16,
    par: BTreeMap<u16, Written>,
    /// Cache, and the name of the history file in the cache.
    #[serde(skip)]
    kept: (Cache, String),
}

impl History {
    /// Returns the history of a board's parameters. The history is empty if the board has another program now.
    pub fn of(cache: &Cache, info: &BoardInfo) -> Self {
        let file = format!("written-{:04X}.json", info.flash_number);
        let text = cache.read(&file);
        let last = text.and_then(|text| serde_json::from_str::<Self>(&text).ok()).unwrap_or_default();
        let same = (last.program_id, last.date) == (info.program_id, info.date);
        let par = if same { last.par } else { BTreeMap::new() };
        Self { program_id: info.program_id, date: info.date, par, kept: (cache.clone(), file) }
    }

    /// Records the words that were just written to parameters. If the history file cannot be written, the function ignores the failure.
    pub fn wrote(&mut self, words: impl Iterator<Item = (u16, u16)>) {
        let at = host_kit::unix_time().as_secs();
        self.par.extend(words.map(|(index, word)| (index, Written { word, at })));
        if let Ok(text) = serde_json::to_string_pretty(self) {
            let (cache, file) = &self.kept;
            cache.write(file.clone(), text);
        }
    }

    /// Returns the value that was last written to a parameter.
    pub fn last(&self, index: usize) -> Option<Written> {
        self.par.get(&u16::try_from(index).ok()?).copied()
    }
}

impl Written {
    /// Returns the time of the write in the form `2026-11-21 06:10 UTC`.
    pub fn when(&self) -> String {
        // Subtracts the days from 1970-01-01 to 2000-01-01.
        let days = (self.at / 86_400).saturating_sub(10_957);
        let date = u16::try_from(days).ok().and_then(|days| DateForm::Days2000.decode(days));
        let (year, month, day) = date.unwrap_or((2000, 1, 1));
        let minutes = self.at % 86_400 / 60;
        format!("{year:04}-{month:02}-{day:02} {:02}:{:02} UTC", minutes / 60, minutes % 60)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ucom::Status;

    #[test]
    fn moments_are_printed_in_utc() {
        assert_eq!(Written { word: 0, at: 1_234_567_890 }.when(), "2009-02-13 23:31 UTC");
    }

    /// D-35: another program has other parameters. Its parameters have no history, even if a parameter of the
    /// previous program has the same index.
    #[test]
    fn d35_another_program_remembers_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let cache = Cache::new(Some(dir.path().into()), false);
        let info =
            BoardInfo { flash_number: 0x21, sequence: 1, status: Status(0x8B), program_id: 7, date: 8 };
        History::of(&cache, &info).wrote([(2, 0xFFEC)].into_iter());
        let again = History::of(&cache, &info);
        assert_eq!((again.last(2).map(|w| w.word), again.last(0)), (Some(0xFFEC), None));
        let other = BoardInfo { program_id: 9, ..info };
        assert_eq!(History::of(&cache, &other).last(2), None);
        assert_eq!(History::of(&cache, &BoardInfo { flash_number: 0x22, ..info }).last(2), None);
    }
}
