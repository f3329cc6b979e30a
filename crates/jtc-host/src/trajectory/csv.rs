//! Tables of numbers with a header line, and tables in the format of existing programs. Existing programs use 19 columns of int16 or float
//! without a header.

use std::fmt::Write as _;

use jtc_core::JOINTS;
use jtc_wire::{POSITION_SCALE, RawPoint};

use super::fit::{FitError, Samples};
use super::{ArmNames, Form, Loaded, Point, ScaleError, Trajectory, header, times};
use crate::file::{FileError, Place, number, short};
use crate::table::{self, Row, rows};

/// Largest position that could be a number of whole rad.
const SMALL: f64 = 3.0;

/// Number of columns in the formats without a header: 1 time, 6 positions, 6 velocities and 6 accelerations.
const COLUMNS: usize = 1 + 3 * JOINTS;

pub(super) fn read(text: &str, names: Option<ArmNames<'_>>) -> Result<Loaded, FileError> {
    let rows = rows(text);
    let Some((line, first)) = rows.first() else {
        return Err(FileError::form("the file is empty, not a trajectory"));
    };
    let line = *line;
    let headed = first.iter().any(|c| c.chars().any(|c| c.is_alphabetic()) && c.parse::<f64>().is_err());
    if headed {
        return with_header(&rows, names);
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
    let whole = rows
        .iter()
        .all(|(_, cells)| cells.iter().all(|c| c.bytes().all(|b| b.is_ascii_digit() || b"+-".contains(&b))));
    if whole { int16(&rows) } else { float(&rows) }
}

fn width((line, cells): &Row<'_>, want: usize) -> Result<(), FileError> {
    if cells.len() == want {
        return Ok(());
    }
    let why = table::decimal_comma(cells, want);
    let problem = format!("{} columns, but the lines before have {want}{why}", cells.len());
    Err(FileError::at(Place::line(*line), problem))
}

fn int16(rows: &[Row<'_>]) -> Result<Loaded, FileError> {
    let mut points = Vec::new();
    let mut times: Vec<(usize, i64)> = Vec::new();
    for row in rows {
        width(row, COLUMNS)?;
        let (line, cells) = (row.0, &row.1);
        let time = cells[0].parse::<i64>().map_err(|_| {
            FileError::at(
                Place::cell(line, 1).named("time"),
                format!("\"{}\" is not a time in ms", short(&cells[0])),
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
    let largest =
        points.iter().flat_map(|p: &Point| p.position).map(|v| (v / POSITION_SCALE * 32767.0).abs());
    let largest = largest.fold(0.0, f64::max).round();
    if (1.0..=SMALL).contains(&largest) && times.len() > 1 {
        notes.push(format!(
            "19 columns of whole numbers are in the scale of the protocol (times in ms, 32767 is {POSITION_SCALE} rad), so the largest position \
             is {largest} of 32767; for s and rad, write decimal points"
        ));
    }
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

fn float(rows: &[Row<'_>]) -> Result<Loaded, FileError> {
    let mut samples =
        Samples { velocity: Some(Vec::new()), acceleration: Some(Vec::new()), ..Samples::default() };
    let mut lines = Vec::new();
    for row in rows {
        width(row, COLUMNS)?;
        let (line, cells) = (row.0, &row.1);
        let mut values = [0.0; COLUMNS];
        for (c, (to, cell)) in values.iter_mut().zip(cells).enumerate() {
            let name = || if c == 0 { "time".to_owned() } else { channel_name(c - 1) };
            *to = number(cell, || Place::cell(line, c + 1).named(name()))?;
        }
        lines.push(line);
        samples.push(values[0], |c| values[1 + c]);
    }
    let notes = times::in_seconds(&mut samples.times, "time", true)?;
    finish(samples, notes, &lines, Form::Float)
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

fn finish(
    samples: Samples,
    mut notes: Vec<String>,
    lines: &[usize],
    form: Form,
) -> Result<Loaded, FileError> {
    let times = samples.times.clone();
    match samples.fit() {
        Ok(fitted) => {
            let mut loaded = Loaded::fitted(fitted, form);
            notes.append(&mut loaded.notes);
            Ok(Loaded { notes, ..loaded })
        }
        Err(FitError::Time(i)) => {
            let problem = format!("{} s is not after {} s of the line before", times[i], times[i - 1]);
            Err(FileError::at(Place::line(lines[i]).named("time"), problem))
        }
        Err(other) => Err(FileError::form(other.to_string() + times::hint(&times, &other, true))),
    }
}

/// Returns the name of column `c`. The time column is not counted.
fn channel_name(c: usize) -> String {
    format!("{}{}", ["q", "qd", "qdd"][c / JOINTS % 3], c % JOINTS + 1)
}

fn with_header(rows: &[Row<'_>], names: Option<ArmNames<'_>>) -> Result<Loaded, FileError> {
    let header = header::Header::of(rows, names)?;
    let [_, velocity, acceleration] = &header.channels;
    let list = |channel: &Option<_>| channel.is_some().then(Vec::new);
    let mut samples =
        Samples { velocity: list(velocity), acceleration: list(acceleration), ..Samples::default() };
    let mut lines = Vec::new();
    for row in &rows[header.rows..] {
        let (line, cells) = (row.0, &row.1);
        width(row, header.names.len())?;
        if let Some(i) = header.joint_names.iter().find(|i| cells[**i] != rows[header.rows].1[**i]) {
            let problem = format!("\"{}\", but the lines before have another joint", short(&cells[*i]));
            return Err(FileError::at(Place::cell(line, i + 1).named(short(&header.names[*i])), problem));
        }
        let value = |i: usize| number(&cells[i], || Place::cell(line, i + 1).named(short(&header.names[i])));
        let mut values = [0.0; COLUMNS];
        for (c, channel) in header.channels.iter().enumerate() {
            for (j, (i, unit)) in channel.iter().flatten().enumerate() {
                values[c * JOINTS + j] = unit * value(*i)?;
            }
        }
        lines.push(line);
        samples.push(value(header.time.0)?, |c| values[c]);
    }
    if lines.is_empty() {
        let problem = format!("the file has a header but no points{}", header.left_out_words("; "));
        return Err(FileError::at(Place::line(rows[0].0), problem));
    }
    let mut notes = header.notes.clone();
    match header.time.1 {
        Some(unit) => samples.times.iter_mut().for_each(|t| *t *= unit),
        None => notes.append(&mut times::in_seconds(&mut samples.times, &header.names[header.time.0], true)?),
    }
    let loaded = finish(samples, notes, &lines, Form::Csv)?;
    Ok(Loaded { units_named: header.angles_named, ..loaded })
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
