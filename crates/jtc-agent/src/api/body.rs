//! Long request bodies. The agent limits how many large bodies it reads at the same time, and parses them on threads
//! that do not serve requests.
use agent_kit::api::Problem;
use axum::Json;
use axum::body::Bytes;
use axum::extract::{FromRequest, OptionalFromRequest, Request};
use axum::http::StatusCode;
use jtc_host::ErrorKind;
use serde::de::DeserializeOwned;

use super::Agent;

/// JSON body of a request, which may be missing.
pub(super) struct Perhaps<T>(pub Option<T>);

impl<T: DeserializeOwned, S: Send + Sync> FromRequest<S> for Perhaps<T> {
    type Rejection = Problem;

    async fn from_request(request: Request, state: &S) -> Result<Self, Problem> {
        let body = <Json<Option<T>> as OptionalFromRequest<S>>::from_request(request, state).await;
        let body = body.map_err(|e| Problem::rejected(e.status(), e.body_text()))?;
        Ok(Self(body.and_then(|Json(body)| body)))
    }
}

/// Reads a JSON request body and converts it with `understand`. The conversion is completed even if the client
/// disconnects.
pub(super) async fn read<B: DeserializeOwned, T: Send + 'static>(
    agent: &Agent,
    request: Request,
    understand: impl FnOnce(B) -> Result<T, Problem> + Send + 'static,
) -> Result<T, Problem> {
    let room = agent.bodies.clone().acquire_owned().await;
    let body =
        Bytes::from_request(request, &()).await.map_err(|e| Problem::rejected(e.status(), e.body_text()))?;
    blocking(move || {
        let read = serde_json::from_slice(&body)
            .map_err(|e| Problem::rejected(StatusCode::BAD_REQUEST, e.to_string()));
        drop(body);
        let understood = read.and_then(understand);
        drop(room);
        understood
    })
    .await?
}

/// Runs a slow function on a separate thread, so that other requests are served at the same time.
pub(super) async fn blocking<T: Send + 'static>(
    act: impl FnOnce() -> T + Send + 'static,
) -> Result<T, Problem> {
    tokio::task::spawn_blocking(act).await.map_err(|_| {
        Problem::new("fault", "internal error of the agent", "read the output of the agent")
            .kind(ErrorKind::Fault)
    })
}
