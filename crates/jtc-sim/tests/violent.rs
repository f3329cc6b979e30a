//! A simulated arm that is pushed violently must stay in its range of positions. Its end stops are allowed to yield
//! slightly.
use jtc_core::{Friction, Parameters};
use jtc_sim::{Arm, FrictionModel, SimArm, SimFriction};

const TICK: f64 = 1e-3;
/// Largest permitted deflection of the end stops, rad. A joint of the default arm hits the end stops at up to 80
/// rad/s.
const YIELD: f64 = 0.5;

/// Returns an arm with links of `mass` times the default masses and rotors of `rotor` kg·m².
fn arm(mass: f64, rotor: f64) -> SimArm {
    let mut arm = SimArm::default();
    for link in &mut arm.model.links {
        link.mass *= mass;
        link.inertia = link.inertia.map(|i| i * mass);
    }
    SimArm { rotor_inertia: [rotor; 6], ..arm }
}

fn in_range(arm: &Arm, what: &str) {
    for j in 0..6 {
        let (q, v, (low, high)) = (arm.q[j], arm.qd[j], arm.parts().stops[j]);
        assert!(v.is_finite() && arm.temperature[j].is_finite(), "{what}: joint {} at {v} rad/s", j + 1);
        assert!(q > low - YIELD && q < high + YIELD, "{what}: joint {} at {q} rad", j + 1);
    }
}

/// Moves the arm violently: pushes several joints at once with up to 400 N·m, and closes and opens brakes during the
/// motion. The friction is that of cold bearings, or is multiplied by a factor.
fn throw_about(parts: &SimArm, seed: u64, what: &str) {
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut arm = Arm::new(parts.clone(), [1.2; 6], [0.0; 6]);
    let (mut push, mut next) = ([0.0; 6], 0);
    for ms in 0..6_000 {
        if ms >= next {
            next = ms + rng.u64(5..800);
            push[rng.usize(0..6)] = [400.0, -400.0, 0.0, 200.0][rng.usize(0..4)];
            arm.braked = core::array::from_fn(|_| seed > 1 && rng.u8(0..4) == 0);
            arm.friction_fault[rng.usize(0..6)] = 3.0 * rng.f64();
            arm.temperature[rng.usize(0..6)] = 200.0 * rng.f64() - 40.0;
            arm.friction_changed();
        }
        arm.step(&push, TICK);
        in_range(&arm, &format!("{what}, seed {seed}, {ms} ms"));
    }
}

#[test]
fn no_push_throws_a_light_or_heavy_arm_out_of_its_range() {
    let Friction::Table(tables) = Parameters::avena_friction_table() else { unreachable!("tables") };
    for (mass, rotor) in [(1.0, 0.7), (0.1, 0.05), (1e-6, 1e-9), (1.0, 1e-4), (10.0, 5.0)] {
        let polynomial = arm(mass, rotor);
        let table = SimArm { friction: tables.map(SimFriction::Table), ..polynomial.clone() };
        let smooth = SimArm { friction_model: FrictionModel::Smooth { width: 0.01 }, ..polynomial.clone() };
        let none = std::array::from_fn(|_| SimFriction::Frictionless);
        let none = SimArm { friction: none, ..polynomial.clone() };
        for (parts, name) in
            [(polynomial, "polynomial"), (table, "table"), (smooth, "smooth"), (none, "none")]
        {
            for seed in 1..=3 {
                throw_about(&parts, seed, &format!("{name}, mass {mass}, rotor {rotor}"));
            }
        }
    }
}

#[test]
fn a_push_that_lasts_ends_at_the_end_stop() {
    for joint in 0..6 {
        for torque in [-200.0, 200.0] {
            let mut arm = Arm::new(SimArm::default(), [1.0; 6], [0.0; 6]);
            let mut push = [0.0; 6];
            push[joint] = torque;
            for ms in 0..1_500 {
                arm.step(&push, TICK);
                in_range(&arm, &format!("joint {} by {torque} N·m, {ms} ms", joint + 1));
            }
        }
    }
}

#[test]
fn a_brake_that_closes_on_a_fast_joint_lets_the_end_stop_end_its_way() {
    for speed in [-20.0, 5.0, 60.0] {
        let mut arm = Arm::new(SimArm::default(), [1.0; 6], [0.0; 6]);
        arm.braked = [true; 6];
        arm.qd = [0.0, 0.0, 0.0, 0.0, speed, 0.0];
        for ms in 0..3_000 {
            arm.step(&[0.0; 6], TICK);
            in_range(&arm, &format!("{speed} rad/s, {ms} ms"));
        }
        assert_eq!(arm.qd, [0.0; 6]);
        if speed == 5.0 {
            // The joint turns by v²/(2·a) = 25/(2·40) = 0.31 rad until it stops, so it does not reach the end stop.
            assert!((0.30..0.33).contains(&arm.q[4]), "{} rad", arm.q[4]);
        }
    }
}
