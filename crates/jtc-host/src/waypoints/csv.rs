//! Waypoints as a table with a header of the columns `t`, `pose`, `leg`, `q1`..`q6` or `q1_deg`..`q6_deg`.

use jtc_core::JOINTS;
use jtc_plan::kinematics::LegKind;

use super::flange::{self, ANGLES, NAMES};
use super::{FileWaypoint, Target, WaypointFile};
use std::borrow::Cow;

use crate::file::{FileError, Place, number, short};
use crate::table::{self, Unit, named, rows, units};

/// Description of the known columns.
pub(super) const KNOWN: &str = "expected q1..q6 (rad) or q1_deg..q6_deg, t (s), pose (a name from the arm file), leg (joint, line, via or arc), and of the flange x, y, z (m) with \
                     qx, qy, qz, qw or roll, pitch, yaw (rad, or roll_deg and so on)";

/// Number of columns of a trajectory without a header.
const TRAJECTORY_COLUMNS: usize = 19;

/// Meaning of a table column, or of a key in a JSON object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Column {
    Time,
    Pose,
    Leg,
    /// Joint, from 0.
    Joint(usize),
    /// Value of a flange pose, as an index into the list of names.
    Flange(usize),
}

/// Columns of the table, with the conversion factor from the unit of each column to radians.
#[derive(Default)]
struct Header {
    names: Vec<String>,
    time: Option<(usize, f64)>,
    pose: Option<usize>,
    leg: Option<usize>,
    joints: [Option<(usize, f64)>; JOINTS],
    flange: [Option<(usize, f64)>; NAMES.len()],
}

pub(super) fn read(text: &str) -> Result<WaypointFile, FileError> {
    let rows = rows(text);
    let Some((line, names)) = rows.first() else {
        return Err(FileError::form("the file is empty, expected waypoints"));
    };
    let line = *line;
    if names.iter().all(|name| name.parse::<f64>().is_ok()) {
        let more = if names.len() == TRAJECTORY_COLUMNS {
            "; 19 columns can be a trajectory, which `jtc traj run` runs directly"
        } else {
            ""
        };
        let problem = format!(
            "{} columns without a header: write q1,q2,q3,q4,q5,q6 before all other lines{more}",
            names.len()
        );
        return Err(FileError::at(Place::line(line), problem));
    }
    let below = rows.get(1).filter(|row| row.1.len() == names.len()).and_then(|row| units(&row.1));
    let header = header(line, names, below.as_deref().unwrap_or_default())?;
    let rows = rows.iter().skip(1 + usize::from(below.is_some()));
    let waypoints = rows.map(|(line, cells)| header.waypoint(*line, cells)).collect::<Result<Vec<_>, _>>()?;
    if waypoints.is_empty() {
        return Err(FileError::at(Place::line(line), "the file has a header but no waypoints"));
    }
    let angle = |unit: &Option<Unit>| matches!(unit, Some(Unit::Angle(..)));
    let units_named = names.iter().any(|name| names_unit(name)) || below.iter().flatten().any(angle);
    Ok(WaypointFile { waypoints, units_named, ..WaypointFile::default() })
}

/// Returns `true` if the name of a column contains a unit of angle, in upper or lower case.
pub(super) fn names_unit(name: &str) -> bool {
    matches!(named(name).1, Ok(Some(Unit::Angle(..))))
}

/// Returns the column with this name, in upper or lower case, and the factor that converts its unit to s, m or rad.
pub(super) fn column(name: &str) -> Option<(Column, f64)> {
    let name = name.trim().to_lowercase();
    // Metres are not a unit of the table of units, because only the position of the flange has this unit.
    let metres = ["_m", " (m)", "(m)", " [m]", "[m]"].into_iter().find_map(|unit| name.strip_suffix(unit));
    let metres = metres.unwrap_or(&name);
    if let Some(i) = NAMES[..ANGLES.start].iter().position(|known| *known == metres) {
        return Some((Column::Flange(i), 1.0));
    }
    let (base, unit) = named(&name);
    let unit = unit.ok()?;
    match (base.as_str(), unit) {
        ("t" | "time", None) => return Some((Column::Time, 1.0)),
        ("t" | "time", Some(Unit::Time(factor))) => return Some((Column::Time, factor)),
        ("pose" | "name", None) => return Some((Column::Pose, 1.0)),
        ("leg", None) => return Some((Column::Leg, 1.0)),
        _ => {}
    }
    let factor = match unit {
        None => 1.0,
        Some(Unit::Angle(factor, 0)) => factor,
        Some(_) => return None,
    };
    if let Some(i) = NAMES[ANGLES].iter().position(|known| *known == base) {
        return Some((Column::Flange(ANGLES.start + i), factor));
    }
    let joint = base.strip_prefix('q')?.parse::<usize>().ok()?;
    (1..=JOINTS).contains(&joint).then(|| (Column::Joint(joint - 1), factor))
}

/// Returns `true` if waypoint files have a column of this name.
pub(crate) fn is_column(name: &str) -> bool {
    column(name).is_some()
}

/// Returns the factor to s or rad of a column for the unit in the row below the names.
fn factor(column: Column, unit: f64, below: Option<Unit>) -> Option<f64> {
    match (column, below) {
        (_, None) => Some(unit),
        (Column::Time, Some(Unit::Time(factor))) => Some(factor),
        (Column::Joint(_), Some(Unit::Angle(factor, 0))) => Some(factor),
        (Column::Flange(k), Some(Unit::Angle(factor, 0))) if k >= ANGLES.start => Some(factor),
        _ => None,
    }
}

fn header(line: usize, names: &[Cow<'_, str>], below: &[Option<Unit>]) -> Result<Header, FileError> {
    let mut header = Header { names: names.iter().map(|name| short(name)).collect(), ..Header::default() };
    for (i, name) in names.iter().enumerate() {
        let wrong = |problem: String| {
            FileError::at(Place::cell(line, i + 1).named(format!("\"{}\"", short(name))), problem)
        };
        let Some((column, unit)) = column(name) else {
            let lower = name.to_ascii_lowercase();
            let is_rate = lower.starts_with("qd");
            let problem = if is_rate {
                "waypoints have no velocities: a file with velocities is a trajectory, which `jtc traj run` runs directly".into()
            } else {
                format!("unknown column; {KNOWN}")
            };
            return Err(wrong(problem));
        };
        let below = below.get(i).copied().flatten();
        let stated = named(name).1.ok().flatten();
        let unit =
            factor(column, unit, below).filter(|_| stated.is_none() || below.is_none() || stated == below);
        let Some(unit) = unit else {
            return Err(wrong("the unit in the row below this name is not valid for the column".into()));
        };
        let before = match column {
            Column::Time => header.time.replace((i, unit)).is_some(),
            Column::Pose => header.pose.replace(i).is_some(),
            Column::Leg => header.leg.replace(i).is_some(),
            Column::Joint(j) => header.joints[j].replace((i, unit)).is_some(),
            Column::Flange(k) => header.flange[k].replace((i, unit)).is_some(),
        };
        if before {
            return Err(wrong("this column occurs twice".into()));
        }
    }
    let missing = header.joints.iter().position(Option::is_none);
    let any = header.joints.iter().any(Option::is_some);
    match missing {
        Some(j) if any || (header.pose.is_none() && header.flange.iter().all(Option::is_none)) => {
            Err(FileError::at(Place::line(line), format!("column q{} is missing; {KNOWN}", j + 1)))
        }
        _ => Ok(header),
    }
}

impl Header {
    fn waypoint(&self, line: usize, cells: &[Cow<'_, str>]) -> Result<FileWaypoint, FileError> {
        if cells.len() != self.names.len() {
            let why = table::decimal_comma(cells, self.names.len());
            let problem = format!("{} columns, but the header has {}{why}", cells.len(), self.names.len());
            return Err(FileError::at(Place::line(line), problem));
        }
        let value = |i: usize| number(&cells[i], || Place::cell(line, i + 1).named(&self.names[i]));
        let time = match self.time {
            Some((i, unit)) if !cells[i].is_empty() => Some(unit * value(i)?),
            _ => None,
        };
        let leg = match self.leg {
            Some(i) => super::leg_kind(cells[i].trim_matches('"'))
                .map_err(|problem| FileError::at(Place::cell(line, i + 1).named(&self.names[i]), problem))?,
            None => None,
        };
        let name = self.pose.map(|i| (i, cells[i].trim_matches('"'))).filter(|(_, name)| !name.is_empty());
        let filled = |i: &usize| !cells[*i].is_empty();
        let joint = self.joints.iter().flatten().map(|(i, _)| *i).find(filled);
        let of_flange = self.flange.iter().flatten().map(|(i, _)| *i).find(filled);
        let both = |what: &str, at: usize| {
            let problem =
                format!("both {what}, expected one of a pose, joint positions or a pose of the flange");
            Err(FileError::at(Place::cell(line, at + 1).named(&self.names[at]), problem))
        };
        let (target, place) = match (name, joint, of_flange) {
            (Some((_, name)), Some(at), _) => {
                return both(&format!("the pose \"{}\" and positions", short(name)), at);
            }
            (Some((_, name)), _, Some(at)) => {
                return both(&format!("the pose \"{}\" and one of the flange", short(name)), at);
            }
            (None, Some(_), Some(at)) => return both("joint positions and a pose of the flange", at),
            (Some((at, name)), None, None) => (Target::Pose(name.to_owned()), Place::cell(line, at + 1)),
            (None, None, Some(_)) => {
                (self.flange(line, cells, leg == Some(LegKind::Via))?, Place::line(line))
            }
            (None, None, None) if self.pose.is_some() || self.flange.iter().any(Option::is_some) => {
                return Err(FileError::at(
                    Place::line(line),
                    "the waypoint has neither a pose nor positions",
                ));
            }
            (None, ..) => {
                let mut position = [0.0; JOINTS];
                for (to, (i, unit)) in position.iter_mut().zip(self.joints.iter().flatten()) {
                    *to = unit * value(*i)?;
                }
                (Target::Joints(position), Place::line(line))
            }
        };
        Ok(FileWaypoint { target, time, leg, place })
    }

    /// Returns a flange pose, or only its position if `point` is set. Empty cells are treated as missing.
    fn flange(&self, line: usize, cells: &[Cow<'_, str>], point: bool) -> Result<Target, FileError> {
        let mut given = [None; NAMES.len()];
        for (to, column) in given.iter_mut().zip(&self.flange) {
            if let Some((i, unit)) = column
                && !cells[*i].is_empty()
            {
                *to = Some(unit * number(&cells[*i], || Place::cell(line, i + 1).named(&self.names[*i]))?);
            }
        }
        let wrong = |problem: String| FileError::at(Place::line(line), problem);
        flange::target(&given, point)
            .map_err(wrong)?
            .ok_or_else(|| wrong("the waypoint has neither a pose nor positions".into()))
    }
}
