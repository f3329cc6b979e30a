//! Trajectory file of a hand-guided motion. The command writes the file during teaching, so that the file is valid even if the program
//! is killed.

use std::fmt::Write as _;
use std::fs::File;
use std::io::{Seek, Write};

use cli_kit::{Failure, OutputFile};
use jtc_host::waypoints::{self, thinned};

use crate::failure::recording_interrupted;

/// Largest joint movement of an arm that is considered to be at rest, rad.
const STILL: f64 = 0.002;
/// Interval of the statuses of the controller, s. The rows of the file have the same interval. The command uses the clock of the host
/// only to detect lost statuses.
const GRID_S: f64 = 0.04;
/// Smallest number of rows in the file of a motion.
const LEAST: usize = 3;
const HEADER: &str = "t,q1,q2,q3,q4,q5,q6\n";

/// Row of the trajectory file with one pose.
struct Row {
    position: [f64; 6],
    /// Length of the file up to the end of this row, bytes.
    end: usize,
}

/// Trajectory file of a motion: one row at rest, the rows of the motion, and one row at rest.
pub(super) struct TaughtFile {
    name: String,
    output: Option<OutputFile>,
    file: Option<File>,
    text: String,
    rows: Vec<Row>,
    /// First pose of the arm at rest before the motion, and the number of the last interval of the grid (`GRID_S`) in
    /// which the arm was at rest.
    rest: Option<([f64; 6], i64)>,
    start_slot: i64,
    last_slot: i64,
}

impl TaughtFile {
    /// Creates the trajectory file from an output file, which stays unchanged until the arm moves.
    pub(super) fn new(output: OutputFile) -> Self {
        Self {
            name: output.name(),
            output: Some(output),
            file: None,
            text: HEADER.to_owned(),
            rows: Vec::new(),
            rest: None,
            start_slot: 0,
            last_slot: -1,
        }
    }

    /// Returns the name of the file for messages to the user.
    pub(super) fn name(&self) -> &str {
        &self.name
    }

    /// Returns `true` if the file contains a motion.
    pub(super) fn is_begun(&self) -> bool {
        self.file.is_some()
    }

    /// Adds the pose at a time (s). If the arm has moved, the function writes the pose to the file before it returns.
    pub(super) fn take(&mut self, time_s: f64, position: [f64; 6]) -> Result<(), Failure> {
        let slot = (time_s / GRID_S).round() as i64;
        if slot <= self.last_slot {
            return Ok(());
        }
        self.last_slot = slot;
        let (rest, rested) = *self.rest.get_or_insert((position, slot));
        if self.rows.is_empty() {
            if !moved(&position, &rest) {
                self.rest = Some((rest, slot));
                return Ok(());
            }
            self.start_slot = rested;
            self.row(rested, rest);
        }
        let before = self.text.len();
        self.row(slot, position);
        let fresh = match &self.file {
            Some(_) => before,
            None if self.in_motion() >= LEAST => {
                self.file = self.output.take().map(|mut output| output.begin()).transpose()?;
                0
            }
            None => return Ok(()),
        };
        let Some(file) = &mut self.file else { return Ok(()) };
        let done = file.write_all(&self.text.as_bytes()[fresh..]);
        done.map_err(|e| recording_interrupted(Failure::usage(format!("{}: {e}", self.name))))
    }

    fn row(&mut self, slot: i64, position: [f64; 6]) {
        let _ = write!(self.text, "{:.3}", (slot - self.start_slot) as f64 * GRID_S);
        for v in position {
            let _ = write!(self.text, ",{v:.6}");
        }
        self.text.push('\n');
        self.rows.push(Row { position, end: self.text.len() });
    }

    /// Returns the number of rows up to the end of the motion, plus one row at rest.
    fn in_motion(&self) -> usize {
        let Some(last) = self.rows.last() else { return 0 };
        let moving = self.rows.iter().rposition(|row| moved(&row.position, &last.position));
        moving.map_or(0, |i| i + 2).min(self.rows.len())
    }

    /// Removes the rows of the final time at rest, and describes the contents of the file. Returns `None` if the arm did not move, so that
    /// the file has no row. If a tolerance (rad) is specified, waypoints replace the motion.
    pub(super) fn finish(self, thin: Option<f64>) -> Result<Option<String>, Failure> {
        let kept = self.in_motion();
        let Self { name, file, mut text, mut rows, .. } = self;
        let Some(mut file) = file else { return Ok(None) };
        if kept >= LEAST {
            text.truncate(rows[kept - 1].end);
            rows.truncate(kept);
        }
        if let Some(tolerance) = thin {
            let positions: Vec<[f64; 6]> = rows.iter().map(|row| row.position).collect();
            let kept = thinned(&positions, tolerance);
            text = waypoints::to_csv(kept.iter().filter_map(|i| positions.get(*i)));
        }
        let mut settle = || {
            if file.metadata()?.is_file() {
                if thin.is_some() {
                    file.rewind()?;
                    file.write_all(text.as_bytes())?;
                }
                file.set_len(text.len() as u64)?;
                file.sync_all()?;
            }
            Ok(())
        };
        settle()
            .map_err(|e: std::io::Error| recording_interrupted(Failure::usage(format!("{name}: {e}"))))?;
        Ok(Some(text))
    }
}

fn moved(a: &[f64; 6], b: &[f64; 6]) -> bool {
    a.iter().zip(b).any(|(x, y)| (x - y).abs() > STILL)
}

#[cfg(test)]
mod tests {
    use super::*;
    use cli_kit::ErrorKind;
    use jtc_host::trajectory::Loaded;

    /// Returns the pose at step `k` of a motion that rests for 0.4 s, moves to 0.5 rad in 1 s, and rests for 0.4 s.
    fn pose(k: u32) -> [f64; 6] {
        let u = ((f64::from(k) - 10.0) / 25.0).clamp(0.0, 1.0);
        [0.0, 0.5 * u * u * (3.0 - 2.0 * u), 0.0, 0.0, 0.0, 0.0]
    }

    #[test]
    fn what_was_led_is_in_the_file_before_anybody_ends_it() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("taught.csv");
        std::fs::write(&path, "precious").unwrap();
        let mut taught = TaughtFile::new(OutputFile::open(&path, true, &[]).unwrap());
        for k in 0..8 {
            taught.take(f64::from(k) * GRID_S, pose(k)).unwrap();
        }
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "precious", "the arm stands still");
        for k in 8..45 {
            taught.take(f64::from(k) * GRID_S, pose(k)).unwrap();
            if k >= 14 {
                let led = Loaded::load(&path, None).unwrap();
                let last = led.trajectory.points.last().unwrap().position[1];
                assert!((last - pose(k)[1]).abs() < 1e-6, "{k}: {last}");
            }
        }
        let text = taught.finish(None).unwrap().unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
        let led = Loaded::load(&path, None).unwrap().trajectory;
        assert!((0.9..=1.16).contains(&led.duration_s()), "{} s", led.duration_s());
        assert!(
            led.points[0].position[1].abs() < 1e-9
                && (led.points.last().unwrap().position[1] - 0.5).abs() < 0.002
        );
    }

    /// The command reduces a motion on a straight path to its two end points, even if the speed varies. The waypoints
    /// replace the recorded motion in the file.
    #[test]
    fn a_motion_by_hand_becomes_waypoints() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("waypoints.csv");
        let mut taught = TaughtFile::new(OutputFile::open(&path, false, &[]).unwrap());
        for k in 0..45 {
            taught.take(f64::from(k) * GRID_S, pose(k)).unwrap();
        }
        taught.finish(Some(0.01)).unwrap().unwrap();
        let read = waypoints::WaypointFile::load(&path).unwrap();
        let positions = read.positions(&jtc_host::Arm::avena()).unwrap();
        assert_eq!(positions.len(), 2, "{:?}", std::fs::read_to_string(&path));
        assert!(positions[0].position[1].abs() < 1e-9 && (positions[1].position[1] - 0.5).abs() < 0.002);
    }

    #[test]
    fn an_arm_that_was_not_moved_leaves_no_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("taught.csv");
        let mut taught = TaughtFile::new(OutputFile::open(&path, false, &[]).unwrap());
        for k in 0..50 {
            taught.take(f64::from(k) * GRID_S, [0.001 * f64::from(k % 2); 6]).unwrap();
        }
        assert!(!taught.is_begun() && taught.finish(None).unwrap().is_none());
        assert!(!path.exists());
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_disk_is_known_at_once() {
        let output = OutputFile::open(std::path::Path::new("/dev/full"), false, &[]).unwrap();
        let mut taught = TaughtFile::new(output);
        let failure = (0..45).find_map(|k| taught.take(f64::from(k) * GRID_S, pose(k)).err()).unwrap();
        assert_eq!(failure.kind, ErrorKind::Fault);
        assert!(failure.message.contains("No space left"), "{}", failure.message);
    }
}
