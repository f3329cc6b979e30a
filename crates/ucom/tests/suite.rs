//! All tests of the crate are in one program, so that the crate is linked only once. Each file in this folder is a module of the test
//! program.
mod board;
mod fuzz_regressions;
