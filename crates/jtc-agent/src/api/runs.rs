//! Jobs that run a trajectory or move the arm to a target, and the results of these jobs.
use std::sync::Arc;

use agent_kit::api::{Body, Number, Problem, Refusals};
use agent_kit::gate::Asker;
use agent_kit::halt::{AskedAfter, KnownHalt};
use agent_kit::lease::LeaseKey;
use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use jtc_host::plan::kinematics::{Orientation, Target};
use jtc_host::plan::margin_in_range;
use jtc_host::{Arm, ErrorKind};
use serde_json::json;
use utoipa::ToSchema;

use super::Agent;
use super::arm::GivenObject;
use super::error::Denials;
use super::plans::margin;
use super::poses::pose_error;
use crate::jobs::{Course, Job, NUMBER_MAX, Order, Stored, run};
use crate::line::Policy;

/// Run of a kept trajectory.
#[derive(Clone, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct RunRequest {
    /// Number of the trajectory.
    #[schema(minimum = 1, maximum = 99)]
    pub trajectory: u16,
    /// Digest of the trajectory that the client saw. The agent refuses the run if another trajectory is now stored
    /// under the number.
    #[serde(default)]
    pub digest: Option<String>,
    /// `true`: if the arm is not at the first point, move it there before the run. The speed of this approach is
    /// `speed_percent` of the limits, at most 50 %. Without `speed_percent`, the speed is 10 %, and 25 % with a simulated
    /// controller.
    #[serde(default)]
    pub approach: bool,
    /// Speed, % of the trajectory's own speed; missing: 100.
    #[serde(default)]
    #[schema(minimum = 1, maximum = 1000)]
    pub speed_percent: Option<f64>,
    /// Number of runs.
    #[serde(default = "one")]
    #[schema(minimum = 1, maximum = 1000000)]
    pub repeat: u32,
    /// Policy for the motion after the lease of this client has lapsed; missing: the policy of the lease.
    #[serde(default)]
    pub policy: Option<Policy>,
    /// `true`: accept a controller that cannot report its limits. Its built-in limits must be safe for this arm.
    #[serde(default)]
    pub accept_device_limits: bool,
}

/// Move from the current position to one of three targets: joint positions, a named pose, or a pose of the flange.
#[derive(Clone, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct MoveRequest {
    /// Target joint positions, rad, base to wrist.
    #[serde(default)]
    #[schema(min_items = 6, max_items = 6)]
    pub to_rad: Option<[f64; 6]>,
    /// Name of a target pose that `GET /api/poses` lists.
    #[serde(default)]
    pub to_pose: Option<String>,
    /// Target pose of the flange.
    #[serde(default)]
    pub to_flange: Option<FlangeObject>,
    /// `true`: the flange moves on a straight line.
    #[serde(default)]
    pub line: bool,
    /// Speed, % of the limits; missing: 10, and 25 with a simulated controller.
    #[serde(default)]
    #[schema(minimum = 1, maximum = 100)]
    pub speed_percent: Option<f64>,
    /// Torque margin for masses and friction that the model does not know, % of each limit.
    #[serde(default = "margin")]
    #[schema(minimum = 0, maximum = 50)]
    pub margin_percent: f64,
    /// Policy for the motion after the lease of this client has lapsed; missing: the policy of the lease.
    #[serde(default)]
    pub policy: Option<Policy>,
    /// `true`: accept a controller that cannot report its limits. Its built-in limits must be safe for this arm.
    #[serde(default)]
    pub accept_device_limits: bool,
}

/// Pose of the flange in the frame of the base.
#[derive(Clone, Copy, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct FlangeObject {
    /// Position x, y, z, m.
    #[schema(min_items = 3, max_items = 3)]
    pub xyz_m: [f64; 3],
    /// Roll, pitch, yaw about the fixed axes x, y, z, as in a URDF, rad.
    #[schema(min_items = 3, max_items = 3)]
    pub rpy_rad: [f64; 3],
}

fn one() -> u32 {
    1
}

/// Job: work of the agent that continues after the answer to its request.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(super) struct JobObject {
    /// Number of the job.
    pub number: u64,
    /// Description of the job.
    pub what: String,
    /// Name of the client that requested it.
    pub client: String,
    /// `running`, `finished`, `stopped` or `failed`.
    pub stage: String,
    /// Number of finished motions, without approaches.
    pub runs: u32,
    /// Results of the last motion of this job.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub result: Option<ResultObject>,
    /// Address of the report page of its last motion. Missing if nothing moved, or if later reports have replaced the
    /// report.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub report: Option<String>,
    /// Arm parameters that were sent to the controller.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub given: Option<GivenObject>,
    /// Reason why the job failed or did not begin.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<Problem>,
}

/// Results of a motion.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(super) struct ResultObject {
    /// Duration of the execution, s.
    pub executed_s: f64,
    /// Joints, from the base.
    #[schema(min_items = 6, max_items = 6)]
    pub joints: Vec<JointResult>,
}

/// Results for a joint.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(super) struct JointResult {
    /// Name of the joint in the arm file.
    pub name: String,
    /// Root mean square of the position error, mrad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_error_mrad: Option<f64>,
    /// Largest absolute error, mrad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_error_mrad: Option<f64>,
    /// Largest absolute torque, N·m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub peak_torque_nm: Option<f64>,
    /// Torque limit, N·m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque_limit_nm: Option<f64>,
    /// Largest absolute speed, rad/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub peak_velocity_rad_s: Option<f64>,
}

impl From<Job> for JobObject {
    fn from(job: Job) -> Self {
        let Job { number, what, client, stage, done, error } = job;
        let result = done.summary.map(|summary| ResultObject {
            executed_s: summary.executed_s,
            joints: summary
                .joints
                .into_iter()
                .map(|joint| JointResult {
                    name: joint.name,
                    rms_error_mrad: joint.rms_error_mrad,
                    max_error_mrad: joint.max_error_mrad,
                    peak_torque_nm: joint.peak_torque_nm,
                    torque_limit_nm: joint.torque_limit_nm,
                    peak_velocity_rad_s: joint.peak_velocity_rad_s,
                })
                .collect(),
        });
        let report = done.report.map(|_| format!("/api/jobs/{number}/report"));
        let (stage, runs, given) = (stage.name().to_owned(), done.runs, done.given.map(GivenObject::from));
        Self { number, what, client, stage, runs, result, report, given, error }
    }
}

/// Runs a trajectory, as a job.
///
/// The agent checks the trajectory from the current position, uploads it, executes it and monitors the motion.
#[utoipa::path(
    post,
    path = "/api/runs",
    operation_id = "run",
    params(LeaseKey, KnownHalt),
    request_body = RunRequest,
    responses((status = 202, description = "Job that was started", body = JobObject), Refusals, Denials)
)]
pub(super) async fn begin_run(
    State(agent): State<Agent>,
    asker: Asker,
    after: AskedAfter,
    Body(request): Body<RunRequest>,
) -> Result<(StatusCode, Json<JobObject>), Problem> {
    let RunRequest {
        trajectory: number,
        digest,
        approach,
        speed_percent,
        repeat,
        policy,
        accept_device_limits,
    } = request;
    within("repeat", f64::from(repeat), 1e6)?;
    within("speed_percent", speed_percent.unwrap_or(100.0), 1000.0)?;
    let stored = agent.jobs.store.get(number).ok_or_else(|| {
        let next = "store one with PUT /api/trajectories/{number}, or list the stored ones with GET \
            /api/trajectories";
        Problem::new(
            "no-trajectory",
            format!("trajectory {number} does not exist (numbers are 1 to {NUMBER_MAX})"),
            next,
        )
        .kind(ErrorKind::Usage)
    })?;
    if digest.is_some_and(|digest| digest != stored.digest) {
        return Err(replaced(&stored));
    }
    let what = format!("run of trajectory {number}, {}", stored.name);
    let course = Course::Along(Arc::new(stored.trajectory.clone()));
    begin(
        &agent,
        (&asker, after),
        what,
        policy,
        Order { course, approach, speed_percent, repeat, accept_device_limits },
    )
}

/// Returns the error for a run whose trajectory was replaced since the client read it.
fn replaced(stored: &Stored) -> Problem {
    let Stored { number, name, digest, .. } = stored;
    let message = format!(
        "trajectory {number} was replaced since the client read it: it is now {name} with the digest \
         {digest}; nothing was sent"
    );
    let next = format!("read its points and its digest again with GET /api/trajectories/{number}/points");
    Problem::new("replaced", message, next)
}

/// Moves the arm to joint positions, a named pose or a pose of the flange, as a job.
///
/// The motion starts at the current position.
#[utoipa::path(
    post,
    path = "/api/moves",
    operation_id = "move_to",
    params(LeaseKey, KnownHalt),
    request_body = MoveRequest,
    responses((status = 202, description = "Job that was started", body = JobObject), Refusals, Denials)
)]
pub(super) async fn begin_move(
    State(agent): State<Agent>,
    asker: Asker,
    after: AskedAfter,
    Body(request): Body<MoveRequest>,
) -> Result<(StatusCode, Json<JobObject>), Problem> {
    let MoveRequest {
        to_rad,
        to_pose,
        to_flange,
        line,
        speed_percent,
        margin_percent: margin_pct,
        policy,
        accept_device_limits,
    } = request;
    within("speed_percent", speed_percent.unwrap_or(100.0), 100.0)?;
    margin_in_range(margin_pct).map_err(|error| Problem::of(&error))?;
    let (place, target) = match (to_rad, to_pose, to_flange) {
        (Some(to), None, None) => (listed(&to), Target::Joints(to)),
        (None, Some(name), None) => {
            // The agent checks the permission first. A client without permission therefore receives no other error.
            agent.http_session(&asker)?;
            let arm = Arm { poses: agent.poses(), ..(*agent.identity().await.arm).clone() };
            let to = arm.pose(&name).map_err(|error| pose_error(&error))?;
            (name, Target::Joints(to))
        }
        (None, None, Some(FlangeObject { xyz_m, rpy_rad })) => {
            let pose = Orientation::Rpy(rpy_rad).at(xyz_m).map_err(|error| {
                let error = Problem::new("pose", error.to_string(), "give lengths in m and angles in rad");
                error.kind(ErrorKind::Usage)
            })?;
            (format!("flange {}", listed(&[xyz_m, rpy_rad].concat())), Target::Flange(pose))
        }
        _ => {
            let message = "a move needs exactly one target: to_rad, to_pose or to_flange; nothing was sent";
            let next = "GET /openapi.json describes each request";
            return Err(Problem::new("request", message, next).kind(ErrorKind::Usage));
        }
    };
    let what = format!("move to {place}{}", if line { ", straight" } else { "" });
    let course = Course::To { target, line, margin_pct };
    let order = Order { course, approach: false, speed_percent, repeat: 1, accept_device_limits };
    begin(&agent, (&asker, after), what, policy, order)
}

fn listed(numbers: &[f64]) -> String {
    numbers.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
}

/// Checks that a value is in the range from 1 to `most`.
fn within(name: &str, value: f64, most: f64) -> Result<(), Problem> {
    if (1.0..=most).contains(&value) {
        return Ok(());
    }
    let message = format!("{name} is out of range: {value}, expected 1 to {most}");
    Err(Problem::new("request", message, "GET /openapi.json describes each request").kind(ErrorKind::Usage))
}

fn begin(
    agent: &Agent,
    (asker, after): (&Asker, AskedAfter),
    what: String,
    policy: Option<Policy>,
    order: Order,
) -> Result<(StatusCode, Json<JobObject>), Problem> {
    let (http_session, turn) = agent.mover(asker, after)?;
    let (client, own) = (http_session.client, http_session.policy);
    agent.line.with(|line, _| line.set_policy(client, policy.unwrap_or(own)));
    let job = agent.jobs.begin(&http_session, turn, what.clone(), move |task, session| {
        let (done, error) = run(task, session, &order);
        task.line.with(|line, now| {
            // If the job failed and the arm may still move, the policy of this run stays valid. Otherwise, the
            // client's own policy applies again.
            if error.is_none() || !line.may_move(now) {
                line.set_policy(client, own);
            }
        });
        (done, error)
    })?;
    agent.note(
        "job",
        json!({ "client": http_session.client.0, "job": job.number, "what": what, "policy": policy }),
    );
    Ok((StatusCode::ACCEPTED, Json(job.into())))
}

/// Returns the last jobs, oldest first.
#[utoipa::path(
    get,
    path = "/api/jobs",
    operation_id = "list_jobs",
    responses((status = 200, description = "Kept jobs, oldest first", body = Vec<JobObject>), Refusals)
)]
pub(super) async fn jobs(State(agent): State<Agent>) -> Json<Vec<JobObject>> {
    Json(agent.jobs.list().into_iter().map(JobObject::from).collect())
}

/// Returns a job, while it runs and afterwards.
#[utoipa::path(
    get,
    path = "/api/jobs/{number}",
    operation_id = "get_job",
    params(("number" = u64, Path, description = "Number of the job")),
    responses(
        (status = 200, description = "State and results of the job", body = JobObject),
        (status = 404, description = "No kept job has this number", body = Problem),
        Refusals
    )
)]
pub(super) async fn job(
    State(agent): State<Agent>,
    Number(number): Number<u64>,
) -> Result<Json<JobObject>, Problem> {
    Ok(Json(found(&agent, number)?.into()))
}

pub(super) fn found(agent: &Agent, number: u64) -> Result<Job, Problem> {
    agent.jobs.job(number).ok_or_else(|| Problem::nothing("job", number, "/api/jobs"))
}
