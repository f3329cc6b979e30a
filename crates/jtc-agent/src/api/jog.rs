//! Jogging by the lease holder. The arm moves only while the user holds a key down and sees current statuses.
use std::time::Duration;

use agent_kit::api::{Asked, Body, Problem, Refusals};
use agent_kit::gate::Asker;
use agent_kit::halt::{AskedAfter, Halts as _, KnownHalt};
use agent_kit::lease::LeaseKey;
use axum::extract::{FromRequestParts, State};
use axum::http::StatusCode;
use axum::http::request::Parts;
use jtc_host::error::Facts;
use utoipa::{IntoParams, ToSchema};

use super::Agent;
use super::error::Denials;

/// Largest age of the status that the user saw, when the jog request arrives.
const SEEN_WITHIN: Duration = Duration::from_millis(500);
/// Tolerance for a status time that is later than the agent's clock. The tolerance is necessary because the client receives
/// a rounded time.
const AHEAD: Duration = Duration::from_millis(100);

/// Joint rates of a jog.
#[derive(Clone, Copy, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct JogRequest {
    /// Joint rates, rad/s, base to wrist. Rates act for 200 ms: send them again within this time, and send zeros at the end.
    #[schema(min_items = 6, max_items = 6)]
    pub rates_rad_s: [f64; 6],
}

/// Data that the client had when it requested the jog.
#[derive(Clone, Copy, Debug, Default, serde::Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct KnownToJog {
    /// Value of `last_halt` in the status that the client used. The agent refuses this request if any client,
    /// including this one, has requested another Stop or Pause since then. Without this parameter, the agent uses the
    /// number of the last Stop or Pause before the headers of this request arrived. In both cases, the agent also
    /// refuses the request within 3 s after a Stop or Pause of another client.
    asked_after: Option<u64>,
    /// Value of `at_ms` in the newest status that the user saw. If this request arrives more than 500 ms after that
    /// time, nothing moves. Rates of zero, which end the jog, are always accepted.
    as_of_ms: Option<u64>,
}

/// Data that the client had when it sent the jog request. If the client does not send the number of the last Stop or
/// Pause, the agent reads this number before it reads the request body. The body may arrive slowly.
#[derive(Clone, Copy, Debug)]
pub(super) struct JogAsked {
    after: AskedAfter,
    as_of_ms: Option<u64>,
}

impl FromRequestParts<Agent> for JogAsked {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, agent: &Agent) -> Result<Self, Problem> {
        let last = agent.last_halt();
        let Asked(KnownToJog { asked_after, as_of_ms }) = Asked::from_request_parts(parts, agent).await?;
        let after = KnownHalt { asked_after }.among(last)?;
        Ok(Self { after, as_of_ms })
    }
}

/// Returns a duration as a number of milliseconds.
const fn ms(duration: Duration) -> u64 {
    duration.as_millis() as u64
}

/// Returns the refusal of a jog request that arrived too late. The request was based on the status of the time `as_of_ms`,
/// and arrived at `arrived_ms`.
fn too_late(as_of_ms: u64, arrived_ms: u64) -> Option<Problem> {
    let (late, ahead) = (arrived_ms.saturating_sub(as_of_ms), as_of_ms.saturating_sub(arrived_ms));
    if ahead > ms(AHEAD) {
        let message = format!(
            "as_of_ms {as_of_ms} is in the future: this agent started {arrived_ms} ms ago; it may have been \
             restarted"
        );
        let facts = Facts::beyond(as_of_ms as f64, arrived_ms as f64);
        return Some(
            Problem::new("request", message, "read at_ms with GET /api/status").with(facts).unreadable(),
        );
    }
    (late > ms(SEEN_WITHIN)).then(|| {
        let limit = ms(SEEN_WITHIN);
        let message = format!(
            "jog request is too late: the displayed status was {late} ms old, limit {limit} ms; nothing moved"
        );
        let facts = Facts::beyond(late as f64, limit as f64);
        let next = "use a faster connection, or a move instead of a jog";
        Problem::new("late", message, next).with(facts)
    })
}

/// Moves single joints while the request is repeated.
#[utoipa::path(
    post,
    path = "/api/jog",
    params(LeaseKey, KnownToJog),
    request_body = JogRequest,
    responses((status = 204, description = "The joints move at these rates for 200 ms"), Refusals, Denials)
)]
pub(super) async fn jog(
    State(agent): State<Agent>,
    asker: Asker,
    JogAsked { after, as_of_ms }: JogAsked,
    Body(JogRequest { rates_rad_s }): Body<JogRequest>,
) -> Result<StatusCode, Problem> {
    let http_session = agent.http_session(&asker)?;
    let turn = http_session.turn()?;
    let moves = rates_rad_s.iter().any(|rate| *rate != 0.0);
    // The arrival time is taken here, when the body is complete, because the body may have arrived later than the
    // head.
    let arrived_ms = agent.now_ms();
    if let Some(late) = as_of_ms.filter(|_| moves).and_then(|as_of_ms| too_late(as_of_ms, arrived_ms)) {
        // This request is too late and moves nothing. The request shows, however, that the jog key is still pressed, so
        // it extends the hold-off: after a Stop, the user must release the key.
        agent.line.with(|line, now| line.could_jog(http_session.client, now))?;
        return Err(late);
    }
    agent.line.with(|line, now| line.ask_to_jog(http_session.client, after.0, now))?;
    agent.act(&http_session, turn, "jog", move |session| session.jog(&rates_rad_s)).await?;
    Ok(StatusCode::NO_CONTENT)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_jog_is_late_behind_what_was_seen_and_wrong_ahead_of_it() {
        let code = |as_of, arrived| too_late(as_of, arrived).map(|error| error.code);
        assert_eq!((code(1_000, 1_500), code(1_000, 1_501)), (None, Some("late")));
        assert_eq!((code(1_100, 1_000), code(1_101, 1_000)), (None, Some("request")));
        let facts = too_late(1_000, 1_700).map(|error| (error.facts.value, error.facts.limit));
        assert_eq!(facts, Some((Some(700.0), Some(500.0))));
        assert_eq!(code(u64::MAX, 0), Some("request"));
        assert_eq!(code(0, u64::MAX), Some("late"));
    }
}
