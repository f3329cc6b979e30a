//! The true arm: rigid bodies, rotors behind their gears, friction and end stops, integrated by Runge-Kutta
//! at 1 ms.
//!
//! It is deliberately not the arm that the controller believes in: see [`ModelError`](crate::ModelError).
use jtc_core::{Config, Friction, Parameters};
use jtc_dynamics::{ArmModel, Dynamics, JOINTS, JointVec, Payload};

use crate::friction::{FrictionModel, FrictionTorques, SimFriction};

/// Torque per penetration of an end stop, N·m/rad.
const STOP_STIFFNESS: f64 = 20_000.0;
/// Torque per speed inside an end stop, N·m·s/rad.
const STOP_DAMPING: f64 = 200.0;
/// Deceleration of a joint whose brake closes, rad/s².
const BRAKE_DECELERATION: f64 = 40.0;
/// Inertia that stands for a closed brake, kg·m².
const BRAKED: f64 = 1e9;
/// Least inertia of a rotor, kg·m²: a lighter one would be through its range within a few steps.
const LIGHTEST: f64 = 0.02;
/// Largest turn of a joint in a sub-step, rad: a joint of 100 rad/s and more takes several in a millisecond.
const LARGEST_TURN: f64 = 0.1;
/// Most sub-steps of a step.
const MOST_SUBSTEPS: f64 = 32.0;
/// Seconds between two updates of the temperatures.
const WARMING: f64 = 0.05;
/// Heat capacity of a joint's bearing, J/K.
const HEAT_CAPACITY: f64 = 900.0;
/// Heat flow from a bearing to the air, W/K.
const HEAT_FLOW: f64 = 1.2;

/// What an arm is made of; plain data.
#[derive(Clone, Debug, PartialEq)]
pub struct SimArm {
    /// Kinematics and masses.
    pub model: ArmModel,
    /// What it carries at its flange.
    pub payload: Payload,
    /// Acceleration of gravity in the base frame, m/s².
    pub gravity: [f64; 3],
    /// Inertia of the drives' rotors at the joints, kg·m²; less than 0.02 counts as 0.02.
    pub rotor_inertia: JointVec,
    /// Friction per joint.
    pub friction: [SimFriction; JOINTS],
    /// Speed up to which friction polynomials hold, rad/s; beyond it they go on in a straight line that does not fall.
    pub polynomial_speed: JointVec,
    /// What friction does around standstill.
    pub friction_model: FrictionModel,
    /// End stops per joint, rad.
    pub stops: [(f64, f64); JOINTS],
    /// Torque that a drive really reaches, N·m: more is clamped silently.
    pub torque_ceiling: JointVec,
    /// Temperature of the air and of the bearings at the start, °C.
    pub ambient: f64,
}

impl SimArm {
    /// The arm that these settings and parameters describe, with end stops 0.04 rad outside the limits.
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
            // A drive has a rotor also where the file of the arm gives no inertia for it.
            rotor_inertia: core::array::from_fn(|j| if rotor(j) > 0.0 { rotor(j) } else { 0.7 }),
            friction,
            // Friction is measured only within the limits of the arm.
            polynomial_speed: config.joints.map(|j| j.velocity_max),
            friction_model: FrictionModel::default(),
            stops: config.joints.map(|j| (j.position_min - 0.04, j.position_max + 0.04)),
            torque_ceiling: [364.0, 364.0, 364.0, 79.0, 79.0, 79.0],
            ambient: 24.0,
        }
    }
}

impl Default for SimArm {
    fn default() -> Self {
        Self::new(&Config::avena(), &Parameters::avena())
    }
}

/// The arm in motion.
#[derive(Clone, Debug)]
pub struct Arm {
    dynamics: Dynamics,
    parts: SimArm,
    friction_scale: JointVec,
    friction: FrictionTorques,
    /// Deflection of the bristles between the surfaces, rad.
    bristles: JointVec,
    /// Heat of friction since the temperatures were brought up to date, J, and how long ago that was, s.
    heat: JointVec,
    since: f64,
    /// Position, rad.
    pub q: JointVec,
    /// Velocity, rad/s.
    pub qd: JointVec,
    /// Bearing temperature, °C.
    pub temperature: JointVec,
    /// Closed brakes.
    pub braked: [bool; JOINTS],
    /// What a fault makes of the friction: 1 normally.
    pub friction_fault: JointVec,
}

impl Arm {
    /// An arm at rest at `q`; its friction is that of `parts` times `friction_scale`.
    pub fn new(parts: SimArm, friction_scale: JointVec, q: JointVec) -> Self {
        let dynamics = Dynamics::with_payload(&parts.model, parts.gravity, &parts.payload);
        let mut arm = Self {
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
            braked: [false; JOINTS],
            friction_fault: [1.0; JOINTS],
        };
        arm.refresh_friction();
        arm
    }

    /// What it is made of.
    pub fn parts(&self) -> &SimArm {
        &self.parts
    }

    /// Move on by `dt` seconds under the drives' torques `tau` (N·m).
    pub fn step(&mut self, tau: &JointVec, dt: f64) {
        let fastest = self.qd.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
        let substeps = (fastest * dt / LARGEST_TURN).ceil().clamp(1.0, MOST_SUBSTEPS);
        for _ in 0..substeps as u32 {
            self.substep(tau, dt / substeps);
        }
        self.since += dt;
        if self.since >= WARMING {
            self.warm();
        }
    }

    fn substep(&mut self, tau: &JointVec, dt: f64) {
        let mut inertia = self.inertia(dt);
        let mut free = false;
        for j in 0..JOINTS {
            if self.braked[j] {
                self.brake(j, inertia[j], dt);
                inertia[j] = BRAKED;
            }
            free |= !self.braked[j] || self.qd[j] != 0.0;
        }
        if free {
            self.runge_kutta(tau, &inertia, dt);
        }
    }

    /// Slow a joint with a closed brake down; at an end stop the stop helps.
    fn brake(&mut self, j: usize, inertia: f64, dt: f64) {
        let v = self.qd[j];
        let stop = self.stop_torque(j, self.q[j], v);
        let help = if stop * v < 0.0 { stop.abs() / inertia } else { 0.0 };
        let change = (BRAKE_DECELERATION + help) * dt;
        self.qd[j] = if v.abs() <= change { 0.0 } else { v - change.copysign(v) };
    }

    /// Inertia of the rotors for a step of `dt`, kg·m²: more than their own where steep friction or an end stop has a time constant
    /// below `dt` with a light one. Runge-Kutta of fourth order is unstable from `dt` = 2.7 time constants on.
    fn inertia(&self, dt: f64) -> JointVec {
        let steepness = self.friction.steepness(&self.qd);
        core::array::from_fn(|j| {
            let (low, high) = self.parts.stops[j];
            let reach = 2.0 * self.qd[j].abs() * dt;
            let stopping = self.q[j] - reach < low || self.q[j] + reach > high;
            let stop = if stopping { STOP_DAMPING + STOP_STIFFNESS * dt } else { 0.0 };
            self.parts.rotor_inertia[j].max(LIGHTEST).max((steepness[j] + stop) * dt)
        })
    }

    /// Bring temperatures and friction up to date: they change so slowly that not every millisecond has to.
    fn warm(&mut self) {
        for j in 0..JOINTS {
            let loss = HEAT_FLOW * (self.temperature[j] - self.parts.ambient) * self.since;
            self.temperature[j] += (self.heat[j] - loss) / HEAT_CAPACITY;
        }
        self.heat = [0.0; JOINTS];
        self.since = 0.0;
        self.refresh_friction();
    }

    /// Classical Runge-Kutta of fourth order; the bristles of friction, which are too stiff for it, take its stages' velocities by
    /// [`FrictionTorques::bend`].
    fn runge_kutta(&mut self, tau: &JointVec, rotor: &JointVec, dt: f64) {
        let (q0, v0, z0) = (self.q, self.qd, self.bristles);
        let half = 0.5 * dt;
        let friction = self.friction.at(&v0, &z0);
        for j in 0..JOINTS {
            self.heat[j] += v0[j] * friction[j] * dt;
        }
        let bend = |v: &JointVec, dt: f64| self.friction.bend(&z0, v, dt);
        let a1 = self.accelerate(&q0, &v0, tau, &friction, rotor);
        let v2 = along(&v0, &a1, half);
        let a2 = self.acceleration(&along(&q0, &v0, half), &v2, &bend(&v0, half), tau, rotor);
        let v3 = along(&v0, &a2, half);
        let a3 = self.acceleration(&along(&q0, &v2, half), &v3, &bend(&v2, half), tau, rotor);
        let v4 = along(&v0, &a3, dt);
        let a4 = self.acceleration(&along(&q0, &v3, dt), &v4, &bend(&v3, dt), tau, rotor);
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
    ) -> JointVec {
        self.accelerate(q, qd, tau, &self.friction.at(qd, z), rotor)
    }

    fn accelerate(
        &self,
        q: &JointVec,
        qd: &JointVec,
        tau: &JointVec,
        friction: &JointVec,
        rotor: &JointVec,
    ) -> JointVec {
        let sum = core::array::from_fn(|j| tau[j] + self.stop_torque(j, q[j], qd[j]) - friction[j]);
        self.dynamics.forward(q, qd, &sum, rotor)
    }

    /// Torque of the end stops: they push, they never pull.
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

    /// Bring the friction curves to the present temperature.
    fn refresh_friction(&mut self) {
        let scale = core::array::from_fn(|j| self.friction_scale[j] * self.friction_fault[j]);
        self.friction.warm(&self.temperature, &scale);
    }

    /// Make a change of `friction_fault` act at once.
    pub fn friction_changed(&mut self) {
        self.friction.forget_tables();
        self.refresh_friction();
    }
}

fn along(x: &JointVec, rate: &JointVec, dt: f64) -> JointVec {
    core::array::from_fn(|j| x[j] + rate[j] * dt)
}
