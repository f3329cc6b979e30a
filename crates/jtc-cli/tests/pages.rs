//! Runs the commands of README.md and of the pages of docs/ against `jtc sim`. The commands must print the output on the page.
#![cfg(target_os = "linux")]

#[test]
fn the_pages_say_what_the_commands_print() {
    let program = std::path::Path::new(env!("CARGO_BIN_EXE_jtc"));
    test_kit::transcript::follow_all("jtc", program.parent().expect("a folder"));
}
