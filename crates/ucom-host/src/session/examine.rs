//! A doctor's look at a bus: it listens, asks where that cannot do harm, and reports what it found.

use std::time::{Duration, Instant};

use can_link::ErrorState;
use host_kit::{ErrorKind, Finding, Severity};

use super::driver::Driver;
use super::error::SessionError;
use super::link::Link;
use crate::master::doctor::{Controller, Observation, findings};
use crate::master::{BoardSeen, Outcome, Request};

/// What was found.
#[derive(Clone, Debug)]
pub struct Examination {
    /// The worst first.
    pub findings: Vec<Finding>,
    /// The boards that answered.
    pub boards: Vec<BoardSeen>,
    /// Frames of boards that were received.
    pub received: u64,
}

impl Examination {
    /// What kind of failure it is; `None`: nothing is a problem.
    pub fn failure(&self) -> Option<ErrorKind> {
        let bad = self.findings.iter().any(|f| f.severity == Severity::Problem);
        bad.then_some(if self.received == 0 { ErrorKind::NoLink } else { ErrorKind::Device })
    }
}

impl Driver {
    /// Listens to the bus for a while, then asks who is there. With a competing master on the bus nothing is asked: even questions
    /// could mix with its own (D-08).
    ///
    /// # Errors
    /// The bus failed, or the operator asked for an end.
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

    /// What the CAN adapter reports about itself; none where it reports nothing.
    pub fn controller(&mut self) -> Option<Controller> {
        self.link().controller()
    }
}

impl Link {
    /// What the CAN adapter reports about itself; none where it reports nothing.
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
