//! The controller.
use jtc_wire::RawPoint;

use crate::{Config, Inputs, Outputs, Telemetry};

/// The joint trajectory controller. `M` is the memory of its trajectory: at least [`crate::POINTS_MAX`] points.
pub struct Controller<M> {
    _points: M,
}

impl<M: AsRef<[RawPoint]> + AsMut<[RawPoint]>> Controller<M> {
    /// A controller in Start.
    pub fn new(_config: Config, _points: M) -> Self {
        unimplemented!()
    }
    /// One millisecond.
    pub fn tick(&mut self, _inputs: &Inputs<'_>) -> Outputs {
        unimplemented!()
    }
    /// What the last tick computed.
    pub fn telemetry(&self) -> &Telemetry {
        unimplemented!()
    }
    /// The settings.
    pub fn config(&self) -> &Config {
        unimplemented!()
    }
}

impl Config {
    /// The default arm's settings (rules, section 7).
    pub fn avena() -> Self {
        unimplemented!()
    }
}

impl crate::Parameters {
    /// The default arm's parameters (rules, section 7).
    pub fn avena() -> Self {
        unimplemented!()
    }
}
