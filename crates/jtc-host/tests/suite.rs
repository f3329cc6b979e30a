//! All tests of the crate are in one program, because linking one program takes less time than linking many. Each
//! file in this folder is a module of this program.
mod arm_numbers;
mod codes_page;
mod fuzz_regressions;
mod margin;
mod serial;
mod sessions;
mod soak_paths;
