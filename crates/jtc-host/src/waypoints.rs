//! Waypoint files. A waypoint file contains the positions of a motion, with or without times. [`plan`](crate::plan) uses these files.
//!
//! A waypoint is a joint position (rad, base to wrist), the name of one of the arm's [poses](crate::Arm::poses), or a flange pose. A flange
//! pose is in the base frame, and consists of a position (m) and of a quaternion or roll, pitch and yaw. If several sets of joint positions
//! have this flange pose, the reader uses the set nearest to the previous waypoint. `leg` selects the motion to the waypoint: straight in
//! joint space, or with the flange on a [line or an arc](LegKind). Times are in s, counted from the first waypoint. A file is CSV with a
//! header, or JSON whose keys have the names of the CSV columns:
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

use host_kit::{Diagnose, Diagnosis, ErrorKind, Facts};
use jtc_core::JOINTS;
use jtc_plan::kinematics::{self, Kinematics, LegKind, Orientation, Route, RoutePoint};

pub(crate) use csv::is_column;
pub use thinned::thinned;

use crate::arm::{Arm, PoseError};
use crate::error::facts;
use crate::file::{FileError, Place, UNITS_KNOWN, read_text, short};
use crate::plan::PlanError;
use crate::trajectory::is_message;

/// Maximum number of waypoints in a file.
pub const WAYPOINTS_MAX: usize = 10_000;

/// Position of a waypoint, in one of the three forms of a file.
#[derive(Clone, Debug, PartialEq)]
pub enum Target {
    /// Joint positions, rad, base to wrist.
    Joints([f64; JOINTS]),
    /// Name of a pose of the arm.
    Pose(String),
    /// Pose of the flange in the base frame: position (m) and orientation.
    Flange([f64; 3], Orientation),
}

/// A waypoint of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct FileWaypoint {
    /// Position.
    pub target: Target,
    /// Time of the waypoint after the first waypoint, s. If the value is `None`, the arm arrives as soon as the limits permit.
    pub time: Option<f64>,
    /// Type of motion from the previous waypoint, if the file specifies the type.
    pub leg: Option<LegKind>,
    /// Location in the file.
    pub place: Place,
}

/// The waypoints of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WaypointFile {
    /// Waypoints, in order.
    pub waypoints: Vec<FileWaypoint>,
    /// `true` if the file states the units of its numbers.
    pub units_named: bool,
    path: PathBuf,
}

/// Reason why a waypoint file cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WaypointError {
    /// The file cannot be read, or its format is unknown.
    #[error(transparent)]
    File(#[from] FileError),
    /// A name in the file is not a pose of the arm, or the arm cannot reach the pose.
    #[error("{}{place}: {source}", path.display())]
    Pose {
        /// The file.
        path: PathBuf,
        /// Line and column.
        place: Place,
        /// Problem with the name.
        source: Box<PoseError>,
    },
    /// The arm cannot move the flange to the pose.
    #[error("{}{place}: {source}", path.display())]
    Flange {
        /// The file.
        path: PathBuf,
        /// Line, or number of the waypoint.
        place: Place,
        /// Reason.
        source: Box<kinematics::PoseError>,
    },
    /// The path through the waypoints is not possible. The planning error contains the number of the waypoint.
    #[error(transparent)]
    Route(#[from] PlanError),
}

impl Diagnose for WaypointError {
    fn diagnosis(&self) -> Diagnosis {
        match self {
            Self::File(e) => e.diagnosis(),
            Self::Pose { source, .. } => source.diagnosis(),
            Self::Route(e) => e.diagnosis(),
            Self::Flange { source, .. } => {
                // Values that are not finite, and quaternions whose length is not 1, are invalid for every arm. Such
                // values are therefore errors in the use of the file.
                let kind = match **source {
                    kinematics::PoseError::NotFinite { .. } | kinematics::PoseError::NotUnit { .. } => {
                        ErrorKind::Usage
                    }
                    _ => ErrorKind::Refused,
                };
                Diagnosis::new(kind, "flange-pose", source.hint())
            }
        }
    }

    fn facts(&self) -> Facts {
        match self {
            Self::Route(error) => error.facts(),
            Self::Flange { source, .. } => facts::of_pose(source),
            Self::Pose { source, .. } => source.facts(),
            Self::File(_) => Facts::default(),
        }
    }
}

impl WaypointFile {
    /// Reads a CSV or JSON file. The content of the file determines the format.
    ///
    /// # Errors
    ///
    /// Returns an error with line, column and value if the file cannot be read, or is neither CSV nor JSON.
    pub fn load(path: &Path) -> Result<Self, FileError> {
        let text = read_text(path)?;
        let file = Self::parse(&text).map_err(|e| e.in_file(path))?;
        Ok(Self { path: path.to_owned(), ..file })
    }

    /// Sets the path of the file for error messages.
    pub fn in_file(self, path: &Path) -> Self {
        Self { path: path.to_owned(), ..self }
    }

    /// Parses the text of a waypoint file.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`load`](Self::load).
    pub fn parse(text: &str) -> Result<Self, FileError> {
        let start = text.trim_start_matches('\u{feff}').trim_start();
        if is_message(start) {
            return Err(FileError::form("a trajectory, not waypoints: `jtc traj run` runs it directly"));
        }
        let file = if start.starts_with(['{', '[']) { json::read(start)? } else { csv::read(text)? };
        let count = file.waypoints.len();
        if count > WAYPOINTS_MAX {
            let problem = format!(
                "{count} waypoints, expected at most {WAYPOINTS_MAX}; a recorded motion is a trajectory, which `jtc traj run` runs directly"
            );
            return Err(FileError::form(problem));
        }
        file.check_arcs()?;
        Ok(file)
    }

    /// Checks that each `via` point is followed by the end of an arc, and that each end of an arc follows a `via`
    /// point.
    fn check_arcs(&self) -> Result<(), FileError> {
        let kind = |i: usize| self.waypoints.get(i).and_then(|w| w.leg);
        for (i, waypoint) in self.waypoints.iter().enumerate() {
            let before = i.checked_sub(1).and_then(kind);
            let problem = match waypoint.leg {
                Some(leg @ (LegKind::Via | LegKind::Arc)) if i == 0 => {
                    let word = leg_word(leg);
                    format!("`{word}` is not valid for the first waypoint, because the motion begins there")
                }
                Some(LegKind::Via) if kind(i + 1) != Some(LegKind::Arc) => {
                    "`via` (a point on an arc) is not followed by `arc` (the end of the arc)".into()
                }
                Some(LegKind::Arc) if before != Some(LegKind::Via) => {
                    "`arc` (the end of an arc) does not follow `via` (a point on the arc)".into()
                }
                _ => continue,
            };
            return Err(FileError::at(waypoint.place.clone(), problem));
        }
        Ok(())
    }

    /// Returns `true` if the flange moves on a line or an arc on at least one leg (segment between two waypoints). If
    /// `line` is set, legs without a specified type of motion are lines.
    pub fn has_lines(&self, line: bool) -> bool {
        let is_line = |w: &FileWaypoint| w.leg.map_or(line, |leg| leg != LegKind::Joint);
        self.waypoints.iter().skip(1).any(is_line)
    }

    /// Returns the index of each flange pose that follows directly after another flange pose. Includes only flange
    /// poses that are reached in joint space.
    pub fn legs_between_flange_poses(&self) -> Vec<usize> {
        let by_flange = |i: usize| matches!(self.waypoints[i].target, Target::Flange(..));
        let is_joint = |i: usize| self.waypoints[i].leg.unwrap_or_default() == LegKind::Joint;
        (1..self.waypoints.len()).filter(|&i| is_joint(i) && by_flange(i - 1) && by_flange(i)).collect()
    }

    /// Converts the values from degrees to radians.
    ///
    /// # Errors
    ///
    /// Returns an error if the file already states its units.
    pub fn in_degrees(mut self) -> Result<Self, FileError> {
        if self.units_named {
            return Err(FileError::form(UNITS_KNOWN).in_file(&self.path));
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

    /// Returns the waypoints as positions of an arm, for [`Planner::through`](crate::plan::Planner::through). A flange pose becomes the
    /// joint positions nearest to the previous waypoint. If the first waypoint is a flange pose, it becomes the joint positions nearest to
    /// the zero pose.
    ///
    /// # Errors
    ///
    /// Returns [`WaypointError::Pose`], with the most similar name, if a name is not one of this arm's poses. Returns
    /// [`WaypointError::Flange`] if the arm cannot reach a flange pose.
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

    /// Returns the waypoints as a route for [`Planner::on_route`](crate::plan::Planner::on_route), and their times.
    /// If `line` is set, legs (segments between two waypoints) without a specified type of motion are lines. `blends`
    /// are the arguments of [`Route::new`].
    ///
    /// # Errors
    ///
    /// Returns the errors of [`positions`](Self::positions), and [`WaypointError::Route`] for an impossible line or
    /// arc.
    pub fn route(
        &self,
        arm: &Arm,
        line: bool,
        blends: (f64, f64),
    ) -> Result<(Route, Vec<Option<f64>>), WaypointError> {
        let start = self.waypoints.first().and_then(|w| w.time).unwrap_or(0.0);
        let config = arm.config();
        let limits = std::array::from_fn(|j| config.position_range(j));
        let kinematics = Kinematics::new(&arm.model, &limits);
        let default = if line { LegKind::Line } else { LegKind::Joint };
        let points = self
            .waypoints
            .iter()
            .map(|w| Ok(RoutePoint { target: self.target(w, arm)?, leg: w.leg.unwrap_or(default) }));
        let points = points.collect::<Result<Vec<_>, WaypointError>>()?;
        let near = limits.map(|(low, high)| 0f64.clamp(low, high));
        let route =
            Route::new(&kinematics, &points, &near, blends).map_err(|e| WaypointError::Route(e.into()))?;
        Ok((route, self.waypoints.iter().map(|w| w.time.map(|t| t - start)).collect()))
    }

    /// Returns the position of the waypoint for this arm.
    fn target(&self, waypoint: &FileWaypoint, arm: &Arm) -> Result<kinematics::Target, WaypointError> {
        let (path, place) = (self.path.clone(), waypoint.place.clone());
        Ok(match &waypoint.target {
            Target::Joints(q) => kinematics::Target::Joints(*q),
            Target::Pose(name) => {
                kinematics::Target::Joints(arm.pose(name).map_err(|source| WaypointError::Pose {
                    path,
                    place,
                    source: Box::new(source),
                })?)
            }
            Target::Flange(position, orientation) => kinematics::Target::Flange(
                orientation.at(*position).map_err(|source| WaypointError::Flange {
                    path,
                    place,
                    source: Box::new(source),
                })?,
            ),
        })
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
            // This branch is never reached: if a waypoint is a flange pose, `kinematics` is `Some`.
            (Target::Flange(..), None) => Ok(*before),
        }
    }

    /// Returns the message of a planning error, with the location of the waypoint in the file.
    pub fn located(&self, error: &PlanError) -> String {
        match error.waypoint().and_then(|waypoint| self.place_of(waypoint)) {
            Some(place) => format!("{place}: {error}"),
            None => error.to_string(),
        }
    }

    /// Returns the location of waypoint `number` (from 1), including the file name.
    pub fn place_of(&self, number: usize) -> Option<String> {
        let waypoint = self.waypoints.get(number.checked_sub(1)?)?;
        Some(format!("{}{}", self.path.display(), waypoint.place))
    }
}

/// Returns the type of motion for a word in a file. Returns `None` if the word is empty.
///
/// # Errors
///
/// Returns an error if the word is unknown.
fn leg_kind(word: &str) -> Result<Option<LegKind>, String> {
    Ok(Some(match word.to_ascii_lowercase().as_str() {
        "" => return Ok(None),
        "joint" => LegKind::Joint,
        "line" => LegKind::Line,
        "via" => LegKind::Via,
        "arc" => LegKind::Arc,
        _ => return Err(format!("\"{}\" is not a valid leg, expected joint, line, via or arc", short(word))),
    }))
}

fn leg_word(leg: LegKind) -> &'static str {
    match leg {
        LegKind::Joint => "joint",
        LegKind::Line => "line",
        LegKind::Via => "via",
        LegKind::Arc => "arc",
    }
}

/// Returns waypoints as CSV text, with a resolution of 1 µrad.
pub fn to_csv<'a>(positions: impl IntoIterator<Item = &'a [f64; JOINTS]>) -> String {
    let mut text = String::from("q1,q2,q3,q4,q5,q6\n");
    for position in positions {
        let cells: Vec<String> = position.iter().map(|v| format!("{v:.6}")).collect();
        text += &(cells.join(",") + "\n");
    }
    text
}
