//! The load that a joint carries and that the model lacks, as the integral of the position controller has found it.
use crate::DT;
use crate::limits::JointConfig;
use crate::remembered::remembered;

/// Ticks between two observations of a joint: one joint is looked at in each tick.
const PERIOD: f64 = crate::JOINTS as f64;
/// Time constant of the low-pass filter, s.
const TIME_S: f64 = 1.0;
/// Highest load, as a share of the torque limit.
const HIGHEST: f64 = 0.3;
/// Difference of integral and load, as a share of the torque limit, beyond which it is taken for a contact: the load stays.
const APART: f64 = 0.1;
/// Change of the integral, as a share of the torque limit, up to which the joint is held steadily.
const STEADY: f64 = 0.03;
/// Time of steady holding after which the load is taken anew, s.
const STEADY_S: f64 = 10.0;

/// The load of a joint.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Load {
    /// N·m.
    torque: f64,
    /// The joint has settled since it was enabled, or since its load was forgotten.
    known: bool,
    /// Integral at the begin of steady holding, N·m, and observations since.
    steady: f64,
    observations: u16,
}

remembered!(Load { torque, known, steady, observations });

impl Load {
    /// The load is to be found anew.
    pub fn forget(&mut self) {
        *self = Self::default();
    }

    /// N·m; what the `integral` (N·m) has found, before the load is known.
    pub fn torque(&self, integral: f64) -> f64 {
        if self.known { self.torque } else { integral }
    }

    /// N·m; none before the load is known.
    pub fn known_torque(&self) -> f64 {
        self.torque
    }

    /// It was found in another way: a load that was lowered has become this torque, N·m.
    pub fn set(&mut self, torque: f64) {
        *self = Self { torque, known: true, ..Self::default() };
    }

    /// Observes the torque of the `integral` (N·m) of a joint that has `settled` since it was enabled; once in [`PERIOD`] ticks.
    pub fn observe(&mut self, integral: f64, settled: bool, limits: &JointConfig) {
        if !settled {
            self.forget();
            return;
        }
        let limit = limits.torque_max;
        let highest = (HIGHEST * limit).max(self.torque.abs());
        let bounded = |torque: f64| torque.max(-highest).min(highest);
        if (integral - self.steady).abs() > STEADY * limit {
            (self.steady, self.observations) = (integral, 0);
        }
        self.observations = self.observations.saturating_add(1);
        let steady = f64::from(self.observations) * PERIOD * DT >= STEADY_S;
        if !self.known || steady {
            (self.torque, self.known) = (bounded(integral), true);
        } else if (integral - self.torque).abs() <= APART * limit {
            self.torque = bounded(self.torque + (integral - self.torque) * (PERIOD * DT / TIME_S));
        }
    }
}
