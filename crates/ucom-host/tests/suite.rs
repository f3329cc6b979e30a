//! All tests of the crate are in one program, so that the program is linked only once. Each file in this folder is a module of this
//! program.
mod codes_page;
mod fuzz_regressions;
mod master;
