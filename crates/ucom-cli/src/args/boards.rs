//! Parsers for board numbers, status bits and durations on the command line.

pub(crate) use ucom_host::session::{Assignment, Boards};

/// Parses the number of one board.
pub(super) fn one_board(text: &str) -> Result<u8, String> {
    match text.parse() {
        Ok(number @ 0..=31) => Ok(number),
        _ if text.parse::<Boards>().is_ok() => {
            Err("inputs are set on one board at a time; ucom run sets those of several".into())
        }
        _ => Err(format!("\"{text}\" is not a board: a number 0..31")),
    }
}

/// Parses a flash number, which is decimal, or hexadecimal with 0x.
pub(super) fn flash_id(text: &str) -> Result<u16, String> {
    let text = text.trim();
    let number = match text.strip_prefix("0x").or(text.strip_prefix("0X")) {
        Some(hex) => u16::from_str_radix(hex, 16),
        None => text.parse(),
    };
    number.map_err(|_| format!("\"{text}\" is not a flash id, as 0x21 or 33"))
}

/// Parses a mask of status bits, for example `ASTART,OPINIT`.
pub(super) fn bits(text: &str) -> Result<ucom::Status, String> {
    let mut all = ucom::Status(0);
    for name in text.split(',').map(str::trim) {
        let bit = ucom::Status::bit(name).ok_or_else(|| {
            let names: Vec<&str> = ucom::Status::NAMES.iter().map(|(name, _)| *name).collect();
            format!("no bit \"{name}\" exists; there are {}", names.join(" "))
        })?;
        all = all | bit;
    }
    Ok(all)
}

/// Parses the two bytes of PC_SETSTATUS, for example `00:40` or `0x00:0x40`.
pub(super) fn raw_status(text: &str) -> Result<(u8, u8), String> {
    let byte = |text: &str| {
        let digits = text.strip_prefix("0x").or(text.strip_prefix("0X")).unwrap_or(text);
        let hex = digits.chars().all(|c| c.is_ascii_hexdigit());
        u8::from_str_radix(digits, 16).ok().filter(|_| hex && digits.len() <= 2)
    };
    let pair = text.split_once(':').and_then(|(mask, value)| Some((byte(mask)?, byte(value)?)));
    pair.ok_or_else(|| format!("\"{text}\": the form is MASK:VALUE, two hexadecimal bytes, as 00:40"))
}

/// Parses a duration in seconds.
pub(super) fn seconds(text: &str) -> Result<std::time::Duration, String> {
    let value = text.parse::<f64>().ok().and_then(|s| std::time::Duration::try_from_secs_f64(s).ok());
    value.ok_or_else(|| format!("\"{text}\" is not a number of seconds"))
}

#[cfg(test)]
mod tests {
    use super::*;

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
