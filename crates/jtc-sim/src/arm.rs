//! Model of the true arm: rigid bodies, rotors with gears, friction, end stops and walls. The Runge-Kutta method integrates the
//! equations in steps of at most 1 ms.
//!
//! The true arm intentionally differs from the model in the controller (see [`ModelError`](crate::ModelError)).
use jtc_core::{Config, Friction, Parameters};
use jtc_dynamics::{ArmModel, Dynamics, JOINTS, JointVec, LinkInertias, Payload};

use crate::friction::{FrictionModel, FrictionTorques, SimFriction};

mod gear;
mod wall;

pub use gear::Gear;
use gear::OUTPUT;
use wall::Contact;
pub use wall::{Side, Wall};

/// Stiffness of an end stop, N·m/rad.
const STOP_STIFFNESS: f64 = 20_000.0;
/// Damping of an end stop, N·m·s/rad.
const STOP_DAMPING: f64 = 200.0;
/// Deceleration of a joint whose brake is closing, rad/s².
const BRAKE_DECELERATION: f64 = 40.0;
/// Inertia that represents a closed brake, kg·m².
const BRAKED: f64 = 1e9;
/// Smallest inertia of a rotor, kg·m². A rotor with less inertia would cross its whole range within a few steps.
const LIGHTEST: f64 = 0.02;
/// Largest rotation of a joint in a sub-step, rad. A joint with a speed of 100 rad/s or more needs several sub-steps per
/// millisecond.
const LARGEST_TURN: f64 = 0.1;
/// Maximum number of sub-steps per step for fast joints.
const MOST_SUBSTEPS: f64 = 32.0;
/// Largest phase angle of a vibration at a wall or gear in one sub-step, rad. The next constant is the largest decay
/// (decay rate times duration) in one sub-step.
const LARGEST_PHASE: f64 = 0.5;
const LARGEST_DECAY: f64 = 1.0;
/// Maximum number of sub-steps per step for walls and gears. If walls require more sub-steps, the simulation reduces the
/// damping of the walls.
const MOST_STIFF_SUBSTEPS: f64 = 64.0;
/// Decay (decay rate times duration) in one sub-step above which the simulation reduces the damping. From a decay of
/// 2.7, the Runge-Kutta method is unstable.
const UNSTABLE_DECAY: f64 = 2.0;
/// Time between two updates of the temperatures, s.
const WARMING: f64 = 0.05;
/// Heat capacity of a joint's bearing, J/K.
const HEAT_CAPACITY: f64 = 900.0;
/// Heat flow from a bearing to the air, W/K.
const HEAT_FLOW: f64 = 1.2;

/// Properties of an arm, without its state.
#[derive(Clone, Debug, PartialEq)]
pub struct SimArm {
    /// Kinematics and masses.
    pub model: ArmModel,
    /// Load at the flange.
    pub payload: Payload,
    /// Acceleration of gravity in the base frame, m/s².
    pub gravity: [f64; 3],
    /// Inertia of the drives' rotors, converted to the joints, kg·m². A value below 0.02 is treated as 0.02.
    pub rotor_inertia: JointVec,
    /// Friction per joint.
    pub friction: [SimFriction; JOINTS],
    /// Speed up to which friction polynomials are valid, rad/s. Above this speed, the friction continues as a straight line
    /// that does not decrease.
    pub polynomial_speed: JointVec,
    /// Friction around standstill.
    pub friction_model: FrictionModel,
    /// End stops per joint, rad.
    pub stops: [(f64, f64); JOINTS],
    /// Elasticity of the gears, which are rigid by default. An elastic gear transfers 0.01 kg·m² of the rotor's inertia
    /// to its link.
    pub gears: [Gear; JOINTS],
    /// Largest torque of each drive, N·m; that of the known drives by default. The drive limits larger torque commands, but does not report this limitation.
    pub torque_ceiling: JointVec,
    /// Temperature of the air, and of the bearings at the start, °C.
    pub ambient: f64,
}

impl SimArm {
    /// Creates the arm from the controller's settings and parameters, with end stops 0.04 rad outside the position limits.
    pub fn new(config: &Config, parameters: &Parameters) -> Self {
        let friction = match &parameters.friction {
            Friction::Polynomial(c) => core::array::from_fn(|j| SimFriction::Polynomial(c[j])),
            Friction::Table(tables) => core::array::from_fn(|j| SimFriction::Table(tables[j])),
        };
        let rotor = |j: usize| config.joints[j].rotor_inertia;
        Self {
            model: parameters.model,
            payload: config.payload,
            gravity: config.gravity,
            // A real drive always has a rotor. If the arm file contains no rotor inertia, the simulation uses 0.7
            // kg·m².
            rotor_inertia: core::array::from_fn(|j| if rotor(j) > 0.0 { rotor(j) } else { 0.7 }),
            friction,
            // Friction was measured only within the velocity limits of the arm.
            polynomial_speed: config.joints.map(|j| j.velocity_max),
            friction_model: FrictionModel::default(),
            stops: config.joints.map(|j| (j.position_min - 0.04, j.position_max + 0.04)),
            gears: [Gear::RIGID; JOINTS],
            torque_ceiling: jtc_bus::DRIVE_TORQUE_MAX,
            ambient: 24.0,
        }
    }
}

impl Default for SimArm {
    fn default() -> Self {
        Self::new(&Config::avena(), &Parameters::avena())
    }
}

/// An arm with its current state of motion.
#[derive(Clone, Debug)]
pub struct Arm {
    dynamics: Dynamics,
    /// Inertias without the payloads that the arm carries in addition to its own payload. `dynamics` includes these
    /// payloads.
    bare: LinkInertias,
    carried: Vec<Payload>,
    contacts: Vec<Contact>,
    elastic: bool,
    parts: SimArm,
    friction_scale: JointVec,
    friction: FrictionTorques,
    /// Deflection of the bristles in the friction model for each joint, rad.
    bristles: JointVec,
    /// Friction heat since the last update of the temperatures, J. `since` is the time since that update, s.
    heat: JointVec,
    since: f64,
    /// Position of each joint, rad.
    pub q: JointVec,
    /// Velocity of each joint, rad/s.
    pub qd: JointVec,
    /// Position of the motors, converted to the joint side of the gears, rad. If the gears are rigid, these are the positions
    /// of the links.
    pub motor: JointVec,
    /// Velocity of the motors, converted to the joint side of the gears, rad/s.
    pub motor_speed: JointVec,
    /// Bearing temperature of each joint, °C.
    pub temperature: JointVec,
    /// `true` for joints with a closed brake.
    pub braked: [bool; JOINTS],
    /// A fault multiplies the friction by this factor; normally 1.
    pub friction_fault: JointVec,
}

impl Arm {
    /// Creates an arm at rest at `q`. The friction of the arm is the friction of `parts` times `friction_scale`.
    pub fn new(parts: SimArm, friction_scale: JointVec, q: JointVec) -> Self {
        let dynamics = Dynamics::with_payload(&parts.model, parts.gravity, &parts.payload);
        let elastic = parts.gears.iter().any(Gear::is_elastic);
        // At the start, the springs of the gears are deflected by their loads, so that the links are at rest.
        let load = dynamics.gravity_torque(&q);
        let motor = core::array::from_fn(|j| {
            let gear = &parts.gears[j];
            if gear.is_elastic() { q[j] + load[j] / gear.stiffness } else { q[j] }
        });
        let mut arm = Self {
            bare: dynamics.inertias(),
            carried: Vec::new(),
            contacts: Vec::new(),
            elastic,
            dynamics,
            temperature: [parts.ambient; JOINTS],
            friction: FrictionTorques::new(
                parts.friction_model,
                parts.friction.clone(),
                &parts.rotor_inertia,
                &parts.polynomial_speed,
            ),
            bristles: [0.0; JOINTS],
            heat: [0.0; JOINTS],
            since: 0.0,
            parts,
            friction_scale,
            q,
            qd: [0.0; JOINTS],
            motor,
            motor_speed: [0.0; JOINTS],
            braked: [false; JOINTS],
            friction_fault: [1.0; JOINTS],
        };
        arm.refresh_friction();
        arm
    }

    /// Returns the properties of the arm.
    pub fn parts(&self) -> &SimArm {
        &self.parts
    }

    /// Simulates `dt` seconds with the drives' torques `tau` (N·m).
    pub fn step(&mut self, tau: &JointVec, dt: f64) {
        self.step_pushed(tau, &[0.0; JOINTS], dt);
    }

    /// Like [`step`](Self::step), with additional torques `outside` (N·m) that act on the links.
    pub fn step_pushed(&mut self, tau: &JointVec, outside: &JointVec, dt: f64) {
        let fastest = self.qd.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
        let mut substeps = (fastest * dt / LARGEST_TURN).ceil().clamp(1.0, MOST_SUBSTEPS);
        let mut damped = 1.0;
        if self.elastic || !self.contacts.is_empty() {
            let (stiff, share) = self.stiff_substeps(dt);
            (substeps, damped) = (substeps.max(stiff), share);
        }
        for _ in 0..substeps as u32 {
            self.substep(tau, outside, damped, dt / substeps);
        }
        if !self.elastic {
            self.follow_rigid();
        }
        self.since += dt;
        if self.since >= WARMING {
            self.warm();
        }
    }

    /// Returns the number of sub-steps per `dt` seconds that gears and reachable walls need. Also returns the share of
    /// the walls' damping that keeps the simulation stable for this number of sub-steps.
    fn stiff_substeps(&self, dt: f64) -> (f64, f64) {
        let (mut square, mut decay) = (0.0, 0.0);
        let mut link = self.parts.rotor_inertia.map(|rotor| rotor.max(LIGHTEST));
        for (j, gear) in self.parts.gears.iter().enumerate() {
            if gear.is_elastic() {
                // The smallest possible inertia on each side of the gear is used, because it gives the highest
                // frequency.
                let mobility = 1.0 / OUTPUT + 1.0 / (link[j] - OUTPUT);
                square = f64::max(square, gear.stiffness * mobility);
                decay = f64::max(decay, gear.damping * mobility);
                link[j] = OUTPUT;
            }
        }
        let rest = [0.0; JOINTS];
        let mobility = |torques: &JointVec| {
            let [pushed, free] =
                [torques, &rest].map(|tau| self.dynamics.forward(&self.q, &rest, tau, &link));
            core::array::from_fn(|j| pushed[j] - free[j])
        };
        let mut of_walls = 0.0;
        for contact in &self.contacts {
            let rates = contact.rates(&self.dynamics, &self.q, &self.qd, dt, mobility);
            square += rates.0;
            of_walls += rates.1;
        }
        decay += of_walls;
        let substeps = (square.sqrt() * dt / LARGEST_PHASE).max(decay * dt / LARGEST_DECAY);
        let substeps = substeps.ceil().clamp(1.0, MOST_STIFF_SUBSTEPS);
        let bearable = UNSTABLE_DECAY * substeps / dt;
        let share = if decay > bearable { (bearable / decay).min(1.0) } else { 1.0 };
        (substeps, share)
    }

    fn substep(&mut self, tau: &JointVec, outside: &JointVec, damped: f64, dt: f64) {
        let mut inertia = self.inertia(dt);
        let mut walls = [0.0; JOINTS];
        self.push_of_walls(&self.q, &self.qd, damped, &mut walls);
        if self.elastic {
            self.elastic_substep(tau, outside, &inertia, damped, dt);
        } else {
            let mut free = false;
            for j in 0..JOINTS {
                if self.braked[j] {
                    let stop = self.stop_torque(j, self.q[j], self.qd[j]) + walls[j];
                    self.qd[j] = braked(self.qd[j], stop, inertia[j], dt);
                    inertia[j] = BRAKED;
                }
                free |= !self.braked[j] || self.qd[j] != 0.0;
            }
            if free {
                let total = core::array::from_fn(|j| tau[j] + outside[j]);
                self.runge_kutta(&total, &inertia, damped, dt);
            }
        }
        let Self { contacts, dynamics, q, .. } = self;
        contacts.iter_mut().for_each(|contact| contact.follow(dynamics, q));
    }

    /// Sets the payloads that the arm carries in addition to its own payload. Replaces the payloads that were set
    /// earlier.
    pub fn set_carried(&mut self, payloads: &[Payload]) {
        if self.carried == payloads {
            return;
        }
        self.carried = payloads.to_vec();
        let of = |payload: &Payload| {
            Dynamics::with_payload(&self.parts.model, self.parts.gravity, payload).inertias().numbers()
        };
        // The inertial parameters of several bodies can be added, because the equations of motion are linear in them.
        let (mut sum, none) = (self.bare.numbers(), of(&Payload::NONE));
        for payload in payloads {
            let with = of(payload);
            for (link, (with, none)) in sum.iter_mut().zip(with.iter().zip(&none)) {
                for (number, (with, none)) in link.iter_mut().zip(with.iter().zip(none)) {
                    *number += with - none;
                }
            }
        }
        let inertias = if payloads.is_empty() { self.bare } else { LinkInertias::from_numbers(&sum) };
        self.dynamics.set_inertias(&inertias);
    }

    /// Returns the inertia of the rotors for a step of `dt`, kg·m². A light rotor with steep friction or at an end
    /// stop can have a time constant below `dt`. Its inertia is increased, because fourth-order Runge-Kutta is
    /// unstable if `dt` is at least 2.7 time constants.
    fn inertia(&self, dt: f64) -> JointVec {
        let steepness = self.friction.steepness(&self.qd);
        core::array::from_fn(|j| {
            let stop = self.stopping(j, dt);
            self.parts.rotor_inertia[j].max(LIGHTEST).max((steepness[j] + stop) * dt)
        })
    }

    /// Returns the damping of the end stop that a joint can touch within `dt` seconds, N·m·s/rad.
    fn stopping(&self, j: usize, dt: f64) -> f64 {
        let (low, high) = self.parts.stops[j];
        let reach = 2.0 * self.qd[j].abs() * dt;
        let stopping = self.q[j] - reach < low || self.q[j] + reach > high;
        if stopping { STOP_DAMPING + STOP_STIFFNESS * dt } else { 0.0 }
    }

    /// Updates temperatures and friction. Temperatures and friction change so slowly that an update in every millisecond is not
    /// necessary.
    fn warm(&mut self) {
        for j in 0..JOINTS {
            let loss = HEAT_FLOW * (self.temperature[j] - self.parts.ambient) * self.since;
            self.temperature[j] += (self.heat[j] - loss) / HEAT_CAPACITY;
        }
        self.heat = [0.0; JOINTS];
        self.since = 0.0;
        self.refresh_friction();
    }

    /// Integrates with the classical fourth-order Runge-Kutta method. The bristles of the friction model are too
    /// stiff for this method, so [`FrictionTorques::bend`] computes their deflection from the velocities of the
    /// stages.
    fn runge_kutta(&mut self, tau: &JointVec, rotor: &JointVec, damped: f64, dt: f64) {
        let (q0, v0, z0) = (self.q, self.qd, self.bristles);
        let half = 0.5 * dt;
        let friction = self.friction.at(&v0, &z0);
        for j in 0..JOINTS {
            self.heat[j] += v0[j] * friction[j] * dt;
        }
        let bend = |v: &JointVec, dt: f64| self.friction.bend(&z0, v, dt);
        let a1 = self.accelerate(&q0, &v0, tau, &friction, rotor, damped);
        let v2 = along(&v0, &a1, half);
        let a2 = self.acceleration(&along(&q0, &v0, half), &v2, &bend(&v0, half), tau, rotor, damped);
        let v3 = along(&v0, &a2, half);
        let a3 = self.acceleration(&along(&q0, &v2, half), &v3, &bend(&v2, half), tau, rotor, damped);
        let v4 = along(&v0, &a3, dt);
        let a4 = self.acceleration(&along(&q0, &v3, dt), &v4, &bend(&v3, dt), tau, rotor, damped);
        let mean: JointVec = core::array::from_fn(|j| (v0[j] + 2.0 * (v2[j] + v3[j]) + v4[j]) / 6.0);
        self.bristles = bend(&mean, dt);
        self.q = along(&q0, &mean, dt);
        for j in 0..JOINTS {
            self.qd[j] = v0[j] + dt / 6.0 * (a1[j] + 2.0 * (a2[j] + a3[j]) + a4[j]);
        }
    }

    fn acceleration(
        &self,
        q: &JointVec,
        qd: &JointVec,
        z: &JointVec,
        tau: &JointVec,
        rotor: &JointVec,
        damped: f64,
    ) -> JointVec {
        self.accelerate(q, qd, tau, &self.friction.at(qd, z), rotor, damped)
    }

    fn accelerate(
        &self,
        q: &JointVec,
        qd: &JointVec,
        tau: &JointVec,
        friction: &JointVec,
        rotor: &JointVec,
        damped: f64,
    ) -> JointVec {
        let mut sum = core::array::from_fn(|j| tau[j] + self.stop_torque(j, q[j], qd[j]) - friction[j]);
        self.push_of_walls(q, qd, damped, &mut sum);
        self.dynamics.forward(q, qd, &sum, rotor)
    }

    /// Returns the torque of the end stop, which can push but not pull.
    fn stop_torque(&self, j: usize, q: f64, qd: f64) -> f64 {
        let (low, high) = self.parts.stops[j];
        if q < low {
            (STOP_STIFFNESS * (low - q) - STOP_DAMPING * qd).max(0.0)
        } else if q > high {
            (STOP_STIFFNESS * (high - q) - STOP_DAMPING * qd).min(0.0)
        } else {
            0.0
        }
    }

    /// Updates the friction curves to the current temperature.
    fn refresh_friction(&mut self) {
        let scale = core::array::from_fn(|j| self.friction_scale[j] * self.friction_fault[j]);
        self.friction.warm(&self.temperature, &scale);
    }

    /// Updates the friction after a change of `friction_fault`.
    pub fn friction_changed(&mut self) {
        self.friction.forget_tables();
        self.refresh_friction();
    }
}

/// Returns the speed of a joint after its brake has acted for `dt` seconds, rad/s. An external torque (N·m) against the
/// motion increases the braking effect.
fn braked(speed: f64, torque: f64, inertia: f64, dt: f64) -> f64 {
    let help = if torque * speed < 0.0 { torque.abs() / inertia } else { 0.0 };
    let change = (BRAKE_DECELERATION + help) * dt;
    if speed.abs() <= change { 0.0 } else { speed - change.copysign(speed) }
}

fn along(x: &JointVec, rate: &JointVec, dt: f64) -> JointVec {
    core::array::from_fn(|j| x[j] + rate[j] * dt)
}
