//! Runs the commands in README.md and in the pages of docs/ unchanged with `ucom sim`. The commands
//! must print the output that the pages show.
#![cfg(target_os = "linux")]

#[test]
fn the_pages_say_what_the_commands_print() {
    let program = std::path::Path::new(env!("CARGO_BIN_EXE_ucom"));
    test_kit::transcript::follow_all("ucom", program.parent().expect("a folder"));
}
