//! Reads the controller's settings, and changes the settings in a list. Either all settings in the list are changed, or
//! none of them.
use agent_kit::api::{Body, Problem, Refusals};
use agent_kit::gate::Asker;
use agent_kit::lease::LeaseKey;
use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use jtc_core::settings::{self, Live, PAYLOAD, Setting};
use jtc_host::error::Facts;
use jtc_host::{ErrorKind, Session};
use jtc_wire::{Joint, SET_VALUES_MAX, SettingValue};
use utoipa::ToSchema;

use super::Agent;
use super::error::Denials;
use crate::owner::ClientPort;

/// Error code for an unknown or refused setting.
const CODE: &str = "setting";

/// Condition under which a setting may be changed.
#[derive(Clone, Copy, Debug, serde::Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub(super) enum When {
    /// Without torque: in Init and in Error.
    Unpowered,
    /// Also during position hold, Teaching or a pause.
    Standing,
    /// Also in motion.
    Always,
}

impl From<Live> for When {
    fn from(live: Live) -> Self {
        match live {
            Live::No | Live::Unpowered => Self::Unpowered,
            Live::Standing => Self::Standing,
            Live::Always => Self::Always,
        }
    }
}

/// Setting of the controller.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(super) struct SettingObject {
    /// Name of the setting, with its unit.
    pub name: String,
    /// Number of the joint, 1 to 6 from the base; missing: a setting of the whole arm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joint: Option<u8>,
    /// Value; switches are 0 or 1.
    pub value: f64,
    /// Unit; empty for a setting without a unit.
    pub unit: String,
    /// Lowest value.
    pub low: f64,
    /// Highest value.
    pub high: f64,
    /// `true` if only whole numbers are possible.
    pub whole: bool,
    /// Condition under which the setting may be changed.
    pub when: When,
    /// `true` if the setting is stored with the arm and included in the hash of the arm.
    pub of_arm: bool,
    /// Meaning of the setting.
    pub meaning: String,
}

impl SettingObject {
    fn new(row: &Setting, SettingValue { joint, value, .. }: SettingValue) -> Self {
        Self {
            name: row.name.to_owned(),
            joint: Joint::from_number(joint.into()).map(Joint::number),
            value,
            unit: row.unit.to_owned(),
            low: row.low,
            high: row.high,
            whole: row.whole,
            when: row.live.into(),
            of_arm: row.of_arm(),
            meaning: row.meaning.to_owned(),
        }
    }
}

/// New value of a setting.
#[derive(Clone, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SettingChange {
    /// Name of the setting, with its unit.
    pub name: String,
    /// Number of the joint, from the base; missing for a setting of the arm.
    #[serde(default)]
    #[schema(minimum = 1, maximum = 6)]
    pub joint: Option<u8>,
    /// Value; switches are 0 or 1.
    pub value: f64,
}

/// Settings to change. The controller changes all of them, or none.
#[derive(Clone, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SettingsRequest {
    /// Settings, each at most once.
    #[schema(min_items = 1, max_items = 256)]
    pub settings: Vec<SettingChange>,
}

impl SettingsRequest {
    /// Converts the values of the settings to the form of the protocol.
    fn values(&self) -> Result<Vec<SettingValue>, Problem> {
        let count = self.settings.len();
        if !(1..=SET_VALUES_MAX).contains(&count) {
            let message = format!(
                "number of settings is out of range: {count}, expected 1 to {SET_VALUES_MAX} per request"
            );
            return Err(none(message, "send the settings in several requests"));
        }
        let mut values: Vec<SettingValue> = Vec::with_capacity(count);
        for change in &self.settings {
            let value = change.value()?;
            if values.iter().any(|other| (other.setting, other.joint) == (value.setting, value.joint)) {
                let message = format!("{} is listed twice; nothing was changed", change.words());
                return Err(none(message, "send each setting once").with(change.facts()));
            }
            values.push(value);
        }
        Ok(values)
    }

    /// Returns a text about the settings for the command log.
    fn words(&self) -> String {
        let all: Vec<String> =
            self.settings.iter().map(|change| format!("{} = {}", change.words(), change.value)).collect();
        format!("settings: {}", all.join(", "))
    }
}

impl SettingChange {
    /// Returns the value of the setting in the form of the protocol. Returns an error if the setting does not exist or
    /// the value is out of range.
    fn value(&self) -> Result<SettingValue, Problem> {
        let row = settings::named(&self.name).ok_or_else(|| {
            let message = format!("there is no setting {:?}; nothing was changed", short(&self.name));
            none(message, "list the settings with GET /api/settings")
        })?;
        if PAYLOAD.contains(&row.number) {
            let message = format!("{} is part of the payload; nothing was changed", row.name);
            return Err(none(
                message,
                "change the payload with PUT /api/payload, which checks that the arm can hold it",
            ));
        }
        let refused = |what: &str, next: &'static str| {
            let message = format!("{}: {what}; nothing was changed", self.words());
            Err(none(message, next).with(self.facts()))
        };
        let joint = match (self.joint, row.of_joint()) {
            (None, false) => 0,
            (Some(joint @ 1..=6), true) => joint,
            (Some(_), true) => {
                return refused("the joint does not exist", "give the joint as 1 to 6, from the base");
            }
            (None, true) => {
                return refused(
                    "the joint is missing: each joint has its own value",
                    "set joint to 1 to 6, counted from the base",
                );
            }
            (Some(_), false) => {
                return refused("this setting belongs to the arm, not to a joint", "leave out joint");
            }
        };
        let Self { value, .. } = *self;
        let facts = |limit| Facts { limit: Some(limit), ..self.facts() };
        let (low, high) = (row.low, row.high);
        if !(low..=high).contains(&value) {
            let message = format!(
                "{}: {value} {} is out of range ({low} to {high}); nothing was changed",
                self.words(),
                row.unit
            );
            let limit = if value < low { low } else { high };
            return Err(
                none(message, "read the range of each setting with GET /api/settings").with(facts(limit))
            );
        }
        if row.whole && value.fract() != 0.0 {
            return refused(
                "only whole numbers are valid",
                "read the range of each setting with GET /api/settings",
            );
        }
        Ok(SettingValue { setting: row.number, joint, value })
    }

    fn words(&self) -> String {
        let name = short(&self.name);
        self.joint.map_or_else(|| name.clone(), |joint| format!("{name} of joint {joint}"))
    }

    fn facts(&self) -> Facts {
        let joint = self.joint.and_then(|joint| Joint::from_number(joint.into())).map(Joint::number);
        Facts { joint, value: Some(self.value), ..Facts::default() }
    }
}

/// Returns the name of a setting in a request, without control characters and at most 64 characters long.
fn short(name: &str) -> String {
    agent_kit::gate::plain(name)
}

/// Returns the error for a refused change of settings. Each setting in the list still has its old value.
fn none(message: String, next: &'static str) -> Problem {
    Problem::new(CODE, message, next).kind(ErrorKind::Usage)
}

/// Returns all settings of the controller.
#[utoipa::path(
    get,
    path = "/api/settings",
    operation_id = "get_settings",
    responses((status = 200, description = "Settings that this agent knows, in the order of their numbers", body = Vec<SettingObject>), Refusals, Denials)
)]
pub(super) async fn list(State(agent): State<Agent>) -> Result<Json<Vec<SettingObject>>, Problem> {
    let values = agent.ask(|session| Ok(session.settings()?)).await?;
    let known = values
        .into_iter()
        .filter_map(|value| settings::setting(value.setting).map(|row| SettingObject::new(row, value)));
    Ok(Json(known.collect()))
}

/// Changes all settings of the request, or none of them.
///
/// The controller accepts most changes only without torque.
#[utoipa::path(
    put,
    path = "/api/settings",
    operation_id = "set_settings",
    params(LeaseKey),
    request_body = SettingsRequest,
    responses((status = 204, description = "The controller has the new values"), Refusals, Denials)
)]
pub(super) async fn change(
    State(agent): State<Agent>,
    asker: Asker,
    Body(request): Body<SettingsRequest>,
) -> Result<StatusCode, Problem> {
    let values = request.values()?;
    let change = move |session: &mut Session<ClientPort>| session.change_settings(&values);
    agent.command(&asker, request.words(), change).await?;
    Ok(StatusCode::NO_CONTENT)
}
