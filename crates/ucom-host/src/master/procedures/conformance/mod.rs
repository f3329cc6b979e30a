//! Acceptance tests of the board side, against real boards: do they follow the protocol page?
//!
//! By default the tests only ask questions that change nothing.
//! [`ConformanceOptions`](crate::master::conformance::ConformanceOptions) allows more: a new address assignment, running
//! applications with safe outputs, programming. Each test is a short conversation in frames of its own making, so that the
//! procedures of this crate are not their own judges.

mod application;
mod ask;
mod bench;
mod chain;
pub(crate) mod procedure;
mod program;
mod restore;
mod runner;
pub(crate) mod table;
