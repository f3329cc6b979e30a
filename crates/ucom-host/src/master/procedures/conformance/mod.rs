//! Whether boards follow the protocol page: the acceptance tests of the board side, against boards that are there.
//!
//! By default only what changes nothing is asked. More is allowed by
//! [`ConformanceOptions`](crate::master::conformance::ConformanceOptions): a new address assignment,
//! running applications with safe outputs, programming. Each test is a short conversation in frames of its own making, so that
//! the procedures of this crate are not their own judges.

mod application;
mod ask;
mod bench;
mod chain;
pub(crate) mod procedure;
mod program;
mod restore;
mod runner;
pub(crate) mod table;
