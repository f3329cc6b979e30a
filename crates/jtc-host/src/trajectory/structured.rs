//! JSON in the format of this project, and files that are JSON or YAML.

use jtc_core::JOINTS;
use serde::{Deserialize, Serialize};

use super::document::{json, json_error, yaml};
use super::fit::{FitError, Samples};
use super::{ArmNames, Form, Loaded, Trajectory, message, times};
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

/// Reads a file that is JSON.
pub(super) fn read_json(text: &str, names: Option<ArmNames<'_>>) -> Result<Loaded, FileError> {
    if !text.contains("position_rad") {
        return message::read(&json(text)?, names);
    }
    // A list of points has no step of its own, so each point must have a time.
    let form = if text.starts_with('[') {
        serde_json::from_str(text).map(|points| JsonForm { step_ms: None, points })
    } else {
        serde_json::from_str(text)
    };
    match form {
        Ok(form) => own(form),
        Err(_) if json(text).is_ok_and(|values| values.len() > 1) => message::read(&json(text)?, names),
        Err(e) => Err(json_error(&e, text)),
    }
}

/// Reads a file that is YAML.
pub(super) fn read_yaml(text: &str, names: Option<ArmNames<'_>>) -> Result<Loaded, FileError> {
    message::read(&[yaml(text)?], names)
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
pub(super) fn all_or_none<P, const N: usize>(
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

pub(super) fn finish(mut samples: Samples, form: Form) -> Result<Loaded, FileError> {
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
        Err(other) => Err(FileError::form(other.to_string() + times::hint(&times, &other, false))),
    }
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
