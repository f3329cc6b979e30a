//! The procedures of the master: `async` functions that use a [`Link`](crate::master::engine::Link).
//!
//! Each file imports only files that come before it in this list: exchange, mastership, one_board, ask_reports, byte_order, survey, scan,
//! take_number, repair, init, control, stop, raw_status, describe, run, update, probe, conformance, work.
pub(crate) mod ask_reports;
pub(crate) mod byte_order;
pub(crate) mod conformance;
pub(crate) mod control;
pub(crate) mod describe;
pub(crate) mod exchange;
pub(crate) mod init;
pub(crate) mod mastership;
pub(crate) mod one_board;
pub(crate) mod probe;
pub(crate) mod raw_status;
pub(crate) mod repair;
pub(crate) mod run;
pub(crate) mod scan;
pub(crate) mod stop;
pub(crate) mod survey;
pub(crate) mod take_number;
pub(crate) mod update;
pub(crate) mod work;
