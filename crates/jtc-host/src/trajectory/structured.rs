//! JSON in the format of this project, and `trajectory_msgs/JointTrajectory` as JSON or YAML.

use jtc_core::JOINTS;
use serde::{Deserialize, Serialize};

use super::fit::{FitError, Samples};
use super::{Form, Loaded, Trajectory};
use crate::file::{FileError, Place};

/// JSON format of this project.
#[derive(Serialize, Deserialize)]
struct JsonForm {
    step_ms: Option<u16>,
    points: Vec<JsonPoint>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct JsonPoint {
    #[serde(skip_serializing_if = "Option::is_none")]
    time_s: Option<f64>,
    position_rad: [f64; JOINTS],
    #[serde(skip_serializing_if = "Option::is_none")]
    velocity_rad_s: Option<[f64; JOINTS]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    acceleration_rad_s2: Option<[f64; JOINTS]>,
}

/// `trajectory_msgs/JointTrajectory`, alone or inside another message.
#[derive(Deserialize)]
struct RosForm {
    joint_names: Option<Vec<String>>,
    points: Option<Vec<RosPoint>>,
    joint_trajectory: Option<Box<RosForm>>,
    trajectory: Option<Box<RosForm>>,
    goal: Option<Box<RosForm>>,
}

#[derive(Deserialize)]
struct RosPoint {
    #[serde(default)]
    positions: Vec<f64>,
    #[serde(default)]
    velocities: Vec<f64>,
    #[serde(default)]
    accelerations: Vec<f64>,
    time_from_start: RosTime,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum RosTime {
    Parts {
        #[serde(alias = "secs")]
        sec: f64,
        #[serde(alias = "nsecs", alias = "nsec", default)]
        nanosec: f64,
    },
    Seconds(f64),
}

impl RosTime {
    fn seconds(&self) -> f64 {
        match self {
            RosTime::Parts { sec, nanosec } => sec + nanosec * 1e-9,
            RosTime::Seconds(s) => *s,
        }
    }
}

pub(super) fn read_json(text: &str, names: Option<&[String; JOINTS]>) -> Result<Loaded, FileError> {
    let wrong = |e: serde_json::Error| FileError::at(Place::line(e.line()), format!("JSON: {e}"));
    // The ROS format is tried only if the text is not in the format of this project.
    match serde_json::from_str::<JsonForm>(text) {
        Ok(form) => own(form),
        Err(e) if text.contains("position_rad") => Err(wrong(e)),
        Err(_) => ros(serde_json::from_str::<RosForm>(text).map_err(wrong)?, names),
    }
}

pub(super) fn read_yaml(text: &str, names: Option<&[String; JOINTS]>) -> Result<Loaded, FileError> {
    // The reader must accept more YAML nodes than by default, because a trajectory of 12,000 points has about 300,000
    // nodes.
    let options = serde_saphyr::options! {
        budget: serde_saphyr::budget! { max_nodes: 2_000_000, max_events: 4_000_000 },
        with_snippet: false,
    };
    // `ros2 topic echo` writes a line of dashes after each message.
    let text = text.trim_end().trim_end_matches("---");
    let form = serde_saphyr::from_str_with_options::<RosForm>(text, options).map_err(|e| {
        let line = e.location().map(|l| l.line() as usize);
        let words = e.to_string();
        FileError::at(
            Place { line, ..Place::default() },
            format!("YAML: {}", words.lines().next().unwrap_or("")),
        )
    })?;
    ros(form, names)
}

fn own(form: JsonForm) -> Result<Loaded, FileError> {
    let timed = form.points.iter().filter(|p| p.time_s.is_some()).count();
    let step = match (form.step_ms, timed) {
        (Some(0), _) => return Err(FileError::at(Place::name("step_ms"), "0 ms")),
        (Some(step), 0) => f64::from(step) * 1e-3,
        (None, n) if n == form.points.len() => 0.0,
        (Some(_), _) => {
            return Err(FileError::at(Place::name("step_ms"), "cannot be combined with time_s of points"));
        }
        (None, _) => return Err(FileError::form("step_ms is missing, and time_s of some points is missing")),
    };
    let mut samples = Samples::default();
    for (i, p) in form.points.iter().enumerate() {
        samples.times.push(p.time_s.unwrap_or(i as f64 * step));
        samples.position.push(p.position_rad);
    }
    samples.velocity = all_or_none(&form.points, "velocity_rad_s", |p| p.velocity_rad_s)?;
    samples.acceleration = all_or_none(&form.points, "acceleration_rad_s2", |p| p.acceleration_rad_s2)?;
    let exact = form.step_ms;
    let mut loaded = finish(samples, Form::Json)?;
    // With a single point, the step of the file is kept, even if it is above 1 s. With several points, such a long step
    // makes the times irregular, and the points are resampled.
    if let (Some(step_ms), 1) = (exact, loaded.trajectory.points.len()) {
        loaded.trajectory.step_ms = step_ms;
    }
    Ok(loaded)
}

/// Returns the values if all points have values. Returns `None` if no point has values.
fn all_or_none<P, const N: usize>(
    points: &[P],
    name: &str,
    get: impl Fn(&P) -> Option<[f64; N]>,
) -> Result<Option<Vec<[f64; N]>>, FileError> {
    let values: Vec<[f64; N]> = points.iter().filter_map(&get).collect();
    if values.len() == points.len() && !values.is_empty() {
        Ok(Some(values))
    } else if values.is_empty() {
        Ok(None)
    } else {
        let i = points.iter().position(|p| get(p).is_none()).unwrap_or(0);
        Err(FileError::at(
            Place::name(format!("point {i}")),
            format!("{name} is missing, but other points have it"),
        ))
    }
}

fn ros(form: RosForm, names: Option<&[String; JOINTS]>) -> Result<Loaded, FileError> {
    let RosForm { joint_names, points, joint_trajectory, trajectory, goal } = form;
    if let Some(inner) = joint_trajectory.or(trajectory).or(goal) {
        return ros(*inner, names);
    }
    let (Some(found), Some(points)) = (joint_names, points) else {
        return Err(FileError::form(
            "neither a trajectory of this program nor a JointTrajectory (joint_names and points)",
        ));
    };
    let (order, mut notes) = joint_order(&found, names)?;
    let mut samples = Samples::default();
    let pick = |i: usize, name: &str, values: &[f64]| -> Result<Option<[f64; JOINTS]>, FileError> {
        if values.is_empty() {
            return Ok(None);
        }
        if values.len() != found.len() {
            let problem = format!("{} values, but {} joint names", values.len(), found.len());
            return Err(FileError::at(Place::name(format!("point {i}, {name}")), problem));
        }
        Ok(Some(order.map(|j| values[j])))
    };
    let mut channels = [Vec::new(), Vec::new()];
    for (i, p) in points.iter().enumerate() {
        samples.times.push(p.time_from_start.seconds());
        let Some(position) = pick(i, "positions", &p.positions)? else {
            return Err(FileError::at(Place::name(format!("point {i}, positions")), "missing"));
        };
        samples.position.push(position);
        channels[0].push(pick(i, "velocities", &p.velocities)?);
        channels[1].push(pick(i, "accelerations", &p.accelerations)?);
    }
    samples.velocity = all_or_none(&channels[0], "velocities", |v| *v)?;
    samples.acceleration = all_or_none(&channels[1], "accelerations", |v| *v)?;
    let mut loaded = finish(samples, Form::JointTrajectory)?;
    notes.append(&mut loaded.notes);
    Ok(Loaded { notes, ..loaded })
}

fn finish(mut samples: Samples, form: Form) -> Result<Loaded, FileError> {
    if samples.times.is_empty() {
        return Err(FileError::form("no points"));
    }
    let channels = [Some(&samples.position), samples.velocity.as_ref(), samples.acceleration.as_ref()];
    for (i, row) in channels.into_iter().flatten().flat_map(|c| c.iter().enumerate()) {
        if row.iter().any(|v| !v.is_finite()) {
            return Err(FileError::at(Place::name(format!("point {i}")), "a number is not finite"));
        }
    }
    if samples.velocity.is_none() {
        samples.acceleration = None;
    }
    let times = samples.times.clone();
    match samples.fit() {
        Ok(fitted) => Ok(Loaded::fitted(fitted, form)),
        Err(FitError::Time(i)) => {
            let problem = format!("time {} s is not after {} s of the point before", times[i], times[i - 1]);
            Err(FileError::at(Place::name(format!("point {i}")), problem))
        }
        Err(other) => Err(FileError::form(other.to_string())),
    }
}

/// Returns the index in the file of each joint of the arm, from base to wrist.
fn joint_order(
    found: &[String],
    names: Option<&[String; JOINTS]>,
) -> Result<([usize; JOINTS], Vec<String>), FileError> {
    let wrong = |problem: String| FileError::at(Place::name("joint_names"), problem);
    let mut twice = found.iter().enumerate().filter(|(i, n)| found[..*i].contains(n));
    if let Some((_, name)) = twice.next() {
        return Err(wrong(format!("{name} occurs twice")));
    }
    let mut order = [0; JOINTS];
    let by_name = |name: &String| found.iter().position(|f| f == name);
    let mut notes = Vec::new();
    let exact = names.and_then(|names| names.iter().map(by_name).collect::<Option<Vec<_>>>());
    if let Some(exact) = exact {
        order.copy_from_slice(&exact);
    } else {
        // Files for the same arm may use different prefixes in the joint names. Therefore only the number at the end
        // of a name is used as the joint number.
        let mut ends: Vec<(u32, usize)> =
            found.iter().enumerate().filter_map(|(i, n)| Some((last_number(n)?, i))).collect();
        ends.sort_unstable();
        let first = ends.first().map_or(0, |e| e.0);
        let counted = ends.len() == JOINTS
            && found.len() == JOINTS
            && first <= 1
            && ends.iter().enumerate().all(|(i, e)| e.0 == first + i as u32);
        if !counted {
            let expected = names.map_or("six names that end in 1..6".to_owned(), |n| n.join(", "));
            return Err(wrong(format!("{} found; expected: {expected}", found.join(", "))));
        }
        for (to, (_, i)) in order.iter_mut().zip(ends) {
            *to = i;
        }
        if names.is_some() {
            notes.push(format!(
                "joint names {}: used in the order of the numbers at their ends",
                found.join(", ")
            ));
        }
    }
    if found.len() > JOINTS {
        let extra: Vec<&str> =
            found.iter().enumerate().filter(|(i, _)| !order.contains(i)).map(|(_, n)| n.as_str()).collect();
        notes.push(format!("{} not of this arm: ignored", extra.join(", ")));
    }
    if !order.is_sorted() {
        notes.push("the joints of the file have another order: sorted by their names".to_owned());
    }
    Ok((order, notes))
}

fn last_number(name: &str) -> Option<u32> {
    let digits = name.len() - name.trim_end_matches(|c: char| c.is_ascii_digit()).len();
    name[name.len() - digits..].parse().ok()
}

impl Trajectory {
    /// Returns the trajectory as JSON with all channels.
    pub fn to_json(&self) -> String {
        let points = self.points.iter().map(|p| JsonPoint {
            time_s: None,
            position_rad: p.position,
            velocity_rad_s: Some(p.velocity),
            acceleration_rad_s2: Some(p.acceleration),
        });
        let form = JsonForm { step_ms: Some(self.step_ms), points: points.collect() };
        serde_json::to_string(&form).expect("finite numbers and fixed keys")
    }
}
