//! Torques that Teaching adds to gravity (J-25): learned load, damping, dry friction at standstill, partial friction compensation, and soft
//! ends.
//!
//! In Teaching, a hand moves the arm. When the hand lets go of the arm, the arm must stay in its pose. The controller estimates a mass at
//! the flange from the torques that HoldPos has learned. The controller uses this mass to compute the load in other poses. Learned torques
//! that this mass does not explain fade while a hand moves the arm ([`carried`]). Every motion in Teaching is damped. If a joint is too
//! fast for this damping, Teaching ends ([`joint`]).
mod carried;
mod joint;

use jtc_dynamics::Dynamics;

use crate::bit_codec::bit_codec;
use crate::config::Config;
use crate::config::limits::JointConfig;
use crate::interpolation::smooth;
use crate::{DT, JOINTS};
use carried::Carried;
pub(crate) use joint::{LedJoint, TaughtTorque, too_fast};
use joint::{TaughtJoint, rotor};

/// Number of ticks in a round. Each round computes the inertia and the friction of each joint once. `FIRST` is the
/// number of ticks before the first round: the start of Teaching, the mass at the flange, the inertia of the whole arm
/// for a ramp, and the inertia of each of the six joints.
const TURNS: u8 = 76;
const FIRST: u8 = 9;
/// Time between two comparisons of the load with the motion, ticks. `PERIOD` is the same time in s.
const JUDGED_MS: u8 = 12;
const PERIOD: f64 = JUDGED_MS as f64 * DT;
/// Thresholds for the torque of 1 kg at the flange on all joints together (root of the sum of squares, N·m/kg). Below
/// the first threshold, no load is attributed to a mass. Above the second threshold, the whole fitted mass is used.
///
/// The thresholds are necessary, because HoldPos cannot distinguish a load from static friction. In a pose in which a
/// mass hardly loads the joints, a small friction torque would look like a large mass.
const LOADS: (f64, f64) = (2.0, 6.0);
/// Time for which a mass must have driven the arm without a hand before the controller begins to remove the mass, ms.
/// `GOES_S` is the time constant of the removal, s.
const DRIVEN_MS: u16 = 1_000;
const GOES_S: f64 = 1.5;
/// Time for which a joint must have sunk without the removed mass before the controller begins to add the mass again,
/// ms. `COMES_BACK_S` is the time constant of this return, s.
const SINKS_MS: u16 = 100;
const COMES_BACK_S: f64 = 0.5;
/// Speed above which the controller assumes that a hand moves a joint, rad/s. `WAY` is a distance, rad: while the
/// fastest joint moves by this distance, the torque that no mass explains falls to 37 %.
const LED: f64 = 0.02;
const WAY: f64 = 0.3;

/// Computation that a tick of Teaching executes. The number in a variant is the index of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Turn {
    /// First tick of Teaching, in which all learned loads act.
    Begin,
    /// Computes the mass at the flange whose torques are closest to the learned loads.
    Mass,
    /// Computes nothing for Teaching. In this tick, the ramp computes the inertia of the whole arm.
    Ramp,
    Inertia(usize),
    /// Computes the friction of a joint, and the torque of 1 kg at the flange on all joints.
    Friction(usize),
    /// Compares the load with the motion of the joints.
    Judge,
    /// Computes the torques of the joints.
    Joints,
}

impl Turn {
    /// Returns the computation of the tick with this number. In each round, every fourth tick computes a slowly changing value.
    fn of(number: u8) -> Self {
        let Some(turn) = number.checked_sub(FIRST) else {
            return match number {
                0 => Self::Begin,
                1 => Self::Mass,
                2 => Self::Ramp,
                _ => Self::Inertia(usize::from(number - 3)),
            };
        };
        let (joint, of_joint) = (usize::from(turn / 12), turn % 12);
        if turn == TURNS - 4 {
            Self::Ramp
        } else if of_joint == 0 {
            Self::Inertia(joint)
        } else if of_joint == 4 {
            Self::Friction(joint)
        } else if of_joint == 8 {
            Self::Judge
        } else {
            Self::Joints
        }
    }
}

/// State of Teaching. The values have single precision, because the flight recorder stores them.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Taught {
    joints: [TaughtJoint; JOINTS],
    carried: [Carried; JOINTS],
    /// Mass at the flange that the model does not contain, kg. `found` is the mass that was estimated, and `mass` is the mass whose torque
    /// acts now. Both masses are negative if the arm is lighter than its model.
    found: f32,
    mass: f32,
    /// Torque of 1 kg at the flange on each joint, N·m.
    unit: [f32; JOINTS],
    /// Time for which the torque of the mass has been the only cause of the motion, ms. `sinks_ms` is the time for
    /// which a joint has sunk because the mass was removed, ms.
    driven_ms: u16,
    sinks_ms: u16,
    /// Excess of the flange speed over the tool speed limit, from 0 (no excess) to 1 (twice the limit).
    haste: f32,
    /// Tick counter, which selects the computation of a tick.
    turn: u8,
}

bit_codec!(Taught { joints, carried, found, mass, unit, driven_ms, sinks_ms, haste, turn });

impl Taught {
    /// Begins Teaching of an arm at rest at `q` (rad), with these learned `loads` (N·m).
    #[inline(never)]
    pub(crate) fn begin(q: &[f64; JOINTS], loads: &[f64; JOINTS], config: &Config) -> Self {
        let mut taught = Self::default();
        for j in 0..JOINTS {
            let limits = &config.joints[j];
            taught.joints[j] = TaughtJoint::begin(q[j], limits, config.position_range(j));
            taught.carried[j] = Carried::begin(loads[j], limits);
        }
        taught
    }

    /// Fits a mass at the flange to the learned loads, by least squares over the joints of the arm at `q` (rad).
    fn fit(&mut self, q: &[f64; JOINTS], dynamics: &Dynamics) {
        let unit = dynamics.flange_torque(q);
        let (mut load, mut moment) = (0.0, 0.0);
        for j in 0..JOINTS {
            load += unit[j] * unit[j];
            moment += unit[j] * f64::from(self.carried[j].rest);
        }
        let (none, all) = (LOADS.0 * LOADS.0, LOADS.1 * LOADS.1);
        let fitted = moment / load.max(f64::MIN_POSITIVE) * smooth((load - none) / (all - none));
        let mass = if fitted.is_finite() { fitted } else { 0.0 };
        (self.found, self.mass, self.unit) = (mass as f32, mass as f32, unit.map(|u| u as f32));
        for j in 0..JOINTS {
            self.carried[j].explain(mass * unit[j]);
        }
    }

    /// Reduces the estimated mass by `mass` (kg), because the model contains this mass at the flange from this tick
    /// on (J-60). The estimate is reduced at most to zero. If `mass` is larger than the estimate, the payload was not
    /// on the arm when its mass was estimated.
    pub(crate) fn give_way(&mut self, mass: f64) {
        let left =
            |of: f32| (f64::from(of) - mass).max(f64::from(of.min(0.0))).min(f64::from(of.max(0.0))) as f32;
        (self.found, self.mass) = (left(self.found), left(self.mass));
    }

    /// Evaluates the answer of a joint in each tick of Teaching. `late` is the delay of this tick in ms. `fresh` is `true` if the joint has
    /// answered with this `position`, rad. Returns the speed computed from the joint positions, rad/s.
    #[inline(always)]
    pub(crate) fn hear(&mut self, j: usize, fresh: bool, position: f64, late: u16) -> f32 {
        self.joints[j].hear(fresh, position, late)
    }

    /// Returns `true` in the first tick of Teaching.
    pub(crate) fn begins(&self) -> bool {
        Turn::of(self.turn) == Turn::Begin
    }

    /// Returns `true` in a tick in which Teaching computes nothing. In this tick, there is time to compute the
    /// inertia of the whole arm for a ramp of path time.
    pub(crate) fn is_turn_of_ramp(&self) -> bool {
        Turn::of(self.turn) == Turn::Ramp
    }

    /// Returns the load torque of a joint in the first tick of Teaching, N·m. This is the whole learned load, because
    /// the controller has not attributed any part of it to a mass yet.
    pub(crate) fn first_load(&self, j: usize) -> f64 {
        self.carried[j].rest.into()
    }

    /// Computes at most one of the slowly changing values. Returns `true` if the tick then has no time left for the
    /// torques of the joints.
    ///
    /// In the first tick of Teaching, only the load torque is set, so that the torque has no step.
    #[inline(never)]
    pub(crate) fn look(
        &mut self,
        q: &[f64; JOINTS],
        v: &[f64; JOINTS],
        dynamics: &Dynamics,
        config: &Config,
        friction: impl Fn(usize, f64) -> (f64, f64),
    ) -> bool {
        let turn = Turn::of(self.turn);
        self.turn = if self.turn + 1 < FIRST + TURNS { self.turn + 1 } else { FIRST };
        match turn {
            Turn::Joints => return false,
            Turn::Mass => self.fit(q, dynamics),
            Turn::Inertia(joint) => self.look_at_inertia(joint, q, dynamics, config),
            Turn::Friction(joint) => {
                self.unit = dynamics.flange_torque(q).map(|u| u as f32);
                let (coulomb, moving) = friction(joint, v.get(joint).copied().unwrap_or(0.0));
                self.each(joint, |joint| joint.set_friction(coulomb, moving));
            }
            Turn::Judge => {
                self.judge(v);
                if config.tool_speed_max > 0.0 {
                    let (speed, limit) = (dynamics.flange_speed(q, v), config.tool_speed_max);
                    self.haste = smooth((speed - limit) / limit) as f32;
                }
            }
            _ => {}
        }
        true
    }

    fn look_at_inertia(&mut self, joint: usize, q: &[f64; JOINTS], dynamics: &Dynamics, config: &Config) {
        let rotors = config.joints.each_ref().map(rotor);
        let felt = dynamics.felt_inertia_of(q, &rotors, joint);
        self.each(joint, |joint| joint.set_inertia(felt));
    }

    fn each(&mut self, number: usize, f: impl FnOnce(&mut TaughtJoint)) {
        if let Some(joint) = self.joints.get_mut(number) {
            f(joint);
        }
    }

    /// Returns the torque that the mass causes on a joint, N·m.
    #[inline(always)]
    fn by_mass(&self, j: usize) -> f64 {
        f64::from(self.mass) * f64::from(self.unit[j])
    }

    /// Executes one tick of Teaching for a joint.
    #[inline(always)]
    pub(crate) fn step(&mut self, j: usize, led: &LedJoint<'_>, config: &Config) -> TaughtTorque {
        let by_mass = self.by_mass(j);
        let whole = self.carried[j].whole(by_mass);
        let (mut torque, bears) = self.joints[j].step(led, whole, self.haste, config);
        torque.load = self.carried[j].step(by_mass, led.velocity, bears.balanced, bears.compressed);
        torque
    }

    /// Compares the load with the motion of the last [`JUDGED_MS`].
    fn judge(&mut self, v: &[f64; JOINTS]) {
        let (mut driven, mut sinks, mut fastest) = (false, false, 0.0_f64);
        for j in 0..JOINTS {
            let gone = f64::from(self.found - self.mass) * f64::from(self.unit[j]);
            let by_mass = self.by_mass(j);
            let against = self.joints[j].against();
            driven |= self.carried[j].is_driven(by_mass, v[j], against);
            sinks |= self.carried[j].sinks(gone, v[j], against);
            fastest = fastest.max(v[j].abs());
        }
        if fastest > LED {
            let left = 1.0 - (fastest * PERIOD / WAY).min(1.0);
            for j in 0..JOINTS {
                self.carried[j].fade(left);
            }
        }
        let lasts = |ms: u16, holds: bool| if holds { ms.saturating_add(JUDGED_MS.into()) } else { 0 };
        (self.driven_ms, self.sinks_ms) = (lasts(self.driven_ms, driven), lasts(self.sinks_ms, sinks));
        if self.sinks_ms >= SINKS_MS {
            self.mass += (self.found - self.mass) * (PERIOD / COMES_BACK_S) as f32;
        } else if self.driven_ms >= DRIVEN_MS {
            self.mass *= (1.0 - PERIOD / GOES_S) as f32;
        }
    }

    /// Returns the torque that holds a joint at `position` (rad), N·m: the torque of the load plus the torque of the
    /// dry friction.
    pub(crate) fn held(&self, j: usize, position: f64, limits: &JointConfig, config: &Config) -> f64 {
        self.carried[j].torque(self.by_mass(j)) + self.joints[j].dry_spring(position, limits, config)
    }
}

#[cfg(test)]
mod tests;
