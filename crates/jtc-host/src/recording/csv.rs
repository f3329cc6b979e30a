//! CSV files: a header with units, then one row a sample; an unknown value is an empty field. The end of a run that was not finished stands in
//! lines that begin with `#`, behind all rows: readers that know no comments have the whole table before them.

use std::io::Write;
use std::path::PathBuf;

use jtc_wire::{Code, NodeState};

use super::{Ending, Recording, RecordingError, Writer};
use crate::sample::{JointSample, Sample};

/// A number of a joint: column name after `q1_`…, and how to reach it.
type Column = (&'static str, fn(&mut JointSample) -> &mut f64);

const COLUMNS: [Column; 13] = [
    ("set_position_rad", |j| &mut j.set_position),
    ("set_velocity_rad_s", |j| &mut j.set_velocity),
    ("set_acceleration_rad_s2", |j| &mut j.set_acceleration),
    ("position_rad", |j| &mut j.position),
    ("velocity_rad_s", |j| &mut j.velocity),
    ("error_rad", |j| &mut j.error),
    ("torque_model_nm", |j| &mut j.torque_model),
    ("torque_p_nm", |j| &mut j.torque_p),
    ("torque_i_nm", |j| &mut j.torque_i),
    ("torque_d_nm", |j| &mut j.torque_d),
    ("torque_friction_nm", |j| &mut j.torque_friction),
    ("torque_nm", |j| &mut j.torque),
    ("temperature_c", |j| &mut j.temperature),
];

const SAMPLE_COLUMNS: [&str; 6] = ["time_s", "state", "tes", "point", "errors", "can_current"];

/// How the comments at the end begin.
const OUTCOME: &str = "# outcome: ";
const REASON: &str = "# reason: ";

/// Writes samples as rows.
pub(super) struct CsvWriter<W: Write> {
    out: W,
    row: String,
    ending: Ending,
}

impl<W: Write> CsvWriter<W> {
    pub(super) fn new(mut out: W, ending: Ending) -> Result<Self, RecordingError> {
        let mut header: Vec<String> = SAMPLE_COLUMNS.map(String::from).to_vec();
        for j in 1..=6 {
            header.extend(COLUMNS.map(|(name, _)| format!("q{j}_{name}")));
            header.extend([format!("q{j}_fsm"), format!("q{j}_internal")]);
        }
        writeln!(out, "{}", header.join(","))?;
        Ok(Self { out, row: String::new(), ending })
    }
}

impl<W: Write + Send> Writer for CsvWriter<W> {
    fn write(&mut self, s: &Sample) -> Result<(), RecordingError> {
        use std::fmt::Write as _;
        let row = &mut self.row;
        row.clear();
        number(row, s.time_s);
        let _ = write!(
            row,
            ",{},{},{},{},{}",
            s.state.byte(),
            s.trajectory.byte(),
            s.point,
            s.errors,
            s.can_current
        );
        for mut joint in s.joints {
            for (_, field) in COLUMNS {
                row.push(',');
                number(row, *field(&mut joint));
            }
            let _ = write!(row, ",{},{}", joint.state.code(), joint.internal);
        }
        row.push('\n');
        self.out.write_all(row.as_bytes())?;
        Ok(())
    }

    fn flush(&mut self) -> Result<(), RecordingError> {
        Ok(self.out.flush()?)
    }

    fn end(&mut self, ending: &Ending) -> Result<(), RecordingError> {
        self.ending = ending.clone();
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Result<(), RecordingError> {
        let Ending { outcome, reason } = &self.ending;
        if !matches!(outcome.as_str(), "" | "finished") {
            writeln!(self.out, "{OUTCOME}{outcome}")?;
            if !reason.is_empty() {
                writeln!(self.out, "{REASON}{}", reason.replace(['\r', '\n'], " "))?;
            }
        }
        Ok(self.out.flush()?)
    }
}

/// To the ninth decimal: 1 nrad, far below what any sensor resolves, at half the size of all digits.
fn number(row: &mut String, value: f64) {
    use std::fmt::Write as _;
    if value.is_finite() {
        let rounded = (value * 1e9).round() / 1e9;
        let _ = write!(row, "{}", rounded + 0.0);
    }
}

/// Reads rows back; columns may stand in any order, unknown ones are passed over, missing ones leave values unknown.
pub(super) fn read(bytes: &[u8]) -> Result<Recording, RecordingError> {
    let text = String::from_utf8_lossy(bytes);
    // Every line that was written whole has its end.
    let whole = text.rfind('\n').map_or(0, |end| end + 1);
    let (rows, rest) = if whole == 0 { (&*text, "") } else { text.split_at(whole) };
    let mut lines = rows.lines().enumerate();
    let fail = |line, column: Option<&str>, problem| RecordingError::Line {
        path: PathBuf::new(),
        line,
        column: column.map(str::to_owned),
        problem,
    };
    let Some((_, header)) = lines.next() else {
        return Err(fail(1, None, "the file is empty"));
    };
    let names: Vec<&str> = header.split(',').map(str::trim).collect();
    if !names.contains(&"time_s") {
        return Err(fail(1, None, "no recording: its header has no column time_s"));
    }
    let mut samples = Vec::new();
    let mut ending = Ending::default();
    for (i, row) in lines.filter(|(_, row)| !row.trim().is_empty()) {
        if row.starts_with('#') {
            for (head, value) in [(OUTCOME, &mut ending.outcome), (REASON, &mut ending.reason)] {
                if let Some(text) = row.strip_prefix(head) {
                    *value = text.trim().to_owned();
                }
            }
            continue;
        }
        let mut sample = Sample::default();
        let mut fields = row.split(',');
        for name in &names {
            let field =
                fields.next().ok_or_else(|| fail(i + 1, Some(name), "the row ends before this column"))?;
            put(&mut sample, name, field.trim()).ok_or_else(|| fail(i + 1, Some(name), "not a number"))?;
        }
        samples.push(sample);
    }
    let in_motion = samples.last().is_some_and(Sample::is_operating);
    let cut = if !rest.trim().is_empty() {
        Some("the file breaks off within a line")
    } else if in_motion && ending.outcome.is_empty() {
        Some("the file breaks off while the arm moves")
    } else {
        None
    };
    Ok(Recording::new(None, ending, samples, cut.map(str::to_owned)))
}

fn put(sample: &mut Sample, name: &str, field: &str) -> Option<()> {
    match name {
        "time_s" => sample.time_s = field.parse().ok()?,
        "state" => sample.state = Code::new(field.parse().ok()?),
        "tes" => sample.trajectory = Code::new(field.parse().ok()?),
        "point" => sample.point = field.parse().ok()?,
        "errors" => sample.errors = field.parse().ok()?,
        "can_current" => sample.can_current = field.parse().ok()?,
        _ => {
            let joint = name.strip_prefix('q').and_then(|n| n.split_once('_'));
            let Some((number, column)) = joint else { return Some(()) };
            let index = number.parse::<usize>().ok().and_then(|n| n.checked_sub(1));
            let Some(joint) = index.and_then(|i| sample.joints.get_mut(i)) else { return Some(()) };
            match column {
                "fsm" => joint.state = NodeState::new(field.parse().ok()?),
                "internal" => joint.internal = field.parse().ok()?,
                _ => {
                    let Some((_, value)) = COLUMNS.iter().find(|(c, _)| *c == column) else {
                        return Some(());
                    };
                    *value(joint) = if field.is_empty() { f64::NAN } else { field.parse().ok()? };
                }
            }
        }
    }
    Some(())
}
