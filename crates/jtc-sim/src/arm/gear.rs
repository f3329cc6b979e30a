//! Elastic gears. An elastic gear is a spring with damping between a motor and its link.
//!
//! Friction, the brake, the drive's torque and most of the rotor's inertia act on the motor side. Pushes, hands, walls
//! and end stops act on the link. Positions and speeds of the motor are divided by the gear ratio, so that they refer
//! to the joint.
use jtc_dynamics::{JOINTS, JointVec};

use super::{Arm, BRAKED, LIGHTEST, along, braked};

/// Part of the rotor's inertia that turns with the link, such as the gear's output, kg·m². Without this part, a light
/// last link would vibrate too fast for the integration steps. The inertia of a rotor is at least twice this value.
pub(super) const OUTPUT: f64 = 0.01;
/// Damping divided by stiffness, s, for a gear with known stiffness and unknown damping.
const DAMPING_TIME: f64 = 5e-4;

/// Elasticity of a gear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gear {
    /// Stiffness: torque per angle between motor and link, N·m/rad. The stiffness is infinite for a rigid gear.
    pub stiffness: f64,
    /// Damping: torque per speed difference between motor and link, N·m·s/rad.
    pub damping: f64,
}

impl Gear {
    /// A rigid gear.
    pub const RIGID: Self = Self { stiffness: f64::INFINITY, damping: 0.0 };
    /// Smallest and largest stiffness that the simulator's options accept, N·m/rad.
    pub const STIFFNESS: (f64, f64) = (100.0, 1e6);

    /// Creates a gear with this stiffness (N·m/rad) and a damping of 0.0005 s times the stiffness. With this damping, a
    /// vibration of 30 Hz at the gear has 5 % of the critical damping.
    pub fn new(stiffness: f64) -> Self {
        Self { stiffness, damping: if stiffness.is_finite() { DAMPING_TIME * stiffness } else { 0.0 } }
    }

    /// Returns `true` if the gear is elastic.
    pub fn is_elastic(&self) -> bool {
        self.stiffness.is_finite()
    }
}

impl Default for Gear {
    fn default() -> Self {
        Self::RIGID
    }
}

/// Positions and velocities of links and motors, or their derivatives.
#[derive(Clone, Copy)]
struct Sides {
    q: JointVec,
    qd: JointVec,
    motor: JointVec,
    motor_speed: JointVec,
}

impl Sides {
    fn along(&self, rate: &Self, dt: f64) -> Self {
        Self {
            q: along(&self.q, &rate.q, dt),
            qd: along(&self.qd, &rate.qd, dt),
            motor: along(&self.motor, &rate.motor, dt),
            motor_speed: along(&self.motor_speed, &rate.motor_speed, dt),
        }
    }
}

/// Values that are constant during a step.
struct Drives<'a> {
    /// Torque of each drive, N·m.
    torque: &'a JointVec,
    /// Torque on each link, N·m.
    outside: &'a JointVec,
    /// Inertias on the motor side and on the link side, kg·m². With a rigid gear, the whole inertia belongs to
    /// the link.
    motor: &'a JointVec,
    link: &'a JointVec,
}

impl Arm {
    /// Simulates a sub-step with separate motors and links. Brakes act on the motor side.
    pub(super) fn elastic_substep(
        &mut self,
        tau: &JointVec,
        outside: &JointVec,
        inertia: &JointVec,
        damped: f64,
        dt: f64,
    ) {
        self.follow_rigid();
        let (mut motor, mut link) = ([0.0; JOINTS], *inertia);
        let steepness = self.friction.steepness(&self.motor_speed);
        for j in 0..JOINTS {
            let elastic = self.parts.gears[j].is_elastic();
            if elastic {
                let rotor = self.parts.rotor_inertia[j].max(LIGHTEST) - OUTPUT;
                motor[j] = rotor.max(steepness[j] * dt);
                link[j] = OUTPUT.max(self.stopping(j, dt) * dt);
            }
            if self.braked[j] {
                let against =
                    if elastic { -self.gear_torque(j) } else { self.stop_torque(j, self.q[j], self.qd[j]) };
                let inertia = if elastic { motor[j] } else { link[j] };
                self.motor_speed[j] = braked(self.motor_speed[j], against, inertia, dt);
                if elastic {
                    motor[j] = BRAKED;
                } else {
                    (self.qd[j], link[j]) = (self.motor_speed[j], BRAKED);
                }
            }
        }
        let drives = Drives { torque: tau, outside, motor: &motor, link: &link };
        self.elastic_runge_kutta(&drives, damped, dt);
    }

    /// Returns the torque of the spring on the link, N·m; 0 for a rigid gear.
    fn gear_torque(&self, j: usize) -> f64 {
        let gear = &self.parts.gears[j];
        if gear.is_elastic() {
            gear.stiffness * (self.motor[j] - self.q[j]) + gear.damping * (self.motor_speed[j] - self.qd[j])
        } else {
            0.0
        }
    }

    /// Like `runge_kutta` for rigid gears, but treats the motors as separate bodies.
    fn elastic_runge_kutta(&mut self, drives: &Drives<'_>, damped: f64, dt: f64) {
        let start = Sides { q: self.q, qd: self.qd, motor: self.motor, motor_speed: self.motor_speed };
        let (z0, half) = (self.bristles, 0.5 * dt);
        let friction = self.friction.at(&start.motor_speed, &z0);
        for j in 0..JOINTS {
            self.heat[j] += start.motor_speed[j] * friction[j] * dt;
        }
        let r1 = self.rate(&start, &friction, drives, damped);
        let stage = |rate: &Sides, dt: f64| {
            let state = start.along(rate, dt);
            let bristles = self.friction.bend(&z0, &rate.motor, dt);
            self.rate(&state, &self.friction.at(&state.motor_speed, &bristles), drives, damped)
        };
        let r2 = stage(&r1, half);
        let r3 = stage(&r2, half);
        let r4 = stage(&r3, dt);
        let mean = |part: fn(&Sides) -> &JointVec| -> JointVec {
            let (a, b, c, d) = (part(&r1), part(&r2), part(&r3), part(&r4));
            core::array::from_fn(|j| (a[j] + 2.0 * (b[j] + c[j]) + d[j]) / 6.0)
        };
        let motor = mean(|rate| &rate.motor);
        self.bristles = self.friction.bend(&z0, &motor, dt);
        self.q = along(&start.q, &mean(|rate| &rate.q), dt);
        self.qd = along(&start.qd, &mean(|rate| &rate.qd), dt);
        self.motor = along(&start.motor, &motor, dt);
        self.motor_speed = along(&start.motor_speed, &mean(|rate| &rate.motor_speed), dt);
        self.follow_rigid();
    }

    /// Sets the positions and speeds of motors with rigid gears to those of their links.
    pub(super) fn follow_rigid(&mut self) {
        for (j, gear) in self.parts.gears.iter().enumerate() {
            if !gear.is_elastic() {
                (self.motor[j], self.motor_speed[j]) = (self.q[j], self.qd[j]);
            }
        }
    }

    fn rate(&self, state: &Sides, friction: &JointVec, drives: &Drives<'_>, damped: f64) -> Sides {
        let (mut on_link, mut motor) = ([0.0; JOINTS], [0.0; JOINTS]);
        for (j, gear) in self.parts.gears.iter().enumerate() {
            let drive = drives.torque[j] - friction[j];
            if gear.is_elastic() {
                let spring = gear.stiffness * (state.motor[j] - state.q[j])
                    + gear.damping * (state.motor_speed[j] - state.qd[j]);
                motor[j] = (drive - spring) / drives.motor[j];
                on_link[j] = spring;
            } else {
                on_link[j] = drive;
            }
            on_link[j] += drives.outside[j] + self.stop_torque(j, state.q[j], state.qd[j]);
        }
        self.push_of_walls(&state.q, &state.qd, damped, &mut on_link);
        let qdd = self.dynamics.forward(&state.q, &state.qd, &on_link, drives.link);
        for (j, gear) in self.parts.gears.iter().enumerate() {
            if !gear.is_elastic() {
                motor[j] = qdd[j];
            }
        }
        Sides { q: state.qd, qd: qdd, motor: state.motor_speed, motor_speed: motor }
    }
}
