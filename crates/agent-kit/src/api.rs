//! Parts that the APIs of agents share: errors, extractors for requests, and the identity of the client.
use axum::Json;
use axum::extract::rejection::{JsonRejection, PathRejection, QueryRejection};
use axum::extract::{FromRequest, FromRequestParts, Path, Query, Request};
use axum::http::request::Parts;
use utoipa::IntoResponses;

pub use crate::finding::FindingObject;
pub use crate::problem::Problem;

/// Refusals that every request can receive.
#[derive(IntoResponses)]
pub enum Refusals {
    /// The request cannot be read
    #[response(status = 400)]
    Unreadable(Problem),
    /// The token is missing or does not belong to this agent
    #[response(status = 401)]
    Token(Problem),
    /// The request comes from a page of another site, uses another host name, or lacks the required token or lease
    #[response(status = 403)]
    Elsewhere(Problem),
    /// The request takes longer than allowed
    #[response(status = 408)]
    Slow,
    /// Too many wrong tokens were sent
    #[response(status = 429)]
    Wrong(Problem),
}

/// JSON body of a request.
pub struct Body<T>(pub T);

impl<T, S: Send + Sync> FromRequest<S> for Body<T>
where
    Json<T>: FromRequest<S, Rejection = JsonRejection>,
{
    type Rejection = Problem;

    async fn from_request(request: Request, state: &S) -> Result<Self, Problem> {
        let Json(body) = Json::from_request(request, state)
            .await
            .map_err(|e| Problem::rejected(e.status(), e.body_text()))?;
        Ok(Self(body))
    }
}

/// Query parameters of a request.
pub struct Asked<T>(pub T);

impl<T, S: Send + Sync> FromRequestParts<S> for Asked<T>
where
    Query<T>: FromRequestParts<S, Rejection = QueryRejection>,
{
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let asked = Query::from_request_parts(parts, state).await;
        let Query(asked) = asked.map_err(|e| Problem::rejected(e.status(), e.body_text()))?;
        Ok(Self(asked))
    }
}

/// Number in the path of a request.
pub struct Number<T>(pub T);

impl<T, S: Send + Sync> FromRequestParts<S> for Number<T>
where
    Path<T>: FromRequestParts<S, Rejection = PathRejection>,
{
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let path = Path::from_request_parts(parts, state).await;
        let Path(number) = path.map_err(|e| Problem::rejected(e.status(), e.body_text()))?;
        Ok(Self(number))
    }
}
