//! Friction, gains and arm model to the controller.

use std::time::Duration;

use jtc_core::Config;
use jtc_wire::{ControllerState, DataStatus, FrameType, Reactions};

use super::{Parameter, Session};
use crate::arm::ParameterSet;
use crate::error::{Error, LinkError, ParametersError, StateError};
use crate::frame;
use crate::port::Port;

/// How long gains that are given under torque are on trial (J-71), and the time until the controller has told of it.
const TRIAL: Duration = Duration::from_millis(2_500);

/// A parameter that the controller confirmed.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct PushReport {
    /// Which.
    pub parameter: Parameter,
    /// Bytes of its frame.
    pub bytes: usize,
    /// Times it was sent on purpose (the friction table: twice).
    pub times: u32,
    /// s.
    pub time_s: f64,
}

impl<P: Port> Session<P> {
    /// Sends what `set` has, after all of it was checked; `done` is called after each.
    ///
    /// Gains that are given while the arm is held are on trial for two seconds: the controller takes them back if the arm does not stand
    /// them, and holds it in a held stop of the kind [`jtc_wire::StopKind::Gains`] (J-71). [`Session::await_trial`] waits for what comes of
    /// it.
    ///
    /// # Errors
    ///
    /// [`ParametersError::Value`] before anything is sent, for numbers that no frame carries or that are not physical;
    /// [`ParametersError::BeyondBounds`] or [`LinkError::Refused`] when the controller refuses one, which keeps what it had;
    /// the other [`LinkError`]s of the line.
    pub fn push(
        &mut self,
        set: &ParameterSet,
        done: impl FnMut(&PushReport),
    ) -> Result<Vec<PushReport>, Error> {
        self.push_until(set, || false, done)
    }

    /// The same, until `ended` returns true because a person wants it to end: nothing more is sent then.
    ///
    /// # Errors
    ///
    /// Those of [`Session::push`]; [`Error::Cancelled`].
    pub fn push_until(
        &mut self,
        set: &ParameterSet,
        ended: impl Fn() -> bool,
        mut done: impl FnMut(&PushReport),
    ) -> Result<Vec<PushReport>, Error> {
        set.check()?;
        let mut frames = Vec::new();
        if let Some(friction) = &set.friction {
            // The table is longer than CRC-16 protects against every double bit error: sent twice, both must be confirmed.
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
        // Parameters lead to torque: a Stop of another program ends them.
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

    /// Waits while gains that have just been given are on trial (J-71); `begun` is called first if they are. Call it right after
    /// [`Session::push`] or [`Session::push_arm`]. Returns whether there was a trial; without torque, and on a device without extensions, there
    /// was not.
    ///
    /// # Errors
    ///
    /// [`StateError::HeldStop`] when the controller took them back, or stopped the arm for another reason meanwhile,
    /// [`StateError::Device`] when the arm was released; the [`LinkError`]s of the line.
    pub fn await_trial(&mut self, begun: impl FnOnce()) -> Result<bool, Error> {
        let age = |reactions: Reactions| reactions.stop.map(|(_, ms)| ms);
        let state = self.fresh_status()?.state;
        let under_torque = state.is_in(&[ControllerState::HoldPos, ControllerState::Teaching]);
        let Some(reactions) = self.reactions().filter(|_| under_torque) else { return Ok(false) };
        begun();
        // The arm may have been in a held stop before.
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

/// A refused value by its name, where one of the set is beyond the bounds of the controllers that are known.
fn explained(error: LinkError, set: &ParameterSet) -> Error {
    let LinkError::Refused { request, code: DataStatus::IncorrectValue, .. } = error else {
        return error.into();
    };
    // Only what this frame carried.
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
