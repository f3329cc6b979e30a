//! Acceptance tests for real boards. The tests check that boards follow the protocol page.
//!
//! By default the tests only ask questions, which change nothing. [`ConformanceOptions`](crate::master::conformance::ConformanceOptions)
//! can allow more: a new address assignment, running applications with safe outputs, programming. Each test exchanges a few frames that it
//! builds itself, so the procedures of this crate are not used to check themselves.

mod application;
mod ask;
mod bench;
mod chain;
pub(crate) mod procedure;
mod program;
mod restore;
mod runner;
pub(crate) mod table;
