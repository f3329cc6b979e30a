//! Load of a joint in Teaching, and the share of this load that acts. HoldPos has learned this load.
//!
//! HoldPos cannot distinguish a load from a person who leans on the arm and lets go of it later. If the load torque drives its joint, its
//! acting share falls with the speed of the joint, so the joint moves only slowly. When the joint slows down, the whole load torque acts
//! again. The controller removes a load permanently only if no other cause explains a motion without a hand.
use crate::DT;
use crate::bit_codec::bit_codec;
use crate::config::limits::JointConfig;
use crate::interpolation::smooth;
use crate::motion::load::Load;
use crate::motion::soft_end::SOFT_END;

/// Speeds of a joint in the direction of its load torque, rad/s. The load acts fully up to the first speed, and not
/// at all from the second speed on. `DRIVES` applies to a joint with little damping, which accelerates quickly before
/// the controller measures its speed. If the damping balances the load, both speeds are higher by `DAMPED`.
const DRIVES: (f64, f64) = (0.03, 0.15);
const DAMPED: (f64, f64) = (0.17, 0.35);
/// Time constants of the acting share of the load, s. The share falls with `FALLS_S` and rises again with
/// `RETURNS_S`. If the joint moves against its load torque, the share rises again with `CATCHES_S`.
const FALLS_S: f64 = 0.006;
const RETURNS_S: f64 = 0.3;
const CATCHES_S: f64 = 0.05;
/// Lowest speed at which the load may drive a joint, rad/s.
const MOVES: f64 = 0.1;
/// Range of the torque of damping and friction, as a share of the acting load torque. Within this range, the load
/// torque is considered the only cause of the motion.
const EXPLAINED: (f64, f64) = (0.8, 1.3);
/// Least torque of a removed mass at which a sinking joint shows that this mass is missing. The value is a share of
/// the highest load torque of the joint.
const MISSED: f64 = 0.1;

/// State of the load of a joint in Teaching.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Carried {
    /// Part of the load torque that does not come from the estimated mass at the flange, N·m.
    pub rest: f32,
    /// Highest load torque that can act in Teaching, N·m. This limit is the learned torque or the highest torque that
    /// the controller can learn, whichever is higher.
    most: f32,
    /// Share of the load that does not act because the joint moves too fast in the direction of the load.
    left_out: f32,
    /// Share of the load that does not act because the joint is in its soft end and the load pushes it outwards.
    inside: f32,
}

bit_codec!(Carried { rest, most, left_out, inside });

impl Carried {
    /// Begins Teaching of a joint with this learned `load`, N·m.
    pub(super) fn begin(load: f64, limits: &JointConfig) -> Self {
        let load = if load.is_finite() { load } else { 0.0 };
        let most = load.abs().max(Load::bounded(f64::MAX, limits));
        Self { rest: load as f32, most: most as f32, ..Self::default() }
    }

    /// Attributes the part `by_mass` of the load to a mass, N·m.
    pub(super) fn explain(&mut self, by_mass: f64) {
        self.rest -= by_mass as f32;
    }

    /// Returns the whole load torque, N·m.
    pub(super) fn whole(&self, by_mass: f64) -> f64 {
        let most = f64::from(self.most);
        (by_mass + f64::from(self.rest)).max(-most).min(most)
    }

    /// Returns the part of the load torque that acts, N·m.
    pub(super) fn torque(&self, by_mass: f64) -> f64 {
        self.whole(by_mass) * (1.0 - f64::from(self.left_out)) * (1.0 - f64::from(self.inside))
    }

    /// Executes one tick. `balanced` is the share of the load that the damping of the joint balances. `depth` is the
    /// compression of the soft end in rad, with the sign of [`depth`](crate::motion::soft_end::depth).
    pub(super) fn step(&mut self, by_mass: f64, velocity: f64, balanced: f64, depth: f64) -> f64 {
        let whole = self.whole(by_mass);
        let along = if whole < 0.0 { -velocity } else { velocity };
        let (from, to) = (DRIVES.0 + balanced * DAMPED.0, DRIVES.1 + balanced * DAMPED.1);
        let wanted = if along > from { smooth((along - from) / (to - from)) } else { 0.0 };
        let left_out = f64::from(self.left_out);
        let returns = if along < -MOVES { CATCHES_S } else { RETURNS_S };
        let time = if wanted > left_out { FALLS_S } else { returns };
        self.left_out = (left_out + (wanted - left_out) * (DT / time)) as f32;
        // If a joint is at its position limit, its load must not push the joint further outwards.
        let outward = if whole * depth > 0.0 { (depth.abs() / SOFT_END).min(1.0) } else { 0.0 };
        let inside = f64::from(self.inside);
        self.inside = (inside + (outward - inside) * (DT / CATCHES_S)) as f32;
        self.torque(by_mass)
    }

    /// Returns `true` if the torque of the mass alone drives the joint. `against` is the torque of damping and friction against the motion,
    /// N·m.
    pub(super) fn is_driven(&self, by_mass: f64, velocity: f64, against: f64) -> bool {
        let acts = self.torque(by_mass);
        let mostly_mass = by_mass * acts > 0.0 && by_mass.abs() > f64::from(self.rest).abs();
        let along = velocity * acts > MOVES * acts.abs();
        mostly_mass && along && explains(acts, against)
    }

    /// Returns `true` if the joint sinks because the torque `gone` (N·m) of the removed mass is missing. `against` is
    /// the torque of damping and friction against the motion, N·m.
    pub(super) fn sinks(&self, gone: f64, velocity: f64, against: f64) -> bool {
        let missed = gone.abs() > MISSED * f64::from(self.most);
        missed && velocity * gone < -MOVES * gone.abs() && explains(gone, against)
    }

    /// Multiplies the part of the load torque that does not come from the mass by `left`.
    pub(super) fn fade(&mut self, left: f64) {
        self.rest = (f64::from(self.rest) * left) as f32;
    }
}

/// Returns `true` if this load torque can be the only cause of a motion. `against` is the torque of damping and
/// friction against this motion, N·m.
fn explains(torque: f64, against: f64) -> bool {
    against >= EXPLAINED.0 * torque.abs() && against <= EXPLAINED.1 * torque.abs()
}

#[cfg(test)]
mod tests;
