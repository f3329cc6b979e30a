//! Waypoints as a JSON list of objects, whose keys are the column names of the CSV table. The list is either the
//! whole file or the value of the key `waypoints`.

use std::fmt;

use jtc_core::JOINTS;
use jtc_plan::kinematics::LegKind;
use serde::Deserialize;
use serde::de::{Deserializer, Error, MapAccess, Visitor};

use super::csv::{Column, KNOWN, column, names_unit};
use super::flange::{self, NAMES};
use super::{FileWaypoint, Target, WaypointFile};
use crate::file::{FileError, Place, short};
use crate::trajectory::document::json_error;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Whole {
    waypoints: Vec<Entry>,
}

/// A waypoint as written in the file. Angles are in rad.
#[derive(Default)]
struct Entry {
    time: Option<f64>,
    pose: Option<String>,
    leg: Option<String>,
    joints: [Option<f64>; JOINTS],
    flange: [Option<f64>; NAMES.len()],
    /// `true` if a key contains a unit of angle.
    unit_named: bool,
    /// If the file contains two keys for the same value, the names of both keys.
    twice: Option<(String, String)>,
}

pub(super) fn read(text: &str) -> Result<WaypointFile, FileError> {
    let entries = if text.starts_with('[') {
        serde_json::from_str::<Vec<Entry>>(text)
    } else {
        serde_json::from_str::<Whole>(text).map(|whole| whole.waypoints)
    };
    let entries = entries.map_err(|e| json_error(&e, text))?;
    if entries.is_empty() {
        return Err(FileError::form("no waypoints"));
    }
    let units_named = entries.iter().any(|entry| entry.unit_named);
    let waypoints = entries.into_iter().enumerate().map(|(i, entry)| entry.waypoint(i + 1));
    Ok(WaypointFile {
        waypoints: waypoints.collect::<Result<_, _>>()?,
        units_named,
        ..WaypointFile::default()
    })
}

impl<'de> Deserialize<'de> for Entry {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Keys)
    }
}

/// Visitor that reads the keys of an object as the names of columns.
struct Keys;

impl<'de> Visitor<'de> for Keys {
    type Value = Entry;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a waypoint")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Entry, A::Error> {
        let mut entry = Entry::default();
        let mut keys: Vec<(Column, String)> = Vec::new();
        while let Some(key) = map.next_key::<String>()? {
            let Some((column, unit)) = column(&key) else {
                return Err(A::Error::custom(format!("unknown field `{}`; {KNOWN}", short(&key))));
            };
            let given = match column {
                Column::Pose => set(&mut entry.pose, map.next_value()?),
                Column::Leg => set(&mut entry.leg, map.next_value()?),
                Column::Time => set(&mut entry.time, map.next_value::<Option<f64>>()?.map(|t| unit * t)),
                Column::Joint(j) => {
                    set(&mut entry.joints[j], map.next_value::<Option<f64>>()?.map(|v| unit * v))
                }
                Column::Flange(k) => {
                    set(&mut entry.flange[k], map.next_value::<Option<f64>>()?.map(|v| unit * v))
                }
            };
            if !given {
                continue;
            }
            entry.unit_named |= names_unit(&key);
            if let Some((_, before)) = keys.iter().find(|(other, _)| *other == column) {
                entry.twice.get_or_insert((before.clone(), key));
            } else {
                keys.push((column, key));
            }
        }
        Ok(entry)
    }
}

/// Stores a value if it is present. Returns `true` if the value is present.
fn set<T>(to: &mut Option<T>, value: Option<T>) -> bool {
    let given = value.is_some();
    if given {
        *to = value;
    }
    given
}

impl Entry {
    fn waypoint(self, number: usize) -> Result<FileWaypoint, FileError> {
        let place = Place::name(format!("waypoint {number}"));
        let wrong = |problem: String| Err(FileError::at(place.clone(), problem));
        if let Some((first, second)) = self.twice {
            return wrong(format!("both {} and {}", short(&first), short(&second)));
        }
        let leg = match super::leg_kind(self.leg.as_deref().unwrap_or_default()) {
            Ok(leg) => leg,
            Err(problem) => return wrong(problem),
        };
        let missing = self.joints.iter().position(Option::is_none);
        let given = self.joints.iter().any(Option::is_some);
        let of_flange = match flange::target(&self.flange, leg == Some(LegKind::Via)) {
            Ok(target) => target,
            Err(problem) => return wrong(problem),
        };
        let target = match (self.pose, of_flange, given, missing) {
            (Some(name), None, false, _) => Target::Pose(name),
            (None, Some(target), false, _) => target,
            (Some(_), ..) | (_, Some(_), ..) => {
                return wrong("expected one of a pose, joint positions and a pose of the flange".into());
            }
            (None, None, false, _) => {
                return wrong("the waypoint has no pose, no q1..q6 and no pose of the flange".into());
            }
            (None, None, true, Some(j)) => return wrong(format!("q{} is missing", j + 1)),
            (None, None, true, None) => Target::Joints(self.joints.map(Option::unwrap_or_default)),
        };
        Ok(FileWaypoint { target, time: self.time, leg, place })
    }
}
