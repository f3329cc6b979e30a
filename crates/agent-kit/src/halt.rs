//! Halts are counted: what was asked for before one does nothing behind it, however long it was on its way.
use axum::extract::FromRequestParts;
use axum::http::request::Parts;
use host_kit::Facts;
use utoipa::IntoParams;

use crate::api::{Asked, Problem};

/// What counts the halts that were asked for.
pub trait Halts {
    /// Number of the last one; 0: there was none.
    fn last_halt(&self) -> u64;
}

/// What the client knew when it asked for what may move something.
#[derive(Clone, Copy, Debug, Default, serde::Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct KnownHalt {
    /// `last_halt` of the status that the client looked at. Where another halt has come since then, also by this client, nothing moves,
    /// however long this request was on its way. Missing: the last one when the head of this request arrived; it is refused within 3 s
    /// behind a halt of others.
    pub asked_after: Option<u64>,
}

/// The last halt behind which something was asked for: the one that the client names, else the last when its request arrived. That is taken
/// before its body, which may be long on its way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AskedAfter(pub u64);

impl KnownHalt {
    /// The halt behind which something was asked for, when `last` was the last one that was counted.
    ///
    /// # Errors
    ///
    /// The client names one that was never counted.
    pub fn among(self, last: u64) -> Result<AskedAfter, Problem> {
        match self.asked_after {
            Some(known) if known > last => {
                let message = format!(
                    "asked_after {known}: this agent has counted {last} halts; it may have been started again"
                );
                Err(Problem::new("request", message, "GET /api/status has last_halt")
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
