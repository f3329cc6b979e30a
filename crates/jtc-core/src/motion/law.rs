//! The control law: τ = τ_id + τ_pid + τ_fric and its limits, each tick, for each joint (section 6).
use jtc_dynamics::Dynamics;

use super::Motion;
use crate::config::{Config, PidGains, TableOf};
use crate::nodes::Nodes;
use crate::pid::PidTorque;
use crate::{JOINTS, friction, joint_error, limits};

/// Most that the brake of teaching takes from a speed, 1/s. Measured speeds are about 8 ms old, being averages of the drives: a
/// brake above 200 1/s would drive a joint to and fro, and joints that move each other make that less.
const BRAKE_RATE: f64 = 100.0;

/// Rotor inertia of a drive of which none is given, kg·m²: that of the known drives.
const UNKNOWN_ROTOR: f64 = 0.7;
/// Speed above which torque at its limit that drives the joint on catches nothing, rad/s.
const DRIVEN: f64 = 0.05;

/// Which parts of the control law act.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Law {
    /// Gravity and PID.
    Hold,
    /// Everything, with commanded velocity and acceleration.
    Follow,
    /// The same on the way to the path. Limits of the path do not bear on it: it begins where the arm was found.
    Approach,
    /// Gravity and a brake above the speed limit.
    Teach,
}

impl Law {
    /// Commanded velocity and acceleration are part of it.
    fn moves(self) -> bool {
        matches!(self, Self::Follow | Self::Approach)
    }
}

/// Parameters that the law uses.
pub(crate) struct ControlParameters<'a> {
    pub dynamics: &'a Dynamics,
    pub pid: &'a [PidGains; JOINTS],
    pub polynomial: &'a [[f64; 6]; JOINTS],
    pub table: Option<&'a [TableOf<f32>; JOINTS]>,
}

/// Parts of one joint's torque, N·m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct JointTorque {
    pub model: f64,
    pub pid: PidTorque,
    pub friction: f64,
    /// What teaching carries besides the model.
    pub payload: f64,
    /// Brake of teaching.
    pub brake: f64,
    /// What is left of a step that is being blended out.
    pub blend: f64,
}

impl JointTorque {
    /// All but the model.
    pub fn correction(&self) -> f64 {
        self.pid.sum() + self.friction + self.payload + self.brake + self.blend
    }

    pub fn sum(&self) -> f64 {
        self.model + self.correction()
    }
}

impl Motion {
    /// The control law and its limits: torques to command, and joint errors found on the way. `braking`: with all the torque
    /// there is, so that what this does to the torque, and on the path to position error and acceleration, is none (J-33).
    pub fn control(
        &mut self,
        law: Law,
        braking: bool,
        nodes: &Nodes,
        config: &Config,
        parameters: &ControlParameters<'_>,
    ) -> ([f64; JOINTS], [u16; JOINTS]) {
        let missing = self.compute(law, nodes, config, parameters);
        if self.yielding {
            self.soften(config);
        }
        let (torque, mut errors) = self.limit(law, braking, nodes, config, parameters);
        for (j, error) in errors.iter_mut().enumerate() {
            if nodes.node(j).enabled() {
                *error |= missing[j];
            }
        }
        (torque, errors)
    }

    /// Computes the torque of this tick into `self.torque`; returns joint errors found on the way (friction table).
    fn compute(
        &mut self,
        law: Law,
        nodes: &Nodes,
        config: &Config,
        parameters: &ControlParameters<'_>,
    ) -> [u16; JOINTS] {
        let mut errors = [0; JOINTS];
        let before = self.transfer.begin(&self.torque);
        let q = nodes.positions();
        let v = nodes.velocities();
        // J-40: measured position; commanded velocity and acceleration in Operate, zero elsewhere.
        let zero = [0.0; JOINTS];
        let (qd, qdd) = if law.moves() { (self.set.velocity, self.set.acceleration) } else { (zero, zero) };
        let model = parameters.dynamics.inverse(q, &qd, &qdd);
        let payload = if law == Law::Teach {
            self.payload.torque(parameters.dynamics, q, v, config)
        } else {
            [0.0; JOINTS]
        };
        for j in 0..JOINTS {
            let limit = &config.joints[j];
            let mut torque = JointTorque {
                model: model[j] + limit.rotor_inertia * qdd[j],
                payload: payload[j],
                ..JointTorque::default()
            };
            if law != Law::Teach {
                let error = self.set.position[j] - q[j];
                let at_rest = self.set.velocity[j] == 0.0 && self.set.acceleration[j] == 0.0;
                let encoder_step = at_rest.then_some(config.encoder_step);
                let saturated = self.saturation[j].saturated;
                torque.pid = self.pid[j].step(&parameters.pid[j], error, saturated, encoder_step);
            }
            if law.moves() {
                let t = friction::celsius(nodes.node(j).report.temperature);
                torque.friction = match parameters.table {
                    None => {
                        friction::polynomial(&parameters.polynomial[j], qd[j], t, config.friction_sign_width)
                    }
                    Some(tables) => {
                        let (slowest, fastest) = friction::velocities(&tables[j]);
                        let nearest = qd[j].max(slowest).min(fastest);
                        let v = if law == Law::Approach { nearest } else { qd[j] };
                        friction::table(&tables[j], v, t).unwrap_or_else(|| {
                            errors[j] |= joint_error::FRICTION_TABLE;
                            0.0
                        })
                    }
                };
            }
            self.torque[j] = torque;
        }
        self.transfer.blend(before, &mut self.torque, nodes, config);
        if law == Law::Hold && !self.yielding && self.all_holding() {
            self.payload.observe(&self.torque.map(|t| t.correction()));
        } else {
            self.payload.forget();
        }
        if law == Law::Teach {
            self.brake(nodes, config, parameters);
        }
        errors
    }

    /// Teaching brakes joints above the speed limit (J-25).
    fn brake(&mut self, nodes: &Nodes, config: &Config, parameters: &ControlParameters<'_>) {
        let limit = config.teach_velocity_max;
        let excess = nodes.velocities().map(|v| v - v.max(-limit).min(limit));
        if excess == [0.0; JOINTS] {
            return;
        }
        let mass = parameters.dynamics.mass_matrix(nodes.positions());
        for (j, torque) in self.torque.iter_mut().enumerate() {
            let joint = &config.joints[j];
            // A rotor that nobody gave is there all the same.
            let rotor = if joint.rotor_inertia > 0.0 { joint.rotor_inertia } else { UNKNOWN_ROTOR };
            let damping = config.teach_damping.min(BRAKE_RATE * (mass[j][j] + rotor));
            if nodes.node(j).enabled() {
                torque.brake = within(-damping * excess[j], torque.sum(), joint.torque_max);
            }
        }
    }

    /// Bounds what the law adds to the torque of the model (J-66).
    fn soften(&mut self, config: &Config) {
        for (torque, joint) in self.torque.iter_mut().zip(&config.joints) {
            let most = config.yield_torque_share * joint.torque_max;
            let correction = torque.correction();
            torque.blend += correction.max(-most).min(most) - correction;
        }
    }

    /// The torques to command and the joint errors found, both per joint (J-43).
    fn limit(
        &mut self,
        law: Law,
        braking: bool,
        nodes: &Nodes,
        config: &Config,
        parameters: &ControlParameters<'_>,
    ) -> ([f64; JOINTS], [u16; JOINTS]) {
        let (mut torque, mut errors) = ([0.0; JOINTS], [0; JOINTS]);
        // Only while path time runs: an arm that is pushed away from where the path stands is not to be fought (J-66).
        let on_path = braking && law == Law::Follow;
        let excused = if on_path { joint_error::POSITION_ERROR | joint_error::ACCELERATION } else { 0 };
        for j in 0..JOINTS {
            let limits = &config.joints[j];
            let computed = self.torque[j].sum();
            let catching = self.catch[j].step(nodes.velocities()[j]) && law == Law::Hold;
            // Torque that drives a joint on, rather than stop it, is neither a catch nor a way to rest.
            let driven = computed.signum() * nodes.velocities()[j] > DRIVEN;
            let stopping = (catching || self.coast[j].is_some()) && !driven;
            let (limited, torque_error) =
                self.saturation[j].limit(computed, limits, config.torque_over_ms, braking || stopping);
            let joint = (self.set.position[j], self.set.velocity[j], self.set.acceleration[j]);
            let set_error = limits::check_set(joint, nodes.positions()[j], limits, law == Law::Follow);
            torque[j] = limited;
            if catching && self.saturation[j].saturated {
                self.sag(j, computed - limited, nodes, config, parameters);
            }
            errors[j] =
                torque_error | if law != Law::Teach && self.holding[j] { set_error & !excused } else { 0 };
        }
        (torque, errors)
    }
}

/// As much of the `wanted` torque as a `torque` so far leaves of the limit, N·m.
fn within(wanted: f64, torque: f64, torque_max: f64) -> f64 {
    let (low, high) = ((-torque_max - torque).min(0.0), (torque_max - torque).max(0.0));
    wanted.max(low).min(high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Parameters;
    use crate::catch::Catch;
    use crate::coast::Coast;
    use crate::config::Friction;

    /// A bent arm: gravity loads joint 2 with some tens of N·m.
    const POSE: [f64; JOINTS] = [0.1, 0.9, 0.4, -0.2, 0.3, 0.5];
    const LAWS: [Law; 4] = [Law::Hold, Law::Follow, Law::Approach, Law::Teach];

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
        fn held(gains: PidGains) -> Self {
            let config = Config::avena();
            let mut motion = Motion::default();
            motion.begin_at(&POSE);
            motion.hold_for_test();
            let Friction::Polynomial(polynomial) = Parameters::avena().friction else { unreachable!() };
            let dynamics = Dynamics::new(&Parameters::avena().model, config.gravity);
            Self { config, dynamics, pid: [gains; JOINTS], polynomial, table: None, motion }
        }

        /// A tick at the pose, with the measured `velocity` (rad/s): torques and errors.
        fn tick(&mut self, law: Law, braking: bool, velocity: f64) -> ([f64; JOINTS], [u16; JOINTS]) {
            let nodes = Nodes::enabled_at(POSE, [velocity; JOINTS]);
            let parameters = ControlParameters {
                dynamics: &self.dynamics,
                pid: &self.pid,
                polynomial: &self.polynomial,
                table: self.table.as_ref(),
            };
            self.motion.control(law, braking, &nodes, &self.config, &parameters)
        }
    }

    const NONE: PidGains = PidGains { kp: 0.0, ki: 0.0, kd: 0.0, int_min: -1.0, int_max: 1.0 };

    /// Also where set values move: a joint that comes to rest in HoldPos has a velocity.
    #[test]
    fn j40_j42_velocity_acceleration_and_friction_are_part_of_the_law_on_the_way_only() {
        for law in LAWS {
            let mut arm = Arm::held(NONE);
            let (qd, qdd) = ([0.5, -0.4, 0.3, 0.2, -0.1, 0.6], [1.0, 2.0, -3.0, 0.5, 1.0, -2.0]);
            (arm.motion.set.velocity, arm.motion.set.acceleration) = (qd, qdd);
            arm.tick(law, false, 0.0);
            let moves = matches!(law, Law::Follow | Law::Approach);
            let (gravity, all) = (arm.dynamics.gravity_torque(&POSE), arm.dynamics.inverse(&POSE, &qd, &qdd));
            for j in 0..JOINTS {
                let model =
                    if moves { all[j] + arm.config.joints[j].rotor_inertia * qdd[j] } else { gravity[j] };
                let torque = &arm.motion.torque[j];
                assert!((torque.model - model).abs() < 1e-9, "{law:?}, joint {}: {torque:?}", j + 1);
                assert_eq!(torque.friction != 0.0, moves, "{law:?}, joint {}: {torque:?}", j + 1);
            }
        }
    }

    /// Such a table is for no path, but an arm can be held with it.
    #[test]
    fn j42_a_table_without_standstill_is_no_error_while_the_arm_is_held() {
        for (law, error) in [(Law::Hold, 0), (Law::Teach, 0), (Law::Follow, joint_error::FRICTION_TABLE)] {
            let mut arm = Arm::held(NONE);
            let axis = |from: f32| core::array::from_fn(|k| from + k as f32);
            arm.table = Some(
                [TableOf { velocity: axis(0.1), temperature: axis(20.0), torque: [[3.0; 20]; 20] }; JOINTS],
            );
            assert_eq!(arm.tick(law, false, 0.0).1, [error; JOINTS], "{law:?}");
        }
    }

    #[test]
    fn j25_only_teaching_carries_what_was_found_missing() {
        let mut arm = Arm::held(NONE);
        let missing = arm.dynamics.flange_torque(&POSE).map(|torque| 2.0 * torque);
        (0..1_000).for_each(|_| arm.motion.payload.observe(&missing));
        arm.motion.begin_teaching(&Nodes::enabled_at(POSE, [0.0; JOINTS]), &arm.config, &arm.dynamics);
        for law in LAWS {
            arm.tick(law, false, 0.0);
            for (torque, missing) in arm.motion.torque.iter().zip(&missing) {
                let carried = if law == Law::Teach { *missing } else { 0.0 };
                assert!((torque.payload - carried).abs() < 0.01, "{law:?}: {torque:?}, {missing}");
            }
        }
    }

    #[test]
    fn j25_what_is_missing_is_observed_while_the_arm_is_held_at_rest_and_firmly() {
        let observed = |law: Law, change: fn(&mut Arm)| {
            let mut arm = Arm::held(NONE);
            arm.tick(Law::Hold, false, 0.0);
            change(&mut arm);
            arm.tick(law, false, 0.0);
            arm.motion.payload.is_known(&arm.config)
        };
        assert!(observed(Law::Hold, |_| ()));
        assert!(LAWS.iter().all(|&law| observed(law, |_| ()) == (law == Law::Hold)));
        assert!(!observed(Law::Hold, |arm| arm.motion.yielding = true));
        assert!(!observed(Law::Hold, |arm| arm.motion.holding[3] = false));
    }

    /// In motion errors below what an encoder can tell add up as well.
    #[test]
    fn j41_the_integral_is_held_within_an_encoder_step_at_rest_only() {
        for (velocity, acceleration, held) in
            [(0.0, 0.0, true), (0.1, 0.0, false), (0.0, 0.1, false), (-0.1, 0.1, false)]
        {
            let mut arm = Arm::held(PidGains { ki: 1.0, ..NONE });
            arm.motion.set.position = POSE.map(|q| q + 0.5 * arm.config.encoder_step);
            (arm.motion.set.velocity, arm.motion.set.acceleration) =
                ([velocity; JOINTS], [acceleration; JOINTS]);
            arm.tick(Law::Follow, false, 0.0);
            let still = arm.motion.torque.map(|torque| torque.pid.i == 0.0);
            assert_eq!(still, [held; JOINTS], "{velocity} rad/s, {acceleration} rad/s²");
        }
    }

    /// Gravity is more than joint 2 can hold, in all cases. What the joint does beside that decides whether it is an error.
    #[test]
    fn j33_j43_torque_at_its_limit_is_excused_while_it_stops_a_joint() {
        let along = Arm::held(NONE).dynamics.gravity_torque(&POSE)[1].signum();
        for (law, catches, coasts, braking, speed, error) in [
            (Law::Hold, false, false, false, 0.0, true),
            (Law::Hold, false, false, true, 0.0, false),
            (Law::Hold, true, false, false, 0.0, false),
            (Law::Follow, true, false, false, 0.0, true),
            (Law::Hold, false, true, false, 0.0, false),
            // Against the motion it stops the joint, along with it it drives the joint on.
            (Law::Hold, true, false, false, -0.06, false),
            (Law::Hold, true, false, false, 0.06, true),
            (Law::Hold, false, true, false, 0.06, true),
            (Law::Hold, true, false, false, DRIVEN, false),
            (Law::Hold, true, false, true, 0.06, false),
        ] {
            // No set position sags where there is no error of position.
            let mut arm = Arm::held(NONE);
            arm.config.joints[1].torque_max = 10.0;
            let limits = arm.config.joints[1];
            if catches {
                arm.motion.catch[1] = Catch::begin(&arm.config);
            }
            if coasts {
                arm.motion.coast[1] = Some(Coast::led(POSE[1], 0.0, &arm.config, &limits));
            }
            let found =
                (0..100).any(|_| arm.tick(law, braking, along * speed).1[1] & joint_error::TORQUE != 0);
            assert_eq!(found, error, "{law:?} {catches} {coasts} {braking} {speed}");
        }
    }

    #[test]
    fn j43_set_values_are_looked_at_where_the_law_holds_a_joint() {
        for (law, braking, holding, errors) in [
            (Law::Hold, false, true, joint_error::POSITION_ERROR),
            (Law::Hold, true, true, joint_error::POSITION_ERROR),
            (Law::Hold, false, false, 0),
            (Law::Teach, false, true, 0),
            (Law::Follow, false, true, joint_error::POSITION_ERROR),
            (Law::Follow, true, true, 0),
            (Law::Approach, true, true, joint_error::POSITION_ERROR),
        ] {
            let mut arm = Arm::held(NONE);
            arm.motion.holding = [holding; JOINTS];
            arm.motion.set.position[4] += 2.0 * arm.config.joints[4].position_error_max;
            let found = arm.tick(law, braking, 0.0).1;
            assert_eq!(found, [0, 0, 0, 0, errors, 0], "{law:?} {braking} {holding}");
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
}
