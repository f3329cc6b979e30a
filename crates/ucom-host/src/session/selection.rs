//! Selection of boards, and values for signals, in the form in which users write them.

use std::str::FromStr;

use super::error::ValuesError;
use crate::files::SignalValue;

/// Selection of boards by a user: numbers, a list, ranges, or all boards.
#[derive(Clone, Debug, Eq, PartialEq)]
pub enum Boards {
    /// The selection is every board that answers.
    All,
    /// The selection contains no board.
    None,
    /// The selection contains the listed boards, in ascending order and without duplicates.
    Some(Vec<u8>),
}

impl FromStr for Boards {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "all" => return Ok(Self::All),
            "none" => return Ok(Self::None),
            _ => {}
        }
        let number = |word: &str| {
            let number = word.trim().parse().ok().filter(|n| *n <= 31);
            number.ok_or_else(|| {
                format!("\"{word}\" is not a board, expected a number 0..31, a list 1,3, a range 1-4, or all")
            })
        };
        let mut boards: Vec<u8> = Vec::new();
        for word in text.split(',') {
            match word.split_once('-') {
                Some((first, last)) => {
                    let (first, last) = (number(first)?, number(last)?);
                    if first > last {
                        return Err(format!("the range {word} is in reverse order, expected {last}-{first}"));
                    }
                    boards.extend(first..=last);
                }
                None => boards.push(number(word)?),
            }
        }
        boards.sort_unstable();
        boards.dedup();
        if boards.is_empty() {
            Err(format!("\"{text}\" does not contain a board"))
        } else {
            Ok(Self::Some(boards))
        }
    }
}

/// Value for a signal in the form `NAME=VALUE` or `BOARD.NAME=VALUE`.
#[derive(Clone, Debug, PartialEq)]
pub struct Assignment {
    /// Number of the board that gets the value; `None` for every selected board.
    pub board: Option<u8>,
    /// Name or index of the signal.
    pub name: String,
    /// Value that the user gave. The word that is sent for the value depends on the signal.
    pub value: SignalValue,
}

impl FromStr for Assignment {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let form = "the form is NAME=VALUE or BOARD.NAME=VALUE";
        let (left, right) = text.split_once('=').ok_or_else(|| format!("\"{text}\" has no value; {form}"))?;
        let value = right.parse().map_err(|e| format!("{}: {e}", left.trim()))?;
        let (board, name) = match left.split_once('.') {
            Some((board, name)) if board.trim().parse::<u8>().is_ok() => (board.trim().parse().ok(), name),
            _ => (None, left),
        };
        if name.trim().is_empty() {
            return Err(format!("\"{text}\" has no name; {form}"));
        }
        Ok(Self { board, name: name.trim().to_owned(), value })
    }
}

/// Returns the values for this board, including the values that are not for a particular board.
pub fn for_board(values: &[Assignment], board: u8) -> Vec<Assignment> {
    values.iter().filter(|a| a.board.is_none_or(|b| b == board)).cloned().collect()
}

/// Returns an error if a value is for a board that is not selected.
pub fn only(boards: &[u8], values: &[Assignment], to: &'static str) -> Result<(), ValuesError> {
    match values.iter().find(|a| a.board.is_some_and(|b| !boards.contains(&b))) {
        Some(a) => {
            let board = a.board.unwrap_or_default();
            Err(ValuesError::NotMeant { board, name: a.name.clone(), to })
        }
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boards_are_numbers_lists_ranges_or_all() {
        assert_eq!("3".parse(), Ok(Boards::Some(vec![3])));
        assert_eq!("4-6,1,5".parse(), Ok(Boards::Some(vec![1, 4, 5, 6])));
        assert_eq!("all".parse(), Ok(Boards::All));
        for wrong in ["32", "", "1,,2", "3-1", "-1", "x", "0x1"] {
            assert!(wrong.parse::<Boards>().is_err(), "{wrong}");
        }
        assert_eq!("1,4-2".parse::<Boards>(), Err("the range 4-2 is in reverse order, expected 2-4".into()));
    }

    #[test]
    fn assignments_are_names_with_values() {
        let parsed = |text: &str| text.parse::<Assignment>().unwrap();
        let number = |value: f64, unit: &str| SignalValue::Number { value, unit: unit.into() };
        assert_eq!(parsed("kp=120"), Assignment { board: None, name: "kp".into(), value: number(120.0, "") });
        assert_eq!(
            parsed("2.set_position=-20.5deg"),
            Assignment { board: Some(2), name: "set_position".into(), value: number(-20.5, "deg") }
        );
        assert_eq!(parsed("0=0xFFFF").value, SignalValue::Raw(65535));
        assert_eq!(parsed("brake=off").value, SignalValue::Switch(false));
        for wrong in ["kp", "kp=", "kp=x", "kp=0x12345", "=3", "1.=3", "kp=1,5"] {
            assert!(wrong.parse::<Assignment>().is_err(), "{wrong}");
        }
    }
}
