//! The control law: set values of each state, τ = τ_id + τ_pid + τ_fric (section 6), and torque without steps (J-44).
use jtc_dynamics::Dynamics;

use crate::coast::{Coast, STANDING};
use crate::config::{Config, PidGains, TableOf};
use crate::friction;
use crate::interpolation::SetPoint;
use crate::limits::{self, Saturation};
use crate::nodes::Nodes;
use crate::overspeed::OverSpeed;
use crate::path::{Bounds, SlopeBounds};
use crate::pid::{Pid, PidTorque};
use crate::teach::Payload;
use crate::{JOINTS, joint_error};

/// Shares of the acceleration and torque limits that a pause, a stop or a resume may use; the rest is for what changes within
/// a tick and for the controller.
const RAMP_ACCELERATION: f64 = 0.98;
const RAMP_TORQUE: f64 = 0.95;
/// Length of a tick, s.
const DT: f64 = 0.001;

/// Which parts of the control law act.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Law {
    /// Gravity and PID.
    Hold,
    /// Everything, with commanded velocity and acceleration.
    Follow,
    /// The same on the way to the path. Limits of the path do not bear on it: it begins where the arm was found.
    Approach,
    /// Gravity and a brake above the speed limit.
    Teach,
}

impl Law {
    /// Commanded velocity and acceleration are part of it.
    fn moves(self) -> bool {
        matches!(self, Self::Follow | Self::Approach)
    }
}

/// Parameters that the law uses.
pub(crate) struct Gains<'a> {
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
    fn correction(&self) -> f64 {
        self.pid.sum() + self.friction + self.payload + self.brake + self.blend
    }

    pub fn sum(&self) -> f64 {
        self.model + self.correction()
    }
}

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
    over_speed: OverSpeed,
    payload: Payload,
    /// Step to blend out, N·m, and how long that has gone on.
    step: [f64; JOINTS],
    step_ms: [u16; JOINTS],
    /// Joints that were latched in this tick: their torque starts from that of the model.
    fresh: [bool; JOINTS],
    /// The next torque has to continue the last one: all of it, or all but the model.
    rebase: Option<Rebase>,
    /// Joints on their way to rest.
    coast: [Option<Coast>; JOINTS],
    /// The arm gives way: the law adds only so much to the torque of the model (J-66).
    yielding: bool,
    /// Mass matrix with rotors at the start of a ramp of path time.
    inertia: [[f64; JOINTS]; JOINTS],
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Rebase {
    Correction,
    Everything,
}

/// Rises from 0 to 1 without a corner.
pub(crate) fn smooth(u: f64) -> f64 {
    let u = u.clamp(0.0, 1.0);
    u * u * (3.0 - 2.0 * u)
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

impl Motion {
    /// Limp: nothing is held, no torque is remembered.
    pub fn release(&mut self, nodes: &Nodes) {
        *self = Self { set: SetPoint::still(*nodes.positions()), ..Self::default() };
    }

    /// The state changes among HoldPos, Operate and Teaching: continue without a step but that of the model (J-44).
    pub fn change_law(&mut self) {
        self.rebase = Some(Rebase::Correction);
    }

    /// The model changes under the holding arm: continue without any step.
    pub fn change_model(&mut self) {
        self.rebase = Some(Rebase::Everything);
    }

    /// Begin to hold where the arm is, coming to rest first if it moves.
    pub fn hold_measured(&mut self, nodes: &Nodes, config: &Config) {
        let (from, velocity) = (nodes.positions(), nodes.velocities());
        self.begin_at(from);
        let moves = velocity.iter().any(|v| v.abs() > STANDING);
        for j in 0..JOINTS {
            // Joints that are enabled later begin on their own.
            let coasts = moves && self.holding[j];
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
        (self.rebase, self.step) = (None, [0.0; JOINTS]);
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

    /// Joints that move, by their set values or as measured: `bit` in each.
    pub fn moving_joints(&self, nodes: &Nodes, bit: u16) -> [u16; JOINTS] {
        core::array::from_fn(|j| {
            let moves = self.set.velocity[j].abs() > STANDING || nodes.velocities()[j].abs() > STANDING;
            if moves { bit } else { 0 }
        })
    }

    /// Every joint is enabled and held at rest.
    pub fn all_holding(&self) -> bool {
        self.coast.iter().all(Option::is_none) && self.holding.iter().all(|&h| h)
    }

    /// Latches the set position of joints that have just been enabled, and brings those to rest that move; joints that are
    /// not enabled are followed, without torque.
    pub fn latch(&mut self, nodes: &Nodes, config: &Config) {
        let (measured, velocity) = (nodes.positions(), nodes.velocities());
        for j in 0..JOINTS {
            let enabled = nodes.node(j).enabled();
            self.fresh[j] = enabled && !self.holding[j];
            if !(enabled && self.holding[j]) {
                self.set.position[j] = measured[j];
                self.pid[j].reset(0.0);
                let moves = self.fresh[j] && velocity[j].abs() > STANDING;
                self.coast[j] =
                    moves.then_some(Coast::falling(measured[j], velocity[j], config, &config.joints[j]));
            }
            self.holding[j] = enabled;
        }
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
        for ((pid, gains), torque) in self.pid.iter_mut().zip(gains).zip(&self.torque) {
            pid.take_over(gains, torque.payload);
        }
    }

    /// The control law and its limits: torques to command, and joint errors found on the way. `braking`: with all the torque
    /// there is, so that what this does to torque, position error and acceleration is none (J-33).
    pub fn control(
        &mut self,
        law: Law,
        braking: bool,
        nodes: &Nodes,
        config: &Config,
        gains: &Gains<'_>,
    ) -> ([f64; JOINTS], [u16; JOINTS]) {
        let missing = self.compute(law, nodes, config, gains);
        if self.yielding {
            self.soften(config);
        }
        let (torque, mut errors) = self.limit(law, braking, nodes, config);
        for (j, error) in errors.iter_mut().enumerate() {
            if nodes.node(j).enabled() {
                *error |= missing[j];
            }
        }
        (torque, errors)
    }

    /// Computes the torque of this tick into `self.torque`; returns joint errors found on the way (friction table).
    fn compute(&mut self, law: Law, nodes: &Nodes, config: &Config, gains: &Gains<'_>) -> [u16; JOINTS] {
        let mut errors = [0; JOINTS];
        // What the last torque has to be continued from, where it has to be.
        let rebase = self.rebase.take();
        let mut before = [0.0; JOINTS];
        if let Some(rebase) = rebase {
            before = self.torque.map(|t| if rebase == Rebase::Everything { t.sum() } else { t.correction() });
        }
        let q = nodes.positions();
        let v = nodes.velocities();
        // J-40: measured position; commanded velocity and acceleration in Operate, zero elsewhere.
        let zero = [0.0; JOINTS];
        let (qd, qdd) = if law.moves() { (self.set.velocity, self.set.acceleration) } else { (zero, zero) };
        let model = gains.dynamics.inverse(q, &qd, &qdd);
        let payload =
            if law == Law::Teach { self.payload.torque(gains.dynamics, q, config) } else { [0.0; JOINTS] };
        for j in 0..JOINTS {
            let limit = &config.joints[j];
            let mut torque = JointTorque {
                model: model[j] + limit.rotor_inertia * qdd[j],
                payload: payload[j],
                ..JointTorque::default()
            };
            if law != Law::Teach {
                let error = self.set.position[j] - q[j];
                let at_rest = self.set.velocity[j] == 0.0 && self.set.acceleration[j] == 0.0;
                let encoder_step = at_rest.then_some(config.encoder_step);
                let saturated = self.saturation[j].saturated;
                torque.pid = self.pid[j].step(&gains.pid[j], error, saturated, encoder_step);
            }
            if law.moves() {
                let t = celsius(nodes.node(j).report.temperature);
                torque.friction = match gains.table {
                    None => friction::polynomial(&gains.polynomial[j], qd[j], t, config.friction_sign_width),
                    Some(tables) => {
                        let (slowest, fastest) = friction::velocities(&tables[j]);
                        let nearest = qd[j].max(slowest).min(fastest);
                        let v = if law == Law::Approach { nearest } else { qd[j] };
                        friction::table(&tables[j], v, t).unwrap_or_else(|| {
                            errors[j] |= joint_error::FRICTION_TABLE;
                            0.0
                        })
                    }
                };
            }
            self.torque[j] = torque;
        }
        self.blend(rebase, &before, nodes, config);
        if law == Law::Hold && !self.yielding {
            self.payload.observe(&self.torque.map(|t| t.correction()));
        } else {
            self.payload.forget();
        }
        if law == Law::Teach {
            for j in 0..JOINTS {
                if nodes.node(j).enabled() {
                    self.torque[j].brake =
                        brake(v[j], self.torque[j].sum(), config, config.joints[j].torque_max);
                }
            }
        }
        errors
    }

    /// Adds what is left of torque steps, and forgets the torque of joints that are not enabled.
    fn blend(&mut self, rebase: Option<Rebase>, before: &[f64; JOINTS], nodes: &Nodes, config: &Config) {
        if let Some(rebase) = rebase {
            for j in 0..JOINTS {
                let now = &self.torque[j];
                self.step[j] =
                    before[j] - if rebase == Rebase::Everything { now.sum() } else { now.correction() };
                self.step_ms[j] = 0;
            }
        }
        let per_tick = 1.0 / f64::from(config.blend_ms.max(1));
        for j in 0..JOINTS {
            if core::mem::take(&mut self.fresh[j]) {
                (self.step[j], self.step_ms[j]) = (-self.torque[j].correction(), 0);
            }
            let left = 1.0 - smooth(f64::from(self.step_ms[j]) * per_tick);
            self.step_ms[j] = self.step_ms[j].saturating_add(1);
            if nodes.node(j).enabled() {
                self.torque[j].blend = self.step[j] * left;
            } else {
                self.torque[j] = JointTorque::default();
                self.step[j] = 0.0;
            }
        }
    }

    /// Bounds what the law adds to the torque of the model (J-66).
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
        law: Law,
        braking: bool,
        nodes: &Nodes,
        config: &Config,
    ) -> ([f64; JOINTS], [u16; JOINTS]) {
        let (mut torque, mut errors) = ([0.0; JOINTS], [0; JOINTS]);
        let excused = if braking { joint_error::POSITION_ERROR | joint_error::ACCELERATION } else { 0 };
        for j in 0..JOINTS {
            let limits = &config.joints[j];
            let (limited, torque_error) =
                self.saturation[j].limit(self.torque[j].sum(), limits, config.torque_over_ms, braking);
            let joint = (self.set.position[j], self.set.velocity[j], self.set.acceleration[j]);
            let set_error = limits::check_set(joint, nodes.positions()[j], limits, law == Law::Follow);
            torque[j] = limited;
            errors[j] =
                torque_error | if law != Law::Teach && self.holding[j] { set_error & !excused } else { 0 };
        }
        (torque, errors)
    }
}

/// Teaching brakes a joint above the speed limit, with what its `torque` so far leaves of the limit (J-25).
fn brake(velocity: f64, torque: f64, config: &Config, torque_max: f64) -> f64 {
    let limit = config.teach_velocity_max;
    let excess = velocity - velocity.max(-limit).min(limit);
    let wanted = -config.teach_damping * excess;
    let (low, high) = ((-torque_max - torque).min(0.0), (torque_max - torque).max(0.0));
    wanted.max(low).min(high)
}

/// Temperature in °C: drives send negative ones modulo 256, and no bearing reaches 200 °C.
pub(crate) fn celsius(byte: u8) -> f64 {
    let t = f64::from(byte);
    if byte >= 200 { t - 256.0 } else { t }
}
