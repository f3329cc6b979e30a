//! Tests of a payload at the flange (J-60): comparison with the same body as a link, comparison with energies, and rejection of impossible
//! bodies.
use crate::arms;

use std::f64::consts::FRAC_PI_2;

use jtc_dynamics::{ArmModel, Dynamics, JOINTS, JointVec, Link, Origin, Payload, PayloadError};
use proptest::prelude::*;

const DOWN: [f64; 3] = [0.0, 0.0, -9.81];

/// Generates random payloads that consist of point masses. Point masses can represent any rigid body.
fn payload() -> impl Strategy<Value = Payload> {
    let point = (0.01..2.0f64, prop::array::uniform3(-0.3..0.3f64));
    prop::collection::vec(point, 1..6).prop_map(|points| of_points(&points))
}

/// Computes the mass, the centre of mass and the inertia about the centre of mass from their definitions.
fn of_points(points: &[(f64, [f64; 3])]) -> Payload {
    let mass: f64 = points.iter().map(|(m, _)| m).sum();
    let com = std::array::from_fn(|i| points.iter().map(|(m, p)| m * p[i]).sum::<f64>() / mass);
    let second = |i: usize, k: usize| -> f64 {
        points.iter().map(|(m, p)| m * (p[i] - com[i]) * (p[k] - com[k])).sum()
    };
    let (x, y, z) = (second(0, 0), second(1, 1), second(2, 2));
    Payload { mass, com, inertia: [y + z, -second(0, 1), -second(0, 2), x + z, -second(1, 2), x + y] }
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(1.0, |a, v| a.max(v.abs()))
}

fn close(a: &[f64], b: &[f64]) -> bool {
    let scale = largest(a).max(largest(b));
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-11 * scale)
}

/// Transforms a point from the flange frame into the base frame by forward kinematics.
fn point(dynamics: &Dynamics, q: &JointVec, p: [f64; 3]) -> [f64; 3] {
    let flange = dynamics.forward_kinematics(q)[6];
    std::array::from_fn(|i| flange.position[i] + (0..3).map(|k| flange.rotation[i][k] * p[k]).sum::<f64>())
}

/// Returns an arm with the same joints whose last link is the payload alone. The other links have no mass.
fn alone(model: &ArmModel, payload: &Payload) -> ArmModel {
    let square = |angle: f64| {
        let quarters = (angle / FRAC_PI_2).round() * FRAC_PI_2;
        if (angle - quarters).abs() <= 2e-6 { quarters } else { angle }
    };
    let Origin { xyz, rpy } = model.joints[6];
    let rpy = rpy.map(square);
    let ((sr, cr), (sp, cp), (sy, cy)) = (rpy[0].sin_cos(), rpy[1].sin_cos(), rpy[2].sin_cos());
    let rotation = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ];
    let com = std::array::from_fn(|i| xyz[i] + (0..3).map(|k| rotation[i][k] * payload.com[k]).sum::<f64>());
    let mut links = [Link::default(); 7];
    links[6] = Link { origin: Origin { xyz: com, rpy }, inertia: payload.inertia, mass: payload.mass };
    ArmModel { links, ..*model }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Torques are linear in the masses of the bodies. The total torque must be the torque of the arm plus the torque of the payload on an
    /// arm without mass.
    #[test]
    fn j60_a_payload_adds_the_torques_of_a_link_that_it_would_be(
        model in arms::model(), payload in payload(), gravity in prop::array::uniform3(-10.0..10.0f64),
        q in arms::vector(3.2), qd in arms::vector(3.0), qdd in arms::vector(10.0),
    ) {
        prop_assert_eq!(payload.check(), Ok(()));
        let (arm, body) = (Dynamics::new(&model, gravity), Dynamics::new(&alone(&model, &payload), gravity));
        let both = Dynamics::with_payload(&model, gravity, &payload);
        let sum = |a: JointVec, b: JointVec| -> JointVec { std::array::from_fn(|j| a[j] + b[j]) };
        prop_assert!(close(&both.inverse(&q, &qd, &qdd), &sum(arm.inverse(&q, &qd, &qdd), body.inverse(&q, &qd, &qdd))));
        prop_assert!(close(&both.gravity_torque(&q), &sum(arm.gravity_torque(&q), body.gravity_torque(&q))));
        let (a, b) = (arm.mass_matrix(&q), body.mass_matrix(&q));
        let masses: Vec<f64> = a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| a + b).collect();
        prop_assert!(close(both.mass_matrix(&q).as_flattened(), &masses));
        prop_assert_eq!(both.flange_torque(&q), arm.flange_torque(&q));
    }

    /// The test computes the potential and kinetic energy of the points of the payload, and differentiates the energies numerically.
    #[test]
    fn j60_a_payload_adds_the_energies_of_its_points(
        model in arms::model(), points in prop::collection::vec((0.01..2.0f64, prop::array::uniform3(-0.3..0.3f64)), 1..5),
        q in arms::vector(3.2), qd in arms::vector(1.0),
    ) {
        const STEP: f64 = 1e-5;
        let payload = of_points(&points);
        let (arm, both) = (Dynamics::new(&model, DOWN), Dynamics::with_payload(&model, DOWN, &payload));
        let along = |t: f64, way: &JointVec| -> JointVec { std::array::from_fn(|j| q[j] + t * way[j]) };
        let height = |at: &JointVec| -> f64 { points.iter().map(|&(m, p)| m * point(&arm, at, p)[2]).sum() };
        for j in 0..JOINTS {
            let mut unit = [0.0; JOINTS];
            unit[j] = 1.0;
            let slope = (height(&along(STEP, &unit)) - height(&along(-STEP, &unit))) / (2.0 * STEP);
            let torque = both.gravity_torque(&q)[j] - arm.gravity_torque(&q)[j];
            prop_assert!((torque - 9.81 * slope).abs() < 1e-6, "joint {}: {torque} {}", j + 1, 9.81 * slope);
        }
        let kinetic: f64 = points.iter().map(|&(m, p)| {
            let (a, b) = (point(&arm, &along(STEP, &qd), p), point(&arm, &along(-STEP, &qd), p));
            (0..3).map(|i| 0.5 * m * ((a[i] - b[i]) / (2.0 * STEP)).powi(2)).sum::<f64>()
        }).sum();
        let half = |d: &Dynamics| -> f64 {
            let m = d.mass_matrix(&q);
            (0..JOINTS).map(|i| (0..JOINTS).map(|k| 0.5 * qd[i] * m[i][k] * qd[k]).sum::<f64>()).sum()
        };
        prop_assert!((half(&both) - half(&arm) - kinetic).abs() < 1e-6 * kinetic.max(1.0), "{kinetic} J");
    }

    /// The interpolation between an arm with one payload and the same arm with another payload must equal the arm with the interpolated
    /// payload.
    #[test]
    fn j60_the_way_between_two_payloads_is_straight(
        model in arms::model(), a in payload(), b in payload(), share in 0.0..=1.0f64,
        q in arms::vector(3.2), qd in arms::vector(3.0), qdd in arms::vector(10.0),
    ) {
        let [from, to] = [a, b].map(|payload| Dynamics::with_payload(&model, DOWN, &payload));
        let mut between = from.clone();
        between.set_inertias(&from.inertias().toward(&to.inertias(), share));
        let (first, last) = (from.inverse(&q, &qd, &qdd), to.inverse(&q, &qd, &qdd));
        let wanted: JointVec = std::array::from_fn(|j| first[j] + share * (last[j] - first[j]));
        prop_assert!(close(&between.inverse(&q, &qd, &qdd), &wanted));
        between.set_inertias(&to.inertias());
        prop_assert_eq!(between.inverse(&q, &qd, &qdd), last);
    }
}

#[test]
fn j60_no_payload_is_the_arm_itself_to_the_bit() {
    let (q, qd, qdd) = ([0.3, 0.8, -0.9, 0.4, 0.7, 0.2], [0.5; JOINTS], [-1.0; JOINTS]);
    let none = Payload { com: [0.1, 0.2, 0.3], ..Payload::default() };
    assert_eq!((none.check(), none.is_there()), (Ok(()), false));
    let [plain, without] =
        [Dynamics::new(&arms::avena(), DOWN), Dynamics::with_payload(&arms::avena(), DOWN, &none)];
    assert_eq!(plain.inverse(&q, &qd, &qdd), without.inverse(&q, &qd, &qdd));
}

/// The requirements for a payload are the same as the requirements for a link (J-06).
#[test]
fn j60_what_is_no_body_is_refused() {
    let good = Payload { mass: 2.0, com: [0.0, 0.0, 0.1], inertia: [0.02, 0.0, 0.0, 0.02, 0.0, 0.01] };
    assert_eq!(good.check(), Ok(()));
    assert_eq!(Payload { inertia: [0.0; 6], ..good }.check(), Ok(()), "a point mass");
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!(Payload { mass: bad, ..good }.check(), Err(PayloadError::NotFinite));
        for i in 0..3 {
            let mut payload = good;
            payload.com[i] = bad;
            assert_eq!(payload.check(), Err(PayloadError::NotFinite));
        }
        for i in 0..6 {
            let mut payload = good;
            payload.inertia[i] = bad;
            assert_eq!(payload.check(), Err(PayloadError::NotFinite));
        }
    }
    assert_eq!(Payload { mass: -2.0, ..good }.check(), Err(PayloadError::MassNegative { mass: -2.0 }));
    assert_eq!(Payload { mass: 0.0, ..good }.check(), Err(PayloadError::MassZero));
    let refused = |inertia: [f64; 6]| Payload { inertia, ..good }.check().expect_err("no body");
    assert!(
        matches!(refused([0.02, 0.05, 0.0, 0.02, 0.0, 0.01]), PayloadError::InertiaNegative { moment } if moment < -0.02)
    );
    assert!(
        matches!(refused([0.02, 0.0, 0.0, 0.02, 0.0, 0.05]), PayloadError::InertiaTriangle { limit, .. } if limit == 0.04)
    );
}
