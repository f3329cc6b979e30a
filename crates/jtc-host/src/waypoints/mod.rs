//! Waypoint files: the places that a motion is to lead through, with or without times, for [`plan`](crate::plan).
//!
//! A waypoint is a joint position (rad, base to wrist), the name of one of the arm's [poses](crate::Arm::poses), or a pose of the flange
//! in the base frame (m, with a quaternion or roll, pitch and yaw), of which the joint positions nearest to the waypoint before are
//! taken. Times are s from the first waypoint. The forms are CSV with a header and JSON with the same keys:
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
mod flange;
mod json;
#[cfg(test)]
mod tests;
mod thinned;

use std::path::{Path, PathBuf};

use host_kit::{Diagnose, Diagnosis, ErrorKind};
use jtc_core::JOINTS;
use jtc_plan::kinematics::{self, Kinematics, Orientation};

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
    /// A pose of the flange in the base frame: m, and its orientation.
    Flange([f64; 3], Orientation),
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
    /// The flange cannot be brought there.
    #[error("{}{place}: {source}", path.display())]
    Flange {
        /// The file.
        path: PathBuf,
        /// Line, or number of the waypoint.
        place: Place,
        /// Why not.
        source: Box<kinematics::PoseError>,
    },
}

impl Diagnose for WaypointError {
    fn diagnosis(&self) -> Diagnosis {
        match self {
            Self::File(e) => e.diagnosis(),
            Self::Pose { source, .. } => source.diagnosis(),
            Self::Flange { source, .. } => Diagnosis::new(ErrorKind::Refused, "flange-pose", source.hint()),
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
            match &mut waypoint.target {
                Target::Joints(q) => *q = q.map(f64::to_radians),
                Target::Flange(_, Orientation::Rpy(angles)) => *angles = angles.map(f64::to_radians),
                Target::Flange(..) | Target::Pose(_) => {}
            }
        }
        Ok(self)
    }

    /// The waypoints as places of an arm, for [`Planner::through`](crate::plan::Planner::through). Of a pose of the flange the joint positions
    /// nearest to the waypoint before are taken, or nearest to the zero pose for the first one.
    ///
    /// # Errors
    ///
    /// [`WaypointError::Pose`] for a name that is none of this arm's poses, with the one that looks most like it;
    /// [`WaypointError::Flange`] for a pose of the flange that the arm does not reach.
    pub fn positions(&self, arm: &Arm) -> Result<Vec<jtc_plan::Waypoint>, WaypointError> {
        let start = self.waypoints.first().and_then(|w| w.time).unwrap_or(0.0);
        let config = arm.config();
        let by_flange = self.waypoints.iter().any(|w| matches!(w.target, Target::Flange(..)));
        let limits = std::array::from_fn(|j| config.position_range(j));
        let kinematics = by_flange.then(|| Kinematics::new(&arm.model, &limits));
        let mut before: [f64; JOINTS] = limits.map(|(low, high)| 0f64.clamp(low, high));
        let mut found = Vec::with_capacity(self.waypoints.len());
        for waypoint in &self.waypoints {
            before = self.position(waypoint, arm, kinematics.as_ref(), &before)?;
            found.push(jtc_plan::Waypoint { position: before, time: waypoint.time.map(|t| t - start) });
        }
        Ok(found)
    }

    fn position(
        &self,
        waypoint: &FileWaypoint,
        arm: &Arm,
        kinematics: Option<&Kinematics>,
        before: &[f64; JOINTS],
    ) -> Result<[f64; JOINTS], WaypointError> {
        let (path, place) = (self.path.clone(), waypoint.place.clone());
        match (&waypoint.target, kinematics) {
            (Target::Joints(q), _) => Ok(*q),
            (Target::Pose(name), _) => {
                arm.pose(name).map_err(|source| WaypointError::Pose { path, place, source: Box::new(source) })
            }
            (Target::Flange(position, orientation), Some(kinematics)) => orientation
                .at(*position)
                .and_then(|pose| kinematics.solve(&pose, before))
                .map_err(|source| WaypointError::Flange { path, place, source: Box::new(source) }),
            // There is one where a waypoint asks for it.
            (Target::Flange(..), None) => Ok(*before),
        }
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
