//! The part of a load that a joint carries in Teaching; HoldPos had found the load.
//!
//! HoldPos cannot tell a load from a person who leans on the arm and will let go. If the torque drives its joint, less of it acts the
//! faster the joint is, so a joint is driven slowly at most; when the joint slows down, all of it comes back. Only the part that is needed
//! to explain a motion without a hand goes for good.
use crate::DT;
use crate::interpolation::smooth;
use crate::limits::JointConfig;
use crate::load::Load;
use crate::remembered::remembered;
use crate::soft_end::SOFT_END;

/// Speed along its load (rad/s) from which on less of the load acts in a joint, and from which on none: for a joint that is hardly damped,
/// which is fast before its speed is measured, and the addition if its damping balances the load.
const DRIVES: (f64, f64) = (0.03, 0.15);
const DAMPED: (f64, f64) = (0.17, 0.35);
/// Time constants of the share that acts: for its fall, for its return, and for its return if the joint falls against its load, s.
const FALLS_S: f64 = 0.006;
const RETURNS_S: f64 = 0.3;
const CATCHES_S: f64 = 0.05;
/// Speed of a joint above which it may be driven, rad/s.
const MOVES: f64 = 0.1;
/// Torque of damping and friction against a motion, as a share of the torque that acts, within which that torque alone explains the motion.
const EXPLAINED: (f64, f64) = (0.8, 1.3);
/// Torque that has gone, as a share of the most that a joint carries, above which that torque is missed if the joint sinks.
const MISSED: f64 = 0.1;

/// Load that a joint carries.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Carried {
    /// Torque that no mass at the flange explains, N·m.
    pub rest: f32,
    /// Highest torque that is carried: the torque that was found, or may be found, N·m.
    most: f32,
    /// Share of all of it that does not act, because the joint is fast.
    left_out: f32,
    /// Share that does not act in the soft end of the joint, because it pushes outwards.
    inside: f32,
}

remembered!(Carried { rest, most, left_out, inside });

impl Carried {
    /// Begins Teaching of a joint that has found this `load`, N·m.
    pub fn begin(load: f64, limits: &JointConfig) -> Self {
        let load = if load.is_finite() { load } else { 0.0 };
        let most = load.abs().max(Load::bounded(f64::MAX, limits));
        Self { rest: load as f32, most: most as f32, ..Self::default() }
    }

    /// Attributes this part of the load to a mass, N·m.
    pub fn explain(&mut self, by_mass: f64) {
        self.rest -= by_mass as f32;
    }

    /// Returns the whole load, N·m.
    pub fn whole(&self, by_mass: f64) -> f64 {
        let most = f64::from(self.most);
        (by_mass + f64::from(self.rest)).max(-most).min(most)
    }

    /// Returns the part of the load that acts, N·m.
    pub fn torque(&self, by_mass: f64) -> f64 {
        self.whole(by_mass) * (1.0 - f64::from(self.left_out)) * (1.0 - f64::from(self.inside))
    }

    /// Runs a tick. `balanced`: share of the load that the damping of the joint balances. `depth`: compression of the joint's soft end, as
    /// in [`depth`](crate::soft_end::depth), rad.
    pub fn step(&mut self, by_mass: f64, velocity: f64, balanced: f64, depth: f64) -> f64 {
        let whole = self.whole(by_mass);
        let along = if whole < 0.0 { -velocity } else { velocity };
        let (from, to) = (DRIVES.0 + balanced * DAMPED.0, DRIVES.1 + balanced * DAMPED.1);
        let wanted = if along > from { smooth((along - from) / (to - from)) } else { 0.0 };
        let left_out = f64::from(self.left_out);
        let returns = if along < -MOVES { CATCHES_S } else { RETURNS_S };
        let time = if wanted > left_out { FALLS_S } else { returns };
        self.left_out = (left_out + (wanted - left_out) * (DT / time)) as f32;
        // No load pushes a joint outwards at its position limit.
        let outward = if whole * depth > 0.0 { (depth.abs() / SOFT_END).min(1.0) } else { 0.0 };
        let inside = f64::from(self.inside);
        self.inside = (inside + (outward - inside) * (DT / CATCHES_S)) as f32;
        self.torque(by_mass)
    }

    /// Returns `true` if the mass alone drives the joint, while damping and friction have the torque `against` the motion, N·m.
    pub fn is_driven(&self, by_mass: f64, velocity: f64, against: f64) -> bool {
        let acts = self.torque(by_mass);
        let mostly_mass = by_mass * acts > 0.0 && by_mass.abs() > f64::from(self.rest).abs();
        let along = velocity * acts > MOVES * acts.abs();
        mostly_mass && along && explains(acts, against)
    }

    /// Returns `true` if the joint sinks for want of `gone`: the torque of the mass that it carried and no longer carries, N·m.
    pub fn sinks(&self, gone: f64, velocity: f64, against: f64) -> bool {
        let missed = gone.abs() > MISSED * f64::from(self.most);
        missed && velocity * gone < -MOVES * gone.abs() && explains(gone, against)
    }

    /// Keeps this share of the torque that no mass explains.
    pub fn fade(&mut self, left: f64) {
        self.rest = (f64::from(self.rest) * left) as f32;
    }
}

/// Returns `true` if a torque alone explains a motion that damping and friction oppose with the torque `against`, N·m.
fn explains(torque: f64, against: f64) -> bool {
    against >= EXPLAINED.0 * torque.abs() && against <= EXPLAINED.1 * torque.abs()
}
