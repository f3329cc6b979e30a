//! Held stops in the API (J-69): the texts and values of [`jtc_host::held_stop`], with their API description.
use jtc_host::held_stop::{HeldStop, Reacting};
use utoipa::ToSchema;

/// Held stop: the controller has brought the arm to rest and holds its position.
#[derive(Clone, Debug, PartialEq, serde::Serialize, ToSchema)]
pub struct HeldStopObject {
    /// Kind of the cause: `overload`, `push`, `position-error`, `position-over-limit`, `velocity-over-limit`,
    /// `acceleration-over-limit`, `friction-table-value-missing`, `unstable`, `encoder-jump`, `speed-scale`,
    /// `approach`, `gains`, `shove`; later versions may have others.
    pub kind: String,
    /// Number of the kind, as in the Modbus registers.
    pub number: u8,
    /// Code of the held stop, for `GET /api/explain/{code}`.
    pub code: String,
    /// First joint in which the cause occurred, counted from 1; missing if the cause does not concern a joint.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joint: Option<u8>,
    /// Value that caused the stop; missing if the kind has no value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<f32>,
    /// Limit of the value; missing without a limit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub limit: Option<f32>,
    /// Unit of value and limit; empty if they have no unit.
    pub unit: String,
    /// Cause in words.
    pub text: String,
    /// Remedy in words.
    pub remedy: String,
    /// Time since the held stop began, s.
    pub since_s: f64,
}

impl From<HeldStop> for HeldStopObject {
    fn from(stop: HeldStop) -> Self {
        let HeldStop { kind, number, code, joint, value, limit, unit, text, remedy, ago_s } = stop;
        let (code, unit) = (code.to_owned(), unit.to_owned());
        let remedy = remedy.replace('`', "");
        Self { kind, number, code, joint, value, limit, unit, text, remedy, since_s: ago_s }
    }
}

/// Reactions of a controller to disturbances.
#[derive(Clone, Debug, PartialEq, serde::Serialize, ToSchema)]
pub struct ReactionsObject {
    /// Last held stop, even if the errors of this stop were cleared. Missing if no held stop has occurred since the
    /// controller started, or since the list of occurred errors was last cleared.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub last_held_stop: Option<HeldStopObject>,
    /// Joints, counted from 1, that yield to a push (J-68) or lower their load because of an overload (J-70).
    pub yields: Vec<u8>,
    /// Joints with an encoder jump, counted from 1. The controller executes no trajectory until the drives of these
    /// joints are reset.
    pub encoder_jumped: Vec<u8>,
    /// Speed along the path, in seconds of trajectory time per second of real time; 0 if no trajectory is executed.
    pub path_rate: f32,
    /// Total time for which the controller slowed this run down because a torque was at its limit, s.
    pub held_back_s: f64,
}

impl From<Reacting> for ReactionsObject {
    fn from(reacting: Reacting) -> Self {
        let Reacting { last_held_stop, yields, encoder_jumped, path_rate, held_back_s } = reacting;
        let last_held_stop = last_held_stop.map(HeldStopObject::from);
        Self { last_held_stop, yields, encoder_jumped, path_rate, held_back_s }
    }
}
