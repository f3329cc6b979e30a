//! The tests of the crate in one program, so that only one program is linked. Each file here is a module of it.
mod buses;
mod fuzz_regressions;
