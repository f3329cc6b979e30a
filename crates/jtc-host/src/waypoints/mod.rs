//! Waypoint files: the places that a motion is to lead through, with or without times, for [`plan`](crate::plan).
//!
//! A waypoint is a joint position (rad, base to wrist) or the name of one of the arm's [poses](crate::Arm::poses). Times are s from the
//! first waypoint. The forms are CSV with a header and JSON with the same keys; both may be mixed of numbers and names:
//!
//! ```
//! use jtc_host::waypoints::WaypointFile;
//!
//! let file = WaypointFile::parse("q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0\n0.5,0.2,-0.4,0,0.3,0\n")?;
//! let waypoints = file.positions(&jtc_host::Arm::avena())?;
//! assert_eq!(waypoints[1].position[0], 0.5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod csv;
mod json;
#[cfg(test)]
mod tests;
mod thinned;

use std::path::{Path, PathBuf};

use host_kit::{Diagnose, Diagnosis};
use jtc_core::JOINTS;

pub use thinned::thinned;

use crate::arm::{Arm, PoseError};
use crate::file::{FileError, Place, read_text};

/// Most waypoints of a file.
pub const WAYPOINTS_MAX: usize = 10_000;

/// Where a waypoint is.
#[derive(Clone, Debug, PartialEq)]
pub enum Target {
    /// Joint positions, rad, base to wrist.
    Joints([f64; JOINTS]),
    /// A pose of the arm, by its name.
    Pose(String),
}

/// One waypoint of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct FileWaypoint {
    /// Where it is.
    pub target: Target,
    /// When to be there, s from the first waypoint; `None`: as soon as the limits allow.
    pub time: Option<f64>,
    /// Where it stands in the file.
    pub place: Place,
}

/// The waypoints of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WaypointFile {
    /// In their order.
    pub waypoints: Vec<FileWaypoint>,
    /// The file names the units of its numbers.
    pub units_named: bool,
    path: PathBuf,
}

/// Why a file of waypoints cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WaypointError {
    /// It cannot be read, or is of no known form.
    #[error(transparent)]
    File(#[from] FileError),
    /// A name in it is none of a pose that the arm has and can be in.
    #[error("{}{place}: {source}", path.display())]
    Pose {
        /// The file.
        path: PathBuf,
        /// Line and column.
        place: Place,
        /// What is wrong with the name.
        source: Box<PoseError>,
    },
}

impl Diagnose for WaypointError {
    fn diagnosis(&self) -> Diagnosis {
        match self {
            Self::File(e) => e.diagnosis(),
            Self::Pose { source, .. } => source.diagnosis(),
        }
    }
}

impl WaypointFile {
    /// From a CSV or JSON file, recognised by its content.
    ///
    /// # Errors
    ///
    /// A file that cannot be read or is none of the forms, with line, column and value.
    pub fn load(path: &Path) -> Result<Self, FileError> {
        let text = read_text(path)?;
        let file = Self::parse(&text).map_err(|e| e.in_file(path))?;
        Ok(Self { path: path.to_owned(), ..file })
    }

    /// From the text of such a file.
    ///
    /// # Errors
    ///
    /// As [`load`](Self::load).
    pub fn parse(text: &str) -> Result<Self, FileError> {
        let start = text.trim_start_matches('\u{feff}').trim_start();
        let file = if start.starts_with(['{', '[']) { json::read(start)? } else { csv::read(text)? };
        let count = file.waypoints.len();
        if count > WAYPOINTS_MAX {
            let problem = format!(
                "{count} waypoints, more than {WAYPOINTS_MAX}; a recorded motion is a trajectory, which `jtc traj run` runs as it is"
            );
            return Err(FileError::form(problem));
        }
        Ok(file)
    }

    /// The same numbers as degrees.
    ///
    /// # Errors
    ///
    /// A file that names its units itself.
    pub fn in_degrees(mut self) -> Result<Self, FileError> {
        if self.units_named {
            let problem = "the units of this file are known: its numbers are not taken as degrees";
            return Err(FileError::form(problem).in_file(&self.path));
        }
        for waypoint in &mut self.waypoints {
            if let Target::Joints(q) = &mut waypoint.target {
                *q = q.map(f64::to_radians);
            }
        }
        Ok(self)
    }

    /// The waypoints as places of an arm, for [`Planner::through`](crate::plan::Planner::through).
    ///
    /// # Errors
    ///
    /// [`WaypointError::Pose`] for a name that is none of this arm's poses, with the one that looks most like it.
    pub fn positions(&self, arm: &Arm) -> Result<Vec<jtc_plan::Waypoint>, WaypointError> {
        let start = self.waypoints.first().and_then(|w| w.time).unwrap_or(0.0);
        let position = |w: &FileWaypoint| match &w.target {
            Target::Joints(q) => Ok(*q),
            Target::Pose(name) => arm.pose(name).map_err(|source| WaypointError::Pose {
                path: self.path.clone(),
                place: w.place.clone(),
                source: Box::new(source),
            }),
        };
        let waypoint = |w: &FileWaypoint| {
            Ok(jtc_plan::Waypoint { position: position(w)?, time: w.time.map(|t| t - start) })
        };
        self.waypoints.iter().map(waypoint).collect()
    }

    /// Where waypoint `number` (from 1) stands in the file, with the file.
    pub fn place_of(&self, number: usize) -> Option<String> {
        let waypoint = self.waypoints.get(number.checked_sub(1)?)?;
        Some(format!("{}{}", self.path.display(), waypoint.place))
    }
}

/// Waypoints as CSV, to a millionth of a radian.
pub fn to_csv<'a>(positions: impl IntoIterator<Item = &'a [f64; JOINTS]>) -> String {
    let mut text = String::from("q1,q2,q3,q4,q5,q6\n");
    for position in positions {
        let cells: Vec<String> = position.iter().map(|v| format!("{v:.6}")).collect();
        text += &(cells.join(",") + "\n");
    }
    text
}
