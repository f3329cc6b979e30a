//! The table of reactions in docs/safety.md is what the controller does. `UPDATE_DOCS=1` writes it again.
use std::path::Path;

use jtc_sim::matrix::fault_matrix;

const BEGIN: &str = "<!-- fault matrix begin -->\n";
const END: &str = "<!-- fault matrix end -->";

#[test]
fn j12_j14_j16_j21_j22_each_fault_in_each_state_has_the_documented_reaction() {
    let matrix = fault_matrix().unwrap_or_else(|error| panic!("{error}"));
    println!("{matrix}");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/safety.md");
    let text = std::fs::read_to_string(&path).expect("docs/safety.md is there");
    let begin = text.find(BEGIN).expect("safety.md has the beginning mark") + BEGIN.len();
    let end = begin + text[begin..].find(END).expect("safety.md has the end mark");
    if std::env::var_os("UPDATE_DOCS").is_some() {
        let new = format!("{}{matrix}{}", &text[..begin], &text[end..]);
        std::fs::write(&path, new).expect("docs/safety.md can be written");
    } else {
        assert!(
            text[begin..end] == matrix,
            "docs/safety.md does not say what the controller does: look at the difference, then `cargo xtask docs`"
        );
    }
}
