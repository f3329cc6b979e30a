//! Tables of numbers with a header line, and tables in the format of existing programs. Existing programs use 19 columns of int16 or float
//! without a header.

use std::fmt::Write as _;

use jtc_core::JOINTS;
use jtc_wire::RawPoint;

use super::fit::{FitError, Samples};
use super::{Form, Loaded, Point, ScaleError, Trajectory};
use crate::file::{FileError, Place, number, rows, short};
use crate::waypoints;

/// Number of columns in the formats without a header: 1 time, 6 positions, 6 velocities and 6 accelerations.
const COLUMNS: usize = 1 + 3 * JOINTS;

pub(super) fn read(text: &str) -> Result<Loaded, FileError> {
    let Some((line, first)) = rows(text).next() else {
        return Err(FileError::form("the file is empty, not a trajectory"));
    };
    let headed = first.iter().any(|c| c.chars().any(|c| c.is_alphabetic()) && c.parse::<f64>().is_err());
    if headed {
        return with_header(text, line, &first);
    }
    match first.len() {
        COLUMNS => {}
        22 => {
            let problem = "22 columns: the older form for seven axes, which this controller does not support";
            return Err(FileError::at(Place::line(line), problem));
        }
        n => {
            let names = |parts: &[&str]| {
                let names = parts.iter().flat_map(|p| (1..=JOINTS).map(move |j| format!(",{p}{j}")));
                "t".to_owned() + &names.collect::<String>()
            };
            let guess = match n {
                JOINTS => Some((names(&["q"]), "a time in front of each line and ")),
                7 => Some((names(&["q"]), "")),
                13 => Some((names(&["q", "qd"]), "")),
                _ => None,
            };
            let help = guess.map_or(
                "expected 19 columns without a header (time, 6 positions, 6 velocities, 6 accelerations), or a header \
                 t,q1..q6[,qd1..qd6][,qdd1..qdd6]"
                    .to_owned(),
                |(header, more)| format!("the header is missing: write {more}the line {header} before all others"),
            );
            return Err(FileError::at(Place::line(line), format!("{n} columns without a header; {help}")));
        }
    }
    // Only the float format contains decimal points, and it contains them in every file.
    let whole = rows(text)
        .all(|(_, cells)| cells.iter().all(|c| c.bytes().all(|b| b.is_ascii_digit() || b"+-".contains(&b))));
    if whole { int16(text) } else { float(text) }
}

fn width(line: usize, cells: &[&str], want: usize) -> Result<(), FileError> {
    if cells.len() == want {
        return Ok(());
    }
    Err(FileError::at(
        Place::line(line),
        format!("{} columns, but the lines before have {want}", cells.len()),
    ))
}

fn int16(text: &str) -> Result<Loaded, FileError> {
    let mut points = Vec::new();
    let mut times: Vec<(usize, i64)> = Vec::new();
    for (line, cells) in rows(text) {
        width(line, &cells, COLUMNS)?;
        let time = cells[0].parse::<i64>().map_err(|_| {
            FileError::at(
                Place::cell(line, 1).named("time"),
                format!("\"{}\" is not a time in ms", short(cells[0])),
            )
        })?;
        times.push((line, time));
        let mut raw = [0i16; 3 * JOINTS];
        for (c, (to, cell)) in raw.iter_mut().zip(&cells[1..]).enumerate() {
            *to = cell.parse().map_err(|_| {
                let problem = format!("\"{}\" is not an int16, expected -32768..32767", short(cell));
                FileError::at(Place::cell(line, c + 2).named(channel_name(c)), problem)
            })?;
        }
        let part = |from: usize| std::array::from_fn(|j| raw[from + j]);
        let raw = RawPoint { position: part(0), velocity: part(JOINTS), acceleration: part(2 * JOINTS) };
        points.push(Point::from(&raw));
    }
    let mut notes = Vec::new();
    let step_ms = match times[..] {
        [(_, first), (line, second), ..] => match second.checked_sub(first) {
            Some(step @ 1..=1000) => step as u16,
            _ => {
                let problem =
                    format!("the step from {first} ms to {second} ms is out of range, expected 1 to 1000 ms");
                return Err(FileError::at(Place::cell(line, 1).named("time"), problem));
            }
        },
        _ => 10,
    };
    let odd = times.windows(2).find(|w| w[1].1.checked_sub(w[0].1) != Some(i64::from(step_ms)));
    if let Some([before, after]) = odd {
        notes.push(format!(
            "the time column does not advance by {step_ms} ms at line {} ({} after {}): as in existing programs, the column is ignored, and each \
             step is {step_ms} ms",
            after.0, after.1, before.1
        ));
    }
    Ok(Loaded {
        trajectory: Trajectory { step_ms, points },
        form: Form::Int16,
        notes,
        overshoot: Vec::new(),
        units_named: true,
    })
}

fn float(text: &str) -> Result<Loaded, FileError> {
    let mut samples =
        Samples { velocity: Some(Vec::new()), acceleration: Some(Vec::new()), ..Samples::default() };
    let mut lines = Vec::new();
    for (line, cells) in rows(text) {
        width(line, &cells, COLUMNS)?;
        let mut row = [0.0; COLUMNS];
        for (c, (to, cell)) in row.iter_mut().zip(&cells).enumerate() {
            let name = || if c == 0 { "time".to_owned() } else { channel_name(c - 1) };
            *to = number(cell, || Place::cell(line, c + 1).named(name()))?;
        }
        lines.push(line);
        samples.push(row[0], |c| row[1 + c]);
    }
    finish(samples, &lines, Form::Float)
}

impl Samples {
    fn push(&mut self, time: f64, value: impl Fn(usize) -> f64) {
        let part = |from: usize| std::array::from_fn(|j| value(from + j));
        self.times.push(time);
        self.position.push(part(0));
        if let Some(v) = &mut self.velocity {
            v.push(part(JOINTS));
        }
        if let Some(a) = &mut self.acceleration {
            a.push(part(2 * JOINTS));
        }
    }
}

fn finish(samples: Samples, lines: &[usize], form: Form) -> Result<Loaded, FileError> {
    let times = samples.times.clone();
    match samples.fit() {
        Ok(fitted) => Ok(Loaded::fitted(fitted, form)),
        Err(FitError::Time(i)) => {
            let problem = format!("{} s is not after {} s of the line before", times[i], times[i - 1]);
            Err(FileError::at(Place::line(lines[i]).named("time"), problem))
        }
        Err(other) => Err(FileError::form(other.to_string())),
    }
}

/// Returns the name of column `c`. The time column is not counted.
fn channel_name(c: usize) -> String {
    format!("{}{}", ["q", "qd", "qdd"][c / JOINTS % 3], c % JOINTS + 1)
}

/// Returns the number of the column for a name in a header, and the conversion factor of the unit in this name. Column 0 is the time. All
/// other columns are in the order of the formats without a header.
fn column_of(name: &str) -> Option<(usize, f64)> {
    let name = name.trim_matches(|c: char| c == '"' || c.is_whitespace()).to_ascii_lowercase();
    if ["t", "t_s", "time", "time_s", "time_from_start"].contains(&name.as_str()) {
        return Some((0, 1.0));
    }
    // The name may contain a unit, as in q1_rad, qd1_rad_s, qdd1_rad_s2, q1_deg, qd1_deg_s, qdd1_deg_s2.
    let (name, unit) = match (name.split_once("_rad"), name.split_once("_deg")) {
        (Some((head, _)), _) => (head, 1.0),
        (None, Some((head, _))) => (head, 1f64.to_radians()),
        (None, None) => (name.as_str(), 1.0),
    };
    (0..3 * JOINTS).find(|c| channel_name(*c) == name).map(|c| (c + 1, unit))
}

fn with_header(text: &str, header_line: usize, header: &[&str]) -> Result<Loaded, FileError> {
    let mut place_of = [None; COLUMNS];
    for (i, name) in header.iter().enumerate() {
        let at = |problem: &str| {
            FileError::at(
                Place::cell(header_line, i + 1).named(format!("\"{}\"", short(name))),
                problem.to_owned(),
            )
        };
        let (column, unit) = column_of(name).ok_or_else(|| {
            at(if waypoints::is_column(name) {
                "a column of waypoints, not of a trajectory: `jtc plan` makes a trajectory from waypoints"
            } else {
                "unknown column, expected t, q1..q6 (rad) or q1_deg..q6_deg, qd1..qd6 (rad/s), qdd1..qdd6 (rad/s²)"
            })
        })?;
        if place_of[column].replace((i, unit)).is_some() {
            return Err(at("this column occurs twice"));
        }
    }
    let missing = |from: usize| (from..from + JOINTS).find(|c| place_of[*c].is_none());
    let none = |from: usize| (from..from + JOINTS).all(|c| place_of[c].is_none());
    if place_of[0].is_none() {
        return Err(FileError::at(
            Place::line(header_line),
            "column t (time in s) is missing; `jtc plan` makes a trajectory from waypoints without times",
        ));
    }
    for from in [1, 1 + JOINTS, 1 + 2 * JOINTS] {
        if let Some(c) = missing(from).filter(|_| from == 1 || !none(from)) {
            return Err(FileError::at(
                Place::line(header_line),
                format!("column {} is missing", channel_name(c - 1)),
            ));
        }
    }
    let has = |from: usize| (!none(from)).then(Vec::new);
    let mut samples =
        Samples { velocity: has(1 + JOINTS), acceleration: has(1 + 2 * JOINTS), ..Samples::default() };
    if samples.velocity.is_none() && samples.acceleration.is_some() {
        return Err(FileError::at(Place::line(header_line), "qdd1..qdd6 without qd1..qd6"));
    }
    let mut lines = Vec::new();
    for (line, cells) in rows(text).skip(1) {
        width(line, &cells, header.len())?;
        let mut row = [0.0; COLUMNS];
        for (to, place) in row.iter_mut().zip(&place_of) {
            if let Some((i, unit)) = place {
                *to = unit * number(cells[*i], || Place::cell(line, i + 1).named(header[*i]))?;
            }
        }
        lines.push(line);
        samples.push(row[0], |c| row[1 + c]);
    }
    if lines.is_empty() {
        return Err(FileError::at(Place::line(header_line), "the file has a header but no points"));
    }
    let named = |name: &&str| ["_rad", "_deg"].iter().any(|unit| name.to_ascii_lowercase().contains(unit));
    let loaded = finish(samples, &lines, Form::Csv)?;
    Ok(Loaded { units_named: header.iter().any(named), ..loaded })
}

impl Trajectory {
    /// Returns the trajectory as CSV with a header, with all channels at full precision.
    pub fn to_csv(&self) -> String {
        self.csv_with(|v| format!(",{v}"))
    }

    /// Like [`Trajectory::to_csv`], with 17 significant digits in each number.
    pub fn to_exact_csv(&self) -> String {
        // The addition of zero changes −0 to 0.
        self.csv_with(|v| format!(",{:.16e}", v + 0.0))
    }

    /// Returns the trajectory in the format of 19 columns of integers without a header. The values are exactly the integers that the
    /// trajectory frames contain.
    ///
    /// # Errors
    ///
    /// Returns the first value that does not fit into a trajectory frame.
    pub fn to_int16_csv(&self) -> Result<String, ScaleError> {
        let mut out = String::new();
        for (i, raw) in self.raw()?.iter().enumerate() {
            let _ = write!(out, "{}", i * usize::from(self.step_ms));
            for v in raw.position.iter().chain(&raw.velocity).chain(&raw.acceleration) {
                let _ = write!(out, ",{v}");
            }
            out.push('\n');
        }
        Ok(out)
    }

    fn csv_with(&self, number: impl Fn(f64) -> String) -> String {
        let mut out = String::from("t");
        for c in 0..3 * JOINTS {
            let _ = write!(out, ",{}", channel_name(c));
        }
        out.push('\n');
        for (i, p) in self.points.iter().enumerate() {
            let _ = write!(out, "{}", (i * usize::from(self.step_ms)) as f64 / 1000.0);
            for v in p.position.iter().chain(&p.velocity).chain(&p.acceleration) {
                out += &number(*v);
            }
            out.push('\n');
        }
        out
    }
}
