//! The motion of the arm: the set values of each state, and the state of the control law (section 6).
mod law;
mod ramp;
mod transfer;

use jtc_dynamics::Dynamics;

use crate::JOINTS;
use crate::catch::Catch;
use crate::config::Config;
use crate::deceleration::{Deceleration, moves};
use crate::interpolation::SetPoint;
use crate::limits::Saturation;
use crate::nodes::Nodes;
use crate::overspeed::OverSpeed;
use crate::parameters::PidGains;
use crate::pid::Pid;
use crate::teach::Payload;
pub(crate) use law::{ControlMode, ControlParameters, JointTorque};
use transfer::Transfer;

/// Length of a tick, s.
const DT: f64 = 0.001;

/// The state of the control law.
#[derive(Clone, Debug, Default)]
pub(crate) struct Motion {
    /// Set values.
    pub set: SetPoint,
    /// The joint is enabled and its set position latched.
    holding: [bool; JOINTS],
    pid: [Pid; JOINTS],
    /// Torque of the last tick.
    pub torque: [JointTorque; JOINTS],
    saturation: [Saturation; JOINTS],
    /// Joints whose load is being caught.
    catch: [Catch; JOINTS],
    over_speed: OverSpeed,
    payload: Payload,
    transfer: Transfer,
    /// Joints that decelerate to rest.
    deceleration: [Option<Deceleration>; JOINTS],
    /// The arm gives way: the control law adds only so much to the torque of the model (J-66).
    yielding: bool,
    /// Mass matrix with rotors at the start of a ramp of path time.
    inertia: [[f64; JOINTS]; JOINTS],
}

/// Rises from 0 to 1 without a corner.
pub(crate) fn smooth(u: f64) -> f64 {
    let u = u.clamp(0.0, 1.0);
    u * u * (3.0 - 2.0 * u)
}

impl Motion {
    /// Torque off: nothing is held, no torque is remembered.
    pub fn release(&mut self, nodes: &Nodes) {
        *self = Self { set: SetPoint::still(*nodes.positions()), ..Self::default() };
    }

    /// The control mode changes among HoldPos, Operate and Teaching: bumpless transfer, with no step but that of the model (J-44).
    pub fn change_mode(&mut self) {
        self.transfer.change_mode();
    }

    /// The model changes under the holding arm: bumpless transfer without any step.
    pub fn change_model(&mut self) {
        self.transfer.change_model();
    }

    /// Begin to hold where the arm is, coming to rest first if it moves.
    pub fn hold_measured(&mut self, nodes: &Nodes, config: &Config) {
        let (from, velocity) = (nodes.positions(), nodes.velocities());
        self.begin_at(from);
        let moving = velocity.iter().any(|&v| moves(v));
        for j in 0..JOINTS {
            // Joints that are enabled later begin on their own.
            let decelerates = moving && self.holding[j];
            self.deceleration[j] =
                decelerates.then_some(Deceleration::led(from[j], velocity[j], config, &config.joints[j]));
        }
    }

    /// Whatever comes next begins at rest at `position`.
    pub fn begin_at(&mut self, position: &[f64; JOINTS]) {
        self.set = SetPoint::still(*position);
        for pid in &mut self.pid {
            pid.reset(0.0);
        }
        self.deceleration = [None; JOINTS];
    }

    /// Hold where the arm is, and give way to what moves it from there (J-66).
    pub fn give_way(&mut self, nodes: &Nodes, config: &Config) {
        self.hold_measured(nodes, config);
        // The torque that the control law had added is the torque that it has to let go of.
        self.transfer.let_go();
        self.yielding = true;
    }

    /// The whole torque may be used again.
    pub fn stand_firm(&mut self) {
        self.yielding = false;
    }

    /// The arm gives way.
    pub fn yielding(&self) -> bool {
        self.yielding
    }

    /// Joints that move, by their set values or as measured.
    pub fn moving(&self, nodes: &Nodes) -> [bool; JOINTS] {
        core::array::from_fn(|j| moves(self.set.velocity[j]) || moves(nodes.velocities()[j]))
    }

    /// As if every joint were enabled and its position latched.
    #[cfg(test)]
    pub fn hold_for_test(&mut self) {
        self.holding = [true; JOINTS];
    }

    /// Every joint is enabled and held at rest.
    pub fn all_holding(&self) -> bool {
        self.deceleration.iter().all(Option::is_none)
            && self.holding.iter().all(|&h| h)
            && !self.catch.iter().any(Catch::busy)
    }

    /// What the arm carries is known, or is none of it: an arm that gives way has more likely a contact against it.
    pub fn may_be_taught(&self, config: &Config) -> bool {
        self.all_holding() && (self.yielding || self.payload.is_known(config))
    }

    /// Latches the set position of joints that have just been enabled, and brings those to rest that move; joints that are
    /// not enabled are followed, without torque.
    pub fn latch(&mut self, nodes: &Nodes, config: &Config) {
        let (measured, velocity) = (nodes.positions(), nodes.velocities());
        let enabled = core::array::from_fn(|j| nodes.node(j).enabled());
        let just_enabled: [bool; JOINTS] = core::array::from_fn(|j| enabled[j] && !self.holding[j]);
        let another = just_enabled.contains(&true);
        for j in 0..JOINTS {
            if !(enabled[j] && self.holding[j]) {
                self.set.position[j] = measured[j];
                self.pid[j].reset(0.0);
                self.catch[j] = if just_enabled[j] { Catch::begin(config) } else { Catch::default() };
                let falls = just_enabled[j] && moves(velocity[j]);
                self.deceleration[j] = falls.then_some(Deceleration::falling(
                    measured[j],
                    velocity[j],
                    config,
                    &config.joints[j],
                ));
            } else if another {
                // Its load moves when that of another joint does.
                self.catch[j] = Catch::begin(config);
            }
        }
        self.holding = enabled;
        self.transfer.set_just_enabled(just_enabled);
    }

    /// Set values of HoldPos: the held position.
    pub fn hold(&mut self, config: &Config) {
        (self.set.velocity, self.set.acceleration) = ([0.0; JOINTS], [0.0; JOINTS]);
        for j in 0..JOINTS {
            let Some(deceleration) = &mut self.deceleration[j] else { continue };
            let (position, velocity, rests) = deceleration.step(&config.joints[j]);
            (self.set.position[j], self.set.velocity[j]) = (position, velocity);
            if rests {
                self.deceleration[j] = None;
            }
        }
    }

    /// The set position of a joint whose load is being caught moves on towards it, by as much as the torque is beyond the limit.
    fn sag(
        &mut self,
        j: usize,
        excess: f64,
        nodes: &Nodes,
        config: &Config,
        parameters: &ControlParameters<'_>,
    ) {
        let error = self.set.position[j] - nodes.positions()[j];
        let step = self.catch[j].sag(excess, parameters.pid[j].kp, error, &config.joints[j]);
        self.set.position[j] += step;
        self.pid[j].shift(step);
        if let Some(deceleration) = &mut self.deceleration[j] {
            deceleration.shift(step);
        }
    }

    /// Set values of the approach from a held position to the first point, at `u` (0..1) of `length_ms`: a minimum-jerk
    /// (fifth-order) polynomial.
    pub fn approach(&mut self, from: &[f64; JOINTS], to: &[f64; JOINTS], u: f64, length_ms: f64) {
        let rise = u * u * u * (10.0 + u * (6.0 * u - 15.0));
        let speed = 30.0 * u * u * (1.0 - u) * (1.0 - u) / (length_ms * DT);
        for j in 0..JOINTS {
            self.set.position[j] = from[j] + (to[j] - from[j]) * rise;
            self.set.velocity[j] = (to[j] - from[j]) * speed;
            self.set.acceleration[j] = 0.0;
        }
    }

    /// Set values on the path: full-speed values `at`, scaled by the rate of path time and its slope (1/s) (J-33).
    pub fn follow(&mut self, at: &SetPoint, rate: f64, slope: f64) {
        self.set.position = at.position;
        for j in 0..JOINTS {
            self.set.velocity[j] = at.velocity[j] * rate;
            self.set.acceleration[j] = at.acceleration[j] * rate * rate + at.velocity[j] * slope;
        }
    }

    /// Joints that are measured too fast (J-35). Once a tick, while torque is on.
    pub fn too_fast(&mut self, nodes: &Nodes, config: &Config) -> [u16; JOINTS] {
        self.over_speed.watch(nodes, config)
    }

    /// Teaching begins: what HoldPos had found missing becomes a mass at the flange (J-25). What an arm that gives way has
    /// against it is more likely a contact than a mass.
    pub fn begin_teaching(&mut self, nodes: &Nodes, config: &Config, dynamics: &Dynamics) {
        self.stand_firm();
        self.payload.fit(dynamics, nodes.positions(), config);
    }

    /// Teaching ends: hold where the arm is, and let the integral take over what teaching carried.
    pub fn end_teaching(&mut self, nodes: &Nodes, config: &Config, gains: &[PidGains; JOINTS]) {
        self.hold_measured(nodes, config);
        for (catch, deceleration) in self.catch.iter_mut().zip(&self.deceleration) {
            // A joint that a hand has led is stopped like one with a falling load.
            *catch = if deceleration.is_some() { Catch::begin(config) } else { *catch };
        }
        for ((pid, gains), torque) in self.pid.iter_mut().zip(gains).zip(&self.torque) {
            pid.take_over(gains, torque.payload);
        }
    }
}

#[cfg(test)]
mod tests;
