//! The true arm: rigid bodies, rotors behind their gears, friction and end stops, integrated by Runge-Kutta
//! at 1 ms.
//!
//! It is deliberately not the arm that the controller believes in: see [`ModelError`](crate::ModelError).
use jtc_core::{Config, Friction, Parameters, TableOf};
use jtc_dynamics::{ArmModel, Dynamics, JOINTS, JointVec};

/// Torque per penetration of an end stop, N·m/rad.
const STOP_STIFFNESS: f64 = 20_000.0;
/// Torque per speed inside an end stop, N·m·s/rad.
const STOP_DAMPING: f64 = 200.0;
/// Deceleration of a joint whose brake closes, rad/s².
const BRAKE_DECELERATION: f64 = 40.0;
/// Inertia that stands for a closed brake, kg·m².
const BRAKED: f64 = 1e9;
/// Seconds between two updates of the temperatures.
const WARMING: f64 = 0.05;
/// Heat capacity of a joint's bearing, J/K.
const HEAT_CAPACITY: f64 = 900.0;
/// Heat flow from a bearing to the air, W/K.
const HEAT_FLOW: f64 = 1.2;

/// True friction of a joint.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant)]
pub enum SimFriction {
    /// None.
    Frictionless,
    /// (1 + c4·(T − c5))·(c0·s + c1·v + c2·v²·s + c3·v³) with s = v/√(v² + w²), which RK4 at 1 ms can
    /// integrate.
    Polynomial([f64; 6]),
    /// A measured table; beyond its velocities it goes on in a straight line.
    Table(TableOf<f32>),
}

/// What an arm is made of; plain data.
#[derive(Clone, Debug, PartialEq)]
pub struct SimArm {
    /// Kinematics and masses.
    pub model: ArmModel,
    /// Acceleration of gravity in the base frame, m/s².
    pub gravity: [f64; 3],
    /// Inertia of the drives' rotors at the joints, kg·m².
    pub rotor_inertia: JointVec,
    /// Friction per joint.
    pub friction: [SimFriction; JOINTS],
    /// Speed around zero in which friction changes its sign, rad/s. Below 0.005 RK4 at 1 ms becomes unstable.
    pub friction_width: f64,
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
            gravity: config.gravity,
            // An arm whose file says nothing of its rotors has them all the same.
            rotor_inertia: core::array::from_fn(|j| if rotor(j) > 0.0 { rotor(j) } else { 0.7 }),
            friction,
            friction_width: 0.01,
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

/// Friction of all joints at their present temperatures.
#[derive(Clone, Debug)]
struct Curves {
    /// Polynomial coefficients, a row per power, a column per joint; zero for joints with a table.
    k: [JointVec; 4],
    /// Velocities and torques of joints with a table.
    tables: [Option<Box<Points>>; JOINTS],
    any_table: bool,
}

impl Curves {
    /// N·m against the motion.
    #[inline]
    fn at(&self, v: &JointVec, width: f64) -> JointVec {
        let [k0, k1, k2, k3] = &self.k;
        let mut out: JointVec = core::array::from_fn(|j| {
            let v = v[j];
            let s = v / (v * v + width * width).sqrt();
            k0[j] * s + v * (k1[j] + v * (k2[j] * s + k3[j] * v))
        });
        if self.any_table {
            for (j, table) in self.tables.iter().enumerate() {
                if let Some(table) = table {
                    out[j] += table.at(v[j]);
                }
            }
        }
        out
    }
}

/// A friction table at one temperature.
#[derive(Clone, Debug)]
struct Points {
    /// rad/s.
    velocity: [f64; 20],
    /// N·m.
    torque: [f64; 20],
}

impl Points {
    /// Straight lines between the points, and on beyond the ends.
    fn at(&self, v: f64) -> f64 {
        let (x, y) = (&self.velocity, &self.torque);
        let i = x[1..19].iter().filter(|&&start| v >= start).count();
        y[i] + (v - x[i]) / (x[i + 1] - x[i]) * (y[i + 1] - y[i])
    }
}

/// The arm in motion.
#[derive(Clone, Debug)]
pub struct Arm {
    dynamics: Dynamics,
    parts: SimArm,
    friction_scale: JointVec,
    curves: Curves,
    /// Temperature that the tables in `curves` hold for, °C.
    table_temperature: JointVec,
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
        let dynamics = Dynamics::new(&parts.model, parts.gravity);
        let mut arm = Self {
            dynamics,
            temperature: [parts.ambient; JOINTS],
            curves: Curves { k: [[0.0; JOINTS]; 4], tables: [const { None }; JOINTS], any_table: false },
            table_temperature: [f64::NAN; JOINTS],
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
        let mut rotor = self.parts.rotor_inertia;
        let mut free = false;
        for j in 0..JOINTS {
            if self.braked[j] {
                rotor[j] = BRAKED;
                let change = BRAKE_DECELERATION * dt;
                self.qd[j] =
                    if self.qd[j].abs() <= change { 0.0 } else { self.qd[j] - change.copysign(self.qd[j]) };
            }
            free |= !self.braked[j] || self.qd[j] != 0.0;
        }
        if free {
            self.runge_kutta(tau, &rotor, dt);
        }
        self.since += dt;
        if self.since >= WARMING {
            self.warm();
        }
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

    /// Classical Runge-Kutta of fourth order.
    fn runge_kutta(&mut self, tau: &JointVec, rotor: &JointVec, dt: f64) {
        let (q0, v0) = (self.q, self.qd);
        let half = 0.5 * dt;
        let friction = self.curves.at(&v0, self.parts.friction_width);
        for j in 0..JOINTS {
            self.heat[j] += v0[j] * friction[j] * dt;
        }
        let a1 = self.accelerate(&q0, &v0, tau, &friction, rotor);
        let v2 = along(&v0, &a1, half);
        let a2 = self.acceleration(&along(&q0, &v0, half), &v2, tau, rotor);
        let v3 = along(&v0, &a2, half);
        let a3 = self.acceleration(&along(&q0, &v2, half), &v3, tau, rotor);
        let v4 = along(&v0, &a3, dt);
        let a4 = self.acceleration(&along(&q0, &v3, dt), &v4, tau, rotor);
        for j in 0..JOINTS {
            self.q[j] = q0[j] + dt / 6.0 * (v0[j] + 2.0 * (v2[j] + v3[j]) + v4[j]);
            self.qd[j] = v0[j] + dt / 6.0 * (a1[j] + 2.0 * (a2[j] + a3[j]) + a4[j]);
        }
    }

    fn acceleration(&self, q: &JointVec, qd: &JointVec, tau: &JointVec, rotor: &JointVec) -> JointVec {
        self.accelerate(q, qd, tau, &self.curves.at(qd, self.parts.friction_width), rotor)
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
        for j in 0..JOINTS {
            let scale = self.friction_scale[j] * self.friction_fault[j];
            let t = self.temperature[j];
            match &self.parts.friction[j] {
                SimFriction::Frictionless => {}
                SimFriction::Polynomial(c) => {
                    let k = scale * (1.0 + c[4] * (t - c[5])).clamp(0.2, 2.0);
                    for (row, c) in self.curves.k.iter_mut().zip(c) {
                        row[j] = k * c;
                    }
                }
                SimFriction::Table(table) => {
                    // Also from NaN at the start.
                    if (t - self.table_temperature[j]).abs() < 0.02 {
                        continue;
                    }
                    self.table_temperature[j] = t;
                    self.curves.tables[j] = Some(Box::new(cut(table, t, scale)));
                    self.curves.any_table = true;
                }
            }
        }
    }

    /// Make a change of `friction_fault` act at once.
    pub fn friction_changed(&mut self) {
        self.table_temperature = [f64::NAN; JOINTS];
        self.refresh_friction();
    }
}

fn along(x: &JointVec, rate: &JointVec, dt: f64) -> JointVec {
    core::array::from_fn(|j| x[j] + rate[j] * dt)
}

/// Velocities and torques of the table at one temperature (°C), which is kept within its axis.
fn cut(table: &TableOf<f32>, temperature: f64, scale: f64) -> Points {
    let axis = table.temperature.map(f64::from);
    let t = temperature.clamp(axis[0], axis[19]);
    let i = axis[1..19].iter().filter(|&&start| t >= start).count();
    let u = (t - axis[i]) / (axis[i + 1] - axis[i]);
    let torque = table.torque.map(|row| {
        let (a, b) = (f64::from(row[i]), f64::from(row[i + 1]));
        scale * (a + u * (b - a))
    });
    Points { velocity: table.velocity.map(f64::from), torque }
}
