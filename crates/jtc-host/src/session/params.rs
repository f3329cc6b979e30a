//! Friction, gains and arm model to the controller.

use super::{Parameter, Session};
use crate::arm::ParameterSet;
use crate::port::Port;
use crate::{Error, frame};

/// A parameter that the controller confirmed.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Pushed {
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
    pub fn push(&mut self, set: &ParameterSet, mut done: impl FnMut(&Pushed)) -> Result<Vec<Pushed>, Error> {
        set.check()?;
        let mut all = Vec::new();
        let friction = set.friction.as_ref().map(|f| match f {
            // Longer than CRC-16 protects against every double bit error: sent twice, both must be confirmed.
            jtc_core::Friction::Table(_) => (Parameter::FrictionTable, frame::friction(f), 2),
            jtc_core::Friction::Polynomial(_) => (Parameter::FrictionPolynomial, frame::friction(f), 1),
        });
        let pid = set.pid.as_ref().map(|p| (Parameter::Pid, frame::pid(p), 1));
        let model = set.model.as_ref().map(|m| (Parameter::ArmModel, frame::arm_model(m), 1));
        for (parameter, frame, times) in [friction, pid, model].into_iter().flatten() {
            let start = self.port.now();
            for _ in 0..times {
                self.command(&frame)?;
            }
            let time_s = (self.port.now() - start).as_secs_f64();
            let pushed = Pushed { parameter, bytes: frame.len(), times, time_s };
            done(&pushed);
            all.push(pushed);
        }
        Ok(all)
    }
}
