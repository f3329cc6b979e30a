//! Requests that store, check and list trajectories. A number identifies each trajectory.
use std::sync::Arc;

use agent_kit::api::{Asked, Number, Problem, Refusals};
use agent_kit::gate::plain;
use axum::extract::{Request, State};
use axum::http::StatusCode;
use axum::{Extension, Json};
use jtc_host::check::Verdict;
use jtc_host::error::Facts;
use jtc_host::trajectory::ArmNames;
use jtc_host::{Arm, CheckError, CheckOptions, CheckedTrajectory, Error, ErrorKind, Session};
use jtc_wire::Joint;
use serde_json::json;
use utoipa::{IntoParams, ToSchema};

use super::body::{blocking, read};
use super::error::Denials;
use super::plans::MarginObject;
use super::{Agent, Caller};
use crate::jobs::Stored;
use crate::owner::ClientPort;

/// Largest number of trajectory points in one answer.
const POINTS_MAX: usize = 2000;

/// Trajectory to keep.
#[derive(Clone, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct TrajectoryRequest {
    /// Name of the trajectory for users. The agent uses the first 64 characters.
    pub name: String,
    /// Text of a file in a format that `jtc traj run` accepts: CSV with a time column and joints, JSON, or a ROS
    /// JointTrajectory. Recordings are not possible.
    pub text: String,
    /// `true` if the angles are in degrees.
    #[serde(default)]
    pub degrees: bool,
    /// `true` if the numbers in the names of the joints determine their order. Otherwise, the agent refuses a file that
    /// names the joints of another arm.
    #[serde(default)]
    pub joints_by_number: bool,
}

/// Kept trajectory.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(super) struct TrajectoryObject {
    /// Number of the trajectory.
    pub number: u16,
    /// Name for people.
    pub name: String,
    /// Number of points.
    pub points: usize,
    /// Time between two points, ms.
    pub step_ms: u16,
    /// Duration, s.
    pub duration_s: f64,
    /// Notes about values that the agent derived or left out when it read the file.
    pub notes: Vec<String>,
    /// Digest of points and step, 16 hexadecimal digits, for `POST /api/runs`. Other points or another step give another
    /// digest.
    pub digest: String,
}

impl From<&Stored> for TrajectoryObject {
    fn from(stored: &Stored) -> Self {
        let Stored { number, name, trajectory, notes, digest } = stored;
        Self {
            number: *number,
            name: name.clone(),
            points: trajectory.points.len(),
            step_ms: trajectory.step_ms,
            duration_s: trajectory.duration_s(),
            notes: notes.clone(),
            digest: digest.clone(),
        }
    }
}

/// Condition for replacing a trajectory.
#[derive(Clone, Copy, Debug, serde::Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct PlaceRequest {
    /// `true`: refuse the trajectory if the number is taken, and replace nothing.
    #[serde(default)]
    #[param(default = false)]
    new: bool,
}

/// Number of points to return.
#[derive(Clone, Copy, Debug, serde::Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct PointsRequest {
    /// Largest number of points. If the trajectory has more, the agent leaves out points evenly, but never the first and
    /// the last point.
    #[serde(default = "some_points")]
    #[param(minimum = 2, maximum = 2000, default = 500)]
    most: usize,
}

fn some_points() -> usize {
    500
}

/// Trajectory for a plot.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(super) struct PointsObject {
    /// Number of the trajectory.
    pub number: u16,
    /// Name for people.
    pub name: String,
    /// Duration, s.
    pub duration_s: f64,
    /// Digest of points and step, 16 hexadecimal digits, for `POST /api/runs`. Other points or another step give another
    /// digest.
    pub digest: String,
    /// Times of the points, s.
    pub times_s: Vec<f64>,
    /// Joint positions at these times, from the base, rad.
    pub positions_rad: Vec<[f64; 6]>,
}

impl PointsObject {
    /// Returns the trajectory with at least two and at most `most` points.
    fn new(stored: &Stored, most: usize) -> Self {
        let Stored { number, name, trajectory, digest, .. } = stored;
        let count = trajectory.points.len();
        let (shown, steps) = (count.min(most), count.saturating_sub(1));
        let places = (0..shown).map(|k| k * steps / shown.saturating_sub(1).max(1));
        let (times_s, positions_rad) = places
            .filter_map(|place| {
                let point = trajectory.points.get(place)?;
                Some((place as f64 * f64::from(trajectory.step_ms) / 1000.0, point.position))
            })
            .unzip();
        Self {
            number: *number,
            name: name.clone(),
            duration_s: trajectory.duration_s(),
            digest: digest.clone(),
            times_s,
            positions_rad,
        }
    }
}

/// Result of a check.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(super) struct CheckObject {
    /// `true` if the trajectory can run from its first point.
    pub passed: bool,
    /// Duration, s.
    pub duration_s: f64,
    /// Digest of the checked trajectory.
    pub digest: String,
    /// Smallest torque margin; below 10 % there is a warning.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub margin: Option<MarginObject>,
    /// Problems, worst first.
    pub problems: Vec<ProblemObject>,
}

/// Problem of a trajectory.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(super) struct ProblemObject {
    /// Message with value, limit and point.
    pub message: String,
    /// Number of the joint; missing: the trajectory as a whole.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joint: Option<u8>,
    /// Index of the worst point, from 0.
    pub point: usize,
    /// Time along the path, s.
    pub time_s: f64,
    /// Worst value; missing if it is not a number.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// Limit of the value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub limit: Option<f64>,
    /// `true` if the problem does not prevent a run.
    pub warning: bool,
}

impl CheckObject {
    fn new(verdict: &Verdict, digest: String) -> Self {
        let finite = |value: f64| Some(value).filter(|value| value.is_finite());
        let problems = verdict.problems.iter().map(|problem| ProblemObject {
            message: problem.to_string(),
            joint: problem.joint.map(Joint::number),
            point: problem.point,
            time_s: problem.time_s,
            value: finite(problem.value),
            limit: finite(problem.limit),
            warning: problem.warning,
        });
        Self {
            passed: verdict.is_ok(),
            duration_s: verdict.duration_s,
            digest,
            margin: verdict.margin.map(MarginObject::from),
            problems: problems.collect(),
        }
    }
}

/// Returns the kept trajectories.
#[utoipa::path(
    get,
    path = "/api/trajectories",
    operation_id = "list_trajectories",
    responses((status = 200, description = "Kept trajectories, ordered by number", body = Vec<TrajectoryObject>), Refusals)
)]
pub(super) async fn list(State(agent): State<Agent>) -> Json<Vec<TrajectoryObject>> {
    Json(agent.jobs.store.list().iter().map(|stored| TrajectoryObject::from(&**stored)).collect())
}

/// Keeps a trajectory under a number, and replaces a trajectory with the same number.
///
/// A run that has begun continues with its own trajectory.
#[utoipa::path(
    put,
    path = "/api/trajectories/{number}",
    operation_id = "put_trajectory",
    params(("number" = u16, Path, description = "Number of the trajectory, 1 to 99", minimum = 1, maximum = 99), PlaceRequest),
    request_body = TrajectoryRequest,
    responses((status = 200, description = "Kept trajectory", body = TrajectoryObject), Refusals, Denials)
)]
pub(super) async fn put(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    Number(number): Number<u16>,
    Asked(place): Asked<PlaceRequest>,
    request: Request,
) -> Result<Json<TrajectoryObject>, Problem> {
    // Only operators may change trajectories, because other clients run them.
    caller.operator()?;
    let own = agent.clone();
    let kept = read(&agent, request, move |request| {
        let TrajectoryRequest { name, text, degrees, joints_by_number } = request;
        let names = (!joints_by_number).then(|| own.jobs.arm().names());
        let kept = keep(&own, (number, place.new), &name, (&text, degrees, names));
        let (from, why) = (caller.peer.to_string(), kept.as_ref().err().map(|error| error.message.clone()));
        own.note("trajectory", json!({ "number": number, "from": from, "why_not": why }));
        kept
    });
    Ok(Json(kept.await?))
}

/// Stores the trajectory in `text` under a number. If `new` is `true`, stores the trajectory only if no trajectory has
/// this number yet.
pub(super) fn keep(
    agent: &Agent,
    (number, new): (u16, bool),
    name: &str,
    (text, degrees, names): (&str, bool, Option<ArmNames<'_>>),
) -> Result<TrajectoryObject, Problem> {
    let (store, name) = (&agent.jobs.store, plain(name));
    let stored = match new {
        true => store.put_new(number, &name, text, degrees, names),
        false => store.put(number, &name, text, degrees, names),
    };
    stored.map(|stored| TrajectoryObject::from(&*stored)).map_err(|e| Problem::of(&e))
}

/// Deletes a kept trajectory.
#[utoipa::path(
    delete,
    path = "/api/trajectories/{number}",
    operation_id = "delete_trajectory",
    params(("number" = u16, Path, description = "Number of the trajectory, 1 to 99", minimum = 1, maximum = 99)),
    responses(
        (status = 204, description = "The trajectory is deleted"),
        (status = 404, description = "No trajectory has this number", body = Problem),
        Refusals, Denials
    )
)]
pub(super) async fn delete(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    Number(number): Number<u16>,
) -> Result<StatusCode, Problem> {
    // Only operators may change trajectories, because other clients run them.
    caller.operator()?;
    let jobs = agent.jobs.clone();
    let gone = blocking(move || jobs.store.delete(number)).await?;
    if !gone.map_err(|e| Problem::of(&e))? {
        return Err(Problem::nothing("trajectory", number, "/api/trajectories"));
    }
    agent.note("trajectory", json!({ "number": number, "deleted": true, "from": caller.peer.to_string() }));
    Ok(StatusCode::NO_CONTENT)
}

/// Returns points of a trajectory, for a plot.
#[utoipa::path(
    get,
    path = "/api/trajectories/{number}/points",
    operation_id = "get_points",
    params(("number" = u16, Path, description = "Number of the trajectory, 1 to 99", minimum = 1, maximum = 99), PointsRequest),
    responses(
        (status = 200, description = "Times and joint positions of the points", body = PointsObject),
        (status = 404, description = "No trajectory has this number", body = Problem),
        Refusals, Denials
    )
)]
pub(super) async fn points(
    State(agent): State<Agent>,
    Number(number): Number<u16>,
    Asked(PointsRequest { most }): Asked<PointsRequest>,
) -> Result<Json<PointsObject>, Problem> {
    if !(2..=POINTS_MAX).contains(&most) {
        let limit = if most < 2 { 2 } else { POINTS_MAX };
        let facts = Facts::beyond(most as f64, limit as f64);
        let message = format!("number of points is out of range: {most}, expected 2 to {POINTS_MAX}");
        let error = Problem::new("points", message, "request fewer points, and interpolate between them");
        return Err(error.kind(ErrorKind::Usage).with(facts));
    }
    Ok(Json(PointsObject::new(&*kept(&agent, number)?, most)))
}

/// Returns the trajectory that is stored under a number.
fn kept(agent: &Agent, number: u16) -> Result<Arc<Stored>, Problem> {
    agent.jobs.store.get(number).ok_or_else(|| Problem::nothing("trajectory", number, "/api/trajectories"))
}

/// Checks a trajectory with the controller's limits, model and payload, from its own first point.
#[utoipa::path(
    get,
    path = "/api/trajectories/{number}/check",
    operation_id = "check_trajectory",
    params(("number" = u16, Path, description = "Number of the trajectory, 1 to 99", minimum = 1, maximum = 99)),
    responses(
        (status = 200, description = "Result of the check", body = CheckObject),
        (status = 404, description = "No trajectory has this number", body = Problem),
        Refusals, Denials
    )
)]
pub(super) async fn check(
    State(agent): State<Agent>,
    Number(number): Number<u16>,
) -> Result<Json<CheckObject>, Problem> {
    let stored = kept(&agent, number)?;
    let (own, room) = (agent.jobs.arm().clone(), agent.checks.clone().acquire_owned().await);
    let asked = move |session: &mut Session<ClientPort>| -> Result<(Arm, CheckOptions), Error> {
        let device = session.device_config()?;
        let arm = if session.has_extensions() { session.device_arm()? } else { own };
        Ok((arm, CheckOptions { accept_device_limits: true, device, ..CheckOptions::default() }))
    };
    let asked = agent.jobs.asker().call_in_turn(asked).await?;
    let (arm, options) = asked.map_err(|error| Problem::of(&error))?;
    let digest = stored.digest.clone();
    let start = stored.trajectory.points.first().map_or([0.0; 6], |point| point.position);
    let checked = blocking(move || {
        let checked = CheckedTrajectory::check(&stored.trajectory, &arm, &start, &options);
        drop(room);
        checked
    })
    .await?;
    match checked {
        Ok(checked) => Ok(Json(CheckObject::new(checked.verdict(), digest))),
        Err(CheckError::Refused(verdict)) => Ok(Json(CheckObject::new(&verdict, digest))),
        Err(error) => Err(Problem::of(&error)),
    }
}
