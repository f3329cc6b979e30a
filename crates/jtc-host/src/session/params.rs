//! Transfer of friction, gains and arm model to the controller.

use std::time::Duration;

use jtc_core::Config;
use jtc_wire::{ControllerState, DataStatus, FrameType, Reactions};

use super::{Parameter, Session};
use crate::arm::ParameterSet;
use crate::error::{Error, LinkError, ParametersError, StateError};
use crate::frame;
use crate::port::Port;

/// Trial time of gains that are set under torque (J-71), plus the time until the controller has reported the result.
const TRIAL: Duration = Duration::from_millis(2_500);

/// A parameter that the controller confirmed.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct PushReport {
    /// Parameter.
    pub parameter: Parameter,
    /// Size of its frame, bytes.
    pub bytes: usize,
    /// Number of intended transmissions (the friction table: two).
    pub times: u32,
    /// Duration, s.
    pub time_s: f64,
}

impl<P: Port> Session<P> {
    /// Checks all of `set`, then sends its parameters; calls `done` after each.
    ///
    /// Gains that are set while the arm is held are on trial for two seconds. If the arm is not stable with them, the
    /// controller restores the old gains and holds the arm in a held stop of the kind [`jtc_wire::StopKind::Gains`]
    /// (J-71). [`Session::await_trial`] waits for the result.
    ///
    /// # Errors
    ///
    /// [`ParametersError::Value`] before anything is sent, for values that no frame can carry or that are not physical;
    /// [`ParametersError::BeyondBounds`] or [`LinkError::Refused`] if the controller rejects a parameter and keeps its
    /// old one; the other [`LinkError`]s of the line.
    pub fn push(
        &mut self,
        set: &ParameterSet,
        done: impl FnMut(&PushReport),
    ) -> Result<Vec<PushReport>, Error> {
        self.push_until(set, || false, done)
    }

    /// Like [`Session::push`], until `ended` returns `true` because the user cancels: then sends nothing more.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::push`]; [`Error::Cancelled`].
    pub fn push_until(
        &mut self,
        set: &ParameterSet,
        ended: impl Fn() -> bool,
        mut done: impl FnMut(&PushReport),
    ) -> Result<Vec<PushReport>, Error> {
        set.check()?;
        let mut frames = Vec::new();
        if let Some(friction) = &set.friction {
            // The table is too long for CRC-16 to detect every double bit error: it is sent twice, and both must be confirmed.
            let (parameter, times) = match friction {
                jtc_core::Friction::Table(_) => (Parameter::FrictionTable, 2),
                jtc_core::Friction::Polynomial(_) => (Parameter::FrictionPolynomial, 1),
            };
            frames.push((parameter, frame::friction(friction)?, times));
        }
        if let Some(pid) = &set.pid {
            frames.push((Parameter::Pid, frame::pid(pid)?, 1));
        }
        if let Some(model) = &set.model {
            frames.push((Parameter::ArmModel, frame::arm_model(model)?, 1));
        }
        // Complete parameters switch the torque on, so a Stop of another program ends the transfer.
        let stops = self.port.halts().stops;
        let mut all = Vec::new();
        for (parameter, frame, times) in frames {
            let start = self.port.now();
            for _ in 0..times {
                if ended() || self.port.halts().stops != stops {
                    return Err(Error::Cancelled);
                }
                self.command(&frame).map_err(|e| explained(e, set))?;
            }
            let time_s = (self.port.now() - start).as_secs_f64();
            let pushed = PushReport { parameter, bytes: frame.len(), times, time_s };
            done(&pushed);
            all.push(pushed);
        }
        Ok(all)
    }

    /// Waits while new gains are on trial (J-71); if they are, calls `begun` first. Call it right after
    /// [`Session::push`] or [`Session::push_arm`]. Returns `true` if there was a trial; `false` without torque, and on a
    /// device without extensions.
    ///
    /// # Errors
    ///
    /// [`StateError::HeldStop`] if the controller restored the old gains, or stopped the arm for another reason
    /// meanwhile, [`StateError::Device`] if the arm was released; the [`LinkError`]s of the line.
    pub fn await_trial(&mut self, begun: impl FnOnce()) -> Result<bool, Error> {
        let age = |reactions: Reactions| reactions.stop.map(|(_, ms)| ms);
        let state = self.fresh_status()?.state;
        let under_torque = state.is_in(&[ControllerState::HoldPos, ControllerState::Teaching]);
        let Some(reactions) = self.reactions().filter(|_| under_torque) else { return Ok(false) };
        begun();
        // The arm may have been in an earlier held stop.
        let before = age(reactions).unwrap_or(u32::MAX);
        let end = self.port.now() + TRIAL;
        while self.port.now() < end {
            let status = self.next_status()?;
            if status.state == ControllerState::Error {
                return Err(StateError::Device { status: Box::new(status) }.into());
            }
            if status.is_held_stop() && self.reactions().and_then(age).is_some_and(|ms| ms < before) {
                self.without_held_stop(&status)?;
            }
        }
        Ok(true)
    }
}

/// Returns an error that names the rejected value, if a value of the set is beyond the bounds of known controllers.
fn explained(error: LinkError, set: &ParameterSet) -> Error {
    let LinkError::Refused { request, code: DataStatus::IncorrectValue, .. } = error else {
        return error.into();
    };
    // Only the values that this frame carried.
    let part = match request {
        FrameType::PidParam => ParameterSet { pid: set.pid, ..ParameterSet::default() },
        FrameType::ArmModel => ParameterSet { model: set.model, ..ParameterSet::default() },
        _ => ParameterSet { friction: set.friction.clone(), ..ParameterSet::default() },
    };
    match part.beyond(&Config::avena()) {
        Some(beyond) => ParametersError::BeyondBounds { request, beyond }.into(),
        None => error.into(),
    }
}
