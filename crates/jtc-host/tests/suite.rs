//! All tests of the crate in one program, to save link time: each file here is a module of it.
mod arm_numbers;
mod codes_page;
mod fuzz_regressions;
mod margin;
mod serial;
mod sessions;
mod soak_paths;
