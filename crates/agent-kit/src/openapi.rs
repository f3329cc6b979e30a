//! Parts of the descriptions of APIs, OpenAPI 3.1.
use std::collections::BTreeMap;

use axum::http::header;
use axum::routing::{MethodRouter, get};
use utoipa::openapi::security::{Http, HttpAuthScheme, SecurityScheme};
use utoipa::openapi::{OpenApi, RefOr, Response};
use utoipa::{IntoResponses, Modify};

use crate::api::Problem;

/// The description as JSON.
pub fn text(description: &OpenApi) -> String {
    // It is made of strings.
    description.to_pretty_json().unwrap_or_default()
}

/// Serves the description.
pub fn served<S: Clone + Send + Sync + 'static>(description: &OpenApi) -> MethodRouter<S> {
    let description = text(description);
    get(async move || ([(header::CONTENT_TYPE, "application/json")], description))
}

/// A token, which those on the same computer need for commands alone.
pub struct Bearer;

impl Modify for Bearer {
    fn modify(&self, description: &mut OpenApi) {
        let scheme = SecurityScheme::Http(Http::new(HttpAuthScheme::Bearer));
        description.components.get_or_insert_default().add_security_scheme("token", scheme);
    }
}

/// What a command of any agent may be refused with.
#[derive(IntoResponses)]
#[expect(dead_code, reason = "describes responses")]
enum Denials {
    /// Refused
    #[response(status = 409)]
    Denied(Problem),
    /// More than may be sent at once
    #[response(status = 413)]
    TooLarge(Problem),
    /// The body is no JSON
    #[response(status = 415)]
    NoJson(Problem),
    /// What was asked for is none
    #[response(status = 422)]
    Invalid(Problem),
    /// Something went wrong on the way
    #[response(status = 500)]
    Fault(Problem),
    /// What is commanded is not there
    #[response(status = 503)]
    Lost(Problem),
}

/// What a command may be refused with beside what every request may; in the words of an agent, why it is `denied`, and what can be `lost`.
pub fn denials(denied: &str, lost: &str) -> BTreeMap<String, RefOr<Response>> {
    let mut responses = Denials::responses();
    for (status, words) in [("409", denied), ("503", lost)] {
        if let Some(RefOr::T(response)) = responses.get_mut(status) {
            response.description = words.to_owned();
        }
    }
    responses
}
