//! The control law: τ = τ_id + τ_pid + τ_fric and its limits, each tick, for each joint (section 6).
use jtc_dynamics::Dynamics;

use super::Motion;
use crate::config::Config;
use crate::nodes::Nodes;
use crate::parameters::{PidGains, TableOf};
use crate::pid::PidTorque;
use crate::{JOINTS, friction, joint_error, limits};

/// Most that the brake of teaching takes from a speed, 1/s. Measured speeds are about 8 ms old, being averages of the drives: a
/// brake above 200 1/s would drive a joint to and fro, and joints that move each other make that less.
const BRAKE_RATE: f64 = 100.0;

/// Rotor inertia of a drive of which none is given, kg·m²: that of the known drives.
const UNKNOWN_ROTOR: f64 = 0.7;
/// Speed above which torque at its limit that drives the joint on catches nothing, rad/s.
const DRIVEN: f64 = 0.05;

/// Which parts of the control law act: the control mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ControlMode {
    /// Gravity and PID.
    Hold,
    /// Gravity, PID, friction, and inertia at the commanded velocity and acceleration.
    Follow,
    /// The same while the arm approaches the path. The limits of the path do not apply: the approach begins at the measured
    /// position.
    Approach,
    /// Gravity and a brake above the speed limit.
    Teach,
}

impl ControlMode {
    /// The commanded velocity and acceleration act.
    fn moves(self) -> bool {
        matches!(self, Self::Follow | Self::Approach)
    }
}

/// Parameters of the control law: model, gains and friction.
pub(crate) struct ControlParameters<'a> {
    pub dynamics: &'a Dynamics,
    pub pid: &'a [PidGains; JOINTS],
    pub polynomial: &'a [[f64; 6]; JOINTS],
    pub table: Option<&'a [TableOf<f32>; JOINTS]>,
}

/// Parts of one joint's torque, N·m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct JointTorque {
    pub model: f64,
    pub pid: PidTorque,
    pub friction: f64,
    /// What teaching carries besides the model.
    pub payload: f64,
    /// Brake of teaching.
    pub brake: f64,
    /// What is left of a step that is being blended out.
    pub blend: f64,
}

impl JointTorque {
    /// All but the model.
    pub fn correction(&self) -> f64 {
        self.pid.sum() + self.friction + self.payload + self.brake + self.blend
    }

    pub fn sum(&self) -> f64 {
        self.model + self.correction()
    }
}

impl Motion {
    /// The control law and its limits: torques to command, and joint errors found on the way. `braking`: with all the torque
    /// there is, so that what this does to the torque, and on the path to position error and acceleration, is none (J-33).
    pub fn control(
        &mut self,
        mode: ControlMode,
        braking: bool,
        nodes: &Nodes,
        config: &Config,
        parameters: &ControlParameters<'_>,
    ) -> ([f64; JOINTS], [u16; JOINTS]) {
        let missing = self.compute(mode, nodes, config, parameters);
        if self.yielding {
            self.soften(config);
        }
        let (torque, mut errors) = self.limit(mode, braking, nodes, config, parameters);
        for (j, error) in errors.iter_mut().enumerate() {
            if nodes.node(j).enabled() {
                *error |= missing[j];
            }
        }
        (torque, errors)
    }

    /// Computes the torque of this tick into `self.torque`; returns joint errors found on the way (friction table).
    fn compute(
        &mut self,
        mode: ControlMode,
        nodes: &Nodes,
        config: &Config,
        parameters: &ControlParameters<'_>,
    ) -> [u16; JOINTS] {
        let mut errors = [0; JOINTS];
        let before = self.transfer.begin(&self.torque);
        let q = nodes.positions();
        let v = nodes.velocities();
        // J-40: measured position; commanded velocity and acceleration in Operate, zero elsewhere.
        let zero = [0.0; JOINTS];
        let (qd, qdd) = if mode.moves() { (self.set.velocity, self.set.acceleration) } else { (zero, zero) };
        let model = parameters.dynamics.inverse(q, &qd, &qdd);
        let payload = if mode == ControlMode::Teach {
            self.payload.torque(parameters.dynamics, q, v, config)
        } else {
            [0.0; JOINTS]
        };
        for j in 0..JOINTS {
            let limit = &config.joints[j];
            let mut torque = JointTorque {
                model: model[j] + limit.rotor_inertia * qdd[j],
                payload: payload[j],
                ..JointTorque::default()
            };
            if mode != ControlMode::Teach {
                let error = self.set.position[j] - q[j];
                let at_rest = self.set.velocity[j] == 0.0 && self.set.acceleration[j] == 0.0;
                let encoder_step = at_rest.then_some(config.encoder_step);
                let saturated = self.saturation[j].saturated;
                torque.pid = self.pid[j].step(&parameters.pid[j], error, saturated, encoder_step);
            }
            if mode.moves() {
                let t = friction::celsius(nodes.node(j).report.temperature);
                torque.friction = match parameters.table {
                    None => {
                        friction::polynomial(&parameters.polynomial[j], qd[j], t, config.friction_sign_width)
                    }
                    Some(tables) => {
                        let (slowest, fastest) = friction::velocities(&tables[j]);
                        let nearest = qd[j].max(slowest).min(fastest);
                        let v = if mode == ControlMode::Approach { nearest } else { qd[j] };
                        friction::table(&tables[j], v, t).unwrap_or_else(|| {
                            errors[j] |= joint_error::FRICTION_TABLE;
                            0.0
                        })
                    }
                };
            }
            self.torque[j] = torque;
        }
        self.transfer.blend(before, &mut self.torque, nodes, config);
        if mode == ControlMode::Hold && !self.yielding && self.all_holding() {
            self.payload.observe(&self.torque.map(|t| t.correction()));
        } else {
            self.payload.forget();
        }
        if mode == ControlMode::Teach {
            self.brake(nodes, config, parameters);
        }
        errors
    }

    /// Teaching brakes joints above the speed limit (J-25).
    fn brake(&mut self, nodes: &Nodes, config: &Config, parameters: &ControlParameters<'_>) {
        let limit = config.teach_velocity_max;
        let excess = nodes.velocities().map(|v| v - v.max(-limit).min(limit));
        if excess == [0.0; JOINTS] {
            return;
        }
        let mass = parameters.dynamics.mass_matrix(nodes.positions());
        for (j, torque) in self.torque.iter_mut().enumerate() {
            let joint = &config.joints[j];
            // A drive has a rotor also where the configuration gives none.
            let rotor = if joint.rotor_inertia > 0.0 { joint.rotor_inertia } else { UNKNOWN_ROTOR };
            let damping = config.teach_damping.min(BRAKE_RATE * (mass[j][j] + rotor));
            if nodes.node(j).enabled() {
                torque.brake = within(-damping * excess[j], torque.sum(), joint.torque_max);
            }
        }
    }

    /// Bounds what the control law adds to the torque of the model (J-66).
    fn soften(&mut self, config: &Config) {
        for (torque, joint) in self.torque.iter_mut().zip(&config.joints) {
            let most = config.yield_torque_share * joint.torque_max;
            let correction = torque.correction();
            torque.blend += correction.max(-most).min(most) - correction;
        }
    }

    /// The torques to command and the joint errors found, both per joint (J-43).
    fn limit(
        &mut self,
        mode: ControlMode,
        braking: bool,
        nodes: &Nodes,
        config: &Config,
        parameters: &ControlParameters<'_>,
    ) -> ([f64; JOINTS], [u16; JOINTS]) {
        let (mut torque, mut errors) = ([0.0; JOINTS], [0; JOINTS]);
        // Only while path time runs: an arm that is pushed away from where the path stands is not to be fought (J-66).
        let on_path = braking && mode == ControlMode::Follow;
        let excused = if on_path { joint_error::POSITION_ERROR | joint_error::ACCELERATION } else { 0 };
        for j in 0..JOINTS {
            let limits = &config.joints[j];
            let computed = self.torque[j].sum();
            let catching = self.catch[j].step(nodes.velocities()[j]) && mode == ControlMode::Hold;
            // Torque that drives a joint on, rather than stop it, is neither a catch nor a way to rest.
            let driven = computed.signum() * nodes.velocities()[j] > DRIVEN;
            let stopping = (catching || self.deceleration[j].is_some()) && !driven;
            let (limited, torque_error) =
                self.saturation[j].limit(computed, limits, config.torque_over_ms, braking || stopping);
            let joint = (self.set.position[j], self.set.velocity[j], self.set.acceleration[j]);
            let set_error =
                limits::check_set(joint, nodes.positions()[j], limits, mode == ControlMode::Follow);
            torque[j] = limited;
            if catching && self.saturation[j].saturated {
                self.sag(j, computed - limited, nodes, config, parameters);
            }
            errors[j] = torque_error
                | if mode != ControlMode::Teach && self.holding[j] { set_error & !excused } else { 0 };
        }
        (torque, errors)
    }
}

/// As much of the `wanted` torque as a `torque` so far leaves of the limit, N·m.
fn within(wanted: f64, torque: f64, torque_max: f64) -> f64 {
    let (low, high) = ((-torque_max - torque).min(0.0), (torque_max - torque).max(0.0));
    wanted.max(low).min(high)
}

#[cfg(test)]
mod tests;
