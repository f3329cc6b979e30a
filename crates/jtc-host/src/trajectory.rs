//! Trajectories of points at a fixed time step. This module reads trajectories from common file formats.

mod columns;
mod csv;
pub(crate) mod document;
pub mod fit;
mod header;
mod joints;
pub(crate) mod message;
#[cfg(test)]
mod other_columns;
#[cfg(test)]
mod other_tools;
mod overshoot;
mod replay;
mod segments;
mod spline;
mod structured;
#[cfg(test)]
mod tests;
mod times;

use std::path::Path;

pub use jtc_core::POINTS_MAX;
use jtc_core::{JOINTS, SetPoint};
use jtc_wire::{ACCELERATION_SCALE, Joint, POSITION_SCALE, RawPoint, VELOCITY_SCALE};

pub use overshoot::{Overshoot, overshoot_words};
pub use segments::UploadOptions;

use crate::file::{FileError, UNITS_KNOWN, read_text};

/// A point of a trajectory.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Point {
    /// Positions, rad.
    pub position: [f64; JOINTS],
    /// Velocities, rad/s.
    pub velocity: [f64; JOINTS],
    /// Accelerations, rad/s².
    pub acceleration: [f64; JOINTS],
}

impl From<&Point> for SetPoint {
    /// Converts the point without the rounding that a frame applies.
    fn from(p: &Point) -> Self {
        Self { position: p.position, velocity: p.velocity, acceleration: p.acceleration }
    }
}

/// Trajectory of points at a fixed time step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trajectory {
    /// Time between points, ms.
    pub step_ms: u16,
    /// Points, first to last.
    pub points: Vec<Point>,
}

/// Format of a trajectory file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Form {
    /// CSV with a header.
    Csv,
    /// 19 columns of integers, in the units of the trajectory frames.
    Int16,
    /// 19 columns of floats.
    Float,
    /// JSON in the format of this project.
    Json,
    /// `trajectory_msgs/JointTrajectory`, as YAML or JSON.
    JointTrajectory,
    /// A recording of an execution, as MCAP or CSV.
    Recording,
}

/// Trajectory that was read from a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// Trajectory.
    pub trajectory: Trajectory,
    /// Format of the file.
    pub form: Form,
    /// Messages about derived, resampled and ignored data.
    pub notes: Vec<String>,
    /// Overshoot of the curve beyond the waypoints. The list is empty if the file contains velocities.
    pub overshoot: Vec<Overshoot>,
    /// `true` if the file states the units of its numbers.
    pub units_named: bool,
}

/// Names of an arm and of its joints, for files that name the joints.
#[derive(Clone, Copy, Debug)]
pub struct ArmNames<'a> {
    /// Name of the arm. In a file, this name can precede the names of the joints.
    pub arm: &'a str,
    /// Names of the joints, base to wrist.
    pub joints: &'a [String; JOINTS],
}

impl Loaded {
    fn fitted(fitted: fit::Fitted, form: Form) -> Self {
        let fit::Fitted { trajectory, notes, overshoot } = fitted;
        Self { trajectory, form, notes, overshoot, units_named: matches!(form, Form::Json | Form::Recording) }
    }

    /// Reads a file of any of these formats. A file that names other joints than the joints of the arm is refused. Without `names`, the
    /// numbers at the ends of the names in the file determine the order of the joints.
    ///
    /// # Errors
    ///
    /// Returns an error with line and column if the file cannot be read or is not a trajectory of a known format.
    pub fn load(path: &Path, names: Option<ArmNames<'_>>) -> Result<Self, FileError> {
        if replay::is_recording(path, None) {
            return replay::load(path);
        }
        let text = read_text(path)?;
        if replay::is_recording(path, Some(&text)) {
            return replay::load(path);
        }
        let yaml = path.extension().is_some_and(|e| e == "yaml" || e == "yml");
        let read = if yaml { structured::read_yaml(&text, names) } else { Self::parse(&text, names) };
        read.map_err(|e| e.in_file(path))
    }

    /// Reads the measured motion of a recording instead of the commanded motion. The result is the last motion by hand. If the recording
    /// has no motion by hand, the result is the last execution.
    ///
    /// # Errors
    ///
    /// Returns an error if the file is not a recording, or contains no motion by hand and no execution.
    pub fn load_measured(path: &Path) -> Result<Self, FileError> {
        replay::load_measured(path)
    }

    /// Converts the values from degrees, degrees/s and degrees/s² to radians. Returns an error if the file already
    /// states its units.
    pub fn in_degrees(mut self) -> Result<Self, FileError> {
        if self.units_named {
            return Err(FileError::form(UNITS_KNOWN));
        }
        for point in &mut self.trajectory.points {
            for channel in [&mut point.position, &mut point.velocity, &mut point.acceleration] {
                *channel = channel.map(f64::to_radians);
            }
        }
        for over in &mut self.overshoot {
            over.beyond_rad = over.beyond_rad.to_radians();
            over.position_rad = over.position_rad.to_radians();
        }
        Ok(self)
    }

    /// Parses a text. The content of the text determines the format.
    ///
    /// # Errors
    ///
    /// Returns an error with line and column if the text is not a trajectory of a known format.
    pub fn parse(text: &str, names: Option<ArmNames<'_>>) -> Result<Self, FileError> {
        let start = text.trim_start_matches('\u{feff}').trim_start();
        if is_json(start) {
            structured::read_json(start, names)
        } else if is_yaml(start) {
            structured::read_yaml(start, names)
        } else {
            csv::read(text, names)
        }
    }
}

/// Returns `true` if the text is JSON. The first line of a CSV file can begin with a unit in brackets.
fn is_json(start: &str) -> bool {
    let after = start.strip_prefix('[').map(str::trim_start);
    start.starts_with('{')
        || after.is_some_and(|rest| rest.starts_with(['[', '{', '"', ']', '-']) || starts_with_digit(rest))
}

fn starts_with_digit(text: &str) -> bool {
    text.starts_with(|c: char| c.is_ascii_digit())
}

/// Returns `true` if the text is YAML: it has a key of a message, or begins with a key.
fn is_yaml(text: &str) -> bool {
    let first = text
        .lines()
        .find(|line| !line.trim().is_empty() && !line.trim_start().starts_with('#'))
        .unwrap_or_default();
    let begins =
        first.trim_end() == "---" || first.split_whitespace().next().is_some_and(|word| word.ends_with(':'));
    begins || has_message(text)
}

/// Returns `true` if the text has a key of a JointTrajectory.
fn has_message(text: &str) -> bool {
    let known = |line: &str| {
        let key = line.trim_start_matches([' ', '-']);
        ["points:", "joint_trajectory:"].iter().any(|known| key.starts_with(known))
    };
    let named = |line: &str| ["joint_names:", "\"joint_names\":"].iter().any(|key| line.contains(key));
    text.lines().filter(|line| !line.trim_start().starts_with('#')).any(|line| named(line) || known(line))
}

/// Returns `true` if the text is a trajectory in a message, or a trajectory of this project in JSON. The text is not a valid waypoint file.
pub(crate) fn is_message(text: &str) -> bool {
    let start = text.trim_start_matches('\u{feff}').trim_start();
    if is_json(start) {
        let own = || start.contains("\"position_rad\"");
        own()
            || start.contains("joint_names")
                && document::json(start).is_ok_and(|values| message::has_trajectory(&values))
    } else {
        has_message(start)
    }
}

/// Error for a value that does not fit into a trajectory frame.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("point {point}, {joint}: {channel} {value} is outside the scale of ±{limit} {unit}")]
pub struct ScaleError {
    /// Index of the point, from 0.
    pub point: usize,
    /// Joint of the value.
    pub joint: Joint,
    /// "position", "velocity" or "acceleration".
    pub channel: &'static str,
    /// Value that does not fit.
    pub value: f64,
    /// Largest value that fits.
    pub limit: f64,
    /// Unit of `value` and `limit`.
    pub unit: &'static str,
}

impl From<&RawPoint> for Point {
    fn from(raw: &RawPoint) -> Self {
        let scaled = |v: &[i16; JOINTS], scale: f64| v.map(|x| f64::from(x) * scale / 32767.0);
        Self {
            position: scaled(&raw.position, POSITION_SCALE),
            velocity: scaled(&raw.velocity, VELOCITY_SCALE),
            acceleration: scaled(&raw.acceleration, ACCELERATION_SCALE),
        }
    }
}

impl Point {
    /// Returns the point as integers, in the units of a trajectory frame. The error contains `index`, the index of the point.
    ///
    /// # Errors
    ///
    /// Returns the first value that does not fit into a trajectory frame.
    pub fn raw(&self, index: usize) -> Result<RawPoint, ScaleError> {
        let channel = |values: &[f64; JOINTS], scale: f64, channel, unit| {
            let mut out = [0i16; JOINTS];
            for (joint, (to, v)) in Joint::ALL.into_iter().zip(out.iter_mut().zip(values)) {
                let exact = v * 32767.0 / scale;
                // A value out of range is an error: it is neither clipped nor does it wrap. A small tolerance allows
                // for the rounding of the multiplication. NaN is outside every range.
                if !(-32768.0 - 1e-9..=32767.0 + 1e-9).contains(&exact) {
                    return Err(ScaleError { point: index, joint, channel, value: *v, limit: scale, unit });
                }
                *to = exact.round() as i16;
            }
            Ok(out)
        };
        Ok(RawPoint {
            position: channel(&self.position, POSITION_SCALE, "position", "rad")?,
            velocity: channel(&self.velocity, VELOCITY_SCALE, "velocity", "rad/s")?,
            acceleration: channel(&self.acceleration, ACCELERATION_SCALE, "acceleration", "rad/s²")?,
        })
    }
}

impl Trajectory {
    /// Returns all points as integers, in the units of a trajectory frame.
    ///
    /// # Errors
    ///
    /// Returns the first value that does not fit into a trajectory frame.
    pub fn raw(&self) -> Result<Vec<RawPoint>, ScaleError> {
        self.points.iter().enumerate().map(|(i, p)| p.raw(i)).collect()
    }

    /// Returns the time from the first to the last point, s.
    pub fn duration_s(&self) -> f64 {
        self.points.len().saturating_sub(1) as f64 * f64::from(self.step_ms) * 1e-3
    }
}
