//! Tables of text cells, as other programs write them: any line end, one separator for the file, quoted cells, a last empty column.

use std::borrow::Cow;

/// Row of a table: line number in the file (from 1), and cells.
pub(crate) type Row<'a> = (usize, Vec<Cow<'a, str>>);

/// Returns the lines of a text. A line ends with LF, CR LF or CR.
pub(crate) fn lines(text: &str) -> impl Iterator<Item = &str> {
    text.trim_start_matches('\u{feff}')
        .split('\n')
        .flat_map(|l| l.strip_suffix('\r').unwrap_or(l).split('\r'))
}

/// Returns the rows of a table. Blank lines and lines that begin with `#` are skipped. The first row determines the separator. Empty cells
/// after the last cell of the first row are removed from all rows.
pub(crate) fn rows(text: &str) -> Vec<Row<'_>> {
    let mut rows: Vec<Row<'_>> = Vec::new();
    let mut first = None;
    for (i, line) in lines(text).enumerate() {
        if line.trim().is_empty() || line.trim_start().starts_with('#') {
            continue;
        }
        let (separator, count) = *first.get_or_insert_with(|| {
            let separator = separator(line);
            let mut cells = split(line, separator);
            without_end(&mut cells, 1);
            (separator, cells.len())
        });
        let mut cells = split(line, separator);
        if cells.len() != count || separator.is_none() && cells.iter().any(|cell| cell.ends_with(',')) {
            // Some files have a header with another separator than the numbers.
            let other = split(line, self::separator(line));
            if other.len() == count {
                cells = other;
            }
        }
        without_end(&mut cells, count);
        rows.push((i + 1, cells));
    }
    rows
}

fn without_end(cells: &mut Vec<Cow<'_, str>>, count: usize) {
    while cells.len() > count && cells.last().is_some_and(|cell| cell.is_empty()) {
        cells.pop();
    }
}

/// Returns the separator of a line. `None` means blanks.
fn separator(line: &str) -> Option<char> {
    let mut quoted = false;
    let bare: String = line
        .chars()
        .filter(|c| {
            quoted ^= *c == '"';
            !quoted
        })
        .collect();
    if bare.contains(';') {
        return Some(';');
    }
    // A comma next to a tab separates cells, and the tab only aligns them. All other commas are in the cells.
    let aligned = |cell: &str| cell.trim().starts_with(',') || cell.trim().ends_with(',');
    if bare.trim().contains('\t') && !bare.trim().split('\t').any(aligned) {
        return Some('\t');
    }
    // A decimal comma is before a digit. In "0, 0" the comma separates cells.
    let decimal = |cell: &str| !cell.ends_with(',') && cell.replacen(',', ".", 1).parse::<f64>().is_ok();
    let mut blank = bare.split_whitespace();
    let by_blanks = bare.split_whitespace().count() > 1 && blank.all(decimal);
    (bare.contains(',') && !by_blanks).then_some(',')
}

fn split(line: &str, separator: Option<char>) -> Vec<Cow<'_, str>> {
    let is_end = |c: char| separator.map_or(c.is_whitespace(), |s| c == s);
    if !line.contains('"') {
        return match separator {
            Some(s) => line.split(s).map(|cell| Cow::Borrowed(bare(cell))).collect(),
            None => line.split_whitespace().map(|cell| Cow::Borrowed(bare(cell))).collect(),
        };
    }
    let (mut cells, mut cell, mut quoted) = (Vec::new(), String::new(), false);
    let mut chars = line.chars().peekable();
    while let Some(c) = chars.next() {
        if c == '"' && quoted && chars.peek() == Some(&'"') {
            // Two quotation marks inside a quoted cell are one mark of its text.
            cell.push('"');
            chars.next();
        } else if c == '"' {
            quoted = !quoted;
        } else if !quoted && is_end(c) {
            cells.push(std::mem::take(&mut cell));
        } else {
            cell.push(c);
        }
    }
    cells.push(cell);
    if separator.is_none() {
        cells.retain(|cell| !cell.trim().is_empty());
    }
    cells.into_iter().map(|cell| Cow::Owned(bare(&cell).to_owned())).collect()
}

/// Removes blanks and single quotation marks around a cell.
fn bare(cell: &str) -> &str {
    let cell = cell.trim();
    cell.strip_prefix('\'').and_then(|rest| rest.strip_suffix('\'')).map_or(cell, str::trim)
}

/// Unit in the name of a column, or in the row below the names.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Unit {
    /// Factor to s.
    Time(f64),
    /// Factor to rad, and the number of divisions by time, if the unit has one: 0 for rad, 1 for rad/s, 2 for rad/s².
    Angle(f64, u8),
}

impl Unit {
    /// Returns the unit with this name.
    pub(crate) fn of(text: &str) -> Option<Self> {
        let text = text.to_lowercase().replace('²', "2").replace('°', "deg");
        let mut words = text.split(|c: char| !c.is_alphanumeric()).filter(|w| !w.is_empty());
        let first = words.next()?;
        let rest: String = words.collect();
        let time = match first {
            "s" | "sec" | "secs" | "second" | "seconds" => Some(1.0),
            "ms" | "msec" | "millis" | "millisecond" | "milliseconds" => Some(1e-3),
            "us" | "µs" | "μs" | "usec" | "micros" | "microsecond" | "microseconds" => Some(1e-6),
            "ns" | "nsec" | "nanos" | "nanosecond" | "nanoseconds" => Some(1e-9),
            _ => None,
        };
        if let (Some(factor), "") = (time, rest.as_str()) {
            return Some(Self::Time(factor));
        }
        let factor = match first {
            "rad" | "rads" | "radian" | "radians" => 1.0,
            "deg" | "degs" | "degree" | "degrees" => 1f64.to_radians(),
            _ => return None,
        };
        let divisions = match rest.as_str() {
            "" => 0,
            "s" | "sec" | "second" | "seconds" | "pers" | "persec" | "persecond" => 1,
            "s2" | "ss" | "sec2" | "second2" | "pers2" | "persec2" | "persecond2" => 2,
            _ => return None,
        };
        Some(Self::Angle(factor, divisions))
    }
}

/// Splits the name of a column into name and unit, both in lower case: `q1_deg`, `qd1 (deg/s)`, `time [ms]`. A unit that is not known is
/// returned as an error with its text.
pub(crate) fn named(name: &str) -> (String, Result<Option<Unit>, String>) {
    let name = name.trim().to_lowercase();
    for (open, close) in [('(', ')'), ('[', ']')] {
        if let Some((head, tail)) = name.strip_suffix(close).and_then(|name| name.rsplit_once(open))
            && !tail.chars().all(|c| c.is_ascii_digit())
        {
            let unit = Unit::of(tail).ok_or_else(|| tail.to_owned());
            return (head.trim().trim_end_matches('_').to_owned(), unit.map(Some));
        }
    }
    let unit = name.match_indices(['_', ' ']).find_map(|(i, _)| Some((i, Unit::of(&name[i + 1..])?)));
    match unit {
        Some((i, unit)) if i > 0 => (name[..i].trim_end_matches(['_', ' ']).to_owned(), Ok(Some(unit))),
        _ => (name, Ok(None)),
    }
}

/// Returns the units of a row that contains only units. Other rows give `None`.
pub(crate) fn units(cells: &[Cow<'_, str>]) -> Option<Vec<Option<Unit>>> {
    let none = |cell: &str| ["", "-", "[]", "[-]", "()", "none"].contains(&cell.to_lowercase().as_str());
    let of = |cell: &Cow<'_, str>| {
        if none(cell) { Some(None) } else { Unit::of(cell.trim_matches(['[', ']', '(', ')'])).map(Some) }
    };
    let units = cells.iter().map(of).collect::<Option<Vec<_>>>()?;
    units.iter().any(Option::is_some).then_some(units)
}

/// Returns what explains a row of `count` cells if `expected` cells are expected: numbers with a decimal comma.
pub(crate) fn decimal_comma(cells: &[Cow<'_, str>], expected: usize) -> &'static str {
    let digits = |cell: &Cow<'_, str>| cell.bytes().all(|b| b.is_ascii_digit() || b == b'-');
    if cells.len() > expected && cells.iter().all(digits) {
        "; if the numbers have a decimal comma, write a decimal point, because commas separate the columns"
    } else {
        ""
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cells(text: &str) -> Vec<Vec<Cow<'_, str>>> {
        rows(text).into_iter().map(|(_, cells)| cells).collect()
    }

    #[test]
    fn separators_quotes_and_line_ends_of_other_programs() {
        let want = [vec!["t", "q1"], vec!["0", "0.5"], vec!["1", "-2"]];
        for text in [
            "t,q1\n0,0.5\n1,-2\n",
            "\u{feff}\"t\";\"q1\"\r\n\"0\";\"0.5\"\r\n1;-2",
            "t\tq1\r0\t0.5\r\r1\t-2\r",
            "# made by x\nt q1\n\n 0   0.5\n 1,-2\n",
            "t,\tq1\n0,\t0.5\n1,\t-2\n",
            "t,q1,\n0,0.5,\n1,-2,,\n",
            "'t','q1'\n'0','0.5'\n'1','-2'\n",
        ] {
            assert_eq!(cells(text), want, "{text:?}");
        }
        assert_eq!(cells("a;\"x;\"\"y\"\"\"\n"), [vec!["a", "x;\"y\""]]);
        assert_eq!(cells("t\tq1\n0,0\t0,5\n")[1], ["0,0", "0,5"]);
        assert_eq!(cells("0, 0, 1\n")[0], ["0", "0", "1"]);
        assert_eq!(cells("t q1 q2\n0, 0, 1\n")[1], ["0", "0", "1"]);
        assert_eq!(cells("0,0 0,5\n")[0], ["0,0", "0,5"]);
    }

    #[test]
    fn units_are_read_in_any_writing() {
        for (name, base, unit) in [
            ("Q1_DEG", "q1", Some(Unit::Angle(1f64.to_radians(), 0))),
            ("qd1 (deg/s)", "qd1", Some(Unit::Angle(1f64.to_radians(), 1))),
            ("qd1_deg_per_s", "qd1", Some(Unit::Angle(1f64.to_radians(), 1))),
            ("qd1_deg_second", "qd1", Some(Unit::Angle(1f64.to_radians(), 1))),
            ("qdd1_rad_s2", "qdd1", Some(Unit::Angle(1.0, 2))),
            ("qdd1 [rad/s²]", "qdd1", Some(Unit::Angle(1.0, 2))),
            ("q1 (°)", "q1", Some(Unit::Angle(1f64.to_radians(), 0))),
            ("t_ms", "t", Some(Unit::Time(1e-3))),
            ("Time [ns]", "time", Some(Unit::Time(1e-9))),
            ("/joint_states/position[0]", "/joint_states/position[0]", None),
            ("target_q_0", "target_q_0", None),
        ] {
            assert_eq!(named(name), (base.to_owned(), Ok(unit)), "{name}");
        }
        assert_eq!(named("q1 (mm)").1, Err("mm".to_owned()));
    }
}
