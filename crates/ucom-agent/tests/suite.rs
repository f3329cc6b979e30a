//! All tests of the crate in one program, so that it is linked only once. Each file in this folder is a module of that program.
mod api;
mod attacks;
mod common;
mod description;
mod halts;
mod log;
mod orders;
mod updates;
