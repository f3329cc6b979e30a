//! Acceptance tests of the board side, against real boards: they check that boards follow the protocol page.
//!
//! By default the tests only ask questions that change nothing. [`ConformanceOptions`](crate::master::conformance::ConformanceOptions)
//! allows more: a new address assignment, running applications with safe outputs, programming. Each test exchanges a few frames that it
//! builds itself, so the procedures of this crate do not check themselves.

mod application;
mod ask;
mod bench;
mod chain;
pub(crate) mod procedure;
mod program;
mod restore;
mod runner;
pub(crate) mod table;
