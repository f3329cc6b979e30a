//! PC side of the protocol: procedures are state machines that do no I/O.
//!
//! A [`Master`] receives frames and the time, and returns frames that a driver must send. The master never waits, and
//! has no clock and no thread. A driver of the master is a loop of a few lines:
//!
//! 1. The driver delivers every frame that has arrived: [`Master::handle`].
//! 2. The driver sends frames as long as [`Master::poll`] returns frames.
//! 3. The driver handles the events that [`Master::take_event`] returns.
//! 4. The driver waits for the next frame, at most until [`Master::next_deadline`].
//!
//! Deliver all received frames to the master before you call `poll`. A wait of a procedure ends only in `poll`.
//! Therefore, even with a late driver, the master does not treat a board as silent if the board's answer has arrived.
//! Use [`Master::poll_behind`] if frames may arrive while the driver delivers other frames. Times are in microseconds
//! since an arbitrary start, from a monotonic clock.
//!
//! ```
//! use ucom_host::master::{Event, Master, Outcome, Request};
//! use ucom::Profile;
//!
//! let mut master = Master::new(Profile::default());
//! let id = master.start(0, Request::Scan).unwrap();
//! let mut now = 0;
//! let report = loop {
//!     while let Some(frame) = master.poll(now) {
//!         println!("{frame}"); // a driver sends it; nobody answers on this bus
//!     }
//!     match master.take_event() {
//!         Some(Event::Done { result: Ok(Outcome::Scan(report)), .. }) => break report,
//!         _ => now = master.next_deadline().expect("the scan is under way"),
//!     }
//! };
//! assert!(report.boards.is_empty());
//! ```
//!
//! A procedure that changes a board first makes this PC the master of the bus. The procedure listens for another
//! master (D-08), and then the master sends heartbeats until [`Master::end_session`]. Procedures that only scan, or
//! only read information and descriptions, do not change boards and do not send heartbeats.

mod counted;
pub mod doctor;
mod engine;
pub(crate) mod error;
#[cfg(feature = "fuzzing")]
#[doc(hidden)]
pub mod fuzzing;
mod interface;
pub mod io;
mod load;
mod procedures;
mod reports;

/// Conformance tests against the protocol page: options, tests and report.
pub mod conformance {
    pub use crate::master::procedures::conformance::table::test_names;
    pub use crate::master::reports::{
        ConformanceOptions, ConformanceProgram, ConformanceReport, ConformanceTest, Verdict,
    };
}

/// Measurement of properties in which boards may differ from the defaults: options and report.
pub mod probe {
    pub use crate::master::reports::{ProbeOptions, ProbeReport, ProbeRow};
}

/// Firmware update: options, plan and report.
pub mod update {
    pub use crate::master::error::{PlanError, SecondImageError, TargetError};
    pub use crate::master::reports::update::*;
}

pub use counted::counted;
pub use engine::{Board, Boards, Event, Life, Rate, Statistics, Supervision, WINDOW_US, state_name};
pub use error::{
    AddressError, Error, ExchangeError, IdentityError, Incomplete, LastReceived, MasterError, Received,
    RunningError, SignalError, StatusError,
};
pub use host_kit::{Diagnose, Diagnosis, ErrorKind};
pub use interface::Master;
pub use load::{LoadForecast, frame_bits};
pub use reports::{
    AdminChange, BoardSeen, InitFinding, InitOptions, InitReport, Outcome, ProcedureId, RawStatus, Reports,
    Request, RunBoard, RunOptions, RunReport, ScanFinding, ScanReport, Setting, StopLevel, expected_status,
};
