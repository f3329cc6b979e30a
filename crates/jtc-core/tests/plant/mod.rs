//! Simulated physical arm that is connected to the [`Rig`]. The arm has rigid bodies, rotors, rigid or elastic gears, LuGre friction, and
//! drives with a coarse encoder and a delayed speed.

use jtc_core::{Config, Parameters};
use jtc_dynamics::{ArmModel, Dynamics};

use crate::rig::Rig;

pub(crate) mod arms;

pub(crate) use arms::ArmFile;

/// Resolution of the drives' 16-bit encoder, rad.
pub(crate) const ENCODER_STEP: f64 = core::f64::consts::TAU / 65_536.0;
/// Resolution of the motor's encoder at the output side of the gear, rad. The drives measure the speed with this encoder.
const MOTOR_STEP: f64 = core::f64::consts::TAU / 1_210_000.0;
/// Number of integration steps per millisecond. The bristles of the friction model are stiff and therefore need many steps.
const SUBSTEPS: usize = 20;
const DT: f64 = 1e-3 / SUBSTEPS as f64;
/// Inertia of the output side of an elastic gear, kg·m². The output side of the gear turns with the link.
const GEAR_OUTPUT: f64 = 0.01;
/// Damping of an elastic gear divided by its stiffness, s (N·m·s/rad for each N·m/rad).
const GEAR_DAMPING: f64 = 5e-4;

/// LuGre friction of a joint (Canudas de Wit et al. 1995), with bristles that stick first and then slip along Stribeck's curve.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LuGre {
    /// Friction torque of a slowly sliding joint, N·m.
    pub coulomb: f64,
    /// Torque at which the joint breaks away, N·m.
    pub stiction: f64,
    /// Speed above which stiction has nearly disappeared, rad/s.
    pub stribeck: f64,
    /// Stiffness of the bristles, N·m/rad.
    pub stiffness: f64,
    /// Damping of the bristles, N·m·s/rad.
    pub damping: f64,
    /// Viscous friction of the grease, N·m·s/rad.
    pub viscous: f64,
}

impl LuGre {
    pub(crate) const NONE: Self =
        Self { coulomb: 0.0, stiction: 0.0, stribeck: 1.0, stiffness: 0.0, damping: 0.0, viscous: 0.0 };

    /// Returns the friction of joint `j` of the default arm at the temperature of the rig. `stiction` is the ratio of stiction to Coulomb
    /// friction.
    pub(crate) fn avena(j: usize, stiction: f64) -> Self {
        let jtc_core::Friction::Polynomial(polynomial) = Parameters::avena().friction else { panic!() };
        let c = polynomial[j];
        let factor = (1.0 + c[4] * (25.0 - c[5])).clamp(0.2, 2.0);
        let coulomb = factor * c[0];
        Self {
            coulomb,
            stiction: stiction * coulomb,
            stribeck: 0.02,
            stiffness: 100_000.0,
            damping: 20.0,
            viscous: factor * c[1],
        }
    }

    /// Returns the default arm's friction multiplied by `factor`. Stiction is 20 % higher than Coulomb friction.
    pub(crate) fn of_avena_times(factor: f64) -> [Self; 6] {
        core::array::from_fn(|j| {
            let f = Self::avena(j, 1.2);
            let Self { coulomb, stiction, viscous, .. } = f;
            Self { coulomb: factor * coulomb, stiction: factor * stiction, viscous: factor * viscous, ..f }
        })
    }

    /// Returns the friction torque against the motion at speed `v`, and moves the bristles `z` by `dt`.
    fn step(&self, z: &mut f64, v: f64, dt: f64) -> f64 {
        if self.stiffness == 0.0 {
            return self.viscous * v;
        }
        let x = v / self.stribeck;
        let level = self.coulomb + (self.stiction - self.coulomb) * (-x * x).exp();
        let rate = self.stiffness * v.abs() / level;
        // The integration step is implicit in z, because the equation is stiff at high speed.
        let next = (*z + v * dt) / (1.0 + rate * dt);
        let slope = (next - *z) / dt;
        *z = next;
        self.stiffness * next + self.damping * slope + self.viscous * v
    }
}

/// State of elastic gears. Each gear is a spring and a damper between its motor and its link. The angles and speeds of the motors are
/// converted to the output side.
struct Gears {
    /// Stiffness of each gear, N·m/rad.
    stiffness: f64,
    /// Angles of the motors, rad.
    q: [f64; 6],
    /// Speeds of the motors, rad/s.
    v: [f64; 6],
}

impl Gears {
    /// Returns the torque of gear `j` on its link, N·m.
    fn torque(&self, j: usize, q: f64, v: f64) -> f64 {
        self.stiffness * (self.q[j] - q + GEAR_DAMPING * (self.v[j] - v))
    }
}

/// Generator of reproducible pseudo-random numbers.
pub(crate) struct Random(pub u64);

impl Random {
    /// Returns a random number that is evenly distributed from 0 to 1.
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Returns a random number that is evenly distributed from `low` to `high`.
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }
}

/// Poses of the arm, rad: a bent pose, a stretched pose (in which joint 2 cannot hold 4 kg), and two other poses.
pub(crate) const POSES: [[f64; 6]; 4] = [
    [0.3, 0.8, -0.9, 0.4, 0.7, 0.2],
    [0.0, 1.4, 0.2, 0.0, 0.0, 0.0],
    [-1.0, -0.7, 1.2, -0.5, 1.0, 2.0],
    [1.0, 0.3, 1.6, 0.2, -0.8, 0.0],
];

/// Returns the torques as shares of the torque limits of the default arm.
pub(crate) fn shares(torque: &[f64; 6]) -> [f64; 6] {
    shares_of(torque, &Config::avena())
}

/// Returns the torques as shares of the torque limits in `config`.
pub(crate) fn shares_of(torque: &[f64; 6], config: &Config) -> [f64; 6] {
    core::array::from_fn(|j| torque[j].abs() / config.joints[j].torque_max)
}

/// Returns the highest of the shares of all joints.
pub(crate) fn highest(shares: &[f64; 6]) -> f64 {
    shares.iter().fold(0.0, |most, share| share.max(most))
}

/// Returns a random pose like [`ArmFile::pose`], for the default arm.
pub(crate) fn pose(random: &mut Random, mass: f64, most: f64) -> ([f64; 6], [f64; 6]) {
    ArmFile::avena().pose(random, mass, most)
}

/// Returns the torques that hold an arm with this `model` at `q`, N·m.
pub(crate) fn standing(model: &ArmModel, q: &[f64; 6]) -> [f64; 6] {
    Dynamics::new(model, Config::avena().gravity).gravity_torque(q)
}

/// The simulated arm.
pub(crate) struct Plant {
    dynamics: Dynamics,
    pub rotor: [f64; 6],
    pub friction: [LuGre; 6],
    bristles: [f64; 6],
    /// Elastic gears of the arm. `None` for rigid gears.
    gears: Option<Gears>,
    pub q: [f64; 6],
    pub v: [f64; 6],
    /// External torque on each joint from a hand or a collision, N·m.
    pub push: [f64; 6],
    /// Speeds of the motors in the last 10 ms, rad/s.
    pub speeds: [[f64; 10]; 6],
    /// `true` if a brake holds each joint while its drive is not enabled.
    pub brakes: bool,
    /// Factor between the true speed and the reported speed.
    pub speed_scale: f64,
    ticks: usize,
}

/// Returns `model` with an additional mass of `mass` kg at the flange.
pub(crate) fn loaded(mut model: ArmModel, mass: f64) -> ArmModel {
    let flange = model.joints[6].xyz;
    let link = &mut model.links[6];
    let total = link.mass + mass;
    for (x, f) in link.origin.xyz.iter_mut().zip(flange) {
        *x = (link.mass * *x + mass * f) / total;
    }
    link.mass = total;
    model
}

/// Returns `model` with every mass multiplied by `factor`.
pub(crate) fn heavier(mut model: ArmModel, factor: f64) -> ArmModel {
    for link in &mut model.links {
        link.mass *= factor;
        link.inertia = link.inertia.map(|i| i * factor);
    }
    model
}

impl Plant {
    pub(crate) fn new(model: &ArmModel, friction: [LuGre; 6], q: [f64; 6]) -> Self {
        let config = Config::avena();
        Self {
            dynamics: Dynamics::new(model, config.gravity),
            rotor: config.joints.map(|j| j.rotor_inertia),
            friction,
            bristles: [0.0; 6],
            gears: None,
            q,
            v: [0.0; 6],
            push: [0.0; 6],
            speeds: [[0.0; 10]; 6],
            brakes: true,
            speed_scale: 1.0,
            ticks: 0,
        }
    }

    /// Creates a plant for another arm, with this true model.
    pub(crate) fn of(arm: &ArmFile, model: &ArmModel, friction: [LuGre; 6], q: [f64; 6]) -> Self {
        Self {
            dynamics: Dynamics::new(model, arm.config.gravity),
            rotor: arm.config.joints.map(|j| j.rotor_inertia),
            ..Self::new(model, friction, q)
        }
    }

    /// Returns this arm with elastic gears of `stiffness` N·m/rad, which are twisted by the load of the arm. The drives measure the
    /// position of the link and the speed of the motor. Rotors and friction are on the motor side.
    pub(crate) fn elastic(mut self, stiffness: f64) -> Self {
        let load = self.dynamics.gravity_torque(&self.q);
        let q = core::array::from_fn(|j| self.q[j] + load[j] / stiffness);
        self.gears = Some(Gears { stiffness, q, v: [0.0; 6] });
        self
    }

    /// Returns a rig whose controller holds another arm.
    pub(crate) fn holding_arm(&mut self, arm: &ArmFile) -> Rig {
        let mut rig = Rig::with_speeds(arm.config.clone());
        rig.follow = false;
        self.report(&mut rig);
        arm.give(&mut rig);
        self.run(&mut rig, 300);
        assert_eq!(rig.state(), jtc_core::ControllerState::HoldPos, "{:?}", rig.controller.telemetry());
        rig
    }

    /// Advances the simulated arm and the rig by one millisecond. The controller measures the state of the previous tick, because this
    /// state does not depend on the torque of the present tick.
    pub(crate) fn tick(&mut self, rig: &mut Rig) {
        rig.tick();
        self.step(rig);
        self.report(rig);
    }

    /// Like [`Self::tick`], but the drives of the rig report the positions `seen` (rad).
    pub(crate) fn tick_seen_at(&mut self, rig: &mut Rig, seen: &[f64; 6]) {
        self.report(rig);
        for (node, q) in rig.nodes.iter_mut().zip(seen) {
            node.report.position = read(*q);
        }
        rig.tick();
        self.step(rig);
    }

    pub(crate) fn run(&mut self, rig: &mut Rig, ticks: usize) {
        for _ in 0..ticks {
            self.tick(rig);
        }
    }

    /// Returns a rig whose controller holds this arm.
    pub(crate) fn holding(&mut self, config: Config) -> Rig {
        let mut rig = Rig::with_speeds(config);
        rig.follow = false;
        self.report(&mut rig);
        rig.defaults();
        self.run(&mut rig, 300);
        assert_eq!(rig.state(), jtc_core::ControllerState::HoldPos, "{:?}", rig.controller.telemetry());
        rig
    }

    fn step(&mut self, rig: &Rig) {
        let enabled: [bool; 6] =
            core::array::from_fn(|j| rig.nodes[j].report.state == jtc_bus::NodeState::ENABLED);
        let braked: [bool; 6] = core::array::from_fn(|j| self.brakes && !enabled[j]);
        let drive: [f64; 6] = core::array::from_fn(|j| if enabled[j] { rig.torque[j] } else { 0.0 });
        let before = self.motors().0;
        let mut mass = self.dynamics.mass_matrix(&self.q);
        let bias = self.dynamics.inverse(&self.q, &self.v, &[0.0; 6]);
        for j in 0..6 {
            let motor = if braked[j] { 1e9 } else { self.rotor[j] };
            mass[j][j] += if self.gears.is_some() { GEAR_OUTPUT } else { motor };
            if braked[j] {
                *self.motor_speed(j) = 0.0;
            }
        }
        let inverse = inverted(mass);
        for _ in 0..SUBSTEPS {
            let torque: [f64; 6] =
                core::array::from_fn(|j| self.push[j] - bias[j] + self.joint_torque(j, drive[j], braked[j]));
            for j in 0..6 {
                let a: f64 = (0..6).map(|k| inverse[j][k] * torque[k]).sum();
                self.v[j] += a * DT;
            }
            for j in 0..6 {
                self.q[j] += self.v[j] * DT;
            }
        }
        let after = self.motors().0;
        for j in 0..6 {
            let counts = |q: f64| (q / MOTOR_STEP).floor();
            self.speeds[j][self.ticks % 10] = (counts(after[j]) - counts(before[j])) * MOTOR_STEP / 0.001;
        }
        self.ticks += 1;
    }

    /// Returns the torque on the link of joint `j`, N·m, if its drive has the torque `drive`. The torque on the link is the drive torque
    /// minus friction, or the torque of an elastic gear. Also advances the motor of an elastic gear by one step.
    fn joint_torque(&mut self, j: usize, drive: f64, braked: bool) -> f64 {
        let speed = *self.motor_speed(j);
        let friction = self.friction[j].step(&mut self.bristles[j], speed, DT);
        let Some(gears) = &mut self.gears else {
            return drive - friction;
        };
        let torque = gears.torque(j, self.q[j], self.v[j]);
        if !braked {
            gears.v[j] += (drive - friction - torque) / self.rotor[j] * DT;
            gears.q[j] += gears.v[j] * DT;
        }
        torque
    }

    /// Returns the angles (rad) and speeds (rad/s) of the motors.
    pub(crate) fn motors(&self) -> ([f64; 6], [f64; 6]) {
        self.gears.as_ref().map_or((self.q, self.v), |gears| (gears.q, gears.v))
    }

    fn motor_speed(&mut self, j: usize) -> &mut f64 {
        self.gears.as_mut().map_or(&mut self.v[j], |gears| &mut gears.v[j])
    }

    pub(crate) fn report(&self, rig: &mut Rig) {
        for j in 0..6 {
            let report = &mut rig.nodes[j].report;
            report.position = read(self.q[j]);
            report.velocity = (self.speed_scale * self.speeds[j].iter().sum::<f64>() / 10.0).clamp(-2.0, 2.0);
        }
    }
}

/// Returns the reading of an encoder at the position `q`, rad.
fn read(q: f64) -> f64 {
    (q / ENCODER_STEP).floor() * ENCODER_STEP
}

/// Returns the inverse of a symmetric positive definite matrix (Gauss-Jordan).
fn inverted(mut a: [[f64; 6]; 6]) -> [[f64; 6]; 6] {
    let mut b = [[0.0; 6]; 6];
    for (k, row) in b.iter_mut().enumerate() {
        row[k] = 1.0;
    }
    for k in 0..6 {
        let pivot = 1.0 / a[k][k];
        (a[k], b[k]) = (a[k].map(|x| x * pivot), b[k].map(|x| x * pivot));
        for i in (0..6).filter(|&i| i != k) {
            let factor = a[i][k];
            for c in 0..6 {
                a[i][c] -= factor * a[k][c];
                b[i][c] -= factor * b[k][c];
            }
        }
    }
    b
}
