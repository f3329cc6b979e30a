//! Objects that the API sends. The agent generates the description of the API from the types of these objects.
use host_kit::{FrontEnd, Next};
use jtc_host::explain::{self, Family};
use jtc_host::held_stop::{self, HeldStop};
use jtc_host::labels;
use jtc_host::sample::is_measured;
use jtc_host::session::Payload;
use jtc_wire::{Joint, Status, StopCause};
use utoipa::ToSchema;

use super::held_stop::HeldStopObject;
use crate::line::Role;

/// Last status of the controller.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct StatusObject {
    /// `true` if the controller is simulated: no real arm moves.
    pub simulated: bool,
    /// Name of the port.
    pub port: String,
    /// Time of this object since the start of the agent, ms. A client can use this time to detect that statuses arrive
    /// late, even if they arrive at a steady rate.
    pub at_ms: u64,
    /// Reason why the port was lost; missing while it is available.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lost: Option<String>,
    /// Age of the last status, ms; missing before the first status. At a high age, the values of the status are not
    /// current.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub age_ms: Option<u64>,
    /// Content of the last status; missing before the first one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub controller: Option<ControllerObject>,
    /// Lease; missing if no client holds it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lease: Option<LeaseObject>,
    /// Number of clients on the line.
    pub clients: usize,
    /// Role of the caller.
    pub role: Role,
    /// Number that identifies this run of the agent.
    pub agent: String,
    /// Number of the last event.
    pub last_event: u64,
    /// Number of the last Stop or Pause: value of `asked_after` for new requests.
    pub last_halt: u64,
}

/// Status of the controller.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct ControllerObject {
    /// State, as named in the protocol.
    pub state: String,
    /// State of the trajectory.
    pub trajectory: String,
    /// Current 1 ms point of the trajectory.
    pub point: u32,
    /// Current errors.
    pub errors: Vec<String>,
    /// Codes of the current errors, in the order of `errors`, for `GET /api/explain/{code}`.
    pub error_codes: Vec<String>,
    /// Causes of the errors, the most specific first, each with its joint. The causes include the errors of the drives.
    /// `GET /api/explain/{code}` accepts these texts.
    pub causes: Vec<String>,
    /// Held stop with its cause (J-69). Missing without a held stop, and until the controller has reported the cause.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_stop: Option<HeldStopObject>,
    /// Joints with an encoder jump at the last held stop, counted from 1; missing: none. The controller executes no
    /// trajectory until the drives of these joints are reset.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub encoder_jumped: Vec<u8>,
    /// Errors that have occurred since the list of occurred errors was last cleared.
    pub errors_occurred: Vec<String>,
    /// Commanded joint positions, rad, from the base. Missing unless the controller executes a trajectory that was sent
    /// through the agent.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 6, max_items = 6)]
    pub commanded_rad: Option<[f64; 6]>,
    /// Joints, from the base.
    #[schema(min_items = 6, max_items = 6)]
    pub joints: Vec<JointObject>,
    /// Next step; empty without a problem.
    pub next: String,
}

/// Status of a joint.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct JointObject {
    /// Number of the joint, 1 to 6 from the base.
    pub joint: u8,
    /// State of its drive.
    pub state: String,
    /// Position, rad; missing if it is not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position_rad: Option<f32>,
    /// Velocity, rad/s; missing if it is not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub velocity_rad_s: Option<f32>,
    /// Torque, N·m; missing if it is not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque_nm: Option<f32>,
    /// Temperature, °C; missing if it is not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature_c: Option<u8>,
    /// Errors of this joint that the controller has detected.
    pub errors: Vec<String>,
    /// Codes of the errors of this joint, in the order of `errors`, for `GET /api/explain/{code}`.
    pub error_codes: Vec<String>,
}

/// Lease, and its holder.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct LeaseObject {
    /// Name of the holder.
    pub holder: String,
    /// Time since the holder took the lease, ms.
    pub age_ms: u64,
    /// Time until the lease lapses without renewal, ms; missing: the lease lasts while its holder is connected.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left_ms: Option<u64>,
    /// Name of the client that waits for the lease.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wanted_by: Option<String>,
}

/// Payload at the flange.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PayloadObject {
    /// Mass, kg; 0: no payload.
    #[schema(minimum = 0)]
    pub mass_kg: f64,
    /// Centre of mass in the frame of the flange, m.
    #[schema(min_items = 3, max_items = 3)]
    pub com_m: [f64; 3],
    /// Inertia about the centre of mass, kg·m²: xx, xy, xz, yy, yz, zz. Zeros: a point mass.
    #[serde(default)]
    #[schema(min_items = 6, max_items = 6)]
    pub inertia_kg_m2: [f64; 6],
}

impl From<PayloadObject> for Payload {
    fn from(object: PayloadObject) -> Self {
        Self { mass: object.mass_kg, com: object.com_m, inertia: object.inertia_kg_m2 }
    }
}

impl From<Payload> for PayloadObject {
    fn from(payload: Payload) -> Self {
        Self { mass_kg: payload.mass, com_m: payload.com, inertia_kg_m2: payload.inertia }
    }
}

/// Held stop and encoder state that the controller has reported.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Found {
    /// Cause of the current held stop, and the age of this stop in ms.
    pub stop: Option<(StopCause, u32)>,
    /// Joints with an encoder jump, one bit per joint.
    pub jumped: u8,
}

impl Found {
    /// Returns the next step that the user should take.
    fn next_step(&self, status: &Status) -> Next {
        if self.jumped != 0 && !status.is_held_stop() {
            return held_stop::after_encoder_jump();
        }
        held_stop::next_step(status, self.stop.as_ref().map(|(cause, _)| cause))
    }
}

/// Command that the agent sends to the controller.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct SentObject {
    /// Command: `stop` or `pause`.
    pub sent: String,
    /// Number of the command; `last_halt` has this value until the next Stop or Pause.
    pub halt: u64,
}

impl ControllerObject {
    /// Returns the contents of a status. Adds the commanded joint positions if they are known.
    pub(super) fn new(status: &Status, commanded_rad: Option<[f64; 6]>, found: &Found) -> Self {
        let texts = |words: Vec<&'static str>| words.into_iter().map(str::to_owned).collect();
        let codes = |family, word: u16| texts(explain::names(family, word.into()));
        let joints = Joint::ALL.into_iter().zip(&status.joints).map(|(joint, values)| {
            let measured = is_measured(status, joint.index());
            JointObject {
                joint: joint.number(),
                state: values.state.name().to_owned(),
                position_rad: measured.then_some(values.position),
                velocity_rad_s: measured.then_some(values.velocity),
                torque_nm: measured.then_some(values.torque),
                temperature_c: measured.then_some(values.temperature),
                errors: texts(labels::joint_errors(values.internal)),
                error_codes: codes(Family::Joint, values.internal),
            }
        });
        Self {
            state: status.state.name().to_owned(),
            trajectory: status.trajectory.name().to_owned(),
            point: status.point,
            errors: texts(labels::errors(status.errors)),
            error_codes: codes(Family::Jtc, status.errors),
            causes: labels::causes(status),
            held_stop: found.stop.as_ref().map(|(cause, ago_ms)| HeldStop::new(cause, *ago_ms).into()),
            encoder_jumped: held_stop::joints(found.jumped).into_iter().map(Joint::number).collect(),
            errors_occurred: texts(labels::errors(status.occurred)),
            commanded_rad,
            joints: joints.collect(),
            next: found.next_step(status).plain(FrontEnd::Agent),
        }
    }
}
