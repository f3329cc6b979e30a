//! All tests of the crate in one program, so that it is linked only once. Each file in this folder is a module of
//! this program.
mod board;
mod fuzz_regressions;
