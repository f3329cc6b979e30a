//! The tests of the crate in one program, which needs one link step: each file here is a module of it.
mod api;
mod attacks;
mod common;
mod description;
mod halts;
mod log;
mod orders;
mod updates;
