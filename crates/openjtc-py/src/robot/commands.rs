//! Motion without a trajectory (jogging, teaching), and stopping the arm.

use std::ops::ControlFlow;
use std::time::Duration;

use jtc_core::JOINTS;
use jtc_host::port::Standstill;
use jtc_host::port::halt::{End, Halt};
use jtc_host::{Error, LinkError, Port as _, PortError, StateError};
use jtc_wire::{ControllerState, TrajectoryState, fixed};

use super::shared::Asked;
use super::worker_state::WorkerState;
use crate::error::Failure;
use crate::threads::lock;

/// Maximum time from a Stop to standstill. The arm needs 0.5 s, or 1 s if it brakes with full torque (J-33).
const STANDSTILL: Duration = Duration::from_secs(5);

/// Returns the error for a caller whose action was interrupted by a Stop.
pub(super) fn stopped(what: &str) -> Failure {
    Failure::fault(
        "stopped",
        format!("{what}: the arm was stopped"),
        "find out who stopped the arm and why; new requests are executed",
    )
}

impl WorkerState {
    /// Stops the arm and waits for standstill. If the arm is already at rest, `stop` returns no error. A Stop also ends
    /// Teaching, even if another program has enabled it, because the caller expects that the controller holds the arm.
    pub(crate) fn stop(&mut self) -> Result<(), Failure> {
        self.session.port_mut().take_over();
        // The Stop is sent before any query. The Stop can therefore reach the controller even if this program receives
        // no bytes.
        let stopped = match self.session.stop() {
            // The controller refuses a Stop if no motion is in progress.
            Err(Error::Link(LinkError::Refused { .. })) => Ok(()),
            done => done,
        };
        let held = self.hold();
        stopped?;
        let (end, mut standstill) = (self.session.now() + STANDSTILL, Standstill::after(Halt::Stop));
        while !standstill.is_reached() {
            let status = self.session.next_status()?;
            standstill.see(self.session.now(), &status);
            if self.session.now() >= end {
                let end = End::of(&status, &standstill);
                let next = end.next_step();
                return Err(Failure::fault("still-moving", end.moving.unwrap_or_default(), next));
            }
            if status.state == ControllerState::Teaching {
                self.session.end_teaching()?;
            }
        }
        self.shared.set_moves(false);
        held
    }

    /// Like [`Self::stop`], but stops only the motion and teaching of this connection.
    pub(crate) fn rest(&mut self) -> Result<(), Failure> {
        if self.shared.moves() { self.stop() } else { self.hold() }
    }

    /// Ends the teaching of this connection.
    pub(crate) fn hold(&mut self) -> Result<(), Failure> {
        if self.teaching {
            self.session.teach(false)?;
            self.teaching = false;
        }
        Ok(())
    }

    /// Sends a last Stop after a panic. Does not wait for an answer.
    pub(crate) fn abandon(&mut self) {
        let port = self.session.port_mut();
        let frames: [&[u8]; 2] = [&fixed::STOP, &fixed::TEACHING_MODE_DISABLE];
        let due = [self.shared.moves(), self.teaching];
        for (frame, _) in frames.into_iter().zip(due).filter(|(_, due)| *due) {
            // An error is ignored, because no caller can receive it here.
            let _ = port.write_all(frame);
        }
    }

    /// Checks the last status, and records the end of this connection's motion if the status shows it.
    pub(crate) fn look(&mut self) {
        if !self.shared.moves() || !self.session.port().is_shown() {
            return;
        }
        let goes_on = [TrajectoryState::Execute, TrajectoryState::Pause];
        if self.session.last().is_some_and(|status| !status.trajectory.is_in(&goes_on)) {
            self.shared.set_moves(false);
        }
    }

    /// Jogs at these velocities (rad/s) for this time, and then waits for standstill. Returns the final positions (rad).
    pub(crate) fn jog(
        &mut self,
        velocity: &[f64; JOINTS],
        time: Duration,
        asked: &Asked,
    ) -> Result<[f64; JOINTS], Failure> {
        self.same_arm()?;
        self.session.ask_to_move()?;
        self.session.settle_for_jog_until(|| asked.is_halted())?;
        let end = self.session.now() + time;
        let jogged = self.session.jog_while(velocity, |session| asked.is_halted() || session.now() >= end);
        // The arm is brought to rest at once, also if the jog ended with an error. Otherwise the arm would move until
        // the jog timeout of the controller.
        let rested = self.session.jog_to_rest();
        if let Ok(Some(_)) = rested {
            self.shared.set_moves(false);
        }
        match jogged {
            Err(Error::Link(LinkError::Port(PortError::Halted { .. }))) | Ok(()) if asked.is_halted() => {
                rested?;
                return Err(stopped("jogging ended early"));
            }
            // The controller refused the jog because of a held stop. `jog_to_rest` reports the same held stop, and
            // its error is returned below.
            Err(_) if matches!(rested, Err(Error::State(StateError::HeldStop { .. }))) => {}
            jogged => jogged?,
        }
        let still = || Failure::fault("still-moving", "the arm still moves", "press the emergency stop");
        Ok(rested?.ok_or_else(still)?.positions())
    }

    /// Starts Teaching: the operator can guide the arm by hand.
    pub(crate) fn teach(&mut self, asked: &Asked) -> Result<(), Failure> {
        self.same_arm()?;
        self.session.ask_to_move()?;
        let before = self.teaching;
        // `teaching` is set before the controller enables Teaching, so that closing the connection always ends Teaching.
        self.teaching = true;
        let begun = self.session.teach_until(|| asked.is_halted());
        if let Err(Error::Link(
            LinkError::Refused { .. } | LinkError::Denied { .. } | LinkError::Port(PortError::Halted { .. }),
        )) = &begun
        {
            self.teaching = before;
        }
        Ok(begun?)
    }

    /// Records the joint positions for this time or until a Stop, while the operator guides the arm by hand.
    pub(crate) fn record_teaching(&mut self, time: Duration, asked: &Asked) -> Result<(), Failure> {
        let shared = &self.shared;
        let ended = |so_far| asked.is_halted() || so_far >= time;
        self.session.record_teaching(ended, |time, positions| {
            lock(&shared.taught).push((time.as_secs_f64(), positions));
            ControlFlow::Continue(())
        })?;
        Ok(())
    }
}
