//! Requests about absent joints, for work on a bench with an incomplete arm.
use agent_kit::api::{Body, Problem, Refusals};
use agent_kit::gate::Asker;
use agent_kit::lease::LeaseKey;
use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use jtc_core::{JOINTS, settings};
use jtc_host::error::Facts;
use jtc_host::{ErrorKind, Session};
use jtc_wire::Joint;
use utoipa::ToSchema;

use super::Agent;
use super::error::Denials;
use crate::owner::ClientPort;

/// Joints that are set absent.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct AbsentObject {
    /// Joints, each at most once; empty: no joint is absent.
    #[schema(max_items = 6)]
    pub absent: Vec<AbsentJoint>,
}

/// Absent joint.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct AbsentJoint {
    /// Number of the joint, 1 to 6 from the base.
    #[schema(minimum = 1, maximum = 6)]
    pub joint: u8,
    /// Assumed position of the absent joint in the arm model, rad.
    #[schema(minimum = -6.2832, maximum = 6.2832)]
    pub position_rad: f64,
}

impl From<[Option<f64>; JOINTS]> for AbsentObject {
    fn from(absent: [Option<f64>; JOINTS]) -> Self {
        let of = |(joint, at): (Joint, Option<f64>)| {
            at.map(|position_rad| AbsentJoint { joint: joint.number(), position_rad })
        };
        Self { absent: Joint::ALL.into_iter().zip(absent).filter_map(of).collect() }
    }
}

impl AbsentObject {
    /// Returns the position of each absent joint.
    fn positions(&self) -> Result<[Option<f64>; JOINTS], Problem> {
        let (low, high) =
            settings::setting(settings::ABSENT_POSITION).map_or((0.0, 0.0), |row| (row.low, row.high));
        let mut absent = [None; JOINTS];
        for AbsentJoint { joint: number, position_rad } in &self.absent {
            let (number, value) = (usize::from(*number), *position_rad);
            let refused = |what: String, next: &'static str, limit: Option<f64>| {
                let facts = Facts {
                    joint: Joint::from_number(number).map(Joint::number),
                    value: Some(value),
                    limit,
                    ..Facts::default()
                };
                let object =
                    Problem::new("absent", format!("joint {number}: {what}; nothing was changed"), next);
                Err(object.kind(ErrorKind::Usage).with(facts))
            };
            let Some(place) = Joint::from_number(number).and_then(|joint| absent.get_mut(joint.index()))
            else {
                return refused(
                    "the joint does not exist".into(),
                    "give joints as 1 to 6, from the base",
                    None,
                );
            };
            if place.is_some() {
                return refused("the joint is listed twice".into(), "list each joint once", None);
            }
            if !(low..=high).contains(&value) {
                let limit = Some(if value < low { low } else { high });
                return refused(
                    format!("angle {value} rad is out of range ({low} to {high} rad)"),
                    "give the angle in rad",
                    limit,
                );
            }
            *place = Some(value);
        }
        Ok(absent)
    }
}

/// Returns the absent joints, and their assumed positions in the arm model.
#[utoipa::path(
    get,
    path = "/api/absent",
    operation_id = "get_absent",
    responses((status = 200, description = "Absent joints", body = AbsentObject), Refusals, Denials)
)]
pub(super) async fn absent(State(agent): State<Agent>) -> Result<Json<AbsentObject>, Problem> {
    Ok(Json(agent.ask(Session::absent).await?.into()))
}

/// Sets these joints absent, and all others present.
///
/// The controller accepts this only without torque. While a joint is absent, the controller does not execute trajectories.
#[utoipa::path(
    put,
    path = "/api/absent",
    operation_id = "set_absent",
    params(LeaseKey),
    request_body = AbsentObject,
    responses((status = 204, description = "These joints are absent, and all others are present"), Refusals, Denials)
)]
pub(super) async fn set_absent(
    State(agent): State<Agent>,
    asker: Asker,
    Body(request): Body<AbsentObject>,
) -> Result<StatusCode, Problem> {
    let positions = request.positions()?;
    let words: Vec<String> =
        request.absent.iter().map(|one| format!("joint {} at {} rad", one.joint, one.position_rad)).collect();
    let what = format!("absent: {}", if words.is_empty() { "none".to_owned() } else { words.join(", ") });
    agent
        .command(&asker, what, move |session: &mut Session<ClientPort>| session.set_absent(&positions))
        .await?;
    Ok(StatusCode::NO_CONTENT)
}
