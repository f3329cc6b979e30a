//! All tests of the crate are in one program, because one program reduces the time for linking. Each file in this folder is a module of
//! this program.
mod arm_numbers;
mod codes_page;
mod fuzz_regressions;
mod margin;
mod serial;
mod sessions;
mod soak_paths;
