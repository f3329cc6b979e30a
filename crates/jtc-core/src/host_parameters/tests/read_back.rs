//! Tests of the values that a host reads back, in the order of the wire format (J-54).
use super::*;
use crate::config::defaults;

/// Returns the next whole number, so that every parameter in a test has a different value.
fn next(count: &mut f64) -> f64 {
    *count += 1.0;
    *count
}

#[test]
fn j54_gains_are_read_joint_by_joint() {
    let (mut parameters, mut count) = (HostParameters::new(&Config::avena()), 0.0);
    for gains in &mut parameters.pid {
        *gains = PidGains {
            kp: next(&mut count),
            ki: next(&mut count),
            kd: next(&mut count),
            int_min: next(&mut count),
            int_max: next(&mut count),
        };
    }
    for i in 0..5 * JOINTS {
        assert_eq!(parameters.pid_float(i), i as f64 + 1.0, "{i}");
    }
}

/// Each joint has six values, and each link has 13 values: its frame, its inertia and its mass.
#[test]
fn j54_the_model_is_read_with_its_joints_before_its_links() {
    let (mut parameters, mut count) = (HostParameters::new(&Config::avena()), 0.0);
    for joint in &mut parameters.model.joints {
        joint.xyz = [(); 3].map(|()| next(&mut count));
        joint.rpy = [(); 3].map(|()| next(&mut count));
    }
    for link in &mut parameters.model.links {
        link.origin.xyz = [(); 3].map(|()| next(&mut count));
        link.origin.rpy = [(); 3].map(|()| next(&mut count));
        link.inertia = [(); 6].map(|()| next(&mut count));
        link.mass = next(&mut count);
    }
    assert_eq!(count, 7.0 * 6.0 + 7.0 * 13.0);
    for i in 0..7 * 6 + 7 * 13 {
        assert_eq!(parameters.model_float(i), i as f64 + 1.0, "{i}");
    }
}

/// The coefficient of the highest power comes first.
#[test]
fn j54_a_polynomial_is_read_from_its_highest_coefficient() {
    let (mut parameters, mut count) = (HostParameters::new(&Config::avena()), 0.0);
    for coefficient in parameters.polynomial.iter_mut().flat_map(|joint| joint.iter_mut().rev()) {
        *coefficient = next(&mut count);
    }
    for i in 0..6 * JOINTS {
        assert_eq!(parameters.friction_float(i), i as f32 + 1.0, "{i}");
    }
}

/// A table has 20 velocities, 20 temperatures, and 20 rows with 20 torques each.
#[test]
fn j54_a_friction_table_is_read_with_its_axes_before_its_rows() {
    let (mut parameters, mut count) = (HostParameters::new(&Config::avena()), 0.0);
    parameters.friction_is_table = true;
    for table in &mut parameters.tables {
        let torque = table.torque.iter_mut().flatten();
        for slot in table.velocity.iter_mut().chain(&mut table.temperature).chain(torque) {
            *slot = next(&mut count) as f32;
        }
    }
    for i in 0..440 * JOINTS {
        assert_eq!(parameters.friction_float(i), i as f32 + 1.0, "{i}");
    }
}

#[test]
fn j54_each_built_in_part_is_recognised_and_restored_alone() {
    for part in 0..3 {
        let only: [bool; 3] = core::array::from_fn(|i| i == part);
        let mut parameters = HostParameters::new(&Config::avena());
        assert_eq!(parameters.built_in(), [true; 3]);
        parameters.pid[2].kp += 1.0;
        parameters.model.links[2].mass += 1.0;
        parameters.polynomial[2][1] += 1.0;
        assert_eq!(parameters.built_in(), [false; 3]);
        parameters.use_built_in([false; 3]);
        assert_eq!(parameters.built_in(), [false; 3]);
        parameters.use_built_in(only);
        assert_eq!(parameters.built_in(), only);
        assert_eq!(parameters.pid == defaults::PID, only[0]);
        assert_eq!(parameters.model == defaults::MODEL, only[1]);
        assert_eq!(parameters.polynomial == defaults::POLYNOMIAL, only[2]);
    }
}

#[test]
fn j54_the_parameters_begin_with_the_built_in_values() {
    let config = Config::avena();
    let at = [0.0, 0.7, 0.3, 0.0, 0.2, 0.0];
    let mut parameters = HostParameters::new(&config);
    let torque = parameters.dynamics.gravity_torque(&at);
    parameters.pid[2].kp += 1.0;
    parameters.model.links[2].mass += 1.0;
    parameters.polynomial[2][1] += 1.0;
    parameters.tables[3].velocity[4] = 1.0;
    parameters.set_gravity(&config);
    assert_ne!(parameters.dynamics.gravity_torque(&at), torque);
    parameters.receive(7);
    (parameters.friction_is_table, parameters.friction_is_new) = (true, true);
    parameters.begin(&config);
    assert_eq!(parameters.built_in(), [true; 3]);
    assert_eq!(parameters.tables, [NO_TABLE; JOINTS]);
    assert_eq!(parameters.dynamics.gravity_torque(&at), torque);
    assert_eq!((parameters.missing(), parameters.all_given()), (7, false));
    assert!(!parameters.friction_is_table && !parameters.friction_is_new);
}
