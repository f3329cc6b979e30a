//! Data that procedures receive and return: requests with options, and outcomes with reports and findings. This module does not send frames
//! and does not wait.
mod conformance;
mod flags;
mod init;
mod probe;
mod raw_status;
mod request;
mod run;
mod scan;
mod seen;
pub(super) mod update;

pub use conformance::{ConformanceOptions, ConformanceProgram, ConformanceReport, ConformanceTest, Verdict};
pub use flags::{AdminChange, StopLevel};
pub use init::{InitFinding, InitOptions, InitReport};
pub use probe::{ProbeOptions, ProbeReport, ProbeRow};
pub use raw_status::{RawStatus, expected_status};
pub use request::{Outcome, ProcedureId, Request};
pub use run::{RunBoard, RunOptions, RunReport, Setting};
pub use scan::{Reports, ScanFinding, ScanReport};
pub use seen::BoardSeen;
