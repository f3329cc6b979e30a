//! All tests of the crate are in one program, which saves link time. Each file in this folder is a module of it.
mod arm_numbers;
mod codes_page;
mod fuzz_regressions;
mod margin;
mod serial;
mod sessions;
mod soak_paths;
