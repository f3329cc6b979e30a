//! Description of the API. `UPDATE_DOCS=1 cargo test -p ucom-agent --test suite description::` writes docs/ucom-openapi.json.
use host_kit::{Action, FrontEnd};
use test_kit::page;

#[test]
fn the_description_in_the_docs_is_that_of_the_code() {
    page::whole("ucom-openapi.json", &format!("{}\n", ucom_agent::api::description()));
}

/// The next step in an error names an HTTP request, or a command if the API has no request for this step.
#[test]
fn each_request_of_a_next_step_exists() {
    let is_own = |action: &&Action| action.name(FrontEnd::Command).starts_with("ucom ");
    let names = Action::ALL.iter().filter(is_own).map(|action| action.name(FrontEnd::Agent));
    page::check_requests(&ucom_agent::api::description(), names);
}
