//! A measurement is older than the set value of the same tick. The controller compares each measurement with the set value for the time of
//! the measurement (J-62).
use crate::{plant, rig};

use std::collections::VecDeque;

use jtc_core::{Config, ControllerState, JointTelemetry, Parameters, TrajectoryState, joint_error};
use jtc_dynamics::Dynamics;
use jtc_wire::{DataStatus, ExecCommand, FrameType, RawPoint};
use plant::{ENCODER_STEP, LuGre, Plant};
use proptest::prelude::*;
use rig::{Rig, floats, pieces, put};

const DT: f64 = 1e-3;
/// Highest allowed delay setting.
const DELAY_MAX: u8 = 7;

fn delayed(ticks: u8) -> Config {
    // A wrong delay setting causes a position error even if the arm follows its set values exactly. This error must
    // not count as a push.
    let mut config = Config { delay_ticks: ticks, torque_release: true, ..Config::avena() };
    if ticks > 3 {
        // With the longest delays, the gains require joints with more inertia (J-71).
        config.joints.iter_mut().for_each(|joint| joint.rotor_inertia = 1.8);
    }
    config
}

/// Returns the points of a motion of all joints by `ways` (rad) and back, in `seconds` for each direction.
fn there_and_back(ways: &[f64; 6], seconds: f64) -> Vec<RawPoint> {
    let steps = (100.0 * seconds) as u32;
    let point = |k: u32| {
        let (u, back) = if k > steps { (2 * steps - k, -1.0) } else { (k, 1.0) };
        let u = f64::from(u) / f64::from(steps);
        let mut point = RawPoint::default();
        for (j, way) in ways.iter().enumerate() {
            let q = way * u * u * u * (10.0 + u * (6.0 * u - 15.0));
            let v = back * way * 30.0 * u * u * (1.0 - u) * (1.0 - u) / seconds;
            let a = way * 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / (seconds * seconds);
            put(&mut point, j, q, v, a);
        }
        point
    };
    (0..=2 * steps).map(point).collect()
}

/// A simulated arm whose drives report positions that are `late` ticks old.
struct LateArm {
    arm: Plant,
    rig: Rig,
    /// True positions of the joints in the last ticks, newest first.
    past: VecDeque<[f64; 6]>,
    late: usize,
}

impl LateArm {
    /// Creates an arm that is equal to its model and has no friction, so that late measurements cause the only deviation.
    fn holding(late: u8, config: Config) -> Self {
        let arm = Plant::new(&Parameters::avena().model, [LuGre::NONE; 6], [0.0; 6]);
        let mut rig = Rig::new(config);
        rig.follow = false;
        rig.send(FrameType::FrictionPolynomial, &floats([0.0f32; 24]));
        rig.send(FrameType::PidParamUseDefault, &[]);
        rig.send(FrameType::ArmModelUseDefault, &[]);
        let past = [arm.q; DELAY_MAX as usize + 1].into();
        let mut all = Self { arm, rig, past, late: late.into() };
        (0..300).for_each(|_| all.tick());
        assert_eq!(all.rig.state(), ControllerState::HoldPos);
        all
    }

    /// Advances one millisecond. The controller receives an answer of the rig in the tick after the answer was sent.
    fn tick(&mut self) {
        self.past.pop_back();
        self.past.push_front(self.arm.q);
        self.arm.tick_seen_at(&mut self.rig, &self.past[self.late - 1]);
    }

    /// Executes a path with these `points`. Returns two values for each joint: the RMS of the difference between commanded and true
    /// position, and the RMS of the commanded velocity.
    fn follow(&mut self, points: &[RawPoint]) -> [(f64, f64); 6] {
        self.rig.upload(points, 10);
        self.rig.send(FrameType::TrajSetExecStatus, &[ExecCommand::Execute as u8]);
        let (mut sums, mut count) = ([(0.0, 0.0); 6], 0.0);
        for _ in 0..20_000 {
            let here = self.arm.q;
            self.tick();
            let t = self.rig.controller.telemetry();
            if t.trajectory == TrajectoryState::Finish {
                return sums.map(|(error, velocity): (f64, f64)| {
                    (f64::sqrt(error / count), f64::sqrt(velocity / count))
                });
            }
            if t.point > 0 {
                count += 1.0;
                for (j, sum) in sums.iter_mut().enumerate() {
                    sum.0 += (t.joints[j].set_position - here[j]).powi(2);
                    sum.1 += t.joints[j].set_velocity.powi(2);
                }
            }
            assert_eq!(self.rig.errors(), 0, "{t:?}");
        }
        panic!("it does not finish: {:?}", self.rig.controller.telemetry());
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 8, failure_persistence: None, ..Default::default() })]

    /// If the delay setting is wrong by some ticks, the arm deviates by the distance that it moves in these ticks. With the correct
    /// setting, only a small part of this deviation remains.
    #[test]
    fn j62_the_true_position_follows_best_with_the_delay_that_the_answers_have(
        late in 1..=4u8,
        ways in prop::array::uniform6(prop_oneof![-0.7..-0.3f64, 0.3..0.7f64]),
        seconds in 1.2..2.0f64,
    ) {
        let points = there_and_back(&ways, (100.0 * seconds).round() / 100.0);
        let follow = |delay: u8| LateArm::holding(late, delayed(delay)).follow(&points);
        let right = follow(late);
        for wrong in [0, late - 1, late + 1] {
            let ticks = (f64::from(late) - f64::from(wrong)).abs();
            for (j, (right, wrong)) in right.iter().zip(follow(wrong)).enumerate() {
                let way = ticks * DT * wrong.1;
                prop_assert!(right.0 < 0.4 * way + ENCODER_STEP, "joint {}: {right:?} of {way}", j + 1);
                prop_assert!((wrong.0 / way - 1.0).abs() < 0.4, "joint {}: {wrong:?}, {way}", j + 1);
            }
        }
    }
}

/// Simulated arm that is exactly at its commanded position in each tick, or at the position to which a hand has moved it. The answers of
/// the arm are at least two ticks old.
struct ExactArm {
    rig: Rig,
    here: [f64; 6],
    past: VecDeque<[f64; 6]>,
}

impl ExactArm {
    fn holding(late: u8) -> Self {
        let mut rig = Rig::holding_with(delayed(late));
        rig.follow = false;
        // The controller receives an answer one tick after it was sent, and this answer shows the effect of the
        // command of one tick before. The queue therefore has two entries fewer than `late`.
        Self { rig, here: [0.0; 6], past: vec![[0.0; 6]; usize::from(late) - 2].into() }
    }

    /// Executes one tick. In Teaching, a hand moves the arm at the velocity `led` (rad/s).
    fn tick(&mut self, led: f64) -> [JointTelemetry; 6] {
        self.past.push_front(self.here);
        let seen = self.past.pop_back().expect("as many as before");
        let teaching = self.rig.state() == ControllerState::Teaching;
        let before = self.rig.controller.telemetry().joints;
        for (j, node) in self.rig.nodes[..6].iter_mut().enumerate() {
            node.report.position = seen[j];
            node.report.velocity = if teaching { led } else { before[j].set_velocity };
        }
        self.rig.tick();
        let now = self.rig.controller.telemetry().joints;
        let led = self.here.map(|q| q + led * DT);
        let held = self.rig.state() != ControllerState::Teaching;
        self.here = if held { now.map(|joint| joint.set_position) } else { led };
        now
    }

    /// Executes ticks until `done` returns `true`. Checks that the torque of the PID controller is zero in every tick.
    fn run(&mut self, what: &str, led: f64, mut done: impl FnMut(&Rig) -> bool) {
        for tick in 0..5_000 {
            if done(&self.rig) {
                return;
            }
            let joints = self.tick(led);
            let taught = self.rig.state() == ControllerState::Teaching;
            for (j, joint) in joints.iter().enumerate() {
                assert!(
                    !taught || joint.position_error() == 0.0,
                    "an arm that is led is where it is to be: {joint:?}"
                );
                let pid = [joint.torque_p, joint.torque_i, joint.torque_d];
                // The bus carries velocities in steps of 61 µrad/s, so the torque is not exactly zero.
                let quiet = pid.iter().all(|part| part.abs() < 0.05);
                assert!(quiet, "{what}, tick {tick}, joint {}: {pid:?}, {joint:?}", j + 1);
            }
            assert_eq!(self.rig.errors(), 0, "{what}");
        }
        panic!("{what}: it goes on for ever: {:?}", self.rig.controller.telemetry());
    }

    /// Sends a command and executes ticks until the command has taken effect.
    fn command(&mut self, what: &str, frame: FrameType, body: &[u8], done: fn(&Rig) -> bool) {
        self.rig.send(frame, body);
        let mut ticks = 0;
        self.run(what, 0.0, |rig| {
            ticks += 1;
            ticks > 3 && done(rig)
        });
    }
}

/// If an arm follows its set values exactly, the torque of the PID controller must be zero, also when a motion
/// begins, continues or ends.
#[test]
fn j44_j62_an_arm_that_follows_exactly_has_no_pid_torque_at_any_change() {
    const EXEC: FrameType = FrameType::TrajSetExecStatus;
    for late in 2..=DELAY_MAX {
        let mut arm = ExactArm::holding(late);
        arm.rig.upload(&there_and_back(&[0.4, -0.3, 0.5, 0.3, -0.6, 0.2], 1.0), 10);
        let held = |rig: &Rig| rig.state() == ControllerState::HoldPos;
        arm.command("approach and path", EXEC, &[3], |rig| rig.controller.telemetry().point > 700);
        arm.command("pause", EXEC, &[2], |rig| rig.trajectory() == TrajectoryState::Pause);
        arm.command("resume", EXEC, &[3], |rig| rig.trajectory() == TrajectoryState::Finish);
        arm.command("held", EXEC, &[1], held);
        arm.command("jog", FrameType::Jog, &floats([0.3f32, -0.2, 0.3, 0.4, -0.3, 0.5]), |rig| {
            rig.controller.telemetry().joints[0].set_velocity > 0.2
        });
        arm.run("jog ends", 0.0, |rig| {
            rig.controller.telemetry().joints.iter().all(|joint| joint.set_velocity == 0.0)
        });
        for led in [0.3, -0.8, 0.0] {
            arm.rig.send(FrameType::TeachingModeEnable, &[]);
            let mut ticks = 0;
            arm.run("led", led, |rig| {
                ticks += i32::from(rig.state() == ControllerState::Teaching);
                ticks > 400
            });
            arm.rig.send(FrameType::TeachingModeDisable, &[]);
            arm.run("teaching ends", led, held);
            // The joint has moved since the measurement, and comes to rest from its present position.
            let from = arm.here[0];
            for _ in 0..400 {
                arm.tick(0.0);
            }
            let way = arm.here[0] - from;
            assert!((way - 0.2 / 3.0 * led).abs() < 0.01, "{late} ticks, led at {led} rad/s: {way} rad");
        }
    }
}

#[test]
fn j62_a_joint_that_falls_when_it_is_enabled_has_no_pid_torque_if_it_follows() {
    const JOINT: usize = 1;
    for (late, velocity) in [(2, 0.6), (3, -0.4), (5, 1.1), (DELAY_MAX, -1.2)] {
        let mut arm = ExactArm::holding(late);
        // Enabling a drive takes a long time, and the joint begins to fall during this time.
        arm.rig.nodes[JOINT].slow_enable = true;
        arm.rig.press_stop(1);
        arm.rig.clear(true, 0x7F);
        arm.rig.until(1_000, |rig| rig.nodes[JOINT].report.state == jtc_bus::NodeState::new(12));
        for k in 1..=100 {
            let falls = velocity * f64::from(k) / 100.0;
            arm.past.push_front(arm.here);
            let seen = arm.past.pop_back().expect("as many as before");
            let report = &mut arm.rig.nodes[JOINT].report;
            (report.position, report.velocity) = (seen[JOINT], falls);
            arm.rig.tick();
            arm.here[JOINT] += velocity * DT;
        }
        arm.rig.nodes[JOINT].report.velocity = velocity;
        arm.rig.nodes[JOINT].report.state = jtc_bus::NodeState::ENABLED;
        // The joint continues its motion until the controller receives the answer with the enabled state.
        for _ in 0..900 {
            arm.past.push_front(arm.here);
            let seen = arm.past.pop_back().expect("as many as before");
            arm.rig.nodes[JOINT].report.position = seen[JOINT];
            arm.rig.tick();
            let joint = arm.rig.controller.telemetry().joints[JOINT];
            let held = joint.set_velocity != 0.0 || joint.torque != 0.0;
            let pid = [joint.torque_p, joint.torque_i, joint.torque_d];
            assert!(!held || pid.iter().all(|part| part.abs() < 0.05), "{late}, {velocity}: {joint:?}");
            let report = &mut arm.rig.nodes[JOINT].report;
            report.velocity = if held { joint.set_velocity } else { velocity };
            arm.here[JOINT] = if held { joint.set_position } else { arm.here[JOINT] + velocity * DT };
        }
        assert_eq!((arm.rig.state(), arm.rig.errors()), (ControllerState::HoldPos, 0), "{late}");
    }
}

/// Returns the points of a motion of joint 1 at 1 rad/s for half a second.
fn steady() -> Vec<RawPoint> {
    pieces(0, &[(5.0, 20), (0.0, 50), (-5.0, 20)])
}

/// At 1 rad/s, a joint moves by 1 mrad per tick. The position error exceeds its limit of 1.5 mrad only if the delay
/// setting is wrong by more than one tick.
#[test]
fn j43_j62_the_position_error_is_that_of_the_same_time() {
    for late in 2..=DELAY_MAX {
        for delay in 0..=DELAY_MAX {
            let mut arm = ExactArm::holding(late);
            arm.rig = Rig::holding_with({
                let mut config = delayed(delay);
                config.joints[0].position_error_max = 1.5e-3;
                config
            });
            arm.rig.follow = false;
            arm.rig.upload(&steady(), 10);
            arm.rig.send(FrameType::TrajSetExecStatus, &[3]);
            for _ in 0..1_300 {
                arm.tick(0.0);
            }
            let far = late.abs_diff(delay) > 1;
            let status = arm.rig.status();
            let found = status.joints[0].internal_occurred & joint_error::POSITION_ERROR != 0;
            assert_eq!(found, far, "{late} ticks late, set to {delay}");
            let finished = arm.rig.trajectory() == TrajectoryState::Finish;
            assert_eq!(finished, !far, "{late} ticks late, set to {delay}");
        }
    }
}

/// The reported position error is the position error that the control law uses. With a delay, the reported position error belongs to a time
/// that is earlier by the number of delay ticks.
#[test]
fn j62_the_error_that_is_reported_is_the_one_that_acts() {
    for delay in 0..=DELAY_MAX {
        let mut arm = ExactArm::holding(3);
        arm.rig = Rig::holding_with(delayed(delay));
        arm.rig.follow = false;
        arm.rig.upload(&steady(), 10);
        arm.rig.send(FrameType::TrajSetExecStatus, &[3]);
        let kp = Parameters::avena().pid[0].kp;
        let mut set: VecDeque<f64> = [0.0; DELAY_MAX as usize + 1].into();
        let mut most = 0.0;
        for _ in 0..1_300 {
            let joint = arm.tick(0.0)[0];
            set.pop_back();
            set.push_front(joint.set_position);
            assert_eq!(joint.due_position, set[usize::from(delay)], "{joint:?}");
            assert_eq!(joint.position_error(), joint.due_position - joint.position);
            assert_eq!(joint.torque_p, kp * joint.position_error(), "{joint:?}");
            most = f64::max(most, joint.position_error().abs());
        }
        let ticks = f64::from(delay.abs_diff(3));
        assert!((most - 1e-3 * ticks).abs() < 1e-4, "{delay}: {most} rad");
        assert_eq!(arm.rig.trajectory(), TrajectoryState::Finish);
    }
}

/// Without a delay, the control law compares the set value of this tick with the measured position. The law is then equal to the law of
/// J-40 and J-41 in every bit.
#[test]
fn j62_without_a_delay_the_present_set_value_is_compared() {
    let config = delayed(0);
    let dynamics = Dynamics::new(&Parameters::avena().model, config.gravity);
    let gains = Parameters::avena().pid;
    let mut arm = ExactArm::holding(4);
    arm.rig = Rig::holding_with(config.clone());
    arm.rig.follow = false;
    arm.rig.upload(&there_and_back(&[0.4, -0.3, 0.5, 0.3, -0.6, 0.2], 1.5), 10);
    assert_eq!(arm.rig.exec(ExecCommand::Execute), DataStatus::NoError);
    let mut moved = 0.0;
    while arm.rig.trajectory() == TrajectoryState::Execute {
        let joints = arm.tick(0.0);
        let (qd, qdd) = (joints.map(|j| j.set_velocity), joints.map(|j| j.set_acceleration));
        let model = dynamics.inverse(&joints.map(|j| j.position), &qd, &qdd);
        for (j, joint) in joints.iter().enumerate() {
            assert_eq!(joint.torque_p, gains[j].kp * (joint.set_position - joint.position));
            if arm.rig.state() == ControllerState::Operate {
                assert_eq!(joint.torque_model, model[j] + config.joints[j].rotor_inertia * qdd[j]);
            }
        }
        moved = f64::max(moved, qd[0].abs());
    }
    assert!(moved > 0.2, "{moved} rad/s");
}

/// The prediction for a lost measurement must be equal to this measurement. For an arm that follows its set values
/// exactly, the torque of the PID controller is then zero. The loss may occur at any time, also when the acceleration
/// changes suddenly, and the answers may have any age.
#[test]
fn j62_j63_a_lost_measurement_is_predicted_for_its_own_time() {
    for late in [2, 4, DELAY_MAX] {
        let mut worst = 0.0;
        for begin in (0..260).step_by(3) {
            let mut arm = ExactArm::holding(late);
            arm.rig.upload(&pieces(0, &[(5.0, 8), (-5.0, 8)]), 10);
            arm.rig.send(FrameType::TrajSetExecStatus, &[3]);
            for tick in 0..500 {
                arm.rig.nodes[0].silent = (180 + begin..184 + begin).contains(&tick);
                let joint = arm.tick(0.0)[0];
                worst = f64::max(worst, joint.position_error().abs());
            }
            assert_eq!((arm.rig.trajectory(), arm.rig.errors()), (TrajectoryState::Finish, 0));
        }
        // The prediction uses the rate over the last 5 ms. For some milliseconds after a sudden change of the
        // acceleration, this rate still contains earlier positions, which causes an error of the prediction.
        assert!(worst < 1.25e-4, "{late} ticks late: {worst} rad");
    }
}

/// Measurements are lost while Teaching ends and the position hold begins during a motion. The set values restart,
/// but the true motion does not change. The prediction must therefore continue without a step.
#[test]
fn j63_a_loss_over_the_end_of_teaching_makes_no_step() {
    for late in [2, 5] {
        for led in [0.4, -0.8] {
            for begin in 0..8 {
                let mut arm = ExactArm::holding(late);
                arm.rig.send(FrameType::TeachingModeEnable, &[]);
                for _ in 0..200 {
                    arm.tick(0.0);
                }
                for _ in 0..200 {
                    arm.tick(led);
                }
                arm.rig.send(FrameType::TeachingModeDisable, &[]);
                for tick in 0..200 {
                    arm.rig.nodes[0].silent = (begin..begin + 4).contains(&tick);
                    let joint = arm.tick(led)[0];
                    assert_eq!(arm.rig.errors(), 0);
                    let error = joint.position_error().abs();
                    assert!(
                        error < 1e-4,
                        "{late} ticks late, {led} rad/s, lost from {begin}, tick {tick}: {error} rad"
                    );
                }
            }
        }
    }
}
