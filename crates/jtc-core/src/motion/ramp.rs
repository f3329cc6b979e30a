//! What the arm can follow on a ramp of path time (J-33): slopes within its acceleration and torque limits.
use jtc_dynamics::Dynamics;

use super::Motion;
use crate::JOINTS;
use crate::coast::STANDING;
use crate::config::Config;
use crate::interpolation::SetPoint;
use crate::nodes::Nodes;
use crate::path::{Bounds, SlopeBounds};

/// Shares of the acceleration and torque limits that a pause, a stop or a resume may use; the rest is for what changes within
/// a tick and for the controller.
const RAMP_ACCELERATION: f64 = 0.98;
const RAMP_TORQUE: f64 = 0.95;

impl Motion {
    /// A ramp of path time begins: its bounds need the inertia of the arm.
    pub fn begin_ramp(&mut self, nodes: &Nodes, config: &Config, dynamics: &Dynamics) {
        self.inertia = dynamics.mass_matrix(nodes.positions());
        for j in 0..JOINTS {
            self.inertia[j][j] += config.joints[j].rotor_inertia;
        }
    }

    /// Slopes of path time that the arm can follow at `at`, at the present `rate` and `slope` (1/s). The torque that each joint
    /// has left is counted from the last one computed, with all its parts: a joint that already falls behind has less.
    pub fn slope_bounds(&self, at: &SetPoint, rate: f64, slope: f64, config: &Config) -> SlopeBounds {
        const FREE: Bounds = (f64::NEG_INFINITY, f64::INFINITY);
        let (mut easy, mut full) = (FREE, FREE);
        for j in 0..JOINTS {
            let limit = &config.joints[j];
            let acceleration = at.acceleration[j] * rate * rate;
            narrow(
                &mut easy,
                within(acceleration, at.velocity[j], RAMP_ACCELERATION * limit.acceleration_max),
            );
            let push: f64 = (0..JOINTS).map(|k| self.inertia[j][k] * at.velocity[k]).sum();
            let torque = self.torque[j].sum() - push * slope;
            narrow(&mut easy, within(torque, push, RAMP_TORQUE * limit.torque_max));
            let (low, high) = within(torque, push, limit.torque_max);
            // No pace of the path helps a joint that does not move along it.
            let moves = at.velocity[j].abs() > STANDING;
            narrow(&mut full, if moves { (low, high) } else { (low.min(0.0), high.max(0.0)) });
        }
        SlopeBounds { easy, full }
    }
}

/// Slopes with |`offset` + `factor`·slope| ≤ `limit`.
fn within(offset: f64, factor: f64, limit: f64) -> Bounds {
    if factor.abs() <= 1e-9 {
        return (f64::NEG_INFINITY, f64::INFINITY);
    }
    let (a, b) = ((-limit - offset) / factor, (limit - offset) / factor);
    (a.min(b), a.max(b))
}

fn narrow(bounds: &mut Bounds, to: Bounds) {
    *bounds = (bounds.0.max(to.0), bounds.1.min(to.1));
}
