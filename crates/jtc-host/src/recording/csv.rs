//! CSV files with a header that contains the units, followed by one row per sample. An unknown value is an empty
//! field. If a run did not finish, comment lines that begin with `#` report how the run ended. These lines follow
//! after all rows, so a reader that does not know comments can still read the whole table.

use std::io::{BufRead, Read, Write};
use std::path::PathBuf;

use jtc_core::JOINTS;
use jtc_wire::{Code, NodeState};

use super::{Ending, Found, RecordingError, Writer};
use crate::sample::{JointSample, Sample};

/// A value of a joint: column name without the prefix (`q1_` and so on), and accessor.
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

/// Prefixes of the comments at the end of the file.
const OUTCOME: &str = "# outcome: ";
const REASON: &str = "# reason: ";
const LOST: &str = "# lost samples: ";

/// Writer of samples as rows.
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
        let Ending { outcome, reason, lost_samples } = &self.ending;
        if !matches!(outcome.as_str(), "" | "finished") {
            writeln!(self.out, "{OUTCOME}{outcome}")?;
            if !reason.is_empty() {
                writeln!(self.out, "{REASON}{}", reason.replace(['\r', '\n'], " "))?;
            }
        }
        if *lost_samples > 0 {
            writeln!(self.out, "{LOST}{lost_samples}")?;
        }
        Ok(self.out.flush()?)
    }
}

/// Formats a number with nine decimals. Its resolution of 1 nrad is much finer than that of any sensor. The text is
/// half as long as with all digits of the number.
fn number(row: &mut String, value: f64) {
    use std::fmt::Write as _;
    if value.is_finite() {
        let rounded = (value * 1e9).round() / 1e9;
        let _ = write!(row, "{}", rounded + 0.0);
    }
}

/// Maximum length of a line, bytes. The lines that this program writes have about 1,500 bytes.
const LINE_MAX: u64 = 1 << 20;

/// Destination of the values of a column.
#[derive(Clone, Copy)]
enum Target {
    Time,
    State,
    Trajectory,
    Point,
    Errors,
    CanCurrent,
    /// Value of a joint: index of the joint, and index into [`COLUMNS`].
    Value(usize, usize),
    Node(usize),
    Internal(usize),
    /// Unknown column, which is ignored.
    Other,
}

impl Target {
    fn of(name: &str) -> Self {
        match name {
            "time_s" => Self::Time,
            "state" => Self::State,
            "tes" => Self::Trajectory,
            "point" => Self::Point,
            "errors" => Self::Errors,
            "can_current" => Self::CanCurrent,
            _ => Self::of_joint(name).unwrap_or(Self::Other),
        }
    }

    fn of_joint(name: &str) -> Option<Self> {
        let (number, column) = name.strip_prefix('q')?.split_once('_')?;
        let joint = number.parse::<usize>().ok()?.checked_sub(1).filter(|joint| *joint < JOINTS)?;
        match column {
            "fsm" => Some(Self::Node(joint)),
            "internal" => Some(Self::Internal(joint)),
            _ => Some(Self::Value(joint, COLUMNS.iter().position(|(known, _)| *known == column)?)),
        }
    }

    /// Stores the text of a field in the sample; returns `None` if the text is not a valid number.
    fn put(self, sample: &mut Sample, field: &[u8]) -> Option<()> {
        match self {
            Self::Time => sample.time_s = decimal(field)?,
            Self::State => sample.state = Code::new(whole(field)?),
            Self::Trajectory => sample.trajectory = Code::new(whole(field)?),
            Self::Point => sample.point = whole(field)?,
            Self::Errors => sample.errors = whole(field)?,
            Self::CanCurrent => sample.can_current = whole(field)?,
            Self::Value(joint, column) => {
                let value = if field.is_empty() { f64::NAN } else { decimal(field)? };
                let (joint, (_, place)) = (sample.joints.get_mut(joint)?, COLUMNS.get(column)?);
                *place(joint) = value;
            }
            Self::Node(joint) => sample.joints.get_mut(joint)?.state = NodeState::new(whole(field)?),
            Self::Internal(joint) => sample.joints.get_mut(joint)?.internal = whole(field)?,
            Self::Other => {}
        }
        Some(())
    }
}

fn whole<T: std::str::FromStr>(field: &[u8]) -> Option<T> {
    std::str::from_utf8(field).ok()?.parse().ok()
}

/// Parses a number like [`str::parse`], but faster for short numbers such as those that this program writes. The
/// digits and the power of ten are exact as floats, so only their quotient is rounded. Therefore the result is
/// correctly rounded (Clinger 1990).
fn decimal(field: &[u8]) -> Option<f64> {
    const POWERS: [f64; 16] =
        [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];
    let (negative, digits) = match field {
        [b'-', digits @ ..] => (true, digits),
        digits => (false, digits),
    };
    let (mut number, mut decimals) = (0_u64, None);
    // Numbers of 15 digits are below 2⁵³, so a float represents them exactly.
    if digits.len() <= 16 && digits.first().is_some_and(u8::is_ascii_digit) {
        for (i, byte) in digits.iter().enumerate() {
            match byte {
                b'0'..=b'9' => number = 10 * number + u64::from(byte - b'0'),
                b'.' if decimals.is_none() => decimals = Some(digits.len() - 1 - i),
                _ => return whole(field),
            }
        }
        if decimals.is_some() || digits.len() <= 15 {
            let value = number as f64 / POWERS.get(decimals.unwrap_or(0))?;
            return Some(if negative { -value } else { value });
        }
    }
    whole(field)
}

/// Reader of the lines of a file. The last line may be incomplete.
struct Lines<R> {
    file: R,
    line: Vec<u8>,
    number: usize,
}

impl<R: BufRead> Lines<R> {
    /// Returns the next line without the line ending, and `true` if the line ending was present. Returns `None` after the last line.
    fn next(&mut self) -> Result<Option<(&[u8], bool)>, RecordingError> {
        self.line.clear();
        self.number += 1;
        let read = (&mut self.file).take(LINE_MAX).read_until(b'\n', &mut self.line)?;
        let ended = self.line.pop_if(|last| *last == b'\n').is_some();
        if !ended && read as u64 == LINE_MAX {
            return Err(failure(self.number, None, "the line is too long for a recording"));
        }
        self.line.pop_if(|last| ended && *last == b'\r');
        Ok((read > 0).then_some((&self.line, ended)))
    }
}

fn failure(line: usize, column: Option<&str>, problem: &'static str) -> RecordingError {
    RecordingError::Line { path: PathBuf::new(), line, column: column.map(str::to_owned), problem }
}

/// Reads the rows in the order of the file. The columns may be in any order. Unknown columns are ignored, and values of missing columns are
/// unknown.
pub(super) fn scan(file: impl BufRead, see: &mut dyn FnMut(&Sample)) -> Result<Found, RecordingError> {
    let mut lines = Lines { file, line: Vec::new(), number: 0 };
    let Some((header, _)) = lines.next()? else {
        return Err(failure(1, None, "the file is empty"));
    };
    let header = String::from_utf8_lossy(header).into_owned();
    let columns: Vec<(&str, Target)> =
        header.split(',').map(str::trim).map(|name| (name, Target::of(name))).collect();
    if !columns.iter().any(|(_, target)| matches!(target, Target::Time)) {
        return Err(failure(1, None, "not a recording: the header has no column time_s"));
    }
    let mut ending = Ending::default();
    let (mut in_motion, mut within_line) = (false, false);
    while let Some((row, ended)) = lines.next()? {
        let row = row.trim_ascii();
        if !ended {
            // A line without a line ending was not written completely.
            within_line = !row.is_empty();
            break;
        }
        if row.is_empty() {
            continue;
        }
        if row.starts_with(b"#") {
            take_comment(&mut ending, &String::from_utf8_lossy(row));
            continue;
        }
        let mut sample = Sample::default();
        let mut fields = row.split(|byte| *byte == b',');
        for (name, target) in &columns {
            let problem = match fields.next() {
                None => "the row ends before this column",
                Some(field) if target.put(&mut sample, field.trim_ascii()).is_none() => "not a number",
                Some(_) => continue,
            };
            return Err(failure(lines.number, Some(name), problem));
        }
        in_motion = sample.is_operating();
        see(&sample);
    }
    let cut = if within_line {
        Some("the file is incomplete: it ends within a line")
    } else if in_motion && ending.outcome.is_empty() {
        Some("the file is incomplete: it ends while the arm moves")
    } else {
        None
    };
    Ok(Found { info: None, ending, cut: cut.map(str::to_owned) })
}

/// Reads the reason for the end of the run from a comment.
fn take_comment(ending: &mut Ending, row: &str) {
    for (head, value) in [(OUTCOME, &mut ending.outcome), (REASON, &mut ending.reason)] {
        if let Some(text) = row.strip_prefix(head) {
            *value = text.trim().to_owned();
        }
    }
    if let Some(text) = row.strip_prefix(LOST) {
        ending.lost_samples = text.trim().parse().unwrap_or(0);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn numbers_are_read_as_the_standard_library_reads_them(
            text in prop_oneof!["-?[0-9]{1,9}(\\.[0-9]{0,9})?", "[-+.eE0-9]{0,20}", "-?[0-9]{1,3}(\\.[0-9]{0,12})?", "NaN|inf|-inf"],
        ) {
            let (read, standard) = (decimal(text.as_bytes()), text.parse::<f64>().ok());
            prop_assert_eq!(read.map(f64::to_bits), standard.map(f64::to_bits), "{}", text);
        }
    }
}
