//! Checks that docs/ucom-openapi.json equals the API description that an agent serves. `UPDATE_DOCS=1 cargo
//! test -p ucom-agent --test suite description::` writes it.
use std::path::Path;

#[test]
fn the_description_in_the_docs_is_that_of_the_code() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/ucom-openapi.json");
    let description = format!("{}\n", ucom_agent::api::description());
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(&path, &description).expect("the page can be written");
    }
    let written = std::fs::read_to_string(&path).expect("docs/ucom-openapi.json");
    assert!(
        written == description,
        "docs/ucom-openapi.json is old: UPDATE_DOCS=1 cargo test -p ucom-agent --test suite description::"
    );
}
