//! All tests of the crate in one program, so that only one program must be linked. Each file here is a module of it.
mod dbc;
mod frames;
mod fuzz_regressions;
