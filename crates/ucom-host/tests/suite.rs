//! All tests of the crate are modules of one program, so that the program is linked only once. Each file in this folder is a module of the
//! test program.
mod codes_page;
mod fuzz_regressions;
mod master;
