//! Tests of walls that the arm touches, and of loads that it picks up and drops, compared with the laws of mechanics.
#[path = "../../jtc-plan/tests/robots/mod.rs"]
#[allow(dead_code, reason = "the tests of jtc-plan use more")]
mod robots;

use jtc_bus::Joint;
use jtc_dynamics::{ArmModel, Dynamics, JOINTS, Link, Origin, Payload};
use jtc_sim::{Arm, Gear, Side, SimArm, SimFriction, Wall};
use proptest::prelude::*;

const TICK: f64 = 1e-3;
const GRAVITY: [f64; 3] = [0.0, 0.0, -9.81];

/// Returns the arm without friction and without end stops.
fn bare(parts: SimArm) -> SimArm {
    SimArm {
        friction: std::array::from_fn(|_| SimFriction::Frictionless),
        stops: [(f64::NEG_INFINITY, f64::INFINITY); JOINTS],
        ..parts
    }
}

/// Returns an arm with these joints and with links of these masses (kg) and sizes (m).
fn of_links(mut model: ArmModel, masses: [f64; JOINTS], size: f64, rotors: [f64; JOINTS]) -> SimArm {
    for (k, mass) in masses.into_iter().enumerate() {
        let middle = model.joints[k + 1].xyz.map(|x| 0.5 * x);
        let moment = 0.1 * mass * size * size;
        let origin = Origin { xyz: middle, rpy: [0.0; 3] };
        model.links[k + 1] = Link { mass, origin, inertia: [moment, 0.0, 0.0, moment, 0.0, moment] };
    }
    SimArm { model, rotor_inertia: rotors, ..SimArm::default() }
}

/// Returns the default arm, a UR5 with its published dimensions and masses, and an arm as small and light as a Z1. The
/// third arm has the lightest rotors that the simulator supports.
fn arms() -> [(&'static str, SimArm); 3] {
    use std::f64::consts::FRAC_PI_2;
    let light = robots::by_dh([
        [0.1, 0.0, FRAC_PI_2],
        [0.0, -0.35, 0.0],
        [0.0, -0.22, 0.0],
        [0.07, 0.0, FRAC_PI_2],
        [0.05, 0.0, -FRAC_PI_2],
        [0.05, 0.0, 0.0],
    ]);
    [
        ("default", SimArm::default()),
        (
            "UR5",
            of_links(
                robots::ur5(),
                [3.7, 8.393, 2.275, 1.219, 1.219, 0.1879],
                0.12,
                [0.75, 0.75, 0.75, 0.14, 0.14, 0.14],
            ),
        ),
        ("light", of_links(light, [0.67, 1.19, 0.84, 0.56, 0.39, 0.29], 0.05, [0.02; JOINTS])),
    ]
}

fn joint_wall(joint: usize, angle: f64, side: Side, stiffness: f64, damping: f64) -> Wall {
    Wall::Joint { joint: Joint::ALL[joint], angle, side, stiffness, damping }
}

fn flange(arm: &SimArm, q: &[f64; JOINTS]) -> [f64; 3] {
    Dynamics::new(&arm.model, GRAVITY).forward_kinematics(q)[JOINTS].position
}

const POSE: [f64; JOINTS] = [0.3, 0.4, -0.7, 0.4, 0.6, -0.2];

/// The depth of the joint in the wall must be the torque divided by the stiffness. This value does not depend on the
/// integration of the motion.
#[test]
fn a_pushed_joint_rests_in_its_wall_at_torque_over_stiffness() {
    for (name, parts) in arms() {
        for joint in 0..JOINTS {
            for (stiffness, side) in [(3_000.0, Side::Above), (20_000.0, Side::Below)] {
                let mut arm =
                    Arm::new(SimArm { gravity: [0.0; 3], ..bare(parts.clone()) }, [0.0; JOINTS], POSE);
                let walls: Vec<_> = (0..JOINTS)
                    .flat_map(|j| {
                        [Side::Above, Side::Below].map(|side| {
                            joint_wall(j, POSE[j], side, stiffness, 400.0 * parts.rotor_inertia[j])
                        })
                    })
                    .collect();
                arm.set_walls(&walls);
                let mut push = [0.0; JOINTS];
                push[joint] = if side == Side::Above { 25.0 } else { -25.0 };
                (0..4_000).for_each(|_| arm.step(&push, TICK));
                let depth = arm.q[joint] - POSE[joint];
                assert!(
                    (depth - push[joint] / stiffness).abs() < 1e-6,
                    "{name}, joint {}: {depth}",
                    joint + 1
                );
                assert!((arm.wall_torque()[joint] + push[joint]).abs() < 0.01);
            }
        }
    }
}

/// The arm hits walls of 20,000 N·m/rad on all joints at once, while it moves fast. The energy must never exceed the
/// initial energy by more than 3 %, and no joint may move farther than 0.3 rad.
#[test]
fn stiff_walls_on_every_joint_are_stable_on_every_arm() {
    for (name, parts) in arms() {
        for damping in [0.0, 20.0, 1_000.0] {
            for stiffness in [3_000.0, 20_000.0, 100_000.0] {
                let mut arm =
                    Arm::new(SimArm { gravity: [0.0; 3], ..bare(parts.clone()) }, [0.0; JOINTS], POSE);
                let walls: Vec<_> = (0..JOINTS)
                    .flat_map(|j| {
                        [
                            joint_wall(j, POSE[j] + 0.05, Side::Above, stiffness, damping),
                            joint_wall(j, POSE[j] - 0.05, Side::Below, stiffness, damping),
                        ]
                    })
                    .collect();
                arm.set_walls(&walls);
                arm.qd = [1.0, -0.8, 1.2, -1.5, 1.4, 1.0];
                let energy = |arm: &Arm| {
                    let m = Dynamics::new(&parts.model, [0.0; 3]).mass_matrix(&arm.q);
                    let links: f64 =
                        (0..36).map(|k| 0.5 * arm.qd[k / 6] * m[k / 6][k % 6] * arm.qd[k % 6]).sum();
                    let rotors: f64 =
                        (0..JOINTS).map(|j| 0.5 * parts.rotor_inertia[j] * arm.qd[j] * arm.qd[j]).sum();
                    links + rotors
                };
                let first = energy(&arm);
                let mut highest = first;
                for ms in 0..1_000 {
                    arm.step(&[0.0; JOINTS], TICK);
                    highest = highest.max(energy(&arm));
                    for j in 0..JOINTS {
                        assert!((arm.q[j] - POSE[j]).abs() < 0.3, "{name}: {:?} after {ms} ms", arm.q);
                    }
                }
                // Without damping, the energy of the bouncing arm is constant. The tolerance of 3 % is for the light
                // arm, whose simulated energy changes slightly at the surfaces of its walls.
                assert!(highest < 1.03 * first, "{name}, {stiffness}, {damping}: {highest} J of {first} J");
            }
        }
    }
}

/// A flange rests on a table. The joint torques of the wall must correspond to the force of the wall. The test checks
/// this by virtual work, with positions only.
#[test]
fn the_force_of_a_plane_acts_through_the_flange() {
    for (name, parts) in arms() {
        let normal = [0.2, -0.3, 0.9];
        let length = f64::sqrt(0.04 + 0.09 + 0.81);
        let position = flange(&parts, &POSE);
        let mut arm = Arm::new(bare(parts.clone()), [0.0; JOINTS], POSE);
        let (stiffness, depth) = (50_000.0, 0.002);
        let inside = |x: [f64; 3]| -> [f64; 3] { std::array::from_fn(|i| x[i] + depth * normal[i] / length) };
        arm.set_walls(&[Wall::Plane { position, normal, stiffness, damping: 0.0 }]);
        assert_eq!(arm.wall_torque(), [0.0; JOINTS], "{name}: at the surface");
        // To place the arm inside the wall, the test creates an equal wall outside the arm, and then moves the arm into
        // this wall.
        let mut before = POSE;
        let away = |q: &[f64; JOINTS]| -> f64 {
            (0..3).map(|i| (flange(&parts, q)[i] - inside(position)[i]) * normal[i] / length).sum()
        };
        let gradient = |q: &[f64; JOINTS]| -> [f64; JOINTS] {
            std::array::from_fn(|j| {
                let (mut low, mut high) = (*q, *q);
                (low[j], high[j]) = (q[j] - 1e-6, q[j] + 1e-6);
                (away(&high) - away(&low)) / 2e-6
            })
        };
        for _ in 0..20 {
            let g = gradient(&before);
            let square: f64 = g.iter().map(|g| g * g).sum();
            let far = away(&before) - 1e-9;
            before.iter_mut().zip(g).for_each(|(q, g)| *q -= far * g / square);
        }
        arm.q = before;
        arm.set_walls(&[Wall::Plane { position: inside(position), normal, stiffness, damping: 0.0 }]);
        arm.q = POSE;
        let torque = arm.wall_torque();
        for (j, g) in gradient(&POSE).into_iter().enumerate() {
            let expected = g * stiffness * depth;
            assert!(
                (torque[j] - expected).abs() < 2e-4 * stiffness * depth,
                "{name}: {} {expected}",
                torque[j]
            );
        }
    }
}

/// An arm that falls onto a table must come to rest on the table. The depth in the table must be the contact force
/// divided by the stiffness.
#[test]
fn an_arm_that_leans_on_a_table_is_as_deep_as_force_over_stiffness() {
    for (name, parts) in arms() {
        let parts = bare(parts);
        let start = flange(&parts, &POSE);
        let position = [0.0, 0.0, start[2] - 0.01];
        let stiffness = 20_000.0;
        let mut arm = Arm::new(parts.clone(), [0.0; JOINTS], POSE);
        arm.set_walls(&[Wall::Plane { position, normal: [0.0, 0.0, 2.0], stiffness, damping: 300.0 }]);
        // The drives compensate all gravity except the weight of 5 kg at the flange, and add some damping.
        let load = Payload { mass: 5.0, ..Payload::NONE };
        let held = Dynamics::new(&parts.model, GRAVITY);
        arm.set_carried(&[load]);
        for _ in 0..6_000 {
            let torque = held.gravity_torque(&arm.q);
            let tau = std::array::from_fn(|j| torque[j] - 20.0 * arm.qd[j]);
            arm.step(&tau, TICK);
        }
        let depth = position[2] - flange(&parts, &arm.q)[2];
        let expected = 5.0 * 9.81 / stiffness;
        assert!((depth - expected).abs() < 0.02 * expected, "{name}: {depth} m of {expected} m");
    }
}

/// If a wall is created inside the arm, its surface must begin at the arm, and the wall must not push the arm away.
#[test]
fn a_wall_that_begins_inside_the_arm_throws_nothing() {
    let mut arm = Arm::new(SimArm { gravity: [0.0; 3], ..bare(SimArm::default()) }, [0.0; JOINTS], POSE);
    let wall = joint_wall(0, -1.0, Side::Above, 20_000.0, 0.0);
    arm.set_walls(&[wall]);
    (0..100).for_each(|_| arm.step(&[0.0; JOINTS], TICK));
    assert_eq!(arm.q, POSE);
    // The surface follows the arm when the arm moves away. When the arm returns, it touches the wall at the point at
    // which the arm changed its direction.
    arm.qd[0] = -0.5;
    (0..200).for_each(|_| arm.step(&[0.0; JOINTS], TICK));
    let turned = arm.q[0];
    arm.qd[0] = 0.5;
    let mut furthest = f64::MIN;
    for _ in 0..300 {
        arm.step(&[0.0; JOINTS], TICK);
        furthest = furthest.max(arm.q[0]);
    }
    assert!(furthest > turned && furthest < turned + 0.02, "{turned} {furthest}");
    // If the test sets an identical wall again, the state must not change.
    let before = arm.clone();
    arm.set_walls(&[wall]);
    assert_eq!((arm.wall_torque(), arm.q), (before.wall_torque(), before.q));
}

/// A wall that the arm does not reach, rigid gears and a load that was dropped must not change any bit of the result.
#[test]
fn what_is_not_there_changes_no_bit() {
    let mut plain = Arm::new(SimArm::default(), [1.0; JOINTS], POSE);
    let mut other =
        Arm::new(SimArm { gears: [Gear::RIGID; JOINTS], ..SimArm::default() }, [1.0; JOINTS], POSE);
    other.set_carried(&[Payload { mass: 3.0, com: [0.0, 0.0, 0.1], ..Payload::NONE }]);
    other.set_carried(&[]);
    let far =
        Wall::Plane { position: [0.0, 0.0, -9.0], normal: [0.0, 0.0, 1.0], stiffness: 1e6, damping: 1e4 };
    other.set_walls(&[far, joint_wall(3, 6.0, Side::Above, 1e5, 1e3)]);
    for ms in 0..3_000 {
        let tau = std::array::from_fn(|j| 30.0 * f64::sin(0.01 * f64::from(ms) + j as f64));
        plain.step(&tau, TICK);
        other.step(&tau, TICK);
        assert_eq!(plain.q.map(f64::to_bits), other.q.map(f64::to_bits), "{ms} ms");
        assert_eq!(plain.qd.map(f64::to_bits), other.qd.map(f64::to_bits), "{ms} ms");
        assert_eq!(plain.q, other.motor, "{ms} ms");
    }
}

/// Returns the gravity torque of an arm at rest, computed from the acceleration of its fall.
fn gravity_torque(arm: &Arm, parts: &SimArm, load: &Payload) -> [f64; JOINTS] {
    let mut falling = arm.clone();
    let dt = 1e-7;
    falling.step(&[0.0; JOINTS], dt);
    let m = Dynamics::with_payload(&parts.model, parts.gravity, load).mass_matrix(&arm.q);
    std::array::from_fn(|j| {
        let links: f64 = (0..JOINTS).map(|k| m[j][k] * falling.qd[k] / dt).sum();
        -(links + parts.rotor_inertia[j] * falling.qd[j] / dt)
    })
}

proptest! {
    /// When the arm picks up or drops a load, the gravity torque must change by the torque of the load's weight. The
    /// test computes the expected torque by virtual work from the height of the load's centre.
    #[test]
    fn a_dropped_load_changes_the_gravity_torque_by_its_weight(
        q in prop::array::uniform6(-1.4..1.4f64),
        mass in 0.1..8.0f64,
        com in prop::array::uniform3(-0.2..0.2f64),
        own in 0.0..3.0f64,
    ) {
        let payload = Payload { mass: own, com: [0.02, 0.0, 0.05], ..Payload::NONE };
        let parts = SimArm { payload, ..bare(SimArm::default()) };
        let mut arm = Arm::new(parts.clone(), [0.0; JOINTS], q);
        let without = gravity_torque(&arm, &parts, &payload);
        let load = Payload { mass, com, ..Payload::NONE };
        arm.set_carried(&[load]);
        let together = own + mass;
        let both: [f64; 3] = std::array::from_fn(|i| (own * payload.com[i] + mass * com[i]) / together);
        let apart: [f64; 3] = std::array::from_fn(|i| com[i] - payload.com[i]);
        let reduced = own * mass / together;
        let [x, y, z] = apart;
        let inertia =
            [y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y].map(|i| reduced * i);
        let with = gravity_torque(&arm, &parts, &Payload { mass: together, com: both, inertia });
        let dynamics = Dynamics::new(&parts.model, GRAVITY);
        let height = |q: &[f64; JOINTS]| {
            let flange = dynamics.forward_kinematics(q)[JOINTS];
            flange.position[2] + (0..3).map(|i| flange.rotation[2][i] * com[i]).sum::<f64>()
        };
        for j in 0..JOINTS {
            let (mut low, mut high) = (q, q);
            (low[j], high[j]) = (q[j] - 1e-6, q[j] + 1e-6);
            let expected = mass * 9.81 * (height(&high) - height(&low)) / 2e-6;
            prop_assert!((with[j] - without[j] - expected).abs() < 1e-3, "{} {expected}", with[j] - without[j]);
        }
        arm.set_carried(&[]);
        prop_assert_eq!(gravity_torque(&arm, &parts, &payload), without);
    }

    /// For any motion of the arm into or out of a wall, the wall must not pull. The force must be along the normal or
    /// 0.
    #[test]
    fn a_wall_never_pulls(
        q in prop::array::uniform6(-1.4..1.4f64),
        qd in prop::array::uniform6(-3.0..3.0f64),
        stiffness in 1.0..1e6f64,
        damping in 0.0..1e4f64,
        depth in -0.02..0.02f64,
    ) {
        let parts = bare(SimArm::default());
        let start = flange(&parts, &q);
        // The test creates the wall at a clear distance from the arm, so that the surface is at its configured
        // position.
        let mut arm = Arm::new(parts.clone(), [0.0; JOINTS], q);
        let wall = |z: f64| Wall::Plane {
            position: [start[0] + z, 0.0, 0.0], normal: [-1.0, 0.0, 0.0], stiffness, damping,
        };
        arm.set_walls(&[wall(-depth)]);
        (arm.q, arm.qd) = (q, qd);
        let torque = arm.wall_torque();
        let gradient: [f64; JOINTS] = std::array::from_fn(|j| {
            let (mut low, mut high) = (q, q);
            (low[j], high[j]) = (q[j] - 1e-6, q[j] + 1e-6);
            -(flange(&parts, &high)[0] - flange(&parts, &low)[0]) / 2e-6
        });
        let square: f64 = gradient.iter().map(|g| g * g).sum();
        prop_assume!(square > 1e-3);
        let force: f64 = torque.iter().zip(&gradient).map(|(t, g)| t * g).sum::<f64>() / square;
        prop_assert!(force >= -1e-9 * stiffness, "{force} N");
        let mut joint = Arm::new(parts, [0.0; JOINTS], q);
        joint.set_walls(&[joint_wall(2, q[2] + 0.01, Side::Above, stiffness, damping)]);
        (joint.q[2], joint.qd) = (q[2] + 0.01 + depth, qd);
        let torque = joint.wall_torque();
        prop_assert!(torque[2] <= 0.0 && (depth > 0.0 || torque[2] == 0.0));
        prop_assert!([0, 1, 3, 4, 5].iter().all(|&j| torque[j] == 0.0));
    }
}
