//! Motion of the arm (J-40 to J-44): set values, control law and limiter.
//!
//! Each part has its own state and runs one step per tick. [`Motion`] connects the parts, and applies a change of the controller's state to
//! all of them.
mod catch;
mod deceleration;
mod hold_back;
mod jog;
mod law;
mod limiter;
mod load;
mod overspeed;
mod pid;
mod ramp;
mod room;
mod set_values;
mod soft_end;
mod teach;
mod torque;
mod transfer;
mod yielding;

use jtc_dynamics::Dynamics;

use crate::JOINTS;
use crate::bit_codec::bit_codec;
use crate::config::Config;
use crate::interpolation::SetPoint;
use crate::nodes::Nodes;
use crate::parameters::PidGains;
use crate::trajectory::path::PathClock;
use catch::Catch;
use deceleration::moves;
pub(crate) use hold_back::{HoldBack, HoldBackStep};
pub(crate) use jog::LASTS_MS as JOG_LASTS_MS;
use law::ControlLaw;
pub(crate) use law::{ControlMode, ControlParameters, LawInputs};
pub(crate) use limiter::{Found, RUSH};
use limiter::{Limited, Limiter};
use overspeed::OverSpeed;
#[cfg(test)]
pub(crate) use pid::PidTorque;
use ramp::PathRamp;
use set_values::SetValues;
pub(crate) use set_values::approach;
use teach::Taught;
pub(crate) use teach::too_fast;
#[cfg(test)]
pub(crate) use torque::JointTorque;
#[cfg(test)]
pub(crate) type Ramp = PathRamp;

/// Time within which the controller learns the loads of joints, if nothing touches the arm, ms.
const KNOWN_MS: u32 = 2_000;

/// State of all parts of the motion.
#[derive(Clone, Debug, Default)]
pub(crate) struct Motion {
    pub set: SetValues,
    pub law: ControlLaw,
    limiter: Limiter,
    pub over_speed: OverSpeed,
    pub ramp: PathRamp,
    pub hold_back: HoldBack,
}

bit_codec!(Motion { set, law, limiter, over_speed, ramp, hold_back });

impl Motion {
    /// Resets all parts of the motion when the torque is switched off: no joint is held, and no torque is stored.
    /// Each part is reset in place, because a new value would be built on the stack and copied.
    pub(crate) fn release(&mut self, nodes: &Nodes) {
        let Self { set, law, limiter, over_speed, ramp, hold_back } = self;
        set.release(nodes);
        law.release();
        *limiter = Limiter::default();
        *over_speed = OverSpeed::default();
        *ramp = PathRamp::default();
        *hold_back = HoldBack::default();
    }

    /// Makes the joints in `yields` yield from the next tick on (J-68), and the joints in `lowers` lower their loads
    /// (J-70). The inertia of each joint is the inertia that was computed for the last ramp of path time.
    pub(crate) fn begin_yields(&mut self, yields: &[bool; JOINTS], lowers: &[bool; JOINTS], config: &Config) {
        let inertia = self.ramp.inertia();
        for j in 0..JOINTS {
            if yields[j] || lowers[j] {
                let set = self.set.point.position[j];
                self.law.begin_yield(j, (lowers[j], self.set.is_led()), set, inertia[j], &config.joints[j]);
                self.limiter.forget(j);
            }
        }
    }

    /// Changes the gains while the arm is held (J-71).
    pub(crate) fn change_gains(&mut self, gains: &[PidGains; JOINTS]) {
        self.law.change_gains(gains);
        self.set.catch.iter_mut().for_each(Catch::watch_anew);
        self.limiter.forget_turns();
    }

    /// Returns `true` if all joints have been at rest at least once since they were enabled, and if no joint yields.
    pub(crate) fn holds(&self, config: &Config) -> bool {
        (0..JOINTS).all(|j| config.absent[j] || (self.set.catch[j].settled() && !self.law.yields(j)))
    }

    /// Returns two flags for each joint. The first is `true` if the joint is at its torque limit. The second is `true`
    /// if the joint lags its set position by too much.
    pub(crate) fn presses(&self, nodes: &Nodes, config: &Config) -> ([bool; JOINTS], [bool; JOINTS]) {
        let lags = |j: usize| {
            let (error, limit) = self.lag(j, nodes, config);
            error.abs() > limit
        };
        let saturated = core::array::from_fn(|j| self.limiter.is_saturated(j));
        (saturated, core::array::from_fn(|j| !self.law.yields(j) && lags(j)))
    }

    /// Returns the position error of a joint, and its limit while the path is held back, rad. The limit is half of
    /// the normal limit. The other half is a reserve, so that the arm can stop on its path (J-75).
    pub(crate) fn lag(&self, j: usize, nodes: &Nodes, config: &Config) -> (f64, f64) {
        let j = j.min(JOINTS - 1); // so that the compiler sees that the index is in range
        let limit = 0.5 * config.joints[j].position_error_max;
        (self.set.due(config)[j] - nodes.positions()[j], limit)
    }

    /// Returns `true` if Teaching may begin: the arm is held at rest, and the loads of its joints are known.
    ///
    /// `contact` is `true` in a held stop, in which an obstacle may still press on the arm. Teaching may then begin
    /// during this contact. If the request has waited for [`KNOWN_MS`] (`waits_ms`), the loads need not be known
    /// either.
    pub(crate) fn may_be_taught(&self, config: &Config, contact: bool, waits_ms: u32) -> bool {
        let overdue = contact && waits_ms >= KNOWN_MS;
        self.set.all_holding()
            && !self.law.is_yielding()
            && (overdue || self.law.knows_loads(&self.set.holding, config, contact))
    }

    /// Executes one tick of Teaching. If the arm moves at the end of Teaching, a ramp brings it to rest, so this
    /// function keeps the inertia for the ramp up to date.
    pub(crate) fn keep_ramp(&mut self, nodes: &Nodes, config: &Config, dynamics: &Dynamics) {
        if self.law.taught.as_ref().is_some_and(Taught::is_turn_of_ramp) {
            self.ramp.begin(nodes, config, dynamics);
        }
    }

    /// Ends Teaching. The arm comes to rest and is held. The integral takes over the torque that Teaching used for
    /// the load.
    ///
    /// Moving joints stop within `ramp_ms`, or more slowly if the torque limits require it, within `stop_ms` (J-33).
    pub(crate) fn end_teaching(&mut self, nodes: &Nodes, config: &Config, gains: &[PidGains; JOINTS]) {
        let mut length_ms = f64::from(config.ramp_ms);
        if nodes.velocities().iter().any(|v| moves(*v)) {
            let needed = self.ramp.shortest_stop_ms(&self.law, nodes.velocities(), config);
            length_ms = length_ms.max(needed).min(f64::from(config.stop_ms).max(length_ms));
        }
        self.set.hold_measured(nodes, length_ms, config);
        self.law.end_teaching(nodes, config, gains);
    }

    /// Begins to hold joints that have just been enabled.
    pub(crate) fn latch(&mut self, nodes: &Nodes, config: &Config) {
        let latched = self.set.latch(nodes, config);
        self.law.latch(&latched);
    }

    /// Executes one tick in HoldPos, which is a tick of the position hold or of a jog.
    pub(crate) fn hold(&mut self, config: &Config) {
        let Self { set, law, ramp, .. } = self;
        if set.jogging() {
            set.jog_on(config, |at, clock| ramp.step(at, law, clock, config));
        } else {
            set.hold(config);
        }
    }

    /// Executes one tick on the path or during the approach. `at` contains the set values at the present time of the
    /// `clock`, as if the motion ran at full speed (J-33). The function scales them with the rate of the clock.
    pub(crate) fn follow(&mut self, at: &SetPoint, clock: &mut PathClock, config: &Config) {
        if self.hold_back.is_active() && !clock.halting() && !clock.above_pace() {
            self.ramp.hold_back(at, &self.law, clock, config);
        } else {
            self.ramp.step(at, &self.law, clock, config);
        }
        self.set.follow(at, clock.rate, clock.slope);
    }

    /// Executes one tick of the control law and of the limiter. Returns the torques to command and the findings of the limiter.
    // A single function does the work of every tick, because calls of inner functions would copy the torques several times.
    #[inline(never)]
    pub(crate) fn control(&mut self, inputs: &LawInputs<'_>) -> Limited {
        let positions = inputs.nodes.positions();
        let yields = self.law.any_yields();
        if yields {
            for (j, position) in positions.iter().enumerate() {
                if let Some(set) = self.law.drag(j, *position) {
                    self.set.lead(j, set);
                }
            }
        }
        self.set.commanded.put(&self.set.point);
        let missing = self.law.step(inputs, &self.set, |j| self.limiter.is_saturated(j));
        let held_back = self.hold_back.is_active();
        let mut limited = Limited::default();
        self.limiter.step(inputs, &self.law, &mut self.set, held_back, &mut limited);
        if let Some(sag) = &limited.sag {
            self.law.sag(sag);
        }
        if missing.iter().fold(0, |all, errors| all | errors) != 0 {
            for (j, found) in limited.found.get_or_insert_default().iter_mut().enumerate() {
                found.errors |= if inputs.nodes.node(j).enabled() { missing[j] } else { 0 };
            }
        }
        if yields {
            let ended = self.law.end_of_yields(inputs.parameters.pid);
            for (j, position) in positions.iter().enumerate() {
                if ended[j] {
                    self.set.lead(j, *position);
                    self.set.catch[j].calm_down();
                }
            }
        }
        limited
    }
}

#[cfg(test)]
mod tests;
