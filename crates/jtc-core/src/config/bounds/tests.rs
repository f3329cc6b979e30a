//! Tests of the bounds of parameters (J-06). The check accepts a value at a bound, and refuses a value beyond the bound.
use jtc_dynamics::Link;

use super::*;
use crate::Config;

const BOUNDS: ParameterBounds = ParameterBounds::known_drives();

fn joint() -> JointConfig {
    JointConfig { torque_max: 100.0, velocity_max: 1.5, ..Config::avena().joints[0] }
}

#[test]
fn j06_a_bound_of_the_gains_is_allowed_and_nothing_beyond() {
    let most = PidGains {
        kp: BOUNDS.kp_max,
        ki: BOUNDS.ki_max,
        kd: BOUNDS.kd_max,
        int_min: -BOUNDS.integral_max,
        int_max: BOUNDS.integral_max,
    };
    let none = PidGains::default();
    let check = |gains: PidGains| BOUNDS.check_gains(&gains, &joint());
    assert_eq!((check(most), check(none)), (Ok(()), Ok(())));
    for factor in [1.001, -0.001, f64::NAN] {
        assert!(check(PidGains { kp: factor * most.kp, ..most }).is_err(), "Kp times {factor}");
        assert!(check(PidGains { ki: factor * most.ki, ..most }).is_err(), "Ki times {factor}");
        assert!(check(PidGains { kd: factor * most.kd, ..most }).is_err(), "Kd times {factor}");
    }
    assert!(check(PidGains { int_min: 1.001 * most.int_min, ..most }).is_err());
    assert!(check(PidGains { int_max: 1.001 * most.int_max, ..most }).is_err());
    assert!(check(PidGains { int_min: 0.2, int_max: 0.1, ..none }).is_err());
}

/// If the bounds of the integral exclude zero, the integral causes a torque on a joint at rest: Ki times the bound that is nearer to zero.
#[test]
fn j06_an_integral_forces_a_quarter_of_the_torque_limit_at_most() {
    for (int_min, int_max, ki) in [(2.0, 9.0, 12.5), (-9.0, -2.0, 12.5), (-1.0, 9.0, 50_000.0)] {
        let check =
            |ki| BOUNDS.check_gains(&PidGains { ki, int_min, int_max, ..PidGains::default() }, &joint());
        assert_eq!(check(ki), Ok(()), "{int_min}..{int_max}");
        assert!(check(1.001 * ki).is_err(), "{int_min}..{int_max}");
    }
}

/// Checks a friction table in which only one torque is not 0.
fn one_torque(velocity: f32, torque: f32) -> Result<(), OutOfBounds> {
    let mut table = TableOf {
        velocity: core::array::from_fn(|i| (i as f32 - 10.0) * 0.125),
        temperature: core::array::from_fn(|i| 20.0 + i as f32),
        torque: [[0.0; 20]; 20],
    };
    for (v, row) in table.velocity.iter().zip(&mut table.torque) {
        row[7] = if *v == velocity { torque } else { 0.0 };
    }
    BOUNDS.check_table(&table, &joint())
}

#[test]
fn j06_friction_is_bounded_by_where_it_is() {
    // Each row contains a speed and the allowed range of the friction torque. The bounds differ at standstill, up to
    // half of the velocity limit, and above it. A torque against the motion counts as positive in both directions.
    for (speed, low, high) in
        [(0.0, -25.0, 25.0), (0.125, -5.0, 100.0), (0.75, -5.0, 100.0), (0.875, -150.0, 150.0)]
    {
        for direction in [1.0, -1.0] {
            for torque in [low, high] {
                let velocity = direction * speed;
                assert_eq!(one_torque(velocity, direction * torque), Ok(()), "{torque} at {velocity}");
                let beyond = one_torque(velocity, 1.01 * direction * torque).map_err(|e| e.velocity);
                assert_eq!(beyond, Err(Some(velocity.into())), "{torque} at {velocity}");
            }
        }
    }
}

#[test]
fn j06_friction_at_rest_is_asked_where_a_table_has_no_row_of_it() {
    let between = |below: f32, above: f32| {
        let velocity = core::array::from_fn(|i| (i as f32 - 9.5) * 0.125);
        let row = |i: usize| {
            if i < 9 {
                0.0
            } else if i == 9 {
                below
            } else if i == 10 {
                above
            } else {
                0.0
            }
        };
        let torque = core::array::from_fn(|i| [row(i); 20]);
        let table = TableOf { velocity, temperature: core::array::from_fn(|i| i as f32), torque };
        BOUNDS.check_table(&table, &joint()).map_err(|e| e.velocity)
    };
    assert_eq!(between(-90.0, 90.0), Ok(()));
    assert_eq!((between(-90.0, 40.0), between(-40.0, 90.0)), (Ok(()), Ok(())));
    assert_eq!((between(-90.0, 39.0), between(-39.0, 90.0)), (Err(Some(0.0)), Err(Some(0.0))));
}

#[test]
fn j06_a_polynomial_is_bounded_up_to_the_velocity_limit() {
    let fastest = joint().velocity_max;
    for sign in [1.0, -1.0] {
        let cubic = |most: f64| {
            let c3 = most * 100.0 / (fastest * fastest * fastest);
            BOUNDS.check_polynomial(&[0.0, 0.0, 0.0, sign * c3, 0.0, 0.0], &joint()).map_err(|e| e.velocity)
        };
        // The friction torque grows with the third power of the speed. Friction against the motion is first refused
        // at the highest speed. Friction along the motion is first refused at half of the highest speed, because its
        // bound is narrow up to this speed.
        let most = if sign > 0.0 { 1.5 } else { 0.05 * 8.0 };
        assert_eq!(cubic(0.999 * most), Ok(()));
        assert_eq!(cubic(1.001 * most), Err(Some(if sign > 0.0 { fastest } else { 0.5 * fastest })));
    }
}

#[test]
fn j06_masses_and_inertias_reach_their_bounds() {
    let with = |change: fn(&mut Link)| {
        let mut model = crate::Parameters::avena().model;
        change(&mut model.links[3]);
        BOUNDS.check_masses(&model).is_ok()
    };
    assert!(with(|link| link.mass = 50.0) && !with(|link| link.mass = 50.01));
    assert!(with(|link| link.mass = 0.0) && !with(|link| link.mass = -0.01));
    assert!(with(|link| link.inertia[4] = 100.0) && !with(|link| link.inertia[4] = 100.1));
    assert!(with(|link| link.inertia[4] = -100.0) && !with(|link| link.inertia[4] = -100.1));
}

/// Friction against the motion is reported as positive. At standstill, friction is reported with its actual sign.
#[test]
fn j06_what_is_refused_is_told_with_its_value() {
    for (velocity, torque, value) in
        [(0.0, 26.0, 26.0), (0.0, -26.0, -26.0), (0.125, 101.0, 101.0), (-0.125, -101.0, 101.0)]
    {
        assert_eq!(one_torque(velocity, torque).map_err(|e| e.value), Err(value), "{torque} at {velocity}");
    }
}

/// The check tests equal numbers of speeds below and above a sixteenth of the velocity limit.
#[test]
fn j06_a_polynomial_is_looked_at_where_arms_move_slowly() {
    let sixteenth = joint().velocity_max / 16.0;
    for (reached, found) in [(0.5, 1.0), (2.5, 3.0), (14.5, 15.0)] {
        // The check divides a sixteenth of the velocity limit into sixteen steps. The friction torque reaches its
        // bound of 100 N·m after `reached` steps, which need not be a whole number. The check refuses the torque at
        // the next whole step, `found`.
        let c1 = 100.0 / (sixteenth * reached / 16.0);
        let refused = BOUNDS.check_polynomial(&[0.0, c1, 0.0, 0.0, 0.0, 0.0], &joint());
        assert_eq!(refused.map_err(|e| e.velocity), Err(Some(sixteenth * found / 16.0)), "{reached}");
    }
}

/// If several rows of a table are out of bounds, the check reports the first row in motion, not the row at
/// standstill.
#[test]
fn j06_of_a_table_the_first_row_in_motion_is_named() {
    let table = TableOf {
        velocity: core::array::from_fn(|i| (i as f32 - 10.0) * 0.125),
        temperature: core::array::from_fn(|i| 20.0 + i as f32),
        torque: core::array::from_fn(|i| [if i < 10 { 0.0 } else { 101.0 }; 20]),
    };
    assert_eq!(BOUNDS.check_table(&table, &joint()).map_err(|e| e.velocity), Err(Some(0.125)));
}

/// The bounds of the mass and inertia of a link also apply to a payload.
#[test]
fn j06_the_mass_and_inertia_of_a_payload_reach_the_bounds_of_a_link() {
    let with = |change: fn(&mut Payload)| {
        let mut payload = Payload { mass: 1.0, ..Payload::NONE };
        change(&mut payload);
        BOUNDS.check_payload(&payload).is_ok()
    };
    assert!(with(|payload| payload.mass = 50.0) && !with(|payload| payload.mass = 50.01));
    assert!(with(|payload| payload.mass = 0.0) && !with(|payload| payload.mass = -0.01));
    assert!(!with(|payload| payload.mass = f64::NAN));
    assert!(with(|payload| payload.inertia[5] = 100.0) && !with(|payload| payload.inertia[5] = 100.1));
    assert!(with(|payload| payload.inertia[5] = -100.0) && !with(|payload| payload.inertia[5] = -100.1));
}
