//! docs/openapi.json is what an agent serves. `UPDATE_DOCS=1 cargo test -p jtc-agent --test suite description::` writes it.
use std::path::Path;

use host_kit::{Action, FrontEnd};
use serde_json::Value;

#[test]
fn the_description_in_the_docs_is_that_of_the_code() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/openapi.json");
    let description = format!("{}\n", jtc_agent::api::description());
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(&path, &description).expect("the page can be written");
    }
    let written = std::fs::read_to_string(&path).expect("docs/openapi.json");
    assert!(
        written == description,
        "docs/openapi.json is old: UPDATE_DOCS=1 cargo test -p jtc-agent --test suite description::"
    );
}

/// Next steps name requests, and commands where there is none.
#[test]
fn each_request_of_a_next_step_exists() {
    let description: Value = serde_json::from_str(&jtc_agent::api::description()).expect("JSON");
    for action in Action::ALL {
        let name = action.name(FrontEnd::Agent);
        let Some((before, path)) = name.split_once(" /api/") else {
            assert_eq!(name, action.name(FrontEnd::Command), "neither a request nor the command");
            continue;
        };
        let method = before.rsplit([' ', '(']).next().unwrap_or(before).to_lowercase();
        let path = format!("/api/{}", path.split([' ', ')']).next().unwrap_or(path));
        assert!(description["paths"][&path][&method].is_object(), "{action:?}: {method} {path}");
    }
}
