//! Trajectories: points at a fixed step, from the files that people have.

mod csv;
pub mod fit;
mod overshoot;
mod replay;
mod segments;
mod spline;
mod structured;
#[cfg(test)]
mod tests;

use std::path::Path;

pub use jtc_core::POINTS_MAX;
use jtc_core::{JOINTS, SetPoint};
use jtc_wire::{ACCELERATION_SCALE, Joint, POSITION_SCALE, RawPoint, VELOCITY_SCALE};

pub use overshoot::{Overshoot, overshoot_words};
pub use segments::UploadOptions;

use crate::file::{FileError, UNITS_KNOWN, read_text};

/// One point of a trajectory.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Point {
    /// rad.
    pub position: [f64; JOINTS],
    /// rad/s.
    pub velocity: [f64; JOINTS],
    /// rad/s².
    pub acceleration: [f64; JOINTS],
}

impl From<&Point> for SetPoint {
    /// As the point is given, before the wire rounds it.
    fn from(p: &Point) -> Self {
        Self { position: p.position, velocity: p.velocity, acceleration: p.acceleration }
    }
}

/// Points at a fixed step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trajectory {
    /// Time between points, ms.
    pub step_ms: u16,
    /// First to last.
    pub points: Vec<Point>,
}

/// Form of a trajectory file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Form {
    /// CSV with a header.
    Csv,
    /// 19 columns of integers, scaled as on the wire.
    Int16,
    /// 19 columns of floats.
    Float,
    /// JSON of our own form.
    Json,
    /// `trajectory_msgs/JointTrajectory` as YAML or JSON.
    JointTrajectory,
    /// A recording of a run, MCAP or CSV.
    Recording,
}

/// A trajectory from a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// The trajectory.
    pub trajectory: Trajectory,
    /// What the file was.
    pub form: Form,
    /// What was derived, resampled or left out.
    pub notes: Vec<String>,
    /// How far the curve goes beyond the waypoints of a file that has positions alone.
    pub overshoot: Vec<Overshoot>,
    /// The file names the units of its numbers.
    pub units_named: bool,
}

impl Loaded {
    fn fitted(fitted: fit::Fitted, form: Form) -> Self {
        let fit::Fitted { trajectory, notes, overshoot } = fitted;
        Self { trajectory, form, notes, overshoot, units_named: matches!(form, Form::Json | Form::Recording) }
    }

    /// From a file of any form; `joint_names` are those of the arm, where they are known.
    ///
    /// # Errors
    ///
    /// A file that cannot be read or is no trajectory of a known form, with line and column.
    pub fn load(path: &Path, joint_names: Option<&[String; JOINTS]>) -> Result<Self, FileError> {
        if replay::is_recording(path, None) {
            return replay::load(path);
        }
        let text = read_text(path)?;
        if replay::is_recording(path, Some(&text)) {
            return replay::load(path);
        }
        let yaml = path.extension().is_some_and(|e| e == "yaml" || e == "yml");
        let read =
            if yaml { structured::read_yaml(&text, joint_names) } else { Self::parse(&text, joint_names) };
        read.map_err(|e| e.in_file(path))
    }

    /// From a recording, as it was measured instead of as it was commanded: its last motion by hand, or else its last execution.
    ///
    /// # Errors
    ///
    /// A file that is no recording, or holds no such motion.
    pub fn load_measured(path: &Path) -> Result<Self, FileError> {
        replay::load_measured(path)
    }

    /// The same numbers as degrees, degrees/s and degrees/s²; an error where the file names its units itself.
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

    /// From a text whose form is recognised by its content.
    ///
    /// # Errors
    ///
    /// A text that is no trajectory of a known form, with line and column.
    pub fn parse(text: &str, joint_names: Option<&[String; JOINTS]>) -> Result<Self, FileError> {
        let start = text.trim_start_matches('\u{feff}').trim_start();
        let keyed = || start.lines().any(|l| l.trim_start_matches([' ', '-']).starts_with("joint_names:"));
        if start.starts_with('{') {
            structured::read_json(start, joint_names)
        } else if keyed() {
            structured::read_yaml(start, joint_names)
        } else {
            csv::read(text)
        }
    }
}

/// A number that a trajectory frame cannot carry.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("point {point}, {joint}: {channel} {value} is outside the scale of ±{limit} {unit}")]
pub struct ScaleError {
    /// Point from 0.
    pub point: usize,
    /// Of this joint.
    pub joint: Joint,
    /// "position", "velocity" or "acceleration".
    pub channel: &'static str,
    /// The value.
    pub value: f64,
    /// Largest value.
    pub limit: f64,
    /// Unit of both.
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
    /// As the wire carries it; `index` is for the error.
    ///
    /// # Errors
    ///
    /// The first number that a trajectory frame cannot carry.
    pub fn raw(&self, index: usize) -> Result<RawPoint, ScaleError> {
        let channel = |values: &[f64; JOINTS], scale: f64, channel, unit| {
            let mut out = [0i16; JOINTS];
            for (joint, (to, v)) in Joint::ALL.into_iter().zip(out.iter_mut().zip(values)) {
                let exact = v * 32767.0 / scale;
                // Neither clipped nor wrapped; a hair for the rounding of the multiplication. NaN is in no range.
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
    /// All points as the wire carries them.
    ///
    /// # Errors
    ///
    /// The first number that a trajectory frame cannot carry.
    pub fn raw(&self) -> Result<Vec<RawPoint>, ScaleError> {
        self.points.iter().enumerate().map(|(i, p)| p.raw(i)).collect()
    }

    /// From the first to the last point, s.
    pub fn duration_s(&self) -> f64 {
        self.points.len().saturating_sub(1) as f64 * f64::from(self.step_ms) * 1e-3
    }
}
