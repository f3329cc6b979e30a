//! Tests of the torque that remains for an approach (J-34) and for a jog (J-58), and of the tool speed limit of a jog.
//!
//! The arm of these tests is a chain of joints with parallel axes. The joints carry no mass, unless a test adds a mass. A test sets the mass
//! matrix, the torques of the integrals and the friction, so that each remaining torque is a difference of a few numbers.
use jtc_dynamics::{ArmModel, Dynamics};

use super::*;
use crate::PidGains;
use crate::config::Config;
use crate::motion::ramp::PathRamp;
use crate::motion::{ControlMode, ControlParameters};
use crate::nodes::Nodes;
use crate::parameters::TableOf;

mod jogs;
mod tool_speed;

/// Torque limit of each joint, N·m. An approach may use 80 N·m of this torque, and a jog may use 92 N·m.
const LIMIT: f64 = 100.0;
const PID: [PidGains; JOINTS] = [PidGains { kp: 0.0, ki: 0.0, kd: 0.0, int_min: 0.0, int_max: 0.0 }; JOINTS];

/// Arm at rest, whose joint settings are round numbers.
struct Bench {
    config: Config,
    model: ArmModel,
    polynomial: [[f64; 6]; JOINTS],
    table: Option<[TableOf<f32>; JOINTS]>,
    motion: Motion,
}

impl Bench {
    /// Creates an arm without mass and friction. In a jog, each joint has a highest acceleration of 2 rad/s² (a fifth of 10 rad/s²) and a
    /// jerk of 20 rad/s³ (2 rad/s² in 0.1 s).
    fn new() -> Self {
        let mut config = Config { ramp_ms: 200, gravity: [0.0, -10.0, 0.0], ..Config::avena() };
        for joint in &mut config.joints {
            (joint.position_min, joint.position_max) = (-2.5, 2.5);
            (joint.velocity_max, joint.acceleration_max, joint.torque_max) = (1.0, 10.0, LIMIT);
        }
        Self {
            config,
            model: ArmModel::default(),
            polynomial: [[0.0; 6]; JOINTS],
            table: None,
            motion: Motion::default(),
        }
    }

    /// Sets elements of the mass matrix, kg·m². Each element is the torque of a joint (first index) per acceleration of a joint (second
    /// index).
    fn inertia(mut self, elements: &[(usize, usize, f64)]) -> Self {
        let mut inertia = [[0.0; JOINTS]; JOINTS];
        for &(j, k, element) in elements {
            inertia[j][k] = element;
        }
        self.motion.ramp = PathRamp::with_inertia_for_test(inertia);
        self
    }

    /// Sets the torque of the integral of a joint, N·m. Before the controller has learned a load, the integral counts as the load.
    fn integral(mut self, j: usize, torque: f64) -> Self {
        self.motion.law.torque[j].pid.i = torque;
        self
    }

    /// Sets the friction of each joint to `coulomb` (N·m) plus `viscous` (N·m·s/rad) times the speed.
    fn friction(mut self, coulomb: f64, viscous: f64) -> Self {
        self.polynomial = [[coulomb, viscous, 0.0, 0.0, 0.0, 0.0]; JOINTS];
        self
    }

    /// Uses a friction table with this torque (N·m) at all velocities, and also at standstill.
    fn flat_friction_table(mut self, torque: f32) -> Self {
        let axis = |i: usize| i as f32 * 0.125;
        let table = TableOf {
            velocity: core::array::from_fn(|i| axis(i) - axis(8)),
            temperature: core::array::from_fn(axis),
            torque: [[torque; 20]; 20],
        };
        self.table = Some([table; JOINTS]);
        self
    }

    /// Attaches a mass (kg) to the link of joint 1, 1 m from the axis. Gravity acts in the direction of −y. At
    /// position 0 the mass is on the x axis, so the holding torque of joint 1 is 10 N·m per kg times the cosine of
    /// its position.
    fn mass(mut self, mass: f64) -> Self {
        (self.model.links[1].mass, self.model.links[1].origin.xyz) = (mass, [1.0, 0.0, 0.0]);
        self
    }

    /// Sets the position of joint 1, rad.
    fn at(mut self, position: f64) -> Self {
        self.motion.set.point.position[0] = position;
        self
    }

    /// Calls a function of the motion with the same inputs that the controller uses.
    fn ask<R>(&self, function: impl FnOnce(&Motion, &LawInputs<'_>) -> R) -> R {
        let (nodes, dynamics) =
            (Nodes::new(&Config::avena()), Dynamics::new(&self.model, self.config.gravity));
        let parameters = ControlParameters {
            dynamics: &dynamics,
            pid: &PID,
            polynomial: &self.polynomial,
            table: self.table.as_ref(),
            on_trial: false,
        };
        let (mode, config) = (ControlMode::Approach, &self.config);
        function(&self.motion, &LawInputs { mode, braking: false, nodes: &nodes, config, parameters })
    }

    /// Returns the time of an approach in which joint 1 moves by `way` (rad), ms.
    fn approach_ms(&self, way: f64) -> Option<f64> {
        let mut to = self.motion.set.point.position;
        to[0] += way;
        self.ask(|motion, inputs| motion.approach_ms(&to, inputs))
    }

    /// Returns the holding torque of joint 1, N·m.
    fn standing(&self) -> f64 {
        self.ask(|motion, inputs| motion.standing(&motion.set.point.position, inputs)[0])
    }
}

/// Returns values for all joints: the two given values for joints 1 and 2, and zero for the others.
fn two(first: f64, second: f64) -> [f64; JOINTS] {
    [first, second, 0.0, 0.0, 0.0, 0.0]
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * b.abs().max(1.0)
}

fn all_near(a: &[f64], b: &[f64]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| near(*a, *b))
}

/// A minimum-jerk approach of 1 rad in T seconds has a top speed of 1.875/T and a highest acceleration of 5.774/T².
#[test]
fn j34_the_approach_takes_the_time_of_its_ramp_speed_or_acceleration() {
    for (way, velocity, acceleration, ms) in [
        (0.0, 1.0, 1e6, 200.0),
        (0.1, 1.0, 1e6, 200.0),
        (1.0, 1.0, 1e6, 1_875.0),
        (-0.5, 1.0, 1e6, 937.5),
        (1.0, 2.0, 1e6, 937.5),
        (1.0, 100.0, 5.774 / 4.0, 2_000.0),
        (-0.25, 100.0, 5.774 / 4.0, 1_000.0),
        (0.25, 100.0, 5.774, 500.0),
    ] {
        let mut bench = Bench::new();
        (bench.config.joints[0].velocity_max, bench.config.joints[0].acceleration_max) =
            (velocity, acceleration);
        let time = bench.approach_ms(way).unwrap();
        assert!(near(time, ms), "{way} {velocity} {acceleration}: {time}");
    }
}

/// Returns an arm whose approach of 1 rad takes 3 s if `left` N·m remain for the acceleration: 5.774/3² · inertia =
/// left. Without a torque limit, the approach takes `ramp_ms`.
fn three_seconds(ramp_ms: u16, left: f64) -> Bench {
    let mut bench = Bench::new().inertia(&[(0, 0, 9.0 * left / 5.774)]);
    bench.config.ramp_ms = ramp_ms;
    (bench.config.joints[0].velocity_max, bench.config.joints[0].acceleration_max) = (100.0, 1e6);
    bench
}

/// An approach may use 80 N·m of the limit of 100 N·m, or the holding torque plus half of the remaining torque if
/// this is more. The friction is computed at the top speed of the fastest approach, 1.875 · 1 rad / 2 s = 0.9375
/// rad/s. In each row, the result is the torque that remains for the acceleration.
#[test]
fn j34_the_approach_uses_the_torque_that_holding_and_friction_leave() {
    for (held, viscous, way, left) in [
        (0.0, 0.0, 1.0, 80.0),
        // The limit of 80 N·m minus the friction of 32 · 0.9375 = 30 N·m leaves 50 N·m. The result is the same in
        // both directions of the motion.
        (0.0, 32.0, 1.0, 50.0),
        (0.0, 32.0, -1.0, 50.0),
        // 80 N·m minus the holding torque of 50 N·m leave 30 N·m. Half of the remaining 50 N·m would be only 25 N·m.
        (50.0, 0.0, 1.0, 30.0),
        // (70 + 15) − 70 = 15.
        (70.0, 0.0, 1.0, 15.0),
        (-70.0, 0.0, 1.0, 15.0),
        // The holding torque of 80 N·m plus half of the remaining 20 N·m allow 90 N·m, which leaves 10 N·m. Friction
        // that helps to hold the load leaves the same torque.
        (80.0, 0.0, 1.0, 10.0),
        (-80.0, 3.2, 1.0, 10.0),
        (80.0, 3.2, -1.0, 10.0),
        // (80 + 10) − (80 + 3.2 · 0.9375) = 7.
        (80.0, 3.2, 1.0, 7.0),
        (-80.0, 3.2, -1.0, 7.0),
    ] {
        let bench = three_seconds(2_000, left).integral(0, held).friction(0.0, viscous);
        let time = bench.approach_ms(way).unwrap();
        assert!(near(time, 3_000.0), "{held} {viscous} {way}: {time}");
    }
}

/// Joint 2 does not move, but must supply a torque because joint 1 accelerates. Without friction, 80 N·m remain for this torque. Joint 1 needs
/// no torque, because its own inertia is 0.
#[test]
fn j34_a_joint_that_does_not_move_has_no_friction_on_the_approach() {
    let bench = three_seconds(2_000, 80.0).inertia(&[(1, 0, 9.0 * 80.0 / 5.774)]).flat_friction_table(20.0);
    let time = bench.approach_ms(1.0).unwrap();
    assert!(near(time, 3_000.0), "{time}");
}

/// Joint 2 holds a torque at or above its limit. The approach of joint 1 is possible if joint 2 needs no torque for this approach.
#[test]
fn j34_a_joint_without_remaining_torque_prevents_only_the_approaches_that_need_its_torque() {
    for held in [100.0, 120.0] {
        let bench = three_seconds(2_000, 1.0).inertia(&[]).integral(1, held);
        assert_eq!(bench.approach_ms(1.0), Some(2_000.0), "{held}");
        assert_eq!(bench.inertia(&[(1, 0, 0.01)]).approach_ms(1.0), None, "{held}");
    }
}

/// Friction of 80 N·m at every speed leaves exactly 0 N·m for an approach, so no approach is possible.
#[test]
fn j34_an_approach_is_not_possible_if_friction_needs_all_of_its_torque() {
    let bench = three_seconds(2_000, 1.0);
    assert_eq!(bench.friction(80.0, 0.0).approach_ms(1.0), None);
}

/// The speed and acceleration limits allow an approach of 1 s, and the torque limits may add at most 2 s. With the
/// top speed v, the friction is 45 − 8·v or 48·v. The top speed is 1.875 rad/s for 1 s, and 0.625 rad/s for 3 s.
#[test]
fn j34_the_torque_limits_may_lengthen_the_approach_by_two_seconds() {
    assert_eq!(5.774 * (9.0 * 50.0 / 5.774), 450.0, "the time of 3 s is exact");
    for (coulomb, viscous) in [
        // The friction of the fastest approach (1 s) is 30 N·m, which leaves 50 N·m for an approach of 3 s. The
        // friction of the slowest approach (40 N·m at 3 s) is not used.
        (45.0, -8.0),
        // The friction of the fastest approach (90 N·m at 1 s) leaves no torque. The friction of the slowest approach
        // (30 N·m at 3 s) leaves 50 N·m, which allow 3 s.
        (0.0, 48.0),
    ] {
        let bench = three_seconds(1_000, 50.0).friction(coulomb, viscous);
        assert_eq!(bench.approach_ms(1.0), Some(3_000.0), "{coulomb}");
        let heavier = three_seconds(1_000, 50.1).friction(coulomb, viscous);
        assert_eq!(heavier.approach_ms(1.0), None, "{coulomb}");
    }
    // Without friction, 80 N·m allow an approach of √(450/80) s = 2.3717 s.
    let time = three_seconds(1_000, 50.0).approach_ms(1.0).unwrap();
    assert!((time - 2_371.7).abs() < 0.1, "{time}");
}

/// Gravity loads joint 1 with 10 N·m. The holding torque is gravity plus the load, or gravity plus the integral if that is more.
#[test]
fn j58_the_holding_torque_contains_the_load_or_the_integral() {
    for (integral, torque) in [(5.0, 15.0), (-5.0, 5.0), (-25.0, -15.0)] {
        // Before the controller has learned the load, the integral counts as the load.
        assert_eq!(Bench::new().mass(1.0).integral(0, integral).standing(), torque, "{integral}");
    }
    // The known load is zero. If gravity plus the load and gravity plus the integral have the same magnitude, the
    // load counts.
    for (integral, torque) in [(0.0, 10.0), (5.0, 15.0), (-5.0, 10.0), (-20.0, 10.0), (-21.0, -11.0)] {
        let mut bench = Bench::new().mass(1.0).integral(0, integral);
        bench.motion.law.find_loads_for_test();
        assert_eq!(bench.standing(), torque, "{integral}");
    }
}

/// While the integral releases the torque of a configured payload, the model already contains this torque. The torque
/// must not count twice, so the holding torque is gravity alone.
#[test]
fn j60_gravity_alone_holds_the_arm_while_the_integral_releases_torque() {
    for (ms, torque) in [(0, 15.0), (1, 10.0), (3_000, 10.0)] {
        let mut bench = Bench::new().mass(1.0).integral(0, 5.0);
        bench.motion.law.unwinds_ms = ms;
        assert_eq!(bench.standing(), torque, "{ms} ms");
    }
}
