//! The control law: τ = τ_id + τ_pid + τ_fric, each tick, for each joint (J-40 to J-44).
use jtc_dynamics::Dynamics;

use super::set_values::{Latched, SetValues};
use super::torque::JointTorque;
use super::transfer::Transfer;
use crate::config::Config;
use crate::limits::{JointConfig, within};
use crate::load::Load;
use crate::nodes::Nodes;
use crate::parameters::{PidGains, TableOf};
use crate::pid::{Pid, PidTorque};
use crate::remembered::remembered;
use crate::teach::Payload;
use crate::yielding::{DAMPING_RATE, Joint, Yield, Yielded};
use crate::{JOINTS, friction, joint_error};

/// Speed below which what the integral finds in motion may be friction that the model has wrong, rad/s: no load is learned from it.
const CREEPS: f64 = 0.05;

/// Rotor inertia of a drive of which none is given, kg·m²: that of the known drives.
const UNKNOWN_ROTOR: f64 = 0.7;

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
    pub(crate) fn moves(self) -> bool {
        matches!(self, Self::Follow | Self::Approach)
    }
}

/// Longest time that the integral takes to give back what it had found for a payload that is given, ms.
const UNWINDS_MS: u16 = 3_000;

/// What a tick of the control law is given.
pub(crate) struct LawInputs<'a> {
    pub mode: ControlMode,
    /// The arm brakes with all the torque there is (J-33).
    pub braking: bool,
    pub nodes: &'a Nodes,
    pub config: &'a Config,
    pub parameters: ControlParameters<'a>,
}

/// Parameters of the control law: model, gains and friction.
pub(crate) struct ControlParameters<'a> {
    pub dynamics: &'a Dynamics,
    pub pid: &'a [PidGains; JOINTS],
    pub polynomial: &'a [[f64; 6]; JOINTS],
    pub table: Option<&'a [TableOf<f32>; JOINTS]>,
}

/// The state of the control law.
#[derive(Clone, Debug, Default)]
pub(crate) struct ControlLaw {
    pid: [Pid; JOINTS],
    /// Torque of the last tick.
    pub torque: [JointTorque; JOINTS],
    pub(super) payload: Payload,
    transfer: Transfer,
    /// Joints that yield (J-68, J-70).
    yields: [Option<Yield>; JOINTS],
    yielded: Yielded,
    /// What each joint carries and the model lacks.
    loads: [Load; JOINTS],
    /// The joint whose load is observed in this tick.
    observed: u8,
    /// Time left in which what is missing is what the controller had found for a payload that is now given, ms (J-60).
    pub(super) unwinds_ms: u16,
}

remembered!(ControlLaw { pid, torque, payload, transfer, yields, yielded, loads, observed, unwinds_ms });

impl ControlLaw {
    /// No torque is remembered.
    pub fn release(&mut self) {
        let Self { pid, torque, payload, transfer, yields, yielded, loads, observed, unwinds_ms } = self;
        (*unwinds_ms, *observed) = (0, 0);
        *pid = Default::default();
        *torque = Default::default();
        *payload = Payload::default();
        *transfer = Transfer::default();
        forget_yields(yields);
        *yielded = Yielded::default();
        *loads = Default::default();
    }

    /// The control mode changes among HoldPos, Operate and Teaching: bumpless transfer, with no step but that of the model (J-44).
    pub fn change_mode(&mut self) {
        self.transfer.change_mode();
    }

    /// The model changes under the holding arm: bumpless transfer without any step.
    pub fn change_model(&mut self) {
        // What was missing was missing in the last one.
        self.payload.forget();
        self.forget_loads();
        self.transfer.change_model();
    }

    /// The gains change: no step but that of the model.
    pub fn change_gains(&mut self) {
        self.forget_loads();
        self.transfer.change_mode();
    }

    /// Forgets the loads: each joint has to find what it carries again.
    fn forget_loads(&mut self) {
        self.loads.iter_mut().for_each(Load::forget);
    }

    /// Whatever comes next begins at rest, without a position error.
    pub fn begin(&mut self) {
        for pid in &mut self.pid {
            pid.reset(0.0);
        }
        self.forget_loads();
    }

    /// Joints that are not held any more, or not yet, begin anew.
    pub fn latch(&mut self, latched: &Latched) {
        for j in 0..JOINTS {
            if !latched.held[j] {
                self.pid[j].reset(0.0);
                self.loads[j].forget();
                self.yields[j] = None;
            }
        }
        self.transfer.set_just_enabled(latched.just_enabled);
    }

    /// A joint yields from the next tick on, or lowers its load. `set`: where it was commanded to, rad; `inertia`: what it moves, kg·m².
    // Inlined, so that its index is known to be that of a joint.
    #[inline(always)]
    pub fn begin_yield(&mut self, joint: usize, lowers: bool, set: f64, inertia: f64, limits: &JointConfig) {
        let (torque, limit) = (&mut self.torque[joint], limits.torque_max);
        if let Some(yields) = &mut self.yields[joint] {
            if lowers {
                yields.lower(0.0);
            }
            return;
        }
        // What was commanded, not what was computed, is what the joint lets go of.
        torque.blend += torque.sum().max(-limit).min(limit) - torque.sum();
        self.transfer.begin_yield(joint);
        let load = &self.loads[joint];
        // The integral of a joint that was pushed has not found a load.
        let load =
            if lowers { Load::bounded(load.torque(torque.pid.i), limits) } else { load.known_torque() };
        let stays = self.yielded.count(joint);
        self.yields[joint] = Some(Yield::begin(lowers, stays, set, inertia, load));
    }

    /// Whether the joint yields, or lowers a load.
    pub fn yields(&self, joint: usize) -> bool {
        self.yields[joint].is_some()
    }

    /// Whether any joint does.
    pub fn any_yields(&self) -> bool {
        self.yields.iter().any(Option::is_some)
    }

    /// A joint yields, and is not calm yet.
    pub fn is_yielding(&self) -> bool {
        self.yields.iter().flatten().any(|yields| !yields.is_calm())
    }

    /// The host ends the reaction: joints that are calm are held again.
    pub fn end_yields(&mut self) {
        self.yields.iter_mut().flatten().for_each(Yield::clear);
    }

    /// Drags the spring of a joint that yields along. Returns where it pulls to, rad; `None` for a joint that does not yield.
    pub fn drag(&mut self, joint: usize, position: f64) -> Option<f64> {
        self.yields[joint].as_mut().map(|yields| yields.drag(position))
    }

    /// Torque that the joint carries and the model lacks, N·m.
    pub fn load(&self, joint: usize) -> f64 {
        self.loads[joint].torque(self.torque[joint].pid.i)
    }

    /// Torque by which the control law corrects that of the model and of the load, N·m: what a push has against it.
    pub fn feedback(&self, joint: usize) -> f64 {
        let pid = &self.torque[joint].pid;
        pid.p + pid.d + (pid.i - self.load(joint))
    }

    /// Ends the yield of joints that are calm. Returns them: they are held where they are.
    pub fn end_of_yields(&mut self, gains: &[PidGains; JOINTS]) -> [bool; JOINTS] {
        let mut ended = [false; JOINTS];
        for j in 0..JOINTS {
            let Some(yields) = self.yields[j].as_ref().filter(|yields| yields.is_over()) else { continue };
            self.pid[j].take_over(&gains[j], yields.load());
            if yields.lowers() {
                self.loads[j].set(yields.load());
            }
            self.yields[j] = None;
            self.transfer.change_mode();
            ended[j] = true;
        }
        ended
    }

    /// Teaching begins: what HoldPos had found missing becomes a mass at the flange (J-25), unless it may be a `contact`.
    pub fn begin_teaching(&mut self, nodes: &Nodes, config: &Config, dynamics: &Dynamics, contact: bool) {
        if contact {
            // What the integral has may be the contact; what was found before it is a load.
            let load = |j: usize| match &self.yields[j] {
                Some(yields) => yields.load(),
                None => self.loads[j].known_torque(),
            };
            self.payload.know(core::array::from_fn(load));
        } else if self.unwinds_ms > 0 {
            self.payload.forget();
        }
        forget_yields(&mut self.yields);
        self.payload.fit(dynamics, nodes.positions(), config);
    }

    /// The payload of the arm comes into the model under the holding arm: what is missing says nothing until the integral has given
    /// back what it had found for it (J-60).
    pub fn payload_comes(&mut self) {
        self.unwinds_ms = UNWINDS_MS;
        self.forget_loads();
    }

    /// The payload of the arm was given in Teaching, and so much more of it (kg) comes into the model with this tick (J-60).
    pub fn give_way_to_payload(&mut self, mass: f64) {
        self.payload.give_way(mass);
    }

    /// Teaching ends: the integral takes over what teaching carried.
    pub fn end_teaching(&mut self, gains: &[PidGains; JOINTS]) {
        for ((pid, gains), torque) in self.pid.iter_mut().zip(gains).zip(&self.torque) {
            pid.take_over(gains, torque.payload);
        }
        self.forget_loads();
    }

    /// The set positions of joints have sagged, rad: that is no motion.
    pub fn sag(&mut self, sag: &[f64; JOINTS]) {
        for (pid, way) in self.pid.iter_mut().zip(sag) {
            pid.shift(*way);
        }
    }

    /// One tick: computes its torque, before any limit; returns joint errors found on the way (friction table).
    pub fn step(
        &mut self,
        inputs: &LawInputs<'_>,
        set: &SetValues,
        saturated: &[bool; JOINTS],
    ) -> [u16; JOINTS] {
        let LawInputs { mode, nodes, config, ref parameters, .. } = *inputs;
        self.unwinds_ms = self.unwinds_ms.saturating_sub(1);
        self.yielded.step();
        let before = self.transfer.begin(&self.torque);
        let q = nodes.positions();
        let v = nodes.velocities();
        // J-62: what is measured is compared with what was due then.
        let due = set.due(config);
        // J-40: measured position; commanded velocity and acceleration in Operate, zero elsewhere. The torque of the model acts
        // now: the measured position is taken to where the commanded motion has brought it since.
        let now = core::array::from_fn(|j| q[j] + (set.point.position[j] - due[j]));
        let any_yields = self.any_yields();
        let lowering = if any_yields {
            self.yields.iter().flatten().filter(|yields| yields.lowers()).count() as u8
        } else {
            0
        };
        let zero = [0.0; JOINTS];
        let (qd, qdd) =
            if mode.moves() { (set.point.velocity, set.point.acceleration) } else { (zero, zero) };
        let model = parameters.dynamics.inverse(&now, &qd, &qdd);
        let payload = if mode == ControlMode::Teach {
            self.payload.torque(parameters.dynamics, q, v, config)
        } else {
            [0.0; JOINTS]
        };
        let (friction, errors) =
            if mode.moves() { compensation(inputs, &qd) } else { ([0.0; JOINTS], [0; JOINTS]) };
        for j in 0..JOINTS {
            let limit = &config.joints[j];
            let model = model[j] + limit.rotor_inertia * qdd[j];
            let pid = if any_yields && let Some(yields) = &mut self.yields[j] {
                yields.step(&Joint {
                    position: q[j],
                    velocity: v[j],
                    fresh: nodes.node(j).fresh(),
                    model,
                    limits: limit,
                    range: config.position_range(j),
                    share: config.yield_torque_share,
                    lowering,
                })
            } else if mode != ControlMode::Teach {
                let error = due[j] - q[j];
                let at_rest = set.point.velocity[j] == 0.0 && set.point.acceleration[j] == 0.0;
                let encoder_step = at_rest.then_some(config.encoder_step);
                self.pid[j].step(&parameters.pid[j], error, saturated[j], encoder_step)
            } else {
                PidTorque::default()
            };
            let (payload, friction) = (payload[j], friction[j]);
            self.torque[j] = JointTorque { model, pid, friction, payload, brake: 0.0, blend: 0.0 };
        }
        self.transfer.blend(before, &mut self.torque, nodes, config);
        if mode != ControlMode::Teach {
            self.observe_load(set, config);
        }
        if mode == ControlMode::Hold && !any_yields && set.all_holding() {
            self.payload.observe(&self.torque.map(|t| t.correction()));
        } else {
            self.payload.forget();
        }
        if mode == ControlMode::Teach {
            self.brake(nodes, config, parameters);
        }
        errors
    }

    /// Observes the load of one joint: the next one in each tick.
    fn observe_load(&mut self, set: &SetValues, config: &Config) {
        let j = usize::from(self.observed) % JOINTS;
        self.observed = (j as u8 + 1) % JOINTS as u8;
        let speed = set.point.velocity[j].abs();
        let creeps = speed > 0.0 && speed < CREEPS;
        // While the integral gives back what is in the model now, it says nothing of a load.
        if self.yields[j].is_none() && self.unwinds_ms == 0 && !creeps {
            self.loads[j].observe(self.torque[j].pid.i, set.settled(j), &config.joints[j]);
        }
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
            let damping = config.teach_damping.min(DAMPING_RATE * (mass[j][j] + rotor));
            if nodes.node(j).enabled() {
                torque.brake = within(-damping * excess[j], torque.sum(), joint.torque_max);
            }
        }
    }
}

/// No joint yields. In place: an array of `None` would be made and copied with room for what it does not hold.
fn forget_yields(yields: &mut [Option<Yield>; JOINTS]) {
    for yields in yields {
        *yields = None;
    }
}

/// Torques that compensate friction at the commanded velocities, N·m, and joint errors: a velocity that the table has not (J-42).
#[inline]
pub(super) fn compensation(
    inputs: &LawInputs<'_>,
    velocity: &[f64; JOINTS],
) -> ([f64; JOINTS], [u16; JOINTS]) {
    let LawInputs { mode, nodes, config, ref parameters, .. } = *inputs;
    let (mut torque, mut errors) = ([0.0; JOINTS], [0; JOINTS]);
    let celsius = |j: usize| friction::celsius(nodes.node(j).report.temperature);
    let Some(tables) = parameters.table else {
        let sign_slope = 1.0 / config.friction_sign_width;
        for j in 0..JOINTS {
            torque[j] =
                friction::polynomial_by_slope(&parameters.polynomial[j], velocity[j], celsius(j), sign_slope);
        }
        return (torque, errors);
    };
    for j in 0..JOINTS {
        let (slowest, fastest) = friction::velocities(&tables[j]);
        let nearest = velocity[j].max(slowest).min(fastest);
        let v = if mode == ControlMode::Approach { nearest } else { velocity[j] };
        torque[j] = friction::table(&tables[j], v, celsius(j)).unwrap_or_else(|| {
            errors[j] |= joint_error::FRICTION_TABLE;
            0.0
        });
    }
    (torque, errors)
}

#[cfg(test)]
mod tests;
