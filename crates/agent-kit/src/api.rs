//! What the APIs of agents share: errors, what is read of a request, and who is in front of every handler.
use axum::Json;
use axum::extract::rejection::{JsonRejection, PathRejection, QueryRejection};
use axum::extract::{FromRequest, FromRequestParts, Path, Query, Request};
use axum::http::request::Parts;
use utoipa::IntoResponses;

pub use crate::problem::Problem;

/// What every request may be refused with.
#[derive(IntoResponses)]
pub enum Refusals {
    /// What was asked cannot be read
    #[response(status = 400)]
    Unreadable(Problem),
    /// The token is missing or none of this agent's
    #[response(status = 401)]
    Token(Problem),
    /// The request comes from a page of another site, asks for another name, or has neither token nor lease for what it asks
    #[response(status = 403)]
    Elsewhere(Problem),
    /// The request takes too long, or more than it may
    #[response(status = 408)]
    Slow,
    /// Too many wrong tokens came
    #[response(status = 429)]
    Wrong(Problem),
}

/// A body of JSON.
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

/// What stands behind the question mark.
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

/// A number in the path.
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
