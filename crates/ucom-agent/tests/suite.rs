//! All tests of the crate are in one program, so that only one program is linked. Each file in this folder is a module of the
//! test program.
mod api;
mod attacks;
mod common;
mod description;
mod halts;
mod log;
mod orders;
mod updates;
