//! All tests of the crate in one program, so that only one program must be linked. Each file in this folder is a module of that program.
mod checks;
mod encoding;
mod frames;
mod fuzz_regressions;
mod receiver;
mod status_receiver;
mod words;
