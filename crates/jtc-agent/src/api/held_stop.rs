//! Held stops in the API (J-69): the words and values of [`jtc_host::held_stop`], with their description.
use jtc_host::held_stop::{HeldStop, Reacting};
use utoipa::ToSchema;

/// A held stop: the controller has brought the arm to rest and holds it.
#[derive(Clone, Debug, PartialEq, serde::Serialize, ToSchema)]
pub struct HeldStopObject {
    /// Kind of the cause: `overload`, `push`, `position-error`, `position-over-limit`, `velocity-over-limit`, `acceleration-over-limit`,
    /// `friction-table-value-missing`, `unstable`, `encoder-jump`, `speed-scale`, `approach`, `gains`, `shove`; later versions may have others.
    pub kind: String,
    /// Number of the kind, as Modbus has it.
    pub number: u8,
    /// Name of its page: `GET /api/explain/{code}`.
    pub code: String,
    /// Joint from 1 that the cause was found at first; missing: at none in particular.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joint: Option<u8>,
    /// Value that was found; missing where the kind has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<f32>,
    /// Limit of the value; missing where there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub limit: Option<f32>,
    /// Unit of value and limit; empty where they have none.
    pub unit: String,
    /// Cause in words.
    pub text: String,
    /// What removes the cause, in words.
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

/// What a controller does about what it has found.
#[derive(Clone, Debug, PartialEq, serde::Serialize, ToSchema)]
pub struct ReactionsObject {
    /// The last held stop, also when its errors have been cleared since; missing: there was none since the controller started, or since
    /// the occurred errors were cleared.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub last_held_stop: Option<HeldStopObject>,
    /// Joints from 1 that yield to a push, or lower a load.
    pub yields: Vec<u8>,
    /// Joints from 1 whose encoder has jumped: no trajectory is executed until their drives were reset.
    pub encoder_jumped: Vec<u8>,
    /// Rate of path time, path seconds per second; 0 where no trajectory is executed.
    pub path_rate: f32,
    /// Time for which this run has been held back because a torque was at its limit, s.
    pub held_back_s: f64,
}

impl From<Reacting> for ReactionsObject {
    fn from(reacting: Reacting) -> Self {
        let Reacting { last_held_stop, yields, encoder_jumped, path_rate, held_back_s } = reacting;
        let last_held_stop = last_held_stop.map(HeldStopObject::from);
        Self { last_held_stop, yields, encoder_jumped, path_rate, held_back_s }
    }
}
