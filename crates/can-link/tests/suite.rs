//! The tests of the crate in one program, so that only one program is linked. Each file in this directory is a module
//! of the program.
mod buses;
mod fuzz_regressions;
