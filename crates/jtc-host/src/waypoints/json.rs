//! Waypoints as JSON: a list of objects with the keys of the table's header, alone or as `waypoints` of an object.

use jtc_core::JOINTS;
use jtc_plan::kinematics::LegKind;
use serde::Deserialize;

use super::flange::{self, NAMES};
use super::{FileWaypoint, Target, WaypointFile};
use crate::file::{FileError, Place};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Whole {
    waypoints: Vec<Entry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    t: Option<f64>,
    pose: Option<String>,
    leg: Option<String>,
    q1: Option<f64>,
    q2: Option<f64>,
    q3: Option<f64>,
    q4: Option<f64>,
    q5: Option<f64>,
    q6: Option<f64>,
    q1_deg: Option<f64>,
    q2_deg: Option<f64>,
    q3_deg: Option<f64>,
    q4_deg: Option<f64>,
    q5_deg: Option<f64>,
    q6_deg: Option<f64>,
    x: Option<f64>,
    y: Option<f64>,
    z: Option<f64>,
    qx: Option<f64>,
    qy: Option<f64>,
    qz: Option<f64>,
    qw: Option<f64>,
    roll: Option<f64>,
    pitch: Option<f64>,
    yaw: Option<f64>,
    roll_deg: Option<f64>,
    pitch_deg: Option<f64>,
    yaw_deg: Option<f64>,
}

pub(super) fn read(text: &str) -> Result<WaypointFile, FileError> {
    let wrong = |e: serde_json::Error| {
        let place = Place { line: Some(e.line()), column: Some(e.column()), name: None };
        let words = e.to_string();
        let words = words.rsplit_once(" at line ").map_or(words.as_str(), |(words, _)| words);
        FileError::at(place, format!("JSON: {words}"))
    };
    let entries = if text.starts_with('[') {
        serde_json::from_str::<Vec<Entry>>(text)
    } else {
        serde_json::from_str::<Whole>(text).map(|whole| whole.waypoints)
    };
    let entries = entries.map_err(wrong)?;
    if entries.is_empty() {
        return Err(FileError::form("no waypoints"));
    }
    let in_degrees =
        |e: &Entry| [e.roll_deg, e.pitch_deg, e.yaw_deg].iter().chain(&e.degrees()).any(Option::is_some);
    let units_named = entries.iter().any(in_degrees);
    let waypoints = entries.into_iter().enumerate().map(|(i, entry)| entry.waypoint(i + 1));
    Ok(WaypointFile {
        waypoints: waypoints.collect::<Result<_, _>>()?,
        units_named,
        ..WaypointFile::default()
    })
}

impl Entry {
    fn radians(&self) -> [Option<f64>; JOINTS] {
        [self.q1, self.q2, self.q3, self.q4, self.q5, self.q6]
    }

    fn degrees(&self) -> [Option<f64>; JOINTS] {
        [self.q1_deg, self.q2_deg, self.q3_deg, self.q4_deg, self.q5_deg, self.q6_deg]
    }

    /// The numbers of a pose of the flange, angles in rad.
    fn flange(&self) -> [Option<f64>; NAMES.len()] {
        let angle = |radians: Option<f64>, degrees: Option<f64>| radians.or(degrees.map(f64::to_radians));
        let (roll, pitch) = (angle(self.roll, self.roll_deg), angle(self.pitch, self.pitch_deg));
        let yaw = angle(self.yaw, self.yaw_deg);
        [self.x, self.y, self.z, self.qx, self.qy, self.qz, self.qw, roll, pitch, yaw]
    }

    fn waypoint(self, number: usize) -> Result<FileWaypoint, FileError> {
        let place = Place::name(format!("waypoint {number}"));
        let wrong = |problem: String| Err(FileError::at(place.clone(), problem));
        let leg = match super::leg_kind(self.leg.as_deref().unwrap_or_default()) {
            Ok(leg) => leg,
            Err(problem) => return wrong(problem),
        };
        let mut position = [0.0; JOINTS];
        let (mut given, mut missing) = (0, None);
        for (j, pair) in self.radians().into_iter().zip(self.degrees()).enumerate() {
            position[j] = match pair {
                (Some(q), None) => q,
                (None, Some(q)) => q.to_radians(),
                (Some(_), Some(_)) => return wrong(format!("both q{0} and q{0}_deg", j + 1)),
                (None, None) => {
                    missing = missing.or(Some(j + 1));
                    continue;
                }
            };
            given += 1;
        }
        let of_flange = match flange::target(&self.flange(), leg == Some(LegKind::Via)) {
            Ok(target) => target,
            Err(problem) => return wrong(problem),
        };
        let target = match (self.pose, of_flange, given, missing) {
            (Some(name), None, 0, _) => Target::Pose(name),
            (None, Some(target), 0, _) => target,
            (Some(_), ..) | (_, Some(_), ..) => {
                return wrong("a waypoint is one of a pose, joint positions and a pose of the flange".into());
            }
            (None, None, 0, _) => return wrong("neither a pose nor q1..q6, nor one of the flange".into()),
            (None, None, _, Some(joint)) => return wrong(format!("q{joint} is missing")),
            (None, None, _, None) => Target::Joints(position),
        };
        Ok(FileWaypoint { target, time: self.t, leg, place })
    }
}
