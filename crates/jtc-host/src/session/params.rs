//! Transfer of friction, gains and arm model to the controller.

use std::time::Duration;

use jtc_core::Config;
use jtc_wire::{ControllerState, DataStatus, FrameType, Reactions};

use super::{Parameter, Session};
use crate::arm::ParameterSet;
use crate::error::{Error, LinkError, ParametersError, StateError};
use crate::frame;
use crate::port::Port;

/// Time for which new gains are on trial while the torque is on (J-71), plus the time until the controller has
/// reported the result.
const TRIAL: Duration = Duration::from_millis(2_500);

/// Transfer of one parameter that the controller has confirmed.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct PushReport {
    /// Parameter.
    pub parameter: Parameter,
    /// Size of the parameter's frame, bytes.
    pub bytes: usize,
    /// Number of times that the frame must be sent, which is two for the friction table.
    pub times: u32,
    /// Duration, s.
    pub time_s: f64,
}

impl<P: Port> Session<P> {
    /// Checks `set`, and then sends its parameters. Calls `done` after each parameter.
    ///
    /// If new gains are set while the controller holds the arm, they are on trial for two seconds. If the arm is not
    /// stable in this time, the controller restores the old gains and goes into a held stop of the kind
    /// [`jtc_wire::StopKind::Gains`] (J-71). [`Session::await_trial`] waits for the result.
    ///
    /// # Errors
    ///
    /// Returns [`ParametersError::Value`], before a frame is sent, for values that do not fit into their frame or are
    /// physically impossible. Returns [`ParametersError::BeyondBounds`] or [`LinkError::Refused`] if the controller
    /// rejects a parameter and keeps its old value. Also returns the other [`LinkError`]s of the communication.
    pub fn push(
        &mut self,
        set: &ParameterSet,
        done: impl FnMut(&PushReport),
    ) -> Result<Vec<PushReport>, Error> {
        self.push_until(set, || false, done)
    }

    /// Like [`Session::push`], but stops once `ended` returns `true` because the user cancels.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::push`], and [`Error::Cancelled`] if the caller cancels.
    pub fn push_until(
        &mut self,
        set: &ParameterSet,
        ended: impl Fn() -> bool,
        mut done: impl FnMut(&PushReport),
    ) -> Result<Vec<PushReport>, Error> {
        set.check()?;
        let mut frames = Vec::new();
        if let Some(friction) = &set.friction {
            // The table is too long for CRC-16 to detect every double bit error. Therefore the table is sent twice, and the controller must
            // confirm both transmissions.
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
        // A controller that has received all parameters switches the torque on. If another program sends a Stop, it
        // must not do this, so the transfer ends.
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

    /// Waits while new gains are on trial (J-71). If gains are on trial, calls `begun` before it waits. The caller must call this function
    /// directly after [`Session::push`] or [`Session::push_arm`]. Returns `true` if gains were on trial. Returns `false` if the arm has no
    /// torque or the device has no extensions.
    ///
    /// # Errors
    ///
    /// Returns [`StateError::HeldStop`] if the controller restored the old gains, or if it stopped the arm for another reason. Returns
    /// [`StateError::Device`] if the arm lost its torque. Also returns the [`LinkError`]s of the communication.
    pub fn await_trial(&mut self, begun: impl FnOnce()) -> Result<bool, Error> {
        let age = |reactions: Reactions| reactions.stop.map(|(_, ms)| ms);
        let state = self.fresh_status()?.state;
        let under_torque = state.is_in(&[ControllerState::HoldPos, ControllerState::Teaching]);
        let Some(reactions) = self.reactions().filter(|_| under_torque) else { return Ok(false) };
        begun();
        // Age of the last held stop before the trial, if there is one. If the trial causes a new held stop, the
        // reported age becomes smaller.
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

/// Adds the reason to an error. If a value of the set is outside the bounds of known controllers, the new error contains this value.
fn explained(error: LinkError, set: &ParameterSet) -> Error {
    let LinkError::Refused { request, code: DataStatus::IncorrectValue, .. } = error else {
        return error.into();
    };
    // The controller rejected one frame, so only a value in this frame can be the reason.
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
