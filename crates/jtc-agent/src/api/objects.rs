//! What the API sends: one type for each object, from which its description is made.
use host_kit::{FrontEnd, Next};
use jtc_host::explain::{self, Family};
use jtc_host::held_stop::{self, HeldStop};
use jtc_host::sample::is_measured;
use jtc_host::session::Payload;
use jtc_host::words;
use jtc_wire::{Joint, Status, StopCause};
use utoipa::ToSchema;

use super::held_stop::HeldStopObject;
use crate::line::Role;

/// The controller, as its last status has it.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct StatusObject {
    /// No arm moves: the controller is simulated.
    pub simulated: bool,
    /// Name of the port.
    pub port: String,
    /// Time of this agent when this was made: since it began, ms. Who reads that it is long ago receives late, however steadily.
    pub at_ms: u64,
    /// Why the port is gone; missing while it is there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lost: Option<String>,
    /// Time since the last status, ms; missing before the first. Old values are not those of now.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub age_ms: Option<u64>,
    /// Missing before the first status.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub controller: Option<ControllerObject>,
    /// Who commands; missing where nobody does.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lease: Option<LeaseObject>,
    /// How many clients are on the line.
    pub clients: usize,
    /// What the caller may do.
    pub role: Role,
    /// Which agent this is, by a number that it was given at its start.
    pub agent: String,
    /// Number of the last event.
    pub last_event: u64,
    /// Number of the last Stop or Pause: `asked_after` of what is asked for now.
    pub last_halt: u64,
}

/// What the controller reports.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct ControllerObject {
    /// State, in the words of the protocol.
    pub state: String,
    /// What becomes of the trajectory.
    pub trajectory: String,
    /// The 1 ms point of the trajectory that the controller is at.
    pub point: u32,
    /// Errors now.
    pub errors: Vec<String>,
    /// Names of their pages, in the same order: `GET /api/explain/{code}`.
    pub error_codes: Vec<String>,
    /// What is wrong, the most particular first, with the joint of each: also what its drive reports. `GET /api/explain/{code}` takes them as
    /// they are.
    pub causes: Vec<String>,
    /// The held stop that the arm is in, with its cause (J-69); missing where it is in none, or the controller has not told its cause yet.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_stop: Option<HeldStopObject>,
    /// Joints from 1 whose encoder had jumped at the last held stop: no trajectory is executed until their drives were reset; missing: none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub encoder_jumped: Vec<u8>,
    /// Errors since they were cleared last.
    pub errors_occurred: Vec<String>,
    /// Where the joints are commanded to be, rad, from the base; missing where the agent does not know: no trajectory that was sent through
    /// it is executed.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 6, max_items = 6)]
    pub commanded_rad: Option<[f64; 6]>,
    /// Joints, from the base.
    #[schema(min_items = 6, max_items = 6)]
    pub joints: Vec<JointObject>,
    /// What helps now; empty where nothing is wrong.
    pub next: String,
}

/// What the controller reports of a joint.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct JointObject {
    /// 1 to 6, from the base.
    pub joint: u8,
    /// State of its drive.
    pub state: String,
    /// rad; missing where it is not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position_rad: Option<f32>,
    /// rad/s; missing alike.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub velocity_rad_s: Option<f32>,
    /// N·m; missing alike.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque_nm: Option<f32>,
    /// °C; missing alike.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature_c: Option<u8>,
    /// Errors that the controller has found at it.
    pub errors: Vec<String>,
    /// Names of their pages, in the same order.
    pub error_codes: Vec<String>,
}

/// Who commands.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct LeaseObject {
    /// Its name.
    pub holder: String,
    /// For how long, ms.
    pub age_ms: u64,
    /// How long it lasts without renewal, ms; missing: as long as the client is connected.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left_ms: Option<u64>,
    /// Who has asked for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wanted_by: Option<String>,
}

/// What an arm carries at its flange.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PayloadObject {
    /// kg; 0: nothing.
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

/// What the controller has told of a held stop and of its encoders.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Found {
    /// Cause of the held stop that the arm is in, and its age, ms.
    pub stop: Option<(StopCause, u32)>,
    /// Joints whose encoder has jumped, a bit for each.
    pub jumped: u8,
}

impl Found {
    /// Returns the next step.
    fn next_step(&self, status: &Status) -> Next {
        if self.jumped != 0 && !status.is_held_stop() {
            return held_stop::after_encoder_jump();
        }
        held_stop::next_step(status, self.stop.as_ref().map(|(cause, _)| cause))
    }
}

/// A command that was handed to the line.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct SentObject {
    /// What was sent: `stop` or `pause`.
    pub sent: String,
    /// Its number: `last_halt` until the next.
    pub halt: u64,
}

impl ControllerObject {
    /// What a status reports, with where the joints are commanded to be, as far as that is known.
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
                errors: texts(words::joint_errors(values.internal)),
                error_codes: codes(Family::Joint, values.internal),
            }
        });
        Self {
            state: status.state.name().to_owned(),
            trajectory: status.trajectory.name().to_owned(),
            point: status.point,
            errors: texts(words::errors(status.errors)),
            error_codes: codes(Family::Jtc, status.errors),
            causes: words::causes(status),
            held_stop: found.stop.as_ref().map(|(cause, ago_ms)| HeldStop::new(cause, *ago_ms).into()),
            encoder_jumped: held_stop::joints(found.jumped).into_iter().map(Joint::number).collect(),
            errors_occurred: texts(words::errors(status.occurred)),
            commanded_rad,
            joints: joints.collect(),
            next: found.next_step(status).plain(FrontEnd::Agent),
        }
    }
}
