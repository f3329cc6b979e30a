//! Exit codes of the command `ucom` for the reports of the master.

use ucom_host::master::conformance::ConformanceReport;
use ucom_host::master::update::UpdateReport;
use ucom_host::master::{Diagnose, Error, ErrorKind, InitReport};

/// Exit code of the command `ucom`, as the documentation of the command defines it.
pub(super) trait Exit {
    fn exit(&self) -> u8;
}

fn code(kind: Option<ErrorKind>) -> u8 {
    match kind {
        None => 0,
        Some(ErrorKind::Device) => 1,
        Some(ErrorKind::Usage) => 2,
        Some(ErrorKind::NoLink) => 3,
        Some(ErrorKind::Refused) => 4,
        Some(ErrorKind::Fault) => 5,
    }
}

impl Exit for Error {
    fn exit(&self) -> u8 {
        code(Some(self.kind()))
    }
}

impl Exit for InitReport {
    fn exit(&self) -> u8 {
        code(self.failure())
    }
}

impl Exit for UpdateReport {
    fn exit(&self) -> u8 {
        code(self.failure())
    }
}

impl Exit for ConformanceReport {
    fn exit(&self) -> u8 {
        code(self.failure())
    }
}
