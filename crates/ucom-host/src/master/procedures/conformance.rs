//! Acceptance tests for real boards. The tests check that boards follow the protocol page.
//!
//! By default, the tests only send queries, which change nothing. [`ConformanceOptions`](crate::master::conformance::ConformanceOptions)
//! can allow three more kinds of test: a new address assignment, running applications with safe outputs, and programming. Each test builds
//! its few frames itself, so the procedures of this crate do not check themselves.

mod application;
mod ask;
mod bench;
mod chain;
pub(crate) mod procedure;
mod program;
mod restore;
mod runner;
pub(crate) mod table;
