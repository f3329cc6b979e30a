//! Planning of the fastest trajectory through waypoints within the limits of the arm.
use std::path::Path;
use std::sync::Arc;

use agent_kit::api::{Problem, Refusals};
use axum::extract::{Request, State};
use axum::{Extension, Json};
use jtc_core::Config;
use jtc_host::check::{JointFigures, TorqueMargin};
use jtc_host::error::Facts;
use jtc_host::plan::{Bound, COLD, MARGIN_PCT, PlanError, Planned, Planner, WayOptions, WaypointPath};
use jtc_host::waypoints::{WaypointError, WaypointFile};
use jtc_host::{Arm, ErrorKind, Session};
use jtc_wire::Joint;
use serde_json::json;
use utoipa::ToSchema;

use super::body::{blocking, read};
use super::error::Denials;
use super::objects::PayloadObject;
use super::trajectories::{TrajectoryObject, keep};
use super::{Agent, Caller};
use crate::jobs::{NUMBER_MAX, StoreError};
use crate::owner::ClientPort;

/// Largest number of waypoints in a plan. A plan with more waypoints takes longer than the time limit of a request.
const WAYPOINTS_MAX: usize = 500;
/// Possible range of bearing temperatures, °C.
const TEMPERATURES: std::ops::RangeInclusive<f64> = -40.0..=120.0;

/// Waypoints, and options of the path through them.
#[derive(Clone, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct PlanRequest {
    /// Waypoints, 500 at most, as CSV or JSON in a format that `jtc plan` accepts. The columns are q1 to q6, or x, y, z with
    /// an orientation, or pose.
    pub waypoints: String,
    /// `true` if the angles are in degrees.
    #[serde(default)]
    pub degrees: bool,
    /// Size of a rounded corner, rad: the path leaves the straight legs only within this distance from the waypoint.
    /// The distance is that of the joint that is furthest from the waypoint. 0: the arm stops at each waypoint.
    #[serde(default)]
    #[schema(minimum = 0)]
    pub blend_rad: f64,
    /// `true`: the flange moves on a straight line on each leg for which the waypoints do not specify the type of path.
    #[serde(default)]
    pub line: bool,
    /// Size of a rounded corner between two lines or arcs, m: the largest distance of the flange from the waypoint in
    /// the corner. 0: the arm stops at the waypoint.
    #[serde(default)]
    #[schema(minimum = 0)]
    pub blend_m: f64,
    /// Speed, % of the limits.
    #[serde(default = "hundred")]
    #[schema(minimum = 1, maximum = 100)]
    pub speed_percent: f64,
    /// `true`: the acceleration may change within 20 ms instead of 100 ms. The motion is faster, and stresses gears
    /// and payload more.
    #[serde(default)]
    pub no_jerk_limit: bool,
    /// Torque margin for masses and friction that the model does not know, % of each limit.
    #[serde(default = "margin")]
    #[schema(minimum = 0, maximum = 50)]
    pub margin_percent: f64,
    /// Lowest bearing temperature that is expected during a run, °C; cold bearings need more torque.
    #[serde(default = "cold")]
    #[schema(minimum = -40, maximum = 120)]
    pub temperature_c: f64,
    /// Payload of the motion; missing: the payload that the controller uses now.
    #[serde(default)]
    pub payload: Option<PayloadObject>,
    /// Number and name under which the agent keeps the trajectory for `POST /api/runs`.
    #[serde(default)]
    pub keep: Option<KeepRequest>,
}

/// Number and name of a planned trajectory.
#[derive(Clone, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct KeepRequest {
    /// Number of the trajectory; it replaces a trajectory with the same number.
    #[schema(minimum = 1, maximum = 99)]
    pub number: u16,
    /// Name of the trajectory for users. The agent uses the first 64 characters.
    pub name: String,
    /// `true`: refuse the plan if the number is taken, and replace nothing.
    #[serde(default)]
    pub new: bool,
}

fn hundred() -> f64 {
    100.0
}

fn cold() -> f64 {
    COLD
}

pub(super) fn margin() -> f64 {
    MARGIN_PCT
}

/// Motion that passed the check.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(super) struct PlanObject {
    /// Duration, s.
    pub duration_s: f64,
    /// Number of points.
    pub points: usize,
    /// Time between two points, ms.
    pub step_ms: u16,
    /// Number of waypoints.
    pub waypoints: usize,
    /// Time at which the motion is nearest to each waypoint, s.
    pub waypoint_times_s: Vec<f64>,
    /// Limiting constraints, in the order of time.
    pub binding: Vec<BoundObject>,
    /// Results for each joint, from the base.
    #[schema(min_items = 6, max_items = 6)]
    pub joints: Vec<JointPlan>,
    /// Smallest torque margin.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub margin: Option<MarginObject>,
    /// Notes for the user, for example about options that have no effect.
    pub notes: Vec<String>,
    /// Warnings, which do not prevent a run; a torque margin below 10 % is one of them.
    pub warnings: Vec<String>,
    /// Trajectory as a file, for `PUT /api/trajectories/{number}` and `jtc traj run`.
    pub text: String,
    /// Trajectory that the agent has stored; missing if the request did not ask for this.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kept: Option<TrajectoryObject>,
}

/// Limiting constraint of a motion during an interval.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(super) struct BoundObject {
    /// Start of the interval, s from the start.
    pub from_s: f64,
    /// End of the interval, s from the start.
    pub to_s: f64,
    /// Number of the joint, 1 to 6 from the base.
    pub joint: u8,
    /// Limit: `velocity`, `acceleration`, `jerk`, `torque`, `stop` (distance to stop in time), `friction` (the friction
    /// table) or `given time`.
    pub limit: String,
}

impl From<&Bound> for BoundObject {
    fn from(bound: &Bound) -> Self {
        let Bound { from_s, to_s, joint, limit } = *bound;
        Self { from_s, to_s, joint: joint.number(), limit: limit.to_owned() }
    }
}

/// Smallest torque margin of a motion, with its joint and time.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(super) struct MarginObject {
    /// Margin: unused part of the torque limit, % of the limit.
    pub percent: f64,
    /// Number of the joint with the smallest margin, 1 to 6 from the base.
    pub joint: u8,
    /// Time of the smallest margin, s from the start.
    pub time_s: f64,
    /// Torque of the model at that time, N·m.
    pub torque_nm: f64,
    /// Torque limit, N·m.
    pub limit_nm: f64,
    /// Bearing temperature for which the friction was computed, °C.
    pub temperature_c: f64,
}

impl From<TorqueMargin> for MarginObject {
    fn from(margin: TorqueMargin) -> Self {
        let TorqueMargin { percent, joint, time_s, torque_nm, limit_nm, temperature_c } = margin;
        Self { percent, joint: joint.number(), time_s, torque_nm, limit_nm, temperature_c }
    }
}

/// Results for a joint.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(super) struct JointPlan {
    /// Number of the joint, 1 to 6 from the base.
    pub joint: u8,
    /// Lowest position, rad.
    pub position_min_rad: f64,
    /// Highest position, rad.
    pub position_max_rad: f64,
    /// Largest absolute speed, rad/s.
    pub velocity_peak_rad_s: f64,
    /// Largest absolute acceleration, rad/s².
    pub acceleration_peak_rad_s2: f64,
    /// Largest absolute torque that the model predicts, N·m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque_peak_nm: Option<f64>,
}

impl JointPlan {
    fn new((joint, figures): (Joint, &JointFigures)) -> Self {
        Self {
            joint: joint.number(),
            position_min_rad: figures.position_min_rad,
            position_max_rad: figures.position_max_rad,
            velocity_peak_rad_s: figures.velocity_peak_rad_s,
            acceleration_peak_rad_s2: figures.acceleration_peak_rad_s2,
            torque_peak_nm: figures.torque_peak_nm,
        }
    }
}

/// Plans a trajectory through waypoints for the controller's arm, as fast as its limits allow.
///
/// The arm does not move. The agent makes a single plan at a time.
#[utoipa::path(
    post,
    path = "/api/plans",
    operation_id = "plan",
    request_body = PlanRequest,
    responses((status = 200, description = "Planned trajectory, and its limiting constraints", body = PlanObject), Refusals, Denials)
)]
pub(super) async fn plan(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    request: Request,
) -> Result<Json<PlanObject>, Problem> {
    // Only operators may request a plan: it needs much computing time, and may replace a trajectory that other
    // clients run.
    caller.operator()?;
    let (request, file) = read(&agent, request, understood).await?;
    if let Some(KeepRequest { number, new: true, .. }) = request.keep {
        // The trajectory number is checked before the planning, because the planning takes time.
        agent.jobs.store.is_free(number).map_err(|e| Problem::of(&e))?;
    }
    let room = agent.plans.clone().try_acquire_owned().map_err(|_| {
        let next = "send the request again when that plan is ready";
        Problem::new("busy", "the agent is computing another plan", next)
    })?;
    let (own, poses) = (agent.jobs.arm().clone(), agent.poses());
    let asked = move |session: &mut Session<ClientPort>| {
        let device = session.device_config()?;
        let mut arm = if session.has_extensions() { session.device_arm()? } else { own };
        // The agent adds the named poses, because a controller does not store poses.
        arm.poses = poses;
        Ok((arm, device))
    };
    let (arm, device) = agent.ask(asked).await?;
    // `waits` is dropped when the client that waits for the plan disconnects.
    let waits = Arc::new(());
    let waited_for = Arc::downgrade(&waits);
    let plan = blocking(move || {
        let planned = planned(&request, &file, &arm, &device);
        let planned = planned.and_then(|planned| match waited_for.upgrade() {
            Some(_) => Ok(planned),
            None => Err(abandoned()),
        });
        let planned = planned.and_then(|planned| kept(&agent, &request, &file, &planned));
        if let Some(KeepRequest { number, .. }) = request.keep {
            let (from, why) = (caller.peer.to_string(), planned.as_ref().err().map(|e| e.message.clone()));
            agent.note(
                "trajectory",
                json!({ "number": number, "planned": true, "from": from, "why_not": why }),
            );
        }
        drop(room);
        planned
    });
    let plan = plan.await??;
    drop(waits);
    Ok(Json(plan))
}

/// Returns the error for a plan whose client has disconnected. The plan is not stored, because the client may already
/// have stored another trajectory under this number.
fn abandoned() -> Problem {
    Problem::new(
        "abandoned",
        "the client that requested this plan has disconnected",
        "request the plan again",
    )
}

/// Returns the waypoints of a request if the waypoints and the options are valid.
fn understood(request: PlanRequest) -> Result<(PlanRequest, WaypointFile), Problem> {
    let refused = |what: &str, message: String, value: f64, limit: f64| {
        let facts = Facts::beyond(value, limit);
        let object = Problem::new("plan", message, format!("choose another {what}"));
        Err(object.kind(ErrorKind::Usage).with(facts))
    };
    let (low, high, value) = (*TEMPERATURES.start(), *TEMPERATURES.end(), request.temperature_c);
    if !TEMPERATURES.contains(&value) {
        let limit = if value < low { low } else { high };
        let message = format!("temperature_c is out of range: {value} °C, expected {low} to {high} °C");
        return refused("temperature", message, value, limit);
    }
    if let Some(KeepRequest { number, .. }) = request.keep
        && !(1..=NUMBER_MAX).contains(&number)
    {
        return Err(Problem::of(&StoreError::Number(number)));
    }
    if let Some(payload) = request.payload {
        super::commands::body(payload)?;
    }
    let unread = |error: jtc_host::file::FileError| Problem::of(&error.in_file(Path::new("waypoints")));
    let file = WaypointFile::parse(&request.waypoints).map_err(unread)?.in_file(Path::new("waypoints"));
    let file = if request.degrees { file.in_degrees().map_err(unread)? } else { file };
    let count = file.waypoints.len();
    if count > WAYPOINTS_MAX {
        let message = format!("too many waypoints: {count}, limit {WAYPOINTS_MAX}; `jtc plan` accepts more");
        return refused("path, or plan it in parts", message, count as f64, WAYPOINTS_MAX as f64);
    }
    Ok((request, file))
}

/// Plans the motion and collects the results for the answer.
fn planned(
    request: &PlanRequest,
    file: &WaypointFile,
    arm: &Arm,
    device: &Config,
) -> Result<Planned, Problem> {
    let options = WayOptions { line: request.line, blend: request.blend_rad, blend_m: request.blend_m };
    let way = WaypointPath::of(file, arm, options).map_err(|error| {
        let object = Problem::of(&error);
        match &error {
            // In the API, the size of a blend is in rad or m, even if the positions are in degrees.
            WaypointError::Route(e @ PlanError::Blend { .. }) => object
                .message(file.located(e))
                .next("give blend_rad in rad (5° is 0.0873 rad) and blend_m in m (20 mm is 0.02 m)"),
            WaypointError::Route(e) => object.message(file.located(e)),
            _ => object,
        }
    })?;
    let mut config = arm.config_on_device(device);
    if let Some(payload) = request.payload {
        config.payload = payload.into();
    }
    let friction = arm.friction();
    let planner = Planner {
        model: Some(&arm.model),
        friction: friction.as_ref(),
        temperature: request.temperature_c,
        speed_pct: request.speed_percent,
        blend: request.blend_rad,
        jerk: !request.no_jerk_limit,
        margin_pct: request.margin_percent,
        ..Planner::new(&config)
    };
    let mut planned =
        way.planned(&planner).map_err(|error| Problem::of(&error).message(file.located(&error)))?;
    if let Some(aside) = way.off_the_line(&planned, arm) {
        let (to, mm) = (aside.waypoint, 1e3 * aside.distance_m);
        planned.notes.push(format!(
            "between waypoints {} and {to} the flange leaves the straight line by up to {mm:.1} mm: legs are \
             straight in joint space; set line to keep the flange on the line",
            to - 1
        ));
    }
    if request.blend_m > 0.0 && !way.has_lines() {
        planned.notes.push(
            "blend_m has no effect: it rounds corners between lines and arcs, and this motion has no lines \
             or arcs"
                .to_owned(),
        );
    }
    Ok(planned)
}

/// Returns the answer to a plan request. Stores the planned trajectory if the client has requested it.
fn kept(
    agent: &Agent,
    request: &PlanRequest,
    file: &WaypointFile,
    planned: &Planned,
) -> Result<PlanObject, Problem> {
    let Planned { trajectory, verdict, binding, waypoint_times, notes } = planned;
    let text = trajectory.to_exact_csv();
    let keep = |KeepRequest { number, name, new }: &KeepRequest| {
        keep(agent, (*number, *new), name, (&text, false, None))
    };
    let kept = request.keep.as_ref().map(keep).transpose()?;
    Ok(PlanObject {
        duration_s: trajectory.duration_s(),
        points: trajectory.points.len(),
        step_ms: trajectory.step_ms,
        waypoints: file.waypoints.len(),
        waypoint_times_s: waypoint_times.clone(),
        binding: binding.iter().map(BoundObject::from).collect(),
        joints: Joint::ALL.into_iter().zip(&verdict.joints).map(JointPlan::new).collect(),
        margin: verdict.margin.map(MarginObject::from),
        notes: notes.clone(),
        warnings: verdict
            .warnings()
            .map(ToString::to_string)
            .chain(verdict.margin.and_then(|margin| margin.warning()))
            .collect(),
        text,
        kept,
    })
}
