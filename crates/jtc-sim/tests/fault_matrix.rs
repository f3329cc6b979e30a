//! The table of reactions in docs/safety.md is what the controller does. `UPDATE_DOCS=1` writes it again.
use std::path::Path;

use jtc_sim::matrix::{fault_matrix, standstill_table, stopping_table};

#[test]
fn j12_j14_j16_j21_j22_each_fault_in_each_state_has_the_documented_reaction() {
    // All in one test: they write the same file.
    documented("fault matrix", &fault_matrix().unwrap_or_else(|error| panic!("{error}")));
    documented("standstill", &standstill_table().unwrap_or_else(|error| panic!("{error}")));
    documented("stopping", &stopping_table().unwrap_or_else(|error| panic!("{error}")));
}

/// The table between the marks of that name in docs/safety.md is `table`, or is made so.
fn documented(name: &str, table: &str) {
    println!("{table}");
    let mark = format!("<!-- {name} begin -->\n");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/safety.md");
    let text = std::fs::read_to_string(&path).expect("docs/safety.md is there");
    let begin = text.find(&mark).expect("safety.md has the beginning mark") + mark.len();
    let end =
        begin + text[begin..].find(&format!("<!-- {name} end -->")).expect("safety.md has the end mark");
    if std::env::var_os("UPDATE_DOCS").is_some() {
        let new = format!("{}{table}{}", &text[..begin], &text[end..]);
        std::fs::write(&path, new).expect("docs/safety.md can be written");
    } else {
        assert!(
            &text[begin..end] == table,
            "docs/safety.md differs from what the controller does: look at the difference, then `cargo xtask docs`"
        );
    }
}
