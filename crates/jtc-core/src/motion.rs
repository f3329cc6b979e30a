//! The motion of the arm: the set values of each state, and what the control law remembers (section 6).
mod law;
mod ramp;
mod transfer;

use jtc_dynamics::Dynamics;

use crate::JOINTS;
use crate::catch::Catch;
use crate::coast::{Coast, moves};
use crate::config::{Config, PidGains};
use crate::interpolation::SetPoint;
use crate::limits::Saturation;
use crate::nodes::Nodes;
use crate::overspeed::OverSpeed;
use crate::pid::Pid;
use crate::teach::Payload;
pub(crate) use law::{ControlParameters, JointTorque, Law};
use transfer::Transfer;

/// Length of a tick, s.
const DT: f64 = 0.001;

/// What the control law remembers.
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
    /// Joints on their way to rest.
    coast: [Option<Coast>; JOINTS],
    /// The arm gives way: the law adds only so much to the torque of the model (J-66).
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
    /// Limp: nothing is held, no torque is remembered.
    pub fn release(&mut self, nodes: &Nodes) {
        *self = Self { set: SetPoint::still(*nodes.positions()), ..Self::default() };
    }

    /// The state changes among HoldPos, Operate and Teaching: continue without a step but that of the model (J-44).
    pub fn change_law(&mut self) {
        self.transfer.change_law();
    }

    /// The model changes under the holding arm: continue without any step.
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
            let coasts = moving && self.holding[j];
            self.coast[j] = coasts.then_some(Coast::led(from[j], velocity[j], config, &config.joints[j]));
        }
    }

    /// Whatever comes next begins at rest at `position`.
    pub fn begin_at(&mut self, position: &[f64; JOINTS]) {
        self.set = SetPoint::still(*position);
        for pid in &mut self.pid {
            pid.reset(0.0);
        }
        self.coast = [None; JOINTS];
    }

    /// Hold where the arm is, and give way to what moves it from there (J-66).
    pub fn give_way(&mut self, nodes: &Nodes, config: &Config) {
        self.hold_measured(nodes, config);
        // What the law had added is what it is to let go of.
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
        self.coast.iter().all(Option::is_none)
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
                self.coast[j] =
                    falls.then_some(Coast::falling(measured[j], velocity[j], config, &config.joints[j]));
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
            let Some(coast) = &mut self.coast[j] else { continue };
            let (position, velocity, rests) = coast.step(&config.joints[j]);
            (self.set.position[j], self.set.velocity[j]) = (position, velocity);
            if rests {
                self.coast[j] = None;
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
        if let Some(coast) = &mut self.coast[j] {
            coast.shift(step);
        }
    }

    /// Set values on the way from a held position to the first point, at `u` (0..1) of `length_ms`.
    pub fn glide(&mut self, from: &[f64; JOINTS], to: &[f64; JOINTS], u: f64, length_ms: f64) {
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
        for (catch, coast) in self.catch.iter_mut().zip(&self.coast) {
            // What a hand has led is stopped as a load is.
            *catch = if coast.is_some() { Catch::begin(config) } else { *catch };
        }
        for ((pid, gains), torque) in self.pid.iter_mut().zip(gains).zip(&self.torque) {
            pid.take_over(gains, torque.payload);
        }
    }
}

#[cfg(test)]
mod tests;
