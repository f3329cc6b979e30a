//! Test program with all tests of the crate, so that only one program must be linked. Each file in this directory is a module of the
//! program.
mod dbc;
mod frames;
mod fuzz_regressions;
