//! Acceptance tests for real boards. The tests check that boards behave as the protocol page describes.
//!
//! By default, the tests do not change any board. [`ConformanceOptions`](crate::master::conformance::ConformanceOptions) can allow three
//! more kinds of test: tests that assign numbers again, tests that run applications with safe outputs, and tests that program a board. Each
//! test builds its few frames itself, so that the procedures of this crate do not check themselves.

mod application;
mod ask;
mod bench;
mod chain;
pub(crate) mod procedure;
mod program;
mod restore;
mod runner;
pub(crate) mod table;
