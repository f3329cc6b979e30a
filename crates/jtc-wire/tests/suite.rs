//! All tests of the crate in one test program, which shortens linking. Each file in this directory is a module of the program.
mod checks;
mod encoding;
mod frames;
mod fuzz_regressions;
mod receiver;
mod status_receiver;
mod words;
