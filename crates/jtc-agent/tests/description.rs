//! The file docs/openapi.json is equal to the description that an agent serves. `UPDATE_DOCS=1 cargo test -p jtc-agent --test suite
//! description::` writes this file.
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

/// The suggested next step in each error names a request, or a command if the API has no request for this step.
#[test]
fn each_request_of_a_next_step_exists() {
    let description: Value = serde_json::from_str(&jtc_agent::api::description()).expect("JSON");
    for action in Action::ALL {
        let name = action.name(FrontEnd::Agent);
        let words: Vec<&str> = name.split([' ', '(', ')']).collect();
        let Some(i) = words.iter().position(|word| word.starts_with('/')) else {
            let typed = name.starts_with("jtc ") || name.ends_with(": true");
            assert!(typed, "{name} is neither a request nor a command");
            continue;
        };
        let (method, path) = (words[i - 1].to_lowercase(), words[i]);
        assert!(description["paths"][path][&method].is_object(), "{action:?}: {method} {path}");
    }
}
