//! The `jtc` command.
fn main() {}
