//! Tests of the loads that the control law learns in HoldPos, and of the torques of Teaching that depend on these loads (J-25, J-66).
use super::*;

const WIDE: PidGains = PidGains { kp: 8_000.0, ki: 10.0, kd: 80.0, int_min: -100.0, int_max: 100.0 };

/// State of joint 1 in a test that observes its load.
#[derive(Clone, Copy, Debug)]
struct Seen {
    speed: f64,
    yields: bool,
    unwinds_ms: u16,
    settled: bool,
    known: bool,
    p: f64,
    d: f64,
}

/// Joint that is held at rest without a position error.
const STILL: Seen =
    Seen { speed: 0.0, yields: false, unwinds_ms: 0, settled: true, known: false, p: 0.0, d: 0.0 };

/// Returns `true` if the load of joint 1 is known after one observation in this state. The integral holds 20 N·m.
fn known_after(seen: Seen) -> bool {
    let (config, mut set, mut law) = (Config::avena(), SetValues::default(), ControlLaw::default());
    set.point.velocity[0] = seen.speed;
    if seen.settled {
        set.catch[0].calm_down();
    }
    if seen.yields {
        law.begin_yield(0, (false, false), 0.0, 5.0, &config.joints[0]);
    }
    if seen.known {
        law.loads[0].set(20.0);
    }
    law.unwinds_ms = seen.unwinds_ms;
    law.torque[0].pid = PidTorque { p: seen.p, i: 20.0, d: seen.d };
    law.observe_load(&set, &config);
    law.loads[0].is_known()
}

/// The load is known if the joint has settled, does not creep or yield, and its integral does not release a torque.
/// If the load is not known yet, the other parts of the PID torque must also be small: at most 0.04 · 80 N·m = 3.2
/// N·m for joint 1.
#[test]
fn j66_a_load_is_learned_from_the_integral_of_a_settled_joint() {
    let little = 3.2;
    for (seen, known) in [
        (STILL, true),
        (Seen { speed: 0.025, ..STILL }, false),
        (Seen { speed: -0.025, ..STILL }, false),
        (Seen { speed: 0.049, ..STILL }, false),
        (Seen { speed: 0.05, ..STILL }, true),
        (Seen { speed: 0.5, ..STILL }, true),
        (Seen { yields: true, ..STILL }, false),
        (Seen { unwinds_ms: 1, ..STILL }, false),
        (Seen { settled: false, ..STILL }, false),
        (Seen { settled: false, known: true, ..STILL }, false),
        // The torques of the position error and of the derivative together must be small.
        (Seen { p: little, ..STILL }, true),
        (Seen { p: -little, ..STILL }, true),
        (Seen { p: 3.21, ..STILL }, false),
        (Seen { d: -3.21, ..STILL }, false),
        (Seen { p: 20.0, d: -20.0, ..STILL }, true),
        (Seen { p: 20.0, d: 20.0, ..STILL }, false),
        (Seen { p: 10.0, known: true, ..STILL }, true),
    ] {
        assert_eq!(known_after(seen), known, "{seen:?}");
    }
}

/// A feedback torque of exactly 0.04 times the torque limit is still small. During a contact, the release of integral
/// torque need not have ended.
#[test]
fn j25_loads_are_known_up_to_and_with_a_little_feedback_torque() {
    let (mut law, config) = (ControlLaw::default(), Config::avena());
    law.find_loads_for_test();
    for sign in [1.0, -1.0] {
        law.torque[1].pid.p = sign * LITTLE * config.joints[1].torque_max;
        assert!(law.knows_loads(&[true; JOINTS], &config, false), "{sign}");
    }
    law.unwinds_ms = 1;
    assert!(!law.knows_loads(&[true; JOINTS], &config, false));
    assert!(law.knows_loads(&[true; JOINTS], &config, true));
}

/// In Teaching, no load changes, because the position controller does not act. In HoldPos, the controller observes
/// one joint per tick, so each joint is observed once in 6 ms. The integral holds no torque here, so a load of 2 N·m
/// falls by 0.006 of its value in each observation (time constant 1 s).
#[test]
fn j25_teaching_learns_no_load_from_an_integral_that_does_not_act() {
    let mut arm = taught(&[2.0; JOINTS]);
    arm.motion.set.catch.iter_mut().for_each(Catch::calm_down);
    (0..2 * JOINTS).for_each(|_| {
        arm.tick(ControlMode::Teach, false, 0.0);
    });
    assert_eq!(arm.motion.law.loads.map(|load| load.known_torque()), [2.0; JOINTS]);
    for tick in 1..=JOINTS {
        arm.tick(ControlMode::Hold, false, 0.0);
        for j in 0..JOINTS {
            let expected = if j < tick { 2.0 * 0.994 } else { 2.0 };
            let load = arm.motion.law.loads[j].known_torque();
            assert!((load - expected).abs() < 1e-6, "tick {tick}, joint {}: {load}", j + 1);
        }
    }
}

/// The second tick of Teaching computes no torques, so the load torques of the first tick continue. A change of the
/// mode in this tick does not alter them.
#[test]
fn j25_j44_a_transfer_during_teaching_keeps_the_load() {
    let found = [3.0, -20.0, 12.0, 5.0, -2.0, 1.0];
    let mut arm = taught(&found);
    arm.tick(ControlMode::Teach, false, 0.0);
    arm.motion.law.change_mode();
    arm.tick(ControlMode::Teach, false, 0.0);
    assert_eq!(arm.motion.law.torque.map(|torque| torque.load), found);
}

/// At the end of Teaching, the torque consists of 64 N·m from the model, 16 N·m for the load and 8 N·m for braking.
/// At a change of the mode, the model torque changes at once and the other 24 N·m are blended out. At a change of the
/// whole torque, all 88 N·m continue without a step.
#[test]
fn j25_j44_the_torques_of_teaching_are_blended_out() {
    let last = JointTorque { model: 64.0, load: 16.0, brake: 8.0, ..JointTorque::default() };
    for whole in [false, true] {
        let mut arm = Arm::held(NONE);
        arm.motion.law.torque = [last; JOINTS];
        if whole {
            arm.motion.law.change_whole_torque();
        } else {
            arm.motion.law.change_mode();
        }
        arm.tick(ControlMode::Hold, false, 0.0);
        let gravity = arm.dynamics.gravity_torque(&POSE);
        for (torque, gravity) in arm.motion.law.torque.iter().zip(gravity) {
            assert_eq!((torque.load, torque.brake), (0.0, 0.0));
            let sum = if whole { 88.0 } else { gravity + 24.0 };
            assert!((torque.sum() - sum).abs() < 1e-9, "{whole}: {torque:?}");
        }
    }
}

/// After Teaching, the integral holds the load torque of Teaching, and the controller must learn the loads again. The
/// tolerance is necessary, because the anchor of the dry-friction spring has single precision.
#[test]
fn j25_after_teaching_the_integral_holds_the_load() {
    let found = [3.0, -20.0, 12.0, 5.0, -2.0, 1.0];
    let mut arm = taught(&found);
    let nodes = Nodes::enabled_at(POSE, [0.0; JOINTS]);
    arm.motion.law.end_teaching(&nodes, &arm.config, &[WIDE; JOINTS]);
    let law = &mut arm.motion.law;
    assert!(law.taught.is_none());
    for (j, found) in found.into_iter().enumerate() {
        let torque = law.pid[j].step(&WIDE, 0.0, true, None);
        assert!((torque.i - found).abs() < 1e-2 && torque.p == 0.0 && torque.d == 0.0, "{torque:?} {found}");
        assert!(!law.loads[j].is_known());
    }
}

/// The torque limit is 80 N·m, and the other parts of the torque need 70 N·m. The braking torque of 20 N·m is
/// therefore reduced to 10 N·m. A joint that is not enabled does not brake.
#[test]
fn j16_j25_the_braking_torque_of_an_enabled_joint_stays_within_its_limit() {
    let (mut law, mut config) = (ControlLaw::default(), Config::avena());
    config.joints.iter_mut().for_each(|joint| joint.torque_max = 80.0);
    law.torque = [JointTorque { model: 70.0, brake: 20.0, ..JointTorque::default() }; JOINTS];
    law.bound_brakes(&Nodes::enabled_at(POSE, [0.0; JOINTS]).with_torque_off(3), &config);
    assert_eq!(law.torque.map(|torque| torque.brake), [10.0, 10.0, 10.0, 0.0, 10.0, 10.0]);
}

/// Joint 2 moves so that its damping of about 30 N·m acts in the direction of its holding torque. The torque limit
/// leaves only 2 N·m above gravity, so the brake is limited and the total torque equals the torque limit.
///
/// In a tick that computes a slowly changing value, the braking torque is kept, even if gravity has increased. The
/// next tick limits the braking torque again.
#[test]
fn j25_teaching_brakes_up_to_the_torque_limit_in_the_ticks_that_compute_torques() {
    let mut arm = taught(&[0.0; JOINTS]);
    let mut further = POSE;
    further[1] += 0.01;
    let gravity = arm.dynamics.gravity_torque(&POSE)[1];
    let more = arm.dynamics.gravity_torque(&further)[1];
    assert!(more.abs() > gravity.abs() + 0.01 && more.abs() < gravity.abs() + 1.9, "{gravity} {more}");
    let limit = gravity.abs() + 2.0;
    arm.config.joints[1].torque_max = limit;
    let velocity = [0.0, -0.35 * gravity.signum(), 0.0, 0.0, 0.0, 0.0];
    let at_limit = |arm: &Arm| (arm.motion.law.torque[1].sum().abs() - limit).abs() < 1e-9;
    // The first nine ticks and every fourth tick after them compute slowly changing values. Ticks 11 to 13 compute
    // the torques of Teaching.
    for _ in 0..13 {
        arm.tick_of(ControlMode::Teach, false, &Nodes::enabled_at(POSE, velocity));
    }
    assert!(at_limit(&arm), "{:?} {limit}", arm.motion.law.torque[1]);
    let brake = arm.motion.law.torque[1].brake;
    arm.tick_of(ControlMode::Teach, false, &Nodes::enabled_at(further, velocity));
    assert_eq!(arm.motion.law.torque[1].brake, brake);
    arm.tick_of(ControlMode::Teach, false, &Nodes::enabled_at(further, velocity));
    assert!(at_limit(&arm), "{:?} {limit}", arm.motion.law.torque[1]);
}

/// The third tick of Teaching computes the inertia of the arm: the mass matrix at the measured position, including
/// the rotors.
#[test]
fn j25_j33_the_third_tick_of_teaching_computes_the_inertia_of_the_arm() {
    let mut arm = taught(&[0.0; JOINTS]);
    let nodes = Nodes::enabled_at(POSE, [0.0; JOINTS]);
    let mass = arm.dynamics.mass_matrix(&POSE);
    let whole: [f64; JOINTS] = core::array::from_fn(|j| mass[j][j] + arm.config.joints[j].rotor_inertia);
    for tick in 1..=4 {
        arm.motion.keep_ramp(&nodes, &arm.config, &arm.dynamics);
        let expected = if tick < 3 { [0.0; JOINTS] } else { whole };
        assert_eq!(arm.motion.ramp.inertia(), expected, "tick {tick}");
        arm.tick_of(ControlMode::Teach, false, &nodes);
    }
    let mut held = Arm::held(NONE);
    held.motion.keep_ramp(&nodes, &held.config, &held.dynamics);
    assert_eq!(held.motion.ramp.inertia(), [0.0; JOINTS], "no Teaching");
}

/// The friction table begins at 0.1 rad/s with 3 N·m. An arm that is held gets no friction torque. In the approach, a
/// speed below 0.1 rad/s gets the friction of 0.1 rad/s.
#[test]
fn j42_an_arm_that_is_held_gets_no_friction_torque_from_a_table_without_standstill() {
    for (mode, friction) in [(ControlMode::Hold, 0.0), (ControlMode::Approach, 3.0)] {
        let mut arm = Arm::held(NONE);
        let axis = |from: f32| core::array::from_fn(|k| from + k as f32);
        arm.table =
            Some([TableOf { velocity: axis(0.1), temperature: axis(20.0), torque: [[3.0; 20]; 20] }; JOINTS]);
        arm.tick(mode, false, 0.0);
        for torque in &arm.motion.law.torque {
            assert!((torque.friction - friction).abs() < 1e-6, "{mode:?}: {torque:?}");
        }
    }
}

/// Joint 2 is at its torque limit, because gravity exceeds this limit. Joint 4 lags if its position error is above
/// 0.125 rad, half of its limit of 0.25 rad. A yielding joint never lags.
#[test]
fn j75_a_joint_presses_at_its_torque_limit_or_lags_by_more_than_half_of_its_position_error_limit() {
    for (error, lags) in [(0.125, false), (-0.125, false), (0.1875, true), (-0.1875, true)] {
        let mut arm = Arm::held(NONE);
        arm.config.joints[1].torque_max = 10.0;
        arm.config.joints[3].position_error_max = 0.25;
        arm.tick(ControlMode::Hold, false, 0.0);
        // These positions of joint 4 have no rounding error in binary.
        arm.motion.set.point.position[3] = 0.5;
        arm.motion.set.commanded.put(&arm.motion.set.point);
        let mut measured = POSE;
        measured[3] = 0.5 - error;
        let nodes = Nodes::enabled_at(measured, [0.0; JOINTS]);
        let (at_limit, apart) = arm.motion.presses(&nodes, &arm.config);
        assert_eq!(at_limit, [false, true, false, false, false, false], "{error}");
        assert_eq!(apart, [false, false, false, lags, false, false], "{error}");
        arm.motion.law.begin_yield(3, (false, false), 0.5, 1.0, &arm.config.joints[3]);
        assert_eq!(arm.motion.presses(&nodes, &arm.config).1, [false; JOINTS], "{error}");
    }
}

#[test]
fn j66_a_held_arm_without_findings_needs_no_reaction() {
    let mut arm = Arm::held(NONE);
    let nodes = Nodes::enabled_at(POSE, [0.0; JOINTS]);
    let parameters = ControlParameters {
        dynamics: &arm.dynamics,
        pid: &arm.pid,
        polynomial: &arm.polynomial,
        table: None,
        on_trial: false,
    };
    let inputs =
        LawInputs { mode: ControlMode::Hold, braking: false, nodes: &nodes, config: &arm.config, parameters };
    let limited = arm.motion.control(&inputs);
    assert!(limited.found.is_none() && limited.sag.is_none());
}
