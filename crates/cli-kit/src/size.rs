//! Parser for options that specify the size of a file or folder.

/// Parses a number of bytes such as `500MB`, `2 GB`, `1GiB` or a plain number. The number must be at least `least`.
///
/// # Errors
///
/// Returns an error for users if the text is not a valid size, or the size is below `least`.
pub fn size(text: &str, least: u64) -> Result<u64, String> {
    let text = text.trim();
    let digits = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
    let (number, unit) = text.split_at(digits);
    let factor: f64 = match unit.trim().to_ascii_lowercase().as_str() {
        "" | "b" => 1.0,
        "kb" => 1e3,
        "mb" => 1e6,
        "gb" => 1e9,
        "tb" => 1e12,
        "kib" => 1024.0,
        "mib" => 1024_f64.powi(2),
        "gib" => 1024_f64.powi(3),
        "tib" => 1024_f64.powi(4),
        unit => {
            return Err(format!(
                "{unit:?} is not a valid unit of size: expected B, kB, MB, GB, TB, KiB, MiB, GiB or TiB"
            ));
        }
    };
    let number: f64 = number
        .parse()
        .map_err(|_| "not a valid size: expected a number and a unit, for example 500MB".to_owned())?;
    let bytes = (number * factor) as u64;
    if bytes < least {
        return Err(format!("size {bytes} B is too small: expected at least {} MB", least as f64 / 1e6));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::size;

    const LEAST: u64 = 10_000_000;

    #[test]
    fn sizes_are_read_with_their_units() {
        for (text, bytes) in [
            ("2GB", 2_000_000_000),
            ("1.5 gb", 1_500_000_000),
            ("64MiB", 64 << 20),
            ("10000000", 10_000_000),
            ("50000kB", 50_000_000),
        ] {
            assert_eq!(size(text, LEAST), Ok(bytes), "{text}");
        }
        for text in ["", "GB", "2 parsec", "-1GB", "9MB", "1e9", "NaN"] {
            assert!(size(text, LEAST).is_err(), "{text}");
        }
        assert_eq!(size("9MB", 9_000_000), Ok(9_000_000));
        assert_eq!(size("9MB", LEAST), Err("size 9000000 B is too small: expected at least 10 MB".into()));
    }
}
