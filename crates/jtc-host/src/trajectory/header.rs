//! Header of a CSV file: the columns that contain the time and the values of the six joints.

use std::borrow::Cow;
use std::collections::BTreeMap;

use jtc_core::JOINTS;

use super::ArmNames;
use super::columns::{Channel, Key, Meaning, is_rest, meaning};
use super::joints::{joint_order, listed, other_arm};
use crate::file::{FileError, Place, short};
use crate::table::{Row, Unit, units};
use crate::waypoints;

/// Columns of one channel: for each joint, the index of its column, and the factor from its unit to rad.
type Columns = [(usize, f64); JOINTS];

/// Columns of a table that contain a trajectory.
#[derive(Debug, Default)]
pub(super) struct Header {
    /// Names of all columns.
    pub names: Vec<String>,
    /// Number of rows before the numbers.
    pub rows: usize,
    /// Column of the time, and the factor from its unit to s. `None` if the file does not state the unit.
    pub time: (usize, Option<f64>),
    /// Columns of the positions, velocities and accelerations.
    pub channels: [Option<Columns>; 3],
    /// `true` if a column states a unit of angle.
    pub angles_named: bool,
    /// Messages about the columns.
    pub notes: Vec<String>,
    /// Columns with the names of the joints.
    pub joint_names: Vec<usize>,
    left_out: Vec<usize>,
}

/// Largest number of columns.
const COLUMNS_MAX: usize = 1000;

/// Columns of one group: for each channel, the joint and the column.
#[derive(Default)]
struct Group([BTreeMap<Key, usize>; 3]);

/// Key of a group: its name, and the kind of its joints. Columns of different kinds are never mixed.
type GroupName = (String, u8);

struct Reader<'a> {
    line: usize,
    cells: &'a [Cow<'a, str>],
    meanings: Vec<Meaning>,
    units: Vec<Result<Option<Unit>, String>>,
    /// Cells of the first row of numbers.
    first: &'a [Cow<'a, str>],
}

impl Header {
    pub(super) fn of(rows: &[Row<'_>], names: Option<ArmNames<'_>>) -> Result<Self, FileError> {
        let (line, cells) = (rows[0].0, rows[0].1.as_slice());
        if cells.len() > COLUMNS_MAX {
            let problem = format!("{} columns, expected at most {COLUMNS_MAX}", cells.len());
            return Err(FileError::at(Place::line(line), problem));
        }
        let (meanings, mut stated): (Vec<_>, Vec<_>) = cells.iter().map(|name| meaning(name, names)).unzip();
        let below = rows.get(1).filter(|row| row.1.len() <= cells.len()).and_then(|row| units(&row.1));
        for (i, unit) in below.iter().flatten().enumerate() {
            match (&stated[i], unit) {
                (Ok(Some(in_name)), Some(unit)) if in_name != unit => {
                    let place = Place::cell(rows[1].0, i + 1).named(short(&cells[i]));
                    return Err(FileError::at(
                        place,
                        "this unit and the unit in the name of the column differ",
                    ));
                }
                (Ok(None), Some(unit)) => stated[i] = Ok(Some(*unit)),
                _ => {}
            }
        }
        let count = 1 + usize::from(below.is_some());
        let first = rows.get(count).map_or(&[][..], |row| row.1.as_slice());
        Reader { line, cells, meanings, units: stated, first }.header(count, names)
    }

    /// Returns the list of the columns that are not used, after `before`. Returns an empty text if all columns are used.
    pub(super) fn left_out_words(&self, before: &str) -> String {
        if self.left_out.is_empty() {
            return String::new();
        }
        let name = |i: &usize| match self.names[*i].as_str() {
            "" => format!("column {} (without a name)", i + 1),
            name => format!("\"{}\"", short(name)),
        };
        let names: Vec<String> = self.left_out.iter().map(name).collect();
        format!("{before}columns left out: {}", listed(&names))
    }
}

impl Reader<'_> {
    fn wrong(&self, i: usize, problem: impl Into<String>) -> FileError {
        let name = format!("\"{}\"", short(&self.cells[i]));
        FileError::at(Place::cell(self.line, i + 1).named(name), problem.into())
    }

    fn line(&self, problem: impl Into<String>) -> FileError {
        FileError::at(Place::line(self.line), problem.into())
    }

    fn header(&self, rows: usize, names: Option<ArmNames<'_>>) -> Result<Header, FileError> {
        let groups = self.groups()?;
        let chosen = self.chosen(&groups);
        self.of_waypoints(chosen.is_ok())?;
        if groups.is_empty() {
            return Err(chosen.err().unwrap_or_else(|| self.line("column q1 is missing")));
        }
        let time = self.time()?;
        let name = chosen?;
        let (order, mut notes) = self.order(name, &groups[name], names)?;
        self.seventh(name, &groups, names)?;
        let channels = self.channels(&groups[name], order)?;
        let used =
            |i: &usize| *i == time || channels.iter().flatten().flatten().any(|(column, _)| column == i);
        let is_name = |i: &usize| matches!(self.meanings[*i], Meaning::JointName { .. });
        let header = Header {
            names: self.cells.iter().map(|cell| cell.to_string()).collect(),
            rows,
            time: (time, self.time_unit(time)?),
            angles_named: channels
                .iter()
                .flatten()
                .flatten()
                .any(|(i, _)| matches!(self.units[*i], Ok(Some(_)))),
            left_out: (0..self.cells.len()).filter(|i| !used(i) && !is_name(i)).collect(),
            channels,
            joint_names: self.joint_names(&name.0).into_values().collect(),
            ..Header::default()
        };
        let left_out = header.left_out_words("");
        if !left_out.is_empty() {
            notes.push(left_out);
        }
        Ok(Header { notes, ..header })
    }

    /// Returns the groups of columns that contain values of joints.
    fn groups(&self) -> Result<BTreeMap<GroupName, Group>, FileError> {
        let mut groups: BTreeMap<GroupName, Group> = BTreeMap::new();
        for (i, meaning) in self.meanings.iter().enumerate() {
            let Meaning::Value { group, channel, key } = meaning else { continue };
            let kind = match key {
                Key::Index(_) => 0,
                Key::Joint(_) => 1,
                Key::Name(..) => 2,
            };
            let group = groups.entry((group.clone(), kind)).or_default();
            if group.0[*channel as usize].insert(key.clone(), i).is_some() {
                return Err(self.wrong(i, "this column occurs twice"));
            }
        }
        Ok(groups)
    }

    /// Returns an error for columns of waypoint files. Other programs also write the position of a tool next to the joints.
    fn of_waypoints(&self, complete: bool) -> Result<(), FileError> {
        let only = |name: &str| ["pose", "leg"].contains(&name.to_lowercase().as_str());
        let unknown = |i: &usize| self.meanings[*i] == Meaning::Unknown;
        let found = (0..self.cells.len())
            .filter(unknown)
            .find(|i| waypoints::is_column(&self.cells[*i]) && (!complete || only(&self.cells[*i])));
        found.map_or(Ok(()), |i| {
            Err(self.wrong(
                i,
                "a column of waypoints, not of a trajectory: `jtc plan` makes a trajectory from waypoints",
            ))
        })
    }

    fn time(&self) -> Result<usize, FileError> {
        let of = |header: bool| -> Vec<usize> {
            let is = |i: &usize| self.meanings[*i] == Meaning::Time { of_header: header };
            (0..self.cells.len()).filter(is).collect()
        };
        let found = if of(false).is_empty() { of(true) } else { of(false) };
        match found[..] {
            [] => Err(self.line(
                "column t (time in s) is missing; `jtc plan` makes a trajectory from waypoints without times",
            )),
            [one] => match (0..self.cells.len())
                .find(|i| *i != one && is_rest(&self.cells[one], &self.cells[*i]))
            {
                Some(rest) => Err(self.wrong(
                    rest,
                    format!(
                        "with \"{}\" the time is in two columns; write it in one column t, in s",
                        short(&self.cells[one])
                    ),
                )),
                None => Ok(one),
            },
            [_, second, ..] => {
                let names: Vec<&str> = found.iter().map(|i| &*self.cells[*i]).collect();
                let problem = format!("{} are all times; keep one of these columns", listed(&names));
                Err(self.wrong(second, problem))
            }
        }
    }

    fn time_unit(&self, i: usize) -> Result<Option<f64>, FileError> {
        match &self.units[i] {
            Ok(None) => Ok(None),
            Ok(Some(Unit::Time(factor))) => Ok(Some(*factor)),
            Ok(Some(Unit::Angle(..))) => {
                Err(self.wrong(i, "a time with a unit of angle, expected s, ms, us or ns"))
            }
            Err(unit) => {
                Err(self.wrong(i, format!("unknown unit \"{}\", expected s, ms, us or ns", short(unit))))
            }
        }
    }

    /// Returns the group whose positions are the trajectory.
    fn chosen<'g>(&self, groups: &'g BTreeMap<GroupName, Group>) -> Result<&'g GroupName, FileError> {
        let complete: Vec<&GroupName> = groups
            .iter()
            .filter(|(name, group)| self.is_complete(name, group))
            .map(|(name, _)| name)
            .collect();
        let plain: Vec<&GroupName> = complete.iter().copied().filter(|(group, _)| group.is_empty()).collect();
        match (&complete[..], &plain[..]) {
            ([one], _) | (_, [one]) => Ok(one),
            ([], _) => Err(self.incomplete(groups)),
            (several, _) => {
                let first = |name: &&GroupName| groups[*name].0[0].values().next().copied();
                let columns: Vec<usize> = several.iter().filter_map(first).collect();
                let names: Vec<String> =
                    columns.iter().map(|i| format!("\"{}\"", short(&self.cells[*i]))).collect();
                let problem = format!(
                    "the file has {} sets of positions, which begin with the columns {}; keep the columns of one set",
                    several.len(),
                    listed(&names)
                );
                Err(self.line(problem))
            }
        }
    }

    fn is_complete(&self, (name, _): &GroupName, group: &Group) -> bool {
        let positions = &group.0[Channel::Position as usize];
        let named = !self.joint_names(name).is_empty();
        let Some(Key::Index(first)) = positions.keys().next() else { return positions.len() >= JOINTS };
        let counted = || positions.keys().zip(*first..).all(|(key, n)| *key == Key::Index(n));
        *first <= 1 && counted() && (positions.len() == JOINTS || named && positions.len() > JOINTS)
    }

    /// Returns the columns with the names of the joints of a group.
    fn joint_names(&self, name: &str) -> BTreeMap<u32, usize> {
        let of = |(i, meaning): (usize, &Meaning)| match meaning {
            // The names of a controller state are next to several groups of positions.
            Meaning::JointName { group, index } if name.starts_with(group.as_str()) => Some((*index, i)),
            _ => None,
        };
        self.meanings.iter().enumerate().filter_map(of).collect()
    }

    /// Returns the error for a file in which no group has the positions of six joints.
    fn incomplete(&self, groups: &BTreeMap<GroupName, Group>) -> FileError {
        const KNOWN: &str = "unknown column, expected t, q1..q6 (rad) or q1_deg..q6_deg, qd1..qd6 (rad/s), qdd1..qdd6 (rad/s²)";
        let most = groups.iter().max_by_key(|(_, group)| group.0[0].len());
        let Some((name, group)) = most.filter(|(_, group)| !group.0[0].is_empty()) else {
            let unknown = self.meanings.iter().position(|m| *m == Meaning::Unknown);
            return unknown.map_or_else(
                || self.line("column q1 is missing"),
                |i| self.wrong(i, KNOWN.to_owned() + &self.unknown()),
            );
        };
        let positions = &group.0[0];
        let indices: Vec<u32> = positions
            .keys()
            .filter_map(|key| if let Key::Index(n) = key { Some(*n) } else { None })
            .collect();
        let base = u32::from(!indices.contains(&0));
        if let Some((_, i)) =
            positions.iter().find(|(key, _)| matches!(key, Key::Index(n) if *n >= base + JOINTS as u32))
        {
            return self.wrong(*i, format!("{KNOWN}; the arm has six joints"));
        }
        if name.0.is_empty() && name.1 == 0 {
            let missing = (base..).find(|n| !indices.contains(n)).unwrap_or_default();
            return self.line(format!("column q{missing} is missing{}", self.unknown()));
        }
        let found: Vec<&str> = positions.values().map(|i| &*self.cells[*i]).collect();
        self.line(format!(
            "positions of {} joints, expected 6: {}{}",
            found.len(),
            listed(&found),
            self.unknown()
        ))
    }

    /// Returns the list of the columns with an unknown meaning, for the end of a message.
    fn unknown(&self) -> String {
        let is = |i: &usize| self.meanings[*i] == Meaning::Unknown && !self.cells[*i].is_empty();
        let names: Vec<&str> = (0..self.cells.len()).filter(is).map(|i| &*self.cells[i]).collect();
        if names.is_empty() { String::new() } else { format!("; unknown columns: {}", listed(&names)) }
    }

    /// Returns an error if the file continues the numbers of the joints of the arm with a seventh joint.
    fn seventh(
        &self,
        (name, kind): &GroupName,
        groups: &BTreeMap<GroupName, Group>,
        arm: Option<ArmNames<'_>>,
    ) -> Result<(), FileError> {
        let (Some(arm), 1) = (arm, *kind) else { return Ok(()) };
        let Some(stem) = arm.bare(&arm.joints[JOINTS - 1]).strip_suffix('6') else { return Ok(()) };
        let Some(others) = groups.get(&(name.clone(), 2)) else { return Ok(()) };
        let next = format!("{stem}7").to_lowercase().replace('_', "");
        let is = |key: &Key| matches!(key, Key::Name(7, found) if found.replace('_', "").ends_with(&next));
        match others.0[Channel::Position as usize].iter().find(|(key, _)| is(key)) {
            Some((_, i)) => Err(self.wrong(*i, "a seventh joint; the arm has six joints")),
            None => Ok(()),
        }
    }

    /// Returns the keys of the six joints, base to wrist, and notes about their order.
    fn order(
        &self,
        (name, _): &GroupName,
        group: &Group,
        arm: Option<ArmNames<'_>>,
    ) -> Result<([Key; JOINTS], Vec<String>), FileError> {
        let positions = &group.0[0];
        let keys: Vec<&Key> = positions.keys().collect();
        let names = self.joint_names(name);
        let found: Vec<String> = match keys[0] {
            Key::Joint(_) => return Ok((std::array::from_fn(Key::Joint), Vec::new())),
            Key::Name(..) => keys
                .iter()
                .filter_map(|k| if let Key::Name(_, name) = k { Some(name.clone()) } else { None })
                .collect(),
            Key::Index(_) if names.is_empty() => {
                let order = std::array::from_fn(|j| keys[j.min(keys.len() - 1)].clone());
                let columns: Vec<&str> = positions.values().map(|i| &*self.cells[*i]).collect();
                let own = |name: &&str| name.to_lowercase().starts_with('q');
                let note = format!("joints in the order of the columns, base to wrist: {}", listed(&columns));
                return Ok((order, if columns.iter().all(own) { Vec::new() } else { vec![note] }));
            }
            Key::Index(_) => {
                let of = |key: &&Key| {
                    let Key::Index(n) = key else { return None };
                    self.first.get(*names.get(n)?).map(|cell| cell.to_string())
                };
                keys.iter().filter_map(of).collect()
            }
        };
        if let (Key::Name(..), Some(arm)) = (keys[0], arm) {
            return Err(other_arm(&found, arm));
        }
        if found.len() != keys.len() {
            return Err(self.line("the columns with the names of the joints are not complete"));
        }
        let (order, notes) = joint_order(&found, arm)?;
        Ok((order.map(|i| keys[i].clone()), notes))
    }

    fn channels(&self, group: &Group, order: [Key; JOINTS]) -> Result<[Option<Columns>; 3], FileError> {
        let mut channels = [None; 3];
        for (c, (to, columns)) in channels.iter_mut().zip(&group.0).enumerate() {
            if columns.is_empty() {
                continue;
            }
            let mut found = [(0, 1.0); JOINTS];
            for (j, (to, key)) in found.iter_mut().zip(&order).enumerate() {
                let Some(i) = columns.get(key) else {
                    let missing = match key {
                        Key::Index(n) => format!("column {}{n}", ["q", "qd", "qdd"][c]),
                        _ => {
                            format!("the {} of joint {}", ["position", "velocity", "acceleration"][c], j + 1)
                        }
                    };
                    return Err(self.line(format!("{missing} is missing")));
                };
                *to = (*i, self.angle_unit(*i, c as u8)?);
            }
            *to = Some(found);
        }
        if channels[1].is_none() && channels[2].is_some() {
            return Err(self.line("qdd1..qdd6 without qd1..qd6"));
        }
        Ok(channels)
    }

    fn angle_unit(&self, i: usize, divisions: u8) -> Result<f64, FileError> {
        let expected = ["rad or deg", "rad/s or deg/s", "rad/s² or deg/s²"][usize::from(divisions.min(2))];
        match &self.units[i] {
            Ok(None) => Ok(1.0),
            Ok(Some(Unit::Angle(factor, found))) if *found == divisions || *found == 0 => Ok(*factor),
            Ok(Some(_)) => {
                Err(self.wrong(i, format!("the unit of this column is not valid, expected {expected}")))
            }
            Err(unit) => Err(self.wrong(i, format!("unknown unit \"{}\", expected {expected}", short(unit)))),
        }
    }
}
