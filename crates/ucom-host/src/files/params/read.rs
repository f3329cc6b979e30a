//! Converts the YAML of a parameter file to values, with their positions in the file.
use serde::Deserialize;
use serde::de::{Deserializer, MapAccess, Visitor};
use serde_saphyr::Spanned;

use super::{ParamsBoard, ParamsEntry, ParamsError, ParamsFile, Place};
use crate::files::signals::SignalValue;

/// Limit of the number of YAML nodes in a parameter file. The limit allows more boards than a bus has and more values than a buffer has.
const MAX_NODES: usize = 400_000;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    boards: Vec<Spanned<Board>>,
}

// The reader reads every scalar as text, because it must distinguish `0x10` from `16`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Board {
    board: Spanned<String>,
    #[serde(default)]
    flash_number: Option<Spanned<String>>,
    #[serde(default)]
    name: Option<String>,
    #[serde(default)]
    program_id: Option<Spanned<String>>,
    #[serde(default)]
    par: Option<Values>,
    #[serde(default)]
    ci: Option<Values>,
}

/// Names and values in the order of the file.
struct Values(Vec<(String, Spanned<String>)>);

impl<'de> Deserialize<'de> for Values {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Pairs;
        impl<'de> Visitor<'de> for Pairs {
            type Value = Values;

            fn expecting(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                f.write_str("names with values, as `kp: 120`")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Values, A::Error> {
                let mut pairs = Vec::new();
                while let Some(pair) = map.next_entry()? {
                    pairs.push(pair);
                }
                Ok(Values(pairs))
            }
        }
        deserializer.deserialize_map(Pairs)
    }
}

fn place<T>(spanned: &Spanned<T>) -> Place {
    let at = spanned.referenced;
    Place { line: at.line() as u32, column: at.column() as u32 }
}

fn wrong(place: Place, what: String) -> ParamsError {
    ParamsError::Form { place, what }
}

/// Reads a 16-bit number in decimal, or in hexadecimal with 0x.
fn number(text: &Spanned<String>, what: &str) -> Result<u16, ParamsError> {
    let number = match text.value.trim().parse() {
        Ok(SignalValue::Raw(word)) => Some(word),
        Ok(SignalValue::Number { value, unit }) if unit.is_empty() && value.fract() == 0.0 => {
            Some(value).filter(|v| (0.0..=65535.0).contains(v)).map(|v| v as u16)
        }
        _ => None,
    };
    let no =
        || wrong(place(text), format!("\"{}\" is not a valid {what}, expected 0x0000 to 0xFFFF", text.value));
    number.ok_or_else(no)
}

fn entries(values: Option<Values>, board: u8) -> Result<Vec<ParamsEntry>, ParamsError> {
    let entry = |(name, value): (String, Spanned<String>)| {
        let place = place(&value);
        let given = value.value.parse().map_err(|e| wrong(place, format!("board {board}, `{name}`: {e}")))?;
        Ok(ParamsEntry { name, given, place })
    };
    values.map_or_else(Vec::new, |v| v.0).into_iter().map(entry).collect()
}

fn board(spanned: Spanned<Board>) -> Result<ParamsBoard, ParamsError> {
    let at = place(&spanned);
    let Board { board, flash_number, name, program_id, par, ci } = spanned.value;
    let no_board =
        || wrong(place(&board), format!("\"{}\" is not a board number, expected 0 to 31", board.value));
    let number_of = number(&board, "board").map_err(|_| no_board())?;
    let number_of = u8::try_from(number_of).ok().filter(|n| *n <= 31).ok_or_else(no_board)?;
    let flash_number = flash_number.map(|text| number(&text, "flash number")).transpose()?;
    let name = name.map(|n| n.trim().to_owned()).filter(|n| !n.is_empty());
    if flash_number.is_none() && name.is_none() {
        let what = format!(
            "board {number_of}: flash_number and name are missing, so the board cannot be identified; `ucom \
             info {number_of}` shows the flash number"
        );
        return Err(wrong(at, what));
    }
    let program_id = match program_id {
        Some(text) if text.value.trim() == "any" => None,
        Some(text) => Some(number(&text, "Program ID or any")?),
        None => {
            let what = format!(
                "board {number_of}: program_id is missing; give the Program ID that has these names, or any \
                 for every program"
            );
            return Err(wrong(at, what));
        }
    };
    let (par, ci) = (entries(par, number_of)?, entries(ci, number_of)?);
    Ok(ParamsBoard { number: number_of, place: at, flash_number, name, program_id, par, ci })
}

/// Rewords a message of the YAML library for the author of the file.
fn people(words: &str) -> String {
    // The message of the library contains another position, which is removed.
    let words = words.split(" at line ").next().unwrap_or(words).trim_end_matches(':');
    if let Some(rest) = words.strip_prefix("duplicate mapping key") {
        let key = rest.split(", set ").next().unwrap_or("").trim_start_matches([':', ' ']);
        let key = if key.is_empty() { "a name".to_owned() } else { format!("`{key}`") };
        return format!("{key} has two entries under the same heading");
    }
    if words.starts_with("multiple YAML documents") {
        return "a second document begins (a line of ---), but a parameter file is one document".into();
    }
    if words.starts_with("unexpected end of input") {
        return "the file is empty: it has no `boards:`".into();
    }
    let list = ["invalid type: sequence", "expected string scalar", "expected scalar"];
    if list.iter().any(|start| words.starts_with(start)) {
        return "this is a list or a group of names, but one value is expected, as `kp: 120`".into();
    }
    if words.starts_with("cannot deserialize null into string") {
        return "a value is missing, as in `kp: 120`".into();
    }
    let terms = [
        (
            "expected sequence start",
            "a list is expected here, with a hyphen before each board, as `- board: 1`",
        ),
        ("expected mapping start", "names with values are expected here, as `kp: 120`"),
        ("expected a sequence", "expected a list, as `- board: 1`"),
        ("struct Board", "a board, as `- board: 1`"),
        ("struct File", "`boards:` with a list"),
    ];
    terms.iter().fold(words.to_owned(), |text, (theirs, ours)| text.replace(theirs, ours))
}

impl ParamsFile {
    /// Reads a parameter file from YAML text.
    pub fn parse(text: &str) -> Result<Self, ParamsError> {
        let options = serde_saphyr::options! {
            budget: serde_saphyr::budget! { max_nodes: MAX_NODES, max_events: 2 * MAX_NODES, max_depth: 16 },
            with_snippet: false,
        };
        let file = serde_saphyr::from_str_with_options::<File>(text, options).map_err(|e| {
            let at = e.location().map(|l| Place { line: l.line() as u32, column: l.column() as u32 });
            let words = e.to_string();
            let what = people(words.lines().next().unwrap_or(""));
            match at.filter(|at| at.line > 0) {
                Some(place) => wrong(place, what),
                None => ParamsError::Nowhere(what),
            }
        })?;
        let mut all = Self::default();
        for spanned in file.boards {
            let next = board(spanned)?;
            if let Some(before) = all.board(next.number) {
                let what = format!(
                    "board {} has two entries, the first one in line {}",
                    next.number, before.place.line
                );
                return Err(wrong(next.place, what));
            }
            all.boards.push(next);
        }
        Ok(all)
    }
}
