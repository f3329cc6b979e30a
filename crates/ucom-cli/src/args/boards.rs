//! Boards and values as words of the command line.

use std::str::FromStr;

use ucom_host::files::SignalValue;

/// Which boards are meant: numbers, a list, ranges, or all.
#[derive(Clone, Debug, Eq, PartialEq)]
pub enum Boards {
    /// Every board that answers.
    All,
    /// None at all.
    None,
    /// These, ascending, each once.
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
                format!("\"{word}\" is no board: a number 0..31, a list 1,3, a range 1-4, or all")
            })
        };
        let mut boards: Vec<u8> = Vec::new();
        for word in text.split(',') {
            match word.split_once('-') {
                Some((first, last)) => {
                    let (first, last) = (number(first)?, number(last)?);
                    if first > last {
                        return Err(format!("{word} is backwards: {last}-{first}"));
                    }
                    boards.extend(first..=last);
                }
                None => boards.push(number(word)?),
            }
        }
        boards.sort_unstable();
        boards.dedup();
        if boards.is_empty() { Err(format!("\"{text}\" names no board")) } else { Ok(Self::Some(boards)) }
    }
}

/// The number of one board.
pub fn one_board(text: &str) -> Result<u8, String> {
    match text.parse() {
        Ok(number @ 0..=31) => Ok(number),
        _ if text.parse::<Boards>().is_ok() => {
            Err("inputs are set on one board at a time; ucom run sets those of several".into())
        }
        _ => Err(format!("\"{text}\" is no board: a number 0..31")),
    }
}

/// `NAME=VALUE` or `BOARD.NAME=VALUE`.
#[derive(Clone, Debug, PartialEq)]
pub struct Assignment {
    /// The board, when it is named.
    pub board: Option<u8>,
    /// Name or index.
    pub name: String,
    /// The value; what word it becomes is the signal's matter.
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
            return Err(format!("\"{text}\" names nothing; {form}"));
        }
        Ok(Self { board, name: name.trim().to_owned(), value })
    }
}

/// A flash number, decimal or with 0x.
pub fn flash_id(text: &str) -> Result<u16, String> {
    let text = text.trim();
    let number = match text.strip_prefix("0x").or(text.strip_prefix("0X")) {
        Some(hex) => u16::from_str_radix(hex, 16),
        None => text.parse(),
    };
    number.map_err(|_| format!("\"{text}\" is no flash id, as 0x21 or 33"))
}

/// `ASTART,OPINIT` as a mask.
pub fn bits(text: &str) -> Result<ucom::Status, String> {
    let mut all = ucom::Status(0);
    for name in text.split(',').map(str::trim) {
        let bit = ucom::Status::bit(name).ok_or_else(|| {
            let names: Vec<&str> = ucom::Status::NAMES.iter().map(|(name, _)| *name).collect();
            format!("there is no bit \"{name}\"; there are {}", names.join(" "))
        })?;
        all = all | bit;
    }
    Ok(all)
}

/// `00:40` or `0x00:0x40`: the two bytes of PC_SETSTATUS.
pub fn raw_status(text: &str) -> Result<(u8, u8), String> {
    let byte = |text: &str| {
        let digits = text.strip_prefix("0x").or(text.strip_prefix("0X")).unwrap_or(text);
        let hex = digits.chars().all(|c| c.is_ascii_hexdigit());
        u8::from_str_radix(digits, 16).ok().filter(|_| hex && digits.len() <= 2)
    };
    let pair = text.split_once(':').and_then(|(mask, value)| Some((byte(mask)?, byte(value)?)));
    pair.ok_or_else(|| format!("\"{text}\": the form is MASK:VALUE, two hexadecimal bytes, as 00:40"))
}

/// A span in seconds.
pub fn seconds(text: &str) -> Result<std::time::Duration, String> {
    let value = text.parse::<f64>().ok().and_then(|s| std::time::Duration::try_from_secs_f64(s).ok());
    value.ok_or_else(|| format!("\"{text}\" is no number of seconds"))
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
        assert_eq!("1,4-2".parse::<Boards>(), Err("4-2 is backwards: 2-4".into()));
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

    #[test]
    fn flash_ids_bits_and_seconds() {
        assert_eq!(flash_id("0x21"), Ok(0x21));
        assert_eq!(flash_id("33"), Ok(33));
        assert!(flash_id("0x10000").is_err() && flash_id("x").is_err());
        assert_eq!(bits("astart,OPINIT"), Ok(ucom::Status(0x42)));
        assert_eq!((raw_status("00:40"), raw_status("0xff:0X8")), (Ok((0, 0x40)), Ok((0xFF, 8))));
        for wrong in ["40", "100:0", "x:1", "1:", "+1:0", ":"] {
            assert!(raw_status(wrong).is_err(), "{wrong}");
        }
        assert!(bits("OPINT").unwrap_err().contains("OPINIT"));
        assert_eq!(seconds("0.5"), Ok(std::time::Duration::from_millis(500)));
        assert!(seconds("-1").is_err() && seconds("nan").is_err() && seconds("").is_err());
    }
}
