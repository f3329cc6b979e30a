//! Properties that are true for every arm (J-40), and known values of the default arm.
use crate::arms;

use std::f64::consts::FRAC_PI_2;

use jtc_dynamics::{ArmModel, Dynamics, JOINTS, JointVec, Origin};
use proptest::prelude::*;

type Mat3 = [[f64; 3]; 3];
const NONE: JointVec = [0.0; JOINTS];
const DOWN: [f64; 3] = [0.0, 0.0, -9.81];

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |a, v| a.max(v.abs()))
}

fn close(a: &[f64], b: &[f64], scale: f64, limit: f64) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= limit * scale)
}

fn times(m: &[JointVec; JOINTS], x: &JointVec) -> JointVec {
    m.map(|row| row.iter().zip(x).map(|(a, b)| a * b).sum())
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn product(a: &Mat3, b: &Mat3) -> Mat3 {
    core::array::from_fn(|i| core::array::from_fn(|k| (0..3).map(|j| a[i][j] * b[j][k]).sum()))
}

fn apply(a: &Mat3, v: [f64; 3]) -> [f64; 3] {
    a.map(|row| dot(row, v))
}

/// Returns Rx, Ry or Rz, computed element by element.
fn about(axis: usize, angle: f64) -> Mat3 {
    let (s, c) = angle.sin_cos();
    match axis {
        0 => [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]],
        1 => [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]],
        _ => [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]],
    }
}

fn rotation(o: &Origin) -> Mat3 {
    product(&about(2, o.rpy[2]), &product(&about(1, o.rpy[1]), &about(0, o.rpy[0])))
}

/// Returns the angle that the crate uses for an angle of a joint origin. An angle within 2 µrad of a multiple of a right angle is replaced
/// by that multiple.
fn squared(angle: f64) -> f64 {
    let quarters = (angle / FRAC_PI_2).round() * FRAC_PI_2;
    if (angle - quarters).abs() <= 2e-6 { quarters } else { angle }
}

/// Computes the frames of the links directly from the definition Trans·Rz(yaw)·Ry(pitch)·Rx(roll)·Rz(q).
fn frames(model: &ArmModel, q: &JointVec) -> Vec<(Mat3, [f64; 3])> {
    let mut at = (about(0, 0.0), [0.0; 3]);
    let mut all = Vec::new();
    for (k, joint) in model.joints.iter().enumerate() {
        let step = apply(&at.0, joint.xyz);
        at.1 = core::array::from_fn(|i| at.1[i] + step[i]);
        let origin = Origin { rpy: joint.rpy.map(squared), ..*joint };
        at.0 = product(&product(&at.0, &rotation(&origin)), &about(2, q.get(k).copied().unwrap_or(0.0)));
        all.push(at);
    }
    all
}

/// Computes the mass matrix and the gravity torque only from the energies, with Jacobians of the centres of mass in the base frame.
fn by_energy(model: &ArmModel, gravity: [f64; 3], q: &JointVec) -> ([JointVec; JOINTS], JointVec) {
    let frames = frames(model, q);
    let (mut mass, mut torque) = ([NONE; JOINTS], NONE);
    for (k, link) in model.links[1..].iter().enumerate() {
        let (r, o) = &frames[k];
        let com = apply(r, link.origin.xyz);
        let com: [f64; 3] = core::array::from_fn(|i| o[i] + com[i]);
        let turn = product(r, &rotation(&link.origin));
        let [xx, xy, xz, yy, yz, zz] = link.inertia;
        let inertia = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
        let axis = |j: usize| frames[j].0.map(|row| row[2]);
        let linear = |j: usize| cross(axis(j), core::array::from_fn(|i| com[i] - frames[j].1[i]));
        let seen =
            |j: usize| core::array::from_fn::<f64, 3, _>(|i| (0..3).map(|n| turn[n][i] * axis(j)[n]).sum());
        for a in 0..=k {
            torque[a] -= link.mass * dot(linear(a), gravity);
            for b in 0..=k {
                mass[a][b] += link.mass * dot(linear(a), linear(b)) + dot(seen(a), apply(&inertia, seen(b)));
            }
        }
    }
    (mass, torque)
}

/// Returns `true` if a Cholesky factorisation shows that the matrix is positive definite.
fn positive_definite(m: &[JointVec; JOINTS]) -> bool {
    let mut l = [NONE; JOINTS];
    for i in 0..JOINTS {
        for j in 0..=i {
            let rest = m[i][j] - (0..j).map(|k| l[i][k] * l[j][k]).sum::<f64>();
            if i == j && rest <= 0.0 {
                return false;
            }
            l[i][j] = if i == j { rest.sqrt() } else { rest / l[j][j] };
        }
    }
    true
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn j40_kinematics_follow_the_rule_as_it_stands(model in arms::model(), q in arms::vector(3.2)) {
        let poses = Dynamics::new(&model, DOWN).forward_kinematics(&q);
        for (pose, (rotation, position)) in poses.iter().zip(frames(&model, &q)) {
            prop_assert!(close(pose.rotation.as_flattened(), rotation.as_flattened(), 1.0, 1e-14));
            prop_assert!(close(&pose.position, &position, 1.0, 1e-14));
        }
    }

    #[test]
    fn j40_mass_matrix_and_gravity_are_those_of_the_energies(
        model in arms::model(), q in arms::vector(3.2), gravity in prop::array::uniform3(-10.0..10.0f64)
    ) {
        let d = Dynamics::new(&model, gravity);
        let (mass, torque) = by_energy(&model, gravity, &q);
        let got = d.mass_matrix(&q);
        prop_assert!(close(got.as_flattened(), mass.as_flattened(), largest(mass.as_flattened()), 1e-12));
        prop_assert!(close(&d.gravity_torque(&q), &torque, largest(&torque).max(1.0), 1e-12));
    }

    #[test]
    fn j40_mass_matrix_is_symmetric_and_positive_definite(model in arms::model(), q in arms::vector(3.2)) {
        let m = Dynamics::new(&model, DOWN).mass_matrix(&q);
        for i in 0..JOINTS {
            for k in 0..JOINTS {
                prop_assert_eq!(m[i][k].to_bits(), m[k][i].to_bits());
            }
        }
        prop_assert!(positive_definite(&m));
    }

    #[test]
    fn j40_inverse_is_mass_times_acceleration_plus_bias(
        model in arms::model(), q in arms::vector(3.2), qd in arms::vector(3.0), qdd in arms::vector(20.0)
    ) {
        let d = Dynamics::new(&model, DOWN);
        let (whole, bias) = (d.inverse(&q, &qd, &qdd), d.inverse(&q, &qd, &NONE));
        let inertial = times(&d.mass_matrix(&q), &qdd);
        let sum: JointVec = core::array::from_fn(|k| inertial[k] + bias[k]);
        prop_assert!(close(&whole, &sum, largest(&whole).max(largest(&inertial)), 1e-12));
        prop_assert!(close(&d.inverse(&q, &NONE, &NONE), &d.gravity_torque(&q), largest(&whole).max(1.0), 1e-13));
    }

    /// The velocity torques must be a quadratic function of the velocities: twice the velocities cause four times the torques.
    #[test]
    fn j40_velocity_torque_is_quadratic(model in arms::model(), q in arms::vector(3.2), qd in arms::vector(3.0)) {
        let d = Dynamics::new(&model, [0.0; 3]);
        let (one, two) = (d.inverse(&q, &qd, &NONE), d.inverse(&q, &qd.map(|v| 2.0 * v), &NONE));
        prop_assert!(close(&two, &one.map(|t| 4.0 * t), largest(&two), 1e-13));
    }

    /// The power of the velocity torques must be ½·qdᵀ·Ṁ·qd, in which Ṁ is the time derivative of the mass matrix.
    #[test]
    fn j40_power_is_the_change_of_the_kinetic_energy(
        model in arms::model(), q in arms::vector(3.2), qd in arms::vector(2.0)
    ) {
        let d = Dynamics::new(&model, [0.0; 3]);
        let power: f64 = d.inverse(&q, &qd, &NONE).iter().zip(&qd).map(|(t, v)| t * v).sum();
        let h = 1e-5;
        let energy = |s: f64| {
            let at = core::array::from_fn(|k| q[k] + s * qd[k]);
            0.5 * times(&d.mass_matrix(&at), &qd).iter().zip(&qd).map(|(p, v)| p * v).sum::<f64>()
        };
        let change = (8.0 * (energy(h) - energy(-h)) - (energy(2.0 * h) - energy(-2.0 * h))) / (12.0 * h);
        prop_assert!((power - change).abs() <= 1e-7 * (energy(0.0) + power.abs()).max(1.0), "{power} {change}");
    }

    #[test]
    fn j40_forward_undoes_inverse(
        model in arms::model(), q in arms::vector(3.2), qd in arms::vector(3.0), qdd in arms::vector(20.0),
        rotor in prop::array::uniform6(0.0..1.0f64)
    ) {
        let d = Dynamics::new(&model, DOWN);
        let mut torque = d.inverse(&q, &qd, &qdd);
        torque.iter_mut().zip(rotor).zip(qdd).for_each(|((t, r), a)| *t += r * a);
        let back = d.forward(&q, &qd, &torque, &rotor);
        let again: JointVec = {
            let mut t = d.inverse(&q, &qd, &back);
            t.iter_mut().zip(rotor).zip(back).for_each(|((t, r), a)| *t += r * a);
            t
        };
        // The test compares torques instead of accelerations, because in an almost massless wrist a rounding error can cause a large
        // acceleration.
        prop_assert!(close(&again, &torque, largest(&torque), 1e-10));
    }

    #[test]
    fn j40_base_link_and_flange_cost_no_torque(
        model in arms::model(), other in arms::model(), q in arms::vector(3.2), qd in arms::vector(3.0)
    ) {
        let mut changed = model;
        changed.links[0] = other.links[0];
        changed.joints[6] = other.joints[6];
        let [a, b] = [model, changed].map(|m| Dynamics::new(&m, DOWN).inverse(&q, &qd, &qd));
        prop_assert_eq!(a.map(f64::to_bits), b.map(f64::to_bits));
    }

    #[test]
    fn j07_no_number_makes_it_panic(bits in prop::collection::vec(any::<u64>(), 133 + 24)) {
        let mut values = bits.into_iter().map(f64::from_bits);
        let mut model = ArmModel::default();
        let mut six = || -> JointVec { core::array::from_fn(|_| values.next().unwrap_or(0.0)) };
        for joint in &mut model.joints {
            let [x, y, z, roll, pitch, yaw] = six();
            *joint = Origin { xyz: [x, y, z], rpy: [roll, pitch, yaw] };
        }
        for link in &mut model.links {
            link.inertia = six();
            link.mass = six()[0];
        }
        let d = Dynamics::new(&model, DOWN);
        let (q, qd) = (six(), six());
        let _ = (model.check(), d.inverse(&q, &qd, &qd), d.forward(&q, &qd, &qd, &qd), d.forward_kinematics(&q));
    }
}

/// Compares the gravity torque of the default arm with values from another program. In that program the arm hangs, so
/// gravity has the opposite direction. The origin of joint 4 is also shifted by 10 mm along the z axis of link 3.
#[test]
fn j40_gravity_torque_of_the_default_arm_hanging() {
    let mut model = arms::avena();
    model.joints[3].xyz[2] = 0.005;
    let d = Dynamics::new(&model, [0.0, 0.0, 9.81]);
    let known = [
        (NONE, NONE),
        ([0.0, FRAC_PI_2, 0.0, 0.0, 0.0, 0.0], [0.0, 131.564, -47.093, 2.543, -0.405, 0.0]),
        ([1.0, 0.5, -0.5, 0.3, 0.2, 0.1], [0.0, 80.414, -39.916, 2.429, -0.383, 0.0]),
    ];
    for (q, torque) in known {
        assert!(close(&d.gravity_torque(&q), &torque, 1.0, 6e-4), "{q:?}: {:?}", d.gravity_torque(&q));
    }
}

/// The torque that holds a mass must be the derivative of its potential energy. The test computes this energy from the heights in forward
/// kinematics.
#[test]
fn j25_the_flange_torque_is_the_slope_of_the_potential_energy() {
    let gravity = [1.3, -0.7, -9.81];
    let mut random = random_from(7);
    for _ in 0..50 {
        let dynamics = Dynamics::new(&arms::avena(), gravity);
        let q: JointVec = core::array::from_fn(|_| 6.0 * random() - 3.0);
        let energy = |q: &JointVec| -dot(gravity, dynamics.forward_kinematics(q)[6].position);
        let torque = dynamics.flange_torque(&q);
        for j in 0..JOINTS {
            let (mut above, mut below) = (q, q);
            (above[j], below[j]) = (q[j] + 1e-5, q[j] - 1e-5);
            let slope = (energy(&above) - energy(&below)) / 2e-5;
            assert!((torque[j] - slope).abs() < 1e-7, "joint {}: {} {slope}", j + 1, torque[j]);
        }
    }
}

/// The felt inertia must match the mass matrix of all joints. The flange speed must match the distance between two
/// positions within a short time.
#[test]
fn j25_inertia_of_a_joint_and_speed_of_the_flange() {
    let mut random = random_from(11);
    for model in [arms::avena(), ArmModel { joints: core::array::from_fn(skew), ..arms::avena() }] {
        let dynamics = Dynamics::new(&model, DOWN);
        for _ in 0..50 {
            let q: JointVec = core::array::from_fn(|_| 6.0 * random() - 3.0);
            let qd: JointVec = core::array::from_fn(|_| 3.0 * random() - 1.5);
            let rotor: JointVec = core::array::from_fn(|_| random());
            let felt = dynamics.felt_inertia(&q, &rotor);
            for j in 0..JOINTS {
                let one = dynamics.felt_inertia_of(&q, &rotor, j);
                assert!((one - felt[j]).abs() < 1e-12 * felt[j], "joint {}", j + 1);
            }
            let at = |t: f64| {
                let q = core::array::from_fn(|j| q[j] + t * qd[j]);
                dynamics.forward_kinematics(&q)[6].position
            };
            let (after, before) = (at(1e-6), at(-1e-6));
            let way: [f64; 3] = core::array::from_fn(|i| (after[i] - before[i]) / 2e-6);
            let speed = dynamics.flange_speed(&q, &qd);
            assert!((speed - dot(way, way).sqrt()).abs() < 1e-7, "{speed} m/s, {way:?}");
        }
    }
}

/// Returns the origin of a joint whose axis is neither parallel to another axis nor meets one.
fn skew(k: usize) -> Origin {
    let k = k as f64;
    Origin { xyz: [0.1 + 0.02 * k, 0.2 - 0.03 * k, 0.1 * k], rpy: [0.3 + 0.2 * k, -0.4, 0.5 * k] }
}

/// Returns a generator of random numbers from 0 to 1 with the given seed.
fn random_from(mut seed: u64) -> impl FnMut() -> f64 {
    move || {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (seed >> 11) as f64 / (1u64 << 53) as f64
    }
}

#[test]
fn j40_rpy_turns_about_fixed_axes_x_then_y_then_z() {
    let mut model = ArmModel::default();
    model.joints[0].rpy = [0.3, -0.5, 0.9];
    let pose = Dynamics::new(&model, DOWN).forward_kinematics(&NONE)[6];
    let wanted = product(&about(2, 0.9), &product(&about(1, -0.5), &about(0, 0.3)));
    assert!(close(pose.rotation.as_flattened(), wanted.as_flattened(), 1.0, 1e-15));
}

/// Angles of π/2 and π with six digits, or rounded to f32, must be treated as the exact angles. An angle with a
/// larger difference must not change.
#[test]
fn j06_j40_angles_next_to_a_right_angle_are_right_angles() {
    let poses = |rpy: [f64; 3]| {
        let mut model = arms::avena();
        (model.joints[2].rpy, model.joints[4].rpy) = (rpy, rpy);
        let d = Dynamics::new(&model, DOWN);
        let q = [0.3, -0.4, 0.5, -0.6, 0.7, -0.8];
        (d.forward_kinematics(&q), d.inverse(&q, &[1.0; JOINTS], &[2.0; JOINTS]).map(f64::to_bits))
    };
    for quarters in [-4.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0] {
        let right = quarters * FRAC_PI_2;
        for near in [right + 1.9e-6, right - 1.9e-6, f64::from(right as f32)] {
            assert!(poses([right; 3]) == poses([near; 3]), "{near}");
        }
        for far in [right + 2.1e-6, right - 2.1e-6] {
            assert_ne!(poses([right; 3]), poses([far; 3]), "{far}");
        }
    }
}

#[test]
fn j40_the_flange_is_placed_by_the_seventh_joint() {
    let model = arms::avena();
    let poses = Dynamics::new(&model, DOWN).forward_kinematics(&[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]);
    let along: [f64; 3] = core::array::from_fn(|i| poses[5].position[i] + 0.0181 * poses[5].rotation[i][2]);
    assert!(close(&poses[6].position, &along, 1.0, 1e-15));
}

/// With rotor inertias, the energy of the arm must stay constant during a free fall of one second (RK4 at 1 ms).
#[test]
fn j40_free_fall_keeps_the_energy() {
    let model = arms::avena();
    let d = Dynamics::new(&model, DOWN);
    let rotor = [0.7; JOINTS];
    let energy = |q: &JointVec, qd: &JointVec| {
        let kinetic = times(&d.mass_matrix(q), qd).iter().zip(qd).map(|(p, v)| 0.5 * p * v).sum::<f64>()
            + qd.iter().map(|v| 0.5 * 0.7 * v * v).sum::<f64>();
        let potential: f64 = frames(&model, q)
            .iter()
            .zip(&model.links[1..])
            .map(|((r, o), l)| 9.81 * l.mass * (o[2] + apply(r, l.origin.xyz)[2]))
            .sum();
        kinetic + potential
    };
    let (mut q, mut qd) = ([0.4, 0.7, -0.6, 0.3, 0.9, -0.2], NONE);
    let begin = energy(&q, &qd);
    let h = 1e-3;
    for _ in 0..1000 {
        let rate = |q: &JointVec, qd: &JointVec| (*qd, d.forward(q, qd, &NONE, &rotor));
        let step =
            |x: &JointVec, k: &JointVec, s: f64| -> JointVec { core::array::from_fn(|i| x[i] + s * k[i]) };
        let a = rate(&q, &qd);
        let b = rate(&step(&q, &a.0, h / 2.0), &step(&qd, &a.1, h / 2.0));
        let c = rate(&step(&q, &b.0, h / 2.0), &step(&qd, &b.1, h / 2.0));
        let e = rate(&step(&q, &c.0, h), &step(&qd, &c.1, h));
        for i in 0..JOINTS {
            q[i] += h / 6.0 * (a.0[i] + 2.0 * b.0[i] + 2.0 * c.0[i] + e.0[i]);
            qd[i] += h / 6.0 * (a.1[i] + 2.0 * b.1[i] + 2.0 * c.1[i] + e.1[i]);
        }
    }
    let drift = energy(&q, &qd) - begin;
    assert!(largest(&qd) > 1.0, "it fell: {qd:?}");
    assert!(drift.abs() < 1e-6, "{drift} J of {begin} J");
}

#[test]
fn j40_a_joint_without_inertia_stays_finite() {
    let mut model = arms::avena();
    model.links[6] = Default::default();
    model.links[5].inertia = [0.0; 6];
    let d = Dynamics::new(&model, DOWN);
    let q = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6];
    let qdd = d.forward(&q, &NONE, &[1.0; JOINTS], &NONE);
    assert!(qdd.iter().all(|a| a.is_finite()), "{qdd:?}");
    assert_eq!(Dynamics::new(&ArmModel::default(), DOWN).forward(&q, &NONE, &[1.0; JOINTS], &NONE), NONE);
}

proptest! {
    /// The felt inertia is the largest inertia that can be subtracted from the joint in the mass matrix. If more is
    /// subtracted, the kinetic energy of some motion becomes zero or negative.
    #[test]
    fn j71_the_inertia_that_a_joint_feels_is_all_that_can_be_taken_from_it(
        model in arms::model(),
        q in arms::vector(3.2),
        rotor in prop::array::uniform6(0.01..2.0f64),
    ) {
        let dynamics = Dynamics::new(&model, DOWN);
        let felt = dynamics.felt_inertia(&q, &rotor);
        for j in 0..JOINTS {
            let mut mass = dynamics.mass_matrix(&q);
            (0..JOINTS).for_each(|k| mass[k][k] += rotor[k]);
            prop_assert!(felt[j] >= rotor[j] * (1.0 - 1e-9) && felt[j] <= mass[j][j] * (1.0 + 1e-9));
            let without = |share: f64| {
                let mut rest = mass;
                rest[j][j] -= share * felt[j];
                positive_definite(&rest)
            };
            prop_assert!(without(1.0 - 1e-6) && !without(1.0 + 1e-6), "joint {}: {} kg·m²", j + 1, felt[j]);
        }
    }
}
