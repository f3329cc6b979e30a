//! The parts of the control law, each where it acts (section 6).
use super::*;
use crate::Parameters;
use crate::catch::Catch;
use crate::deceleration::Deceleration;
use crate::motion::limiter::DRIVEN;
use crate::motion::{Found, Motion};
use crate::parameters::Friction;
use crate::pid::PidTorque;

/// A bent arm: gravity loads joint 2 with some tens of N·m.
const POSE: [f64; JOINTS] = [0.1, 0.9, 0.4, -0.2, 0.3, 0.5];
const MODES: [ControlMode; 4] =
    [ControlMode::Hold, ControlMode::Follow, ControlMode::Approach, ControlMode::Teach];

/// An arm that is held with gains of its own.
struct Arm {
    config: Config,
    dynamics: Dynamics,
    pid: [PidGains; JOINTS],
    polynomial: [[f64; 6]; JOINTS],
    table: Option<[TableOf<f32>; JOINTS]>,
    motion: Motion,
}

impl Arm {
    /// What it measures is compared with the set values of the same tick, so that one tick shows what the law makes of them.
    fn held(gains: PidGains) -> Self {
        let config = Config { delay_ticks: 0, ..Config::avena() };
        let mut motion = Motion::default();
        motion.set.begin_at(&POSE);
        motion.set.hold_for_test();
        let Friction::Polynomial(polynomial) = Parameters::avena().friction else { unreachable!() };
        let dynamics = Dynamics::new(&Parameters::avena().model, config.gravity);
        Self { config, dynamics, pid: [gains; JOINTS], polynomial, table: None, motion }
    }

    /// A tick at the pose, with the measured `velocity` (rad/s): torques and errors.
    fn tick(&mut self, mode: ControlMode, braking: bool, velocity: f64) -> ([f64; JOINTS], [Found; JOINTS]) {
        self.tick_of(mode, braking, &Nodes::enabled_at(POSE, [velocity; JOINTS]))
    }

    /// A tick of these nodes.
    fn tick_of(
        &mut self,
        mode: ControlMode,
        braking: bool,
        nodes: &Nodes,
    ) -> ([f64; JOINTS], [Found; JOINTS]) {
        let parameters = ControlParameters {
            dynamics: &self.dynamics,
            pid: &self.pid,
            polynomial: &self.polynomial,
            table: self.table.as_ref(),
        };
        let limited =
            self.motion.control(&LawInputs { mode, braking, nodes, config: &self.config, parameters });
        (limited.torque, limited.found.unwrap_or_default())
    }
}

const NONE: PidGains = PidGains { kp: 0.0, ki: 0.0, kd: 0.0, int_min: -1.0, int_max: 1.0 };

/// Also where set values move: a joint that comes to rest in HoldPos has a velocity.
#[test]
fn j40_j42_velocity_acceleration_and_friction_are_part_of_the_law_on_the_way_only() {
    for mode in MODES {
        let mut arm = Arm::held(NONE);
        let (qd, qdd) = ([0.5, -0.4, 0.3, 0.2, -0.1, 0.6], [1.0, 2.0, -3.0, 0.5, 1.0, -2.0]);
        (arm.motion.set.point.velocity, arm.motion.set.point.acceleration) = (qd, qdd);
        arm.tick(mode, false, 0.0);
        let moves = matches!(mode, ControlMode::Follow | ControlMode::Approach);
        let (gravity, all) = (arm.dynamics.gravity_torque(&POSE), arm.dynamics.inverse(&POSE, &qd, &qdd));
        for j in 0..JOINTS {
            let model = if moves { all[j] + arm.config.joints[j].rotor_inertia * qdd[j] } else { gravity[j] };
            let torque = &arm.motion.law.torque[j];
            assert!((torque.model - model).abs() < 1e-9, "{mode:?}, joint {}: {torque:?}", j + 1);
            assert_eq!(torque.friction != 0.0, moves, "{mode:?}, joint {}: {torque:?}", j + 1);
        }
    }
}

/// Such a table is for no path, but an arm can be held with it.
#[test]
fn j42_a_table_without_standstill_is_no_error_while_the_arm_is_held() {
    for (mode, error) in
        [(ControlMode::Hold, 0), (ControlMode::Teach, 0), (ControlMode::Follow, joint_error::FRICTION_TABLE)]
    {
        let mut arm = Arm::held(NONE);
        let axis = |from: f32| core::array::from_fn(|k| from + k as f32);
        arm.table =
            Some([TableOf { velocity: axis(0.1), temperature: axis(20.0), torque: [[3.0; 20]; 20] }; JOINTS]);
        assert_eq!(arm.tick(mode, false, 0.0).1.map(|found| found.errors), [error; JOINTS], "{mode:?}");
    }
}

#[test]
fn j25_only_teaching_carries_what_was_found_missing() {
    let mut arm = Arm::held(NONE);
    let missing = arm.dynamics.flange_torque(&POSE).map(|torque| 2.0 * torque);
    (0..1_000).for_each(|_| arm.motion.law.payload.observe(&missing));
    arm.motion.law.begin_teaching(&Nodes::enabled_at(POSE, [0.0; JOINTS]), &arm.config, &arm.dynamics, false);
    for mode in MODES {
        arm.tick(mode, false, 0.0);
        for (torque, missing) in arm.motion.law.torque.iter().zip(&missing) {
            let carried = if mode == ControlMode::Teach { *missing } else { 0.0 };
            assert!((torque.payload - carried).abs() < 0.01, "{mode:?}: {torque:?}, {missing}");
        }
    }
}

#[test]
fn j25_what_is_missing_is_observed_while_the_arm_is_held_at_rest_and_firmly() {
    let observed = |mode: ControlMode, change: fn(&mut Arm)| {
        let mut arm = Arm::held(NONE);
        arm.tick(ControlMode::Hold, false, 0.0);
        change(&mut arm);
        arm.tick(mode, false, 0.0);
        arm.motion.law.payload.is_known(&arm.config)
    };
    assert!(observed(ControlMode::Hold, |_| ()));
    assert!(MODES.iter().all(|&mode| observed(mode, |_| ()) == (mode == ControlMode::Hold)));
    assert!(!observed(ControlMode::Hold, |arm| {
        let limits = arm.config.joints[2];
        arm.motion.law.begin_yield(2, false, POSE[2], 1.0, &limits);
    }));
    assert!(!observed(ControlMode::Hold, |arm| arm.motion.set.holding[3] = false));
}

/// In motion errors below the resolution of an encoder add up as well.
#[test]
fn j41_the_integral_is_held_within_an_encoder_step_at_rest_only() {
    for (velocity, acceleration, held) in
        [(0.0, 0.0, true), (0.1, 0.0, false), (0.0, 0.1, false), (-0.1, 0.1, false)]
    {
        let mut arm = Arm::held(PidGains { ki: 1.0, ..NONE });
        arm.motion.set.point.position = POSE.map(|q| q + 0.5 * arm.config.encoder_step);
        (arm.motion.set.point.velocity, arm.motion.set.point.acceleration) =
            ([velocity; JOINTS], [acceleration; JOINTS]);
        arm.tick(ControlMode::Follow, false, 0.0);
        let still = arm.motion.law.torque.map(|torque| torque.pid.i == 0.0);
        assert_eq!(still, [held; JOINTS], "{velocity} rad/s, {acceleration} rad/s²");
    }
}

/// Gravity is more than joint 2 can hold, in all cases. What the joint does beside that decides whether it is an error.
#[test]
fn j33_j43_torque_at_its_limit_is_excused_while_it_stops_a_joint() {
    let along = Arm::held(NONE).dynamics.gravity_torque(&POSE)[1].signum();
    for (mode, catches, decelerates, braking, speed, error) in [
        (ControlMode::Hold, false, false, false, 0.0, true),
        (ControlMode::Hold, false, false, true, 0.0, false),
        (ControlMode::Hold, true, false, false, 0.0, false),
        (ControlMode::Follow, true, false, false, 0.0, true),
        (ControlMode::Hold, false, true, false, 0.0, false),
        // Against the motion it stops the joint, along with it it drives the joint on.
        (ControlMode::Hold, true, false, false, -0.06, false),
        (ControlMode::Hold, true, false, false, 0.06, true),
        (ControlMode::Hold, false, true, false, 0.06, true),
        (ControlMode::Hold, true, false, false, DRIVEN, false),
        (ControlMode::Hold, true, false, true, 0.06, false),
    ] {
        // No set position sags where there is no error of position.
        let mut arm = Arm::held(NONE);
        arm.config.joints[1].torque_max = 10.0;
        let limits = arm.config.joints[1];
        if catches {
            arm.motion.set.catch[1] = Catch::begin(&arm.config);
        }
        if decelerates {
            arm.motion.set.deceleration[1] = Some(Deceleration::led(POSE[1], 0.0, &arm.config, &limits));
        }
        let found = (0..100).any(|_| arm.tick(mode, braking, along * speed).1[1].overloaded);
        assert_eq!(found, error, "{mode:?} {catches} {decelerates} {braking} {speed}");
    }
}

#[test]
fn j43_set_values_are_looked_at_where_the_law_holds_a_joint() {
    for (mode, braking, holding, errors) in [
        (ControlMode::Hold, false, true, joint_error::POSITION_ERROR),
        (ControlMode::Hold, true, true, joint_error::POSITION_ERROR),
        (ControlMode::Hold, false, false, 0),
        (ControlMode::Teach, false, true, 0),
        (ControlMode::Follow, false, true, joint_error::POSITION_ERROR),
        (ControlMode::Follow, true, true, 0),
        (ControlMode::Approach, false, true, joint_error::POSITION_ERROR),
        (ControlMode::Approach, true, true, 0),
    ] {
        let mut arm = Arm::held(NONE);
        arm.motion.set.holding = [holding; JOINTS];
        arm.motion.set.point.position[4] += 2.0 * arm.config.joints[4].position_error_max;
        let found = arm.tick(mode, braking, 0.0).1.map(|found| found.errors);
        assert_eq!(found, [0, 0, 0, 0, errors, 0], "{mode:?} {braking} {holding}");
    }
}

#[test]
fn j40_j41_j42_the_torque_is_the_sum_of_its_parts() {
    let torque = JointTorque {
        model: 128.0,
        pid: PidTorque { p: 1.0, i: 2.0, d: 4.0 },
        friction: 8.0,
        payload: 16.0,
        brake: 32.0,
        blend: 64.0,
    };
    assert_eq!((torque.correction(), torque.sum()), (127.0, 255.0));
}

/// As much as is wanted, or else as much as the limit leaves; never against what is wanted.
#[test]
fn j25_a_brake_takes_what_the_limit_leaves_and_no_more() {
    for (wanted, torque, taken) in [
        (15.0, 80.0, 15.0),
        (50.0, 80.0, 20.0),
        (-250.0, 80.0, -180.0),
        (50.0, -80.0, 50.0),
        (250.0, -80.0, 180.0),
        (-50.0, -80.0, -20.0),
        (50.0, 120.0, 0.0),
        (-50.0, 120.0, -50.0),
        (-50.0, -120.0, 0.0),
        (300.0, -120.0, 220.0),
    ] {
        assert_eq!(within(wanted, torque, 100.0), taken, "{wanted} to {torque} N·m");
    }
}

/// A joint that is not enabled yet may be found anywhere, at any speed; nothing is asked of it.
#[test]
fn j16_a_joint_that_is_not_enabled_has_no_torque_no_brake_and_no_error() {
    let off = 3;
    for (mode, velocity, error) in [
        (ControlMode::Follow, 0.0, joint_error::FRICTION_TABLE),
        (ControlMode::Teach, 1.5 * Config::avena().teach_velocity_max, 0),
    ] {
        let mut arm = Arm::held(NONE);
        arm.motion.set.holding[off] = false;
        let axis = |from: f32| core::array::from_fn(|k| from + k as f32);
        arm.table =
            Some([TableOf { velocity: axis(0.1), temperature: axis(20.0), torque: [[3.0; 20]; 20] }; JOINTS]);
        let (torque, found) =
            arm.tick_of(mode, false, &Nodes::enabled_at(POSE, [velocity; JOINTS]).with_torque_off(off));
        for j in 0..JOINTS {
            assert_eq!(found[j].errors, if j == off { 0 } else { error }, "{mode:?}, joint {}", j + 1);
            let brakes = mode == ControlMode::Teach && j != off;
            assert_eq!(arm.motion.law.torque[j].brake < 0.0, brakes, "{mode:?}, joint {}", j + 1);
        }
        assert_eq!((torque[off], arm.motion.law.torque[off]), (0.0, JointTorque::default()), "{mode:?}");
    }
}
