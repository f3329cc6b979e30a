//! Parts of API descriptions in OpenAPI 3.1.
use std::cmp::Reverse;
use std::collections::BTreeMap;

use axum::http::{StatusCode, header};
use axum::routing::{MethodRouter, get};
use utoipa::openapi::security::{Http, HttpAuthScheme, SecurityScheme};
use utoipa::openapi::{OpenApi, Ref, RefOr, Response};
use utoipa::{IntoResponses, Modify};

use crate::api::Problem;

/// Returns the API description as JSON. A response that several operations share appears only once.
pub fn text(description: &OpenApi) -> String {
    let mut description = description.clone();
    share_responses(&mut description);
    // All keys of the API description are strings, so the conversion cannot fail.
    description.to_pretty_json().unwrap_or_default()
}

/// Moves responses that several operations share to the components of the API description. The name of a shared
/// response comes from its HTTP status: `NotFound`, `NotFound2`.
fn share_responses(description: &mut OpenApi) {
    let mut counts: Vec<(String, RefOr<Response>, u32)> = Vec::new();
    for_each_response(description, |status, response| {
        match counts.iter_mut().find(|(of, same, _)| of == status && same == response) {
            Some((.., count)) => *count += 1,
            None => counts.push((status.to_owned(), response.clone(), 1)),
        }
    });
    counts.retain(|(.., count)| *count > 1);
    // The most frequent response with a given status gets the name without a number.
    counts.sort_by_key(|(status, _, count)| (status.clone(), Reverse(*count)));
    let mut names: Vec<String> = Vec::new();
    for (status, ..) in &counts {
        let name = status_name(status);
        let numbered = (2..).map(|number| format!("{name}{number}"));
        let free = [name.clone()].into_iter().chain(numbered).find(|name| !names.contains(name));
        names.extend(free);
    }
    for_each_response(description, |status, response| {
        if let Some(i) = counts.iter().position(|(of, same, _)| of == status && same == response) {
            *response = RefOr::Ref(Ref::from_response_name(&names[i]));
        }
    });
    let shared = names.into_iter().zip(counts.into_iter().map(|(_, response, _)| response));
    description.components.get_or_insert_default().responses.extend(shared);
}

/// Calls `act` with the status and the response of every operation.
fn for_each_response(description: &mut OpenApi, mut act: impl FnMut(&str, &mut RefOr<Response>)) {
    for item in description.paths.paths.values_mut() {
        let operations = [&mut item.get, &mut item.put, &mut item.post, &mut item.patch, &mut item.delete];
        for operation in operations.into_iter().flatten() {
            operation.responses.responses.iter_mut().for_each(|(status, response)| act(status, response));
        }
    }
}

/// Returns the name of a status without spaces, for example `NotFound` for 404.
fn status_name(status: &str) -> String {
    let code = status.parse().ok().and_then(|code: u16| StatusCode::from_u16(code).ok());
    let reason = code.and_then(|code| code.canonical_reason()).unwrap_or("Response");
    reason.replace(' ', "")
}

/// Returns a route that serves the API description.
pub fn served<S: Clone + Send + Sync + 'static>(description: &OpenApi) -> MethodRouter<S> {
    let description = text(description);
    get(async move || ([(header::CONTENT_TYPE, "application/json")], description))
}

/// Token of a client; clients on the same computer need a token for commands only.
pub struct Bearer;

impl Modify for Bearer {
    fn modify(&self, description: &mut OpenApi) {
        let scheme = SecurityScheme::Http(Http::new(HttpAuthScheme::Bearer));
        description.components.get_or_insert_default().add_security_scheme("token", scheme);
    }
}

/// Refusals that a command of any agent can receive.
#[derive(IntoResponses)]
#[expect(dead_code, reason = "describes responses")]
enum Denials {
    /// The request is refused
    #[response(status = 409)]
    Denied(Problem),
    /// The request is larger than allowed
    #[response(status = 413)]
    TooLarge(Problem),
    /// The body is not JSON
    #[response(status = 415)]
    NoJson(Problem),
    /// The request contains an invalid value
    #[response(status = 422)]
    Invalid(Problem),
    /// An error occurred during the request
    #[response(status = 500)]
    Fault(Problem),
    /// The device is lost
    #[response(status = 503)]
    Lost(Problem),
}

/// Returns the refusals of commands, in addition to the refusals that every request can receive. `denied` and `lost`
/// are the agent's texts for the statuses 409 and 503.
pub fn denials(denied: &str, lost: &str) -> BTreeMap<String, RefOr<Response>> {
    let mut responses = Denials::responses();
    for (status, words) in [("409", denied), ("503", lost)] {
        if let Some(RefOr::T(response)) = responses.get_mut(status) {
            response.description = words.to_owned();
        }
    }
    responses
}

#[cfg(test)]
mod tests {
    use utoipa::openapi::path::{HttpMethod, Operation};
    use utoipa::openapi::{PathItem, ResponseBuilder};

    use super::*;

    fn operation(responses: &[(&str, &str)]) -> Operation {
        let mut operation = Operation::default();
        for (status, words) in responses {
            let response = ResponseBuilder::new().description(*words).build();
            operation.responses.responses.insert((*status).to_owned(), response.into());
        }
        operation
    }

    #[test]
    fn a_response_that_several_operations_have_stands_in_the_description_once() {
        let mut description = OpenApi::default();
        let own = [("200", "one"), ("200", "two"), ("404", "no pose")];
        for (i, own) in own.into_iter().enumerate() {
            let operation = operation(&[own, ("409", "refused")]);
            description.paths.paths.insert(format!("/{i}"), PathItem::new(HttpMethod::Get, operation));
        }
        let item = PathItem::new(HttpMethod::Put, operation(&[("404", "no pose"), ("409", "other")]));
        description.paths.paths.insert("/put".into(), item);
        share_responses(&mut description);
        let shared = &description.components.as_ref().expect("there are shared ones").responses;
        assert_eq!(shared.keys().collect::<Vec<_>>(), ["Conflict", "NotFound"]);
        let mut left = Vec::new();
        for_each_response(&mut description, |status, response| match response {
            RefOr::Ref(to) => left.push(format!("{status} {}", to.ref_location)),
            RefOr::T(response) => left.push(format!("{status} {}", response.description)),
        });
        left.sort();
        let conflict = "409 #/components/responses/Conflict";
        let found = "404 #/components/responses/NotFound";
        assert_eq!(left, ["200 one", "200 two", found, found, conflict, conflict, conflict, "409 other"]);
    }
}
