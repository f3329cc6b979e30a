//! Diagnosis of a bus: listens, sends queries if the queries cannot do harm, and reports findings.

use std::time::{Duration, Instant};

use can_link::ErrorState;
use host_kit::{ErrorKind, Finding, Severity};

use super::driver::Driver;
use super::error::SessionError;
use super::link::Link;
use crate::master::doctor::{Controller, Observation, findings};
use crate::master::{BoardSeen, Outcome, Request};

/// Result of the diagnosis of a bus.
#[derive(Clone, Debug)]
pub struct Examination {
    /// Findings, the most serious first.
    pub findings: Vec<Finding>,
    /// Boards that answered.
    pub boards: Vec<BoardSeen>,
    /// Number of frames that were received from boards.
    pub received: u64,
}

impl Examination {
    /// Returns the kind of failure; returns `None` if the diagnosis found no problem.
    pub fn failure(&self) -> Option<ErrorKind> {
        let bad = self.findings.iter().any(|f| f.severity == Severity::Problem);
        bad.then_some(if self.received == 0 { ErrorKind::NoLink } else { ErrorKind::Device })
    }
}

impl Driver {
    /// Listens to the bus for the time `listen`, and then scans the bus. If a competing master is on the bus, no query is sent, because a
    /// query could interfere with the queries of that master (D-08).
    ///
    /// # Errors
    /// Returns an error if the bus failed or if the operator requested an end.
    pub fn examine(&mut self, listen: Duration) -> Result<Examination, SessionError> {
        let (start, start_us) = (Instant::now(), self.now_us());
        while start.elapsed() < listen && !self.stop_asked() {
            self.turn(Duration::from_millis(50))?;
            while let Some(event) = self.master.take_event() {
                self.pass_over(&event);
            }
        }
        let received = self.master.competing_master().filter(|(at, ..)| *at >= start_us);
        let competing_master = received.map(|(_, function, to)| (function, to));
        let scan = match competing_master {
            Some(_) => None,
            None => match self.run(Request::Scan)? {
                Outcome::Scan(report) => Some(report),
                other => return Err(other.into()),
            },
        };
        let controller = self.controller();
        let seen = Observation {
            listened_us: listen.as_micros() as u64,
            now_us: self.now_us(),
            statistics: self.master.statistics(),
            boards: self.master.boards(),
            controller,
            scan,
            competing_master,
            profile: self.master.profile(),
            ..Default::default()
        };
        let findings = findings(&seen);
        let boards = seen.scan.map(|scan| scan.boards).unwrap_or_default();
        Ok(Examination { findings, boards, received: seen.statistics.received })
    }

    /// Returns the state that the CAN adapter reports; returns `None` if the adapter does not report its state.
    pub fn controller(&mut self) -> Option<Controller> {
        self.link().controller()
    }
}

impl Link {
    /// Returns the state that the CAN adapter reports; returns `None` if the adapter does not report its state.
    pub fn controller(&mut self) -> Option<Controller> {
        let state = self.state();
        (state.errors != ErrorState::Unknown).then_some(Controller {
            bus_off: state.errors == ErrorState::BusOff,
            times_bus_off: self.times_bus_off(),
            passive: state.errors == ErrorState::Passive,
            tec: state.tec,
            rec: state.rec,
            ..Default::default()
        })
    }
}
