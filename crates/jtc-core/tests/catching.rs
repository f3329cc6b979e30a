//! Tests of enabling an arm that carries an unmodelled load (J-43). When the joints are enabled, they sag until the
//! controller holds the load, that is, until it has *caught* the load. The controller must catch every load within
//! the torque limits.
use crate::{plant, rig};

use jtc_bus::NodeState;
use jtc_core::{Config, ControllerState, Parameters, TrajectoryState, joint_error};
use jtc_dynamics::Dynamics;
use jtc_wire::{ExecCommand, RawPoint};
use plant::{LuGre, POSES, Plant, loaded};
use rig::Rig;

/// Factors of the friction, from zero, which does not damp a swing, to the friction of the default arm.
const FRICTIONS: [f64; 4] = [0.0, 0.1, 0.3, 1.0];

fn friction(factor: f64) -> [LuGre; 6] {
    if factor == 0.0 { [LuGre::NONE; 6] } else { LuGre::of_avena_times(factor) }
}

/// Returns the share of its torque limit that the joint with the highest load needs to hold `mass` kg.
fn share(mass: f64, pose: &[f64; 6]) -> f64 {
    let model = loaded(Parameters::avena().model, mass);
    let gravity = Dynamics::new(&model, Config::avena().gravity).gravity_torque(pose);
    let limits = Config::avena().joints.map(|j| j.torque_max);
    (0..6).map(|j| gravity[j].abs() / limits[j]).fold(0.0, f64::max)
}

/// An arm with `mass` kg at its flange, whose brakes open in `pose` when its joints are enabled.
struct Let {
    arm: Plant,
    rig: Rig,
    pose: [f64; 6],
    /// Largest motion of a joint, rad, and number of torques at their limits.
    sag: f64,
    saturated: u32,
}

impl Let {
    fn new(config: Config, mass: f64, pose: [f64; 6], factor: f64) -> Self {
        let arm = Plant::new(&loaded(Parameters::avena().model, mass), friction(factor), pose);
        let mut rig = Rig::new(config);
        rig.follow = false;
        arm.report(&mut rig);
        rig.defaults();
        Self { arm, rig, pose, sag: 0.0, saturated: 0 }
    }

    fn enabled(&self) -> bool {
        self.rig.nodes[..6].iter().all(|n| n.report.state == NodeState::ENABLED)
    }

    fn run(&mut self, ticks: usize) {
        for _ in 0..ticks {
            self.arm.tick(&mut self.rig);
            for j in 0..6 {
                let (torque, limit) = (self.rig.torque[j].abs(), Config::avena().joints[j].torque_max);
                assert!(torque <= limit + 0.02, "joint {}: {torque} N·m, {limit} allowed", j + 1);
                self.saturated += u32::from(torque >= limit - 0.02);
                self.sag = self.sag.max((self.arm.q[j] - self.pose[j]).abs());
            }
        }
    }

    /// Checks `ticks` ticks, beginning with the tick in which the joints are enabled.
    fn caught(&mut self, ticks: usize) {
        while !self.enabled() {
            self.run(1);
        }
        self.run(ticks);
    }
}

#[test]
fn j43_an_unknown_payload_that_the_torque_limits_hold_is_caught() {
    let (mut most, mut fought) = (0.0f64, 0);
    for pose in POSES {
        for mass in [1.0, 2.0, 3.0, 4.0] {
            let share = share(mass, &pose);
            if share > 0.97 {
                continue;
            }
            most = most.max(share);
            for factor in FRICTIONS {
                let mut it = Let::new(Config::avena(), mass, pose, factor);
                it.caught(3000);
                let about = format!("{mass} kg at {pose:?}, friction times {factor}");
                assert_eq!((it.rig.state(), it.rig.errors()), (ControllerState::HoldPos, 0), "{about}");
                // The joints sag until the proportional part and the integral hold the load. If the torque reaches its limit, the joints
                // sag a little further.
                let sag = if it.saturated > 10 { 0.02 } else { 0.01 };
                assert!(it.sag < sag, "{about}: {} rad", it.sag);
                let from = it.arm.q;
                it.run(2000);
                let way = (0..6).map(|j| (it.arm.q[j] - from[j]).abs()).fold(0.0, f64::max);
                assert!(way < 0.002, "{about}: at rest after 3 s, {way} rad");
                fought += u32::from(it.saturated > 10);
            }
        }
    }
    assert!(most > 0.93 && fought >= 6, "no load was near the limit: {most}, {fought}");
}

/// An arm without brakes moves almost as fast as permitted when its joint 2 is enabled. The controller must catch the
/// unmodelled load during this motion.
#[test]
fn j43_an_unknown_payload_is_caught_in_motion() {
    for velocity in [-0.2, 0.2] {
        let mut it = Let::new(Config::avena(), 2.5, POSES[1], 0.1);
        it.arm.brakes = false;
        while !it.enabled() {
            // Until the joints are enabled, hands let the arm move only at this velocity.
            (it.arm.q, it.arm.v) = (POSES[1], [0.0, velocity, 0.0, 0.0, 0.0, 0.0]);
            it.run(1);
        }
        it.run(3000);
        assert_eq!((it.rig.state(), it.rig.errors()), (ControllerState::HoldPos, 0), "{velocity} rad/s");
        assert!(it.sag < 0.08, "{velocity} rad/s: {} rad", it.sag);
        assert!(it.saturated > 10 || velocity < 0.0, "{velocity} rad/s: {} ms at the limit", it.saturated);
    }
}

#[test]
fn j43_a_load_that_the_torque_limits_do_not_hold_is_an_error_soon() {
    let mut cases = 0;
    for pose in POSES {
        for mass in [4.0, 5.0, 6.0, 8.0, 12.0] {
            if share(mass, &pose) < 1.01 {
                continue;
            }
            for factor in FRICTIONS {
                let config = Config { torque_release: true, ..Config::avena() };
                let mut it = Let::new(config, mass, pose, factor);
                it.caught(1000);
                it.run(20);
                let about = format!("{mass} kg at {pose:?}, friction times {factor}");
                assert_eq!(it.rig.state(), ControllerState::Error, "{about}");
                let bits = it.rig.controller.telemetry().joints.map(|j| j.internal);
                assert_eq!(bits.iter().fold(0, |all, bits| all | bits), joint_error::TORQUE, "{about}");
                assert!(it.sag < 0.25, "{about}: {} rad", it.sag);
                cases += 1;
            }
        }
    }
    assert!(cases > 20, "{cases}");
}

/// While the controller catches the load of a joint that was just enabled, it tolerates an overload, but only for the
/// time in the setting `catch_ms_max`. A load that is added after this time and overloads the joint must be an error
/// (J-43).
#[test]
fn j43_a_load_that_comes_later_is_an_error_after_its_time() {
    for (catch_ms_max, after) in [(1_000, 1_000), (300, 300), (0, 0)] {
        let config = Config { catch_ms_max, torque_release: true, ..Config::avena() };
        let mut it = Let::new(config, 0.0, POSES[1], 0.3);
        it.caught(after);
        it.arm.push[1] = 70.0;
        it.run(400);
        assert_eq!(it.rig.state(), ControllerState::Error, "{catch_ms_max} ms");
        assert_eq!(it.rig.controller.telemetry().joints[1].internal, joint_error::TORQUE);
        assert!(it.saturated <= 11, "{} ms at the limit", it.saturated);
    }
}

/// If Execute must wait for a joint to be enabled, it must also wait until the controller has caught the load of this
/// joint.
#[test]
fn j34_an_execute_waits_until_the_load_is_caught() {
    let mut it = Let::new(Config::avena(), 2.6, POSES[1], 0.1);
    it.rig.nodes[1].slow_enable = true;
    while it.rig.state() != ControllerState::HoldPos {
        it.run(1);
    }
    it.run(200);
    let points = [RawPoint { position: POSES[1].map(|q| rig::raw(q, 3.141592)), ..RawPoint::default() }; 20];
    it.rig.send(jtc_wire::FrameType::Trajectory, &rig::segment_body(7, 0, 1, 10, &points));
    it.rig.send(jtc_wire::FrameType::TrajSetExecStatus, &[ExecCommand::Execute as u8]);
    it.run(100);
    assert_eq!((it.rig.state(), it.rig.trajectory()), (ControllerState::Operate, TrajectoryState::Execute));
    it.rig.nodes[1].report.state = NodeState::ENABLED;
    let mut left = 0;
    while it.rig.trajectory() == TrajectoryState::Execute {
        let before = it.saturated;
        it.run(1);
        let point = it.rig.controller.telemetry().point;
        assert!(it.saturated == before || point == 0, "at the limit on the path, point {point}");
        left += 1;
        assert!(left < 2000);
    }
    it.run(2);
    assert_eq!(
        (it.rig.state(), it.rig.trajectory(), it.rig.errors()),
        (ControllerState::HoldPos, TrajectoryState::Finish, 0)
    );
    assert!(it.saturated > 10, "{} ms at the limit", it.saturated);
}
