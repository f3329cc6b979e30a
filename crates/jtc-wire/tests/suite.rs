//! The tests of the crate in one program, which links in the time of one: each file here is a module of it.
mod checks;
mod encoding;
mod frames;
mod fuzz_regressions;
mod receiver;
mod status_receiver;
mod words;
