//! The tables in docs/modbus.md must be equal to the tables in the code. The command
//! `UPDATE_DOCS=1 cargo test -p jtc-agent --test suite modbus_page::` writes the tables of
//! docs/modbus.md.
use std::path::Path;

const BEGIN: &str = "<!-- map begin -->\n";
const END: &str = "<!-- map end -->";

#[test]
fn the_map_in_the_docs_is_that_of_the_code() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/modbus.md");
    let page = std::fs::read_to_string(&path).expect("docs/modbus.md");
    let (head, rest) = page.split_once(BEGIN).expect("the beginning of the map");
    let (_, tail) = rest.split_once(END).expect("its end");
    let made = format!("{head}{BEGIN}\n{}{END}{tail}", jtc_agent::modbus::tables());
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(&path, &made).expect("the page can be written");
    } else {
        assert!(
            page == made,
            "docs/modbus.md is old: UPDATE_DOCS=1 cargo test -p jtc-agent --test suite modbus_page::"
        );
    }
}
