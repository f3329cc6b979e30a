//! Tests of the parts of the control law, each in the control modes in which the part is active (section 6).
use super::*;
use crate::Parameters;
use crate::motion::catch::Catch;
use crate::motion::deceleration::Deceleration;
use crate::motion::limiter::DRIVEN;
use crate::motion::pid::PidTorque;
use crate::motion::{Found, Motion};
use crate::parameters::Friction;

mod loads;
mod yields;

/// Pose of a bent arm, in which gravity loads joint 2 with several tens of N·m.
const POSE: [f64; JOINTS] = [0.1, 0.9, 0.4, -0.2, 0.3, 0.5];
const MODES: [ControlMode; 4] =
    [ControlMode::Hold, ControlMode::Follow, ControlMode::Approach, ControlMode::Teach];

/// Arm that is held with the given gains.
struct Arm {
    config: Config,
    dynamics: Dynamics,
    pid: [PidGains; JOINTS],
    polynomial: [[f64; 6]; JOINTS],
    table: Option<[TableOf<f32>; JOINTS]>,
    motion: Motion,
}

impl Arm {
    /// Creates a held arm without a measurement delay. Measurements are then compared with the set values of the same
    /// tick, so that one tick shows the result of the control law.
    fn held(gains: PidGains) -> Self {
        let config = Config { delay_ticks: 0, ..Config::avena() };
        let mut motion = Motion::default();
        motion.set.begin_at(&POSE);
        motion.set.hold_for_test();
        let Friction::Polynomial(polynomial) = Parameters::avena().friction else { unreachable!() };
        let dynamics = Dynamics::new(&Parameters::avena().model, config.gravity);
        Self { config, dynamics, pid: [gains; JOINTS], polynomial, table: None, motion }
    }

    /// Executes a tick in the pose `POSE`, with the measured `velocity` (rad/s) of all joints. Returns the torques
    /// and the findings of the limiter.
    fn tick(&mut self, mode: ControlMode, braking: bool, velocity: f64) -> ([f64; JOINTS], [Found; JOINTS]) {
        self.tick_of(mode, braking, &Nodes::enabled_at(POSE, [velocity; JOINTS]))
    }

    /// Executes a tick with these nodes.
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
            on_trial: false,
        };
        let limited =
            self.motion.control(&LawInputs { mode, braking, nodes, config: &self.config, parameters });
        (limited.torque, limited.found.unwrap_or_default())
    }
}

const NONE: PidGains = PidGains { kp: 0.0, ki: 0.0, kd: 0.0, int_min: -1.0, int_max: 1.0 };

/// In HoldPos, friction and the commanded velocity and acceleration do not affect the torque. This is also true if
/// the set values move while a joint comes to rest.
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

/// A friction table without standstill causes an error on a path, but not while the arm is held.
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

/// Returns an arm in Teaching with these learned loads (N·m).
fn taught(loads: &[f64; JOINTS]) -> Arm {
    let mut arm = Arm::held(NONE);
    for (load, torque) in arm.motion.law.loads.iter_mut().zip(loads) {
        load.set(*torque);
    }
    arm.motion.law.begin_teaching(&Nodes::enabled_at(POSE, [0.0; JOINTS]), &arm.config);
    arm
}

#[test]
fn j25_only_teaching_carries_the_load_found_as_load() {
    let found = [3.0, -20.0, 12.0, 5.0, -2.0, 1.0];
    for mode in MODES {
        let mut arm = taught(&found);
        arm.tick(mode, false, 0.0);
        for (torque, found) in arm.motion.law.torque.iter().zip(&found) {
            let carried = if mode == ControlMode::Teach { *found } else { 0.0 };
            assert!((torque.load - carried).abs() < 1e-6, "{mode:?}: {torque:?}, {found}");
        }
    }
}

#[test]
fn j25_a_load_that_nobody_has_found_is_not_carried() {
    let mut arm = taught(&[20.0; JOINTS]);
    arm.motion.law.payload_comes();
    arm.motion.law.begin_teaching(&Nodes::enabled_at(POSE, [0.0; JOINTS]), &arm.config);
    arm.tick(ControlMode::Teach, false, 0.0);
    assert_eq!(arm.motion.law.torque.map(|torque| torque.load), [0.0; JOINTS]);
}

/// Teaching can begin only if the load of every held joint is known. While the integral releases torque, no load is
/// known. The load of an absent joint need not be known.
#[test]
fn j25_the_loads_are_known_when_each_joint_that_is_held_has_found_its_own() {
    let mut arm = taught(&[1.0; JOINTS]);
    let (law, config) = (&mut arm.motion.law, &arm.config);
    law.torque = Default::default();
    law.torque.iter_mut().for_each(|torque| torque.pid.i = 1.0);
    assert!(law.knows_loads(&[true; JOINTS], config, false));
    // The torque of the position error may come from a person who leans on joint 2. The load counts as known up to a
    // feedback torque of 0.04 · 180 N·m = 7.2 N·m. During a contact, this limit does not apply.
    for (p, known) in [(7.1, true), (-7.1, true), (7.3, false), (-7.3, false)] {
        law.torque[1].pid.p = p;
        assert_eq!(law.knows_loads(&[true; JOINTS], config, false), known, "{p} N·m");
        assert!(law.knows_loads(&[true; JOINTS], config, true), "a contact is not waited for");
    }
    law.torque[1].pid.p = 0.0;
    law.loads[3].forget();
    assert!([true, false].iter().all(|&contact| !law.knows_loads(&[true; JOINTS], config, contact)));
    assert!(law.knows_loads(&[true, true, true, false, true, true], config, false));
    law.unwinds_ms = 1;
    assert!(!law.knows_loads(&[true, true, true, false, true, true], config, false));
}

/// Above the tool speed limit, every moving joint has more damping, up to the highest damping that its inertia tolerates.
#[test]
fn j25_above_the_tool_speed_limit_every_joint_is_braked_harder() {
    let brakes = |tool_speed_max: f64| {
        let mut arm = taught(&[0.0; JOINTS]);
        arm.config.tool_speed_max = tool_speed_max;
        (0..30).for_each(|_| {
            arm.tick(ControlMode::Teach, false, 0.35);
        });
        arm.motion.law.torque.map(|torque| torque.brake)
    };
    let speed = Arm::held(NONE).dynamics.flange_speed(&POSE, &[0.35; JOINTS]);
    let (off, below, at, twice) =
        (brakes(0.0), brakes(1.01 * speed), brakes(speed / 1.5), brakes(0.5 * speed));
    assert_eq!(off, below);
    // Only joints 1 to 3 get more damping. Joints 4 to 6 already have the highest damping that their inertia
    // tolerates.
    for j in 0..JOINTS {
        assert!(off[j] < 0.0 && at[j] <= off[j] && twice[j] <= at[j], "joint {}: {off:?} {at:?}", j + 1);
        assert!(j > 2 || twice[j] < off[j], "joint {}: {off:?} {twice:?}", j + 1);
    }
}

/// In motion, the integral also accumulates errors that are smaller than the encoder resolution.
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

/// Gravity exceeds the torque limit of joint 2. While the torque stops the joint, this overload is not an error.
/// While the torque drives the joint, it is an error.
#[test]
fn j33_j43_torque_at_its_limit_is_excused_while_it_stops_a_joint() {
    let along = Arm::held(NONE).dynamics.gravity_torque(&POSE)[1].signum();
    for (mode, catches, decelerates, braking, speed, error) in [
        (ControlMode::Hold, false, false, false, 0.0, true),
        (ControlMode::Hold, false, false, true, 0.0, false),
        (ControlMode::Hold, true, false, false, 0.0, false),
        (ControlMode::Follow, true, false, false, 0.0, true),
        (ControlMode::Hold, false, true, false, 0.0, false),
        // A torque against the motion stops the joint and is permitted. A torque along the motion drives the joint,
        // and is an error at more than 0.05 rad/s.
        (ControlMode::Hold, true, false, false, -0.06, false),
        (ControlMode::Hold, true, false, false, 0.06, true),
        (ControlMode::Hold, false, true, false, 0.06, true),
        (ControlMode::Hold, true, false, false, DRIVEN, false),
        (ControlMode::Hold, true, false, true, 0.06, false),
    ] {
        // With gains of zero and no position error, the set position does not sag during a catch.
        let mut arm = Arm::held(NONE);
        arm.config.joints[1].torque_max = 10.0;
        let limits = arm.config.joints[1];
        if catches {
            arm.motion.set.catch[1] = Catch::begin(&arm.config);
        }
        if decelerates {
            arm.motion.set.deceleration[1] = Some(Deceleration::led(POSE[1], 0.0, 200.0, &limits));
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
        load: 16.0,
        brake: 32.0,
        blend: 64.0,
    };
    assert_eq!((torque.correction(), torque.sum()), (127.0, 255.0));
}

/// The braking torque is reduced to the part that the torque limit leaves. The braking torque never changes its sign.
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

/// A joint that is not enabled can have any position and any speed. Its limits do not apply, so it has no error. Its
/// torque and its braking torque are zero.
#[test]
fn j16_a_joint_that_is_not_enabled_has_no_torque_no_brake_and_no_error() {
    let off = 3;
    for (mode, velocity, error) in
        [(ControlMode::Follow, 0.0, joint_error::FRICTION_TABLE), (ControlMode::Teach, 1.5, 0)]
    {
        let mut arm = Arm::held(NONE);
        arm.motion.law.begin_teaching(&Nodes::enabled_at(POSE, [0.0; JOINTS]), &arm.config);
        arm.motion.set.holding[off] = false;
        let axis = |from: f32| core::array::from_fn(|k| from + k as f32);
        arm.table =
            Some([TableOf { velocity: axis(0.1), temperature: axis(20.0), torque: [[3.0; 20]; 20] }; JOINTS]);
        let nodes = Nodes::enabled_at(POSE, [velocity; JOINTS]).with_torque_off(off);
        if mode == ControlMode::Teach {
            // The first ticks of Teaching compute the inertia of the arm and of each joint. Teaching brakes only
            // after them.
            (0..10).for_each(|_| {
                arm.tick_of(mode, false, &nodes);
            });
        }
        let (torque, found) = arm.tick_of(mode, false, &nodes);
        for j in 0..JOINTS {
            assert_eq!(found[j].errors, if j == off { 0 } else { error }, "{mode:?}, joint {}", j + 1);
            let brakes = mode == ControlMode::Teach && j != off;
            assert_eq!(arm.motion.law.torque[j].brake < 0.0, brakes, "{mode:?}, joint {}", j + 1);
        }
        assert_eq!((torque[off], arm.motion.law.torque[off]), (0.0, JointTorque::default()), "{mode:?}");
    }
}
