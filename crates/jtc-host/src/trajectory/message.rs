//! `trajectory_msgs/JointTrajectory` in a document, alone or inside other messages.

use jtc_core::JOINTS;

use super::document::Node;
use super::fit::Samples;
use super::joints::{joint_order, listed};
use super::structured::{all_or_none, finish};
use super::{ArmNames, Form, Loaded, times};
use crate::file::{FileError, Place, short, short_to};

/// Advice for a message that `ros2 topic echo` has shortened.
const CUT: &str =
    "`ros2 topic echo` has cut the message; `ros2 topic echo --once --full-length` writes the whole message";

/// Largest number of characters of the keys in a message.
const KEYS: usize = 100;

/// JointTrajectory, and the keys that lead to it.
struct Found<'a> {
    keys: String,
    names: &'a Node,
    points: &'a Node,
}

impl Found<'_> {
    /// Returns `true` if the message has neither joints nor points. Many messages have such a part.
    fn is_empty(&self) -> bool {
        self.points.list().is_some_and(<[Node]>::is_empty)
    }

    fn place(&self, name: &str) -> Place {
        Place::name(if self.keys.is_empty() {
            name.to_owned()
        } else {
            format!("{}.{name}", short_to(&self.keys, KEYS))
        })
    }
}

/// Finds each object with the keys `joint_names` and `points`.
fn find<'a>(node: &'a Node, keys: &str, found: &mut Vec<Found<'a>>) {
    match node {
        Node::Map(entries) => {
            if let (Some(names), Some(points)) = (node.get("joint_names"), node.get("points")) {
                // The points of joints with several axes have transforms instead of positions.
                let other = points.list().is_some_and(|p| p.iter().any(|p| p.get("transforms").is_some()));
                if !other {
                    found.push(Found { keys: keys.to_owned(), names, points });
                }
                return;
            }
            for (key, value) in entries {
                let keys = if keys.is_empty() { key.clone() } else { format!("{keys}.{key}") };
                find(value, &keys, found);
            }
        }
        Node::List(items) => {
            for (i, item) in items.iter().enumerate() {
                find(item, &format!("{keys}[{i}]"), found);
            }
        }
        _ => {}
    }
}

/// Returns `true` if the documents contain a JointTrajectory.
pub(crate) fn has_trajectory(documents: &[Node]) -> bool {
    let mut found = Vec::new();
    documents.iter().for_each(|document| find(document, "", &mut found));
    !found.is_empty()
}

/// Returns the trajectory of the only JointTrajectory in the documents.
pub(super) fn read(documents: &[Node], names: Option<ArmNames<'_>>) -> Result<Loaded, FileError> {
    let mut found = Vec::new();
    for (i, document) in documents.iter().enumerate() {
        find(
            document,
            &if documents.len() > 1 { format!("message {}", i + 1) } else { String::new() },
            &mut found,
        );
    }
    if found.is_empty() {
        return Err(unknown(documents));
    }
    let empty = found.iter().all(Found::is_empty);
    let full: Vec<&Found<'_>> = found.iter().filter(|f| empty || !f.is_empty()).collect();
    if full.len() > 1 && !empty {
        let places: Vec<String> = full.iter().map(|f| short_to(&f.keys, KEYS)).collect();
        return Err(FileError::form(format!(
            "{} trajectories in the file ({}), expected one; keep one of them",
            full.len(),
            listed(&places)
        )));
    }
    let one = full[0];
    if one.is_empty() {
        return Err(FileError::at(one.place("points"), "no points"));
    }
    let loaded = trajectory(one, names)?;
    let mut notes = Vec::new();
    if !one.keys.is_empty() {
        notes.push(format!("the trajectory is the value of {}", short_to(&one.keys, KEYS)));
    }
    notes.extend(loaded.notes);
    Ok(Loaded { notes, ..loaded })
}

/// Returns the error for documents without a trajectory.
fn unknown(documents: &[Node]) -> FileError {
    const KNOWN: &str = "neither a trajectory of this program nor a JointTrajectory (joint_names and points)";
    let keys = |node: &Node| -> Vec<String> {
        let Node::Map(entries) = node else { return Vec::new() };
        entries.iter().map(|(key, _)| key.clone()).collect()
    };
    let has = |key: &str| documents.iter().any(|node| node.get(key).is_some());
    let problem = match documents {
        [Node::List(items)] if items.iter().all(|item| matches!(item, Node::List(_))) => format!(
            "a list of {} lists, whose numbers have no names; expected {{\"points\": [{{\"time_s\": 0, \"position_rad\": [0, 0, 0, 0, 0, 0]}}]}}, \
             or CSV with the header t,q1,q2,q3,q4,q5,q6",
            items.len()
        ),
        [Node::List(items)] if items.iter().any(|item| item.get("q1").or(item.get("pose")).is_some()) => {
            "waypoints, not a trajectory: `jtc plan` makes a trajectory from waypoints".to_owned()
        }
        _ if has("waypoints") => {
            "waypoints, not a trajectory: `jtc plan` makes a trajectory from waypoints".to_owned()
        }
        _ if has("position_rad") || documents.len() > 1 => format!(
            "{} JSON values one after the other, expected one; `jq -s '{{points: .}}' FILE` makes one value from points with time_s and \
             position_rad",
            documents.len()
        ),
        [node] if !keys(node).is_empty() => format!("{KNOWN}; its keys are {}", listed(&keys(node))),
        _ => KNOWN.to_owned(),
    };
    FileError::form(problem)
}

fn trajectory(found: &Found<'_>, names: Option<ArmNames<'_>>) -> Result<Loaded, FileError> {
    let joint_names = texts(found)?;
    let Some(points) = found.points.list() else {
        return Err(match found.points {
            Node::Text(text) if text.starts_with('<') => FileError::at(
                found.place("points"),
                format!("\"{}\": `ros2 topic echo` has left out the points; omit --no-arr", short(text)),
            ),
            other if is_cut(other) => FileError::at(found.place("points"), CUT),
            other => FileError::at(found.place("points"), format!("{}, expected a list", other.words())),
        });
    };
    let (order, mut notes) = joint_order(&joint_names, names)?;
    let mut samples = Samples::default();
    let mut channels = [Vec::new(), Vec::new()];
    let mut without_unit = false;
    for (i, point) in points.iter().enumerate() {
        if is_cut(point) {
            return Err(FileError::at(found.place(&format!("points, after {i} points")), CUT));
        }
        let Node::Map(_) = point else {
            let problem = format!("{}, expected an object with positions and time_from_start", point.words());
            return Err(FileError::at(point_place(i, None), problem));
        };
        let pick = |name: &'static str| values(point, i, name, &joint_names, &order);
        let Some(position) = pick("positions")? else {
            return Err(FileError::at(point_place(i, Some("positions")), "missing"));
        };
        let (time, unit) = time(point, i)?;
        without_unit |= !unit;
        samples.times.push(time);
        samples.position.push(position);
        channels[0].push(pick("velocities")?);
        channels[1].push(pick("accelerations")?);
    }
    samples.velocity = all_or_none(&channels[0], "velocities", |v| *v)?;
    samples.acceleration = all_or_none(&channels[1], "accelerations", |v| *v)?;
    if without_unit {
        notes.append(&mut times::in_seconds(&mut samples.times, "time_from_start", false)?);
    }
    let mut loaded = finish(samples, Form::JointTrajectory)?;
    notes.append(&mut loaded.notes);
    Ok(Loaded { notes, ..loaded })
}

fn point_place(i: usize, name: Option<&str>) -> Place {
    Place::name(name.map_or(format!("point {i}"), |name| format!("point {i}, {name}")))
}

/// Returns `true` for the text that `ros2 topic echo` writes for omitted elements.
fn is_cut(node: &Node) -> bool {
    matches!(node, Node::Text(text) if text.trim_matches(['\'', '"', ' ']).ends_with("..."))
}

fn texts(found: &Found<'_>) -> Result<Vec<String>, FileError> {
    let place = || found.place("joint_names");
    let Some(items) = found.names.list() else {
        let problem = format!("{}, expected a list of names", found.names.words());
        return Err(FileError::at(place(), if is_cut(found.names) { CUT.to_owned() } else { problem }));
    };
    let text = |item: &Node| match item {
        _ if is_cut(item) => Err(FileError::at(place(), CUT)),
        Node::Text(text) => Ok(text.clone()),
        Node::Number(value) => Ok(value.to_string()),
        other => Err(FileError::at(place(), format!("{}, expected a name", other.words()))),
    };
    items.iter().map(text).collect()
}

/// Returns the values of a point for the six joints. Returns `None` if the point does not have values.
fn values(
    point: &Node,
    i: usize,
    name: &'static str,
    joints: &[String],
    order: &[usize; JOINTS],
) -> Result<Option<[f64; JOINTS]>, FileError> {
    let place = || point_place(i, Some(name));
    let Some(node) = point.get(name) else { return Ok(None) };
    let Some(items) = node.list() else {
        let problem = format!("{}, expected a list of numbers", node.words());
        return Err(FileError::at(place(), if is_cut(node) { CUT.to_owned() } else { problem }));
    };
    if items.is_empty() {
        return Ok(None);
    }
    if items.iter().any(is_cut) {
        return Err(FileError::at(place(), CUT));
    }
    if items.len() != joints.len() {
        let problem = format!("{} values, but {} joint names", items.len(), joints.len());
        return Err(FileError::at(place(), problem));
    }
    let mut found = [0.0; JOINTS];
    for (to, j) in found.iter_mut().zip(order) {
        let place = || Place::name(format!("point {i}, {name}, {}", short(&joints[*j])));
        match items[*j].number() {
            Some(value) if value.is_finite() => *to = value,
            Some(value) => return Err(FileError::at(place(), format!("{value} is not a finite number"))),
            None => return Err(FileError::at(place(), format!("{} is not a number", items[*j].words()))),
        }
    }
    Ok(Some(found))
}

/// Returns the time of a point in s, and whether the message states its unit.
fn time(point: &Node, i: usize) -> Result<(f64, bool), FileError> {
    let wrong = |problem: String| FileError::at(point_place(i, Some("time_from_start")), problem);
    let Some(node) = point.get("time_from_start") else { return Err(wrong("missing".into())) };
    let part = |keys: [&str; 3]| {
        let Some((key, value)) = keys.into_iter().find_map(|key| Some((key, node.get(key)?))) else {
            return Ok(None);
        };
        let number = value.number().filter(|value| value.is_finite());
        number.map(Some).ok_or_else(|| wrong(format!("{key}: {} is not a finite number", value.words())))
    };
    if let Node::Map(_) = node {
        let Node::Map(entries) = node else { return Err(wrong("not an object".into())) };
        let known = ["sec", "secs", "s", "nanosec", "nsecs", "nsec"];
        if let Some((key, _)) = entries.iter().find(|(key, _)| !known.contains(&key.as_str())) {
            return Err(wrong(format!("unknown key {}, expected sec and nanosec", short(key))));
        }
        let (sec, nanosec) = (part(["sec", "secs", "s"])?, part(["nanosec", "nsecs", "nsec"])?);
        if entries.len() > usize::from(sec.is_some()) + usize::from(nanosec.is_some()) {
            return Err(wrong("a part of the time occurs twice".into()));
        }
        let Some(sec) = sec else { return Err(wrong("the key sec is missing".into())) };
        return Ok((sec + nanosec.unwrap_or_default() * 1e-9, true));
    }
    match node.number() {
        Some(seconds) if seconds.is_finite() => Ok((seconds, false)),
        _ => Err(wrong(format!("{} is not a finite number", node.words()))),
    }
}
