//! The commands of README.md and of the pages of docs/ are typed as they stand there, against `ucom sim`, and print what is shown.
#![cfg(target_os = "linux")]

#[test]
fn the_pages_say_what_the_commands_print() {
    let program = std::path::Path::new(env!("CARGO_BIN_EXE_ucom"));
    test_kit::transcript::follow_all("ucom", program.parent().expect("a folder"));
}
