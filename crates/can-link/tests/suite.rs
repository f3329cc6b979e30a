//! The tests of the crate in one program, which links in the time of one: each file here is a module of it.
mod buses;
mod fuzz_regressions;
