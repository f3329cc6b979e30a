//! Numbered Stops and Pauses. A motion request that a client sent before a Stop or Pause never moves the arm, even if
//! the request arrives later.
use axum::extract::FromRequestParts;
use axum::http::request::Parts;
use host_kit::Facts;
use utoipa::IntoParams;

use crate::api::{Asked, Problem};

/// Counter of the Stops and Pauses that clients have requested.
pub trait Halts {
    /// Returns the number of the last Stop or Pause; 0 before the first Stop or Pause.
    fn last_halt(&self) -> u64;
}

/// Last Stop or Pause that the client knew when it requested a motion.
#[derive(Clone, Copy, Debug, Default, serde::Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct KnownHalt {
    /// Value of `last_halt` in the status that the client used. The agent refuses this request if any client,
    /// including this one, has requested another Stop or Pause since then. Without this parameter, the agent uses the
    /// number of the last Stop or Pause before the headers of this request arrived. In both cases, the agent also
    /// refuses the request within 3 s after a Stop or Pause of another client.
    pub asked_after: Option<u64>,
}

/// Number of the last Stop or Pause before a motion request. If the client sends no number, the agent uses the number
/// at the time when the head of the request arrived. The body may arrive much later.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AskedAfter(pub u64);

impl KnownHalt {
    /// Returns the number of the last Stop or Pause before the request; `last` is the number of the last Stop or
    /// Pause that the agent has counted.
    ///
    /// # Errors
    ///
    /// The client sends a number that is higher than `last`.
    pub fn among(self, last: u64) -> Result<AskedAfter, Problem> {
        match self.asked_after {
            Some(known) if known > last => {
                let message = format!(
                    "asked_after {known} is out of range: this agent has counted {last} Stops and Pauses; it \
                     may have been restarted"
                );
                Err(Problem::new("request", message, "read last_halt with GET /api/status")
                    .with(Facts::beyond(known as f64, last as f64))
                    .unreadable())
            }
            known => Ok(AskedAfter(known.unwrap_or(last))),
        }
    }
}

impl<S: Halts + Send + Sync> FromRequestParts<S> for AskedAfter {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, agent: &S) -> Result<Self, Problem> {
        let last = agent.last_halt();
        let Asked(known) = Asked::<KnownHalt>::from_request_parts(parts, agent).await?;
        known.among(last)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_halt_that_was_never_counted_is_none() {
        let among = |asked_after, last| KnownHalt { asked_after }.among(last);
        assert_eq!(among(None, 3), Ok(AskedAfter(3)));
        assert_eq!(among(Some(0), 3), Ok(AskedAfter(0)));
        assert_eq!(among(Some(3), 3), Ok(AskedAfter(3)));
        let error = among(Some(4), 3).expect_err("three were counted");
        assert_eq!((error.facts.value, error.facts.limit), (Some(4.0), Some(3.0)));
    }
}
