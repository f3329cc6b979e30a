//! The tests of the crate in one program, which needs one link step: each file here is a module of it.
mod codes_page;
mod fuzz_regressions;
mod master;
