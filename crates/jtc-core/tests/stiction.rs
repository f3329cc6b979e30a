//! Tests of the hold of joints with stiction, in which an integral can cause endless hunting (J-41).
use crate::{plant, rig};

use jtc_core::{Config, Parameters, TrajectoryState};
use jtc_wire::{FrameType, RawPoint};
use plant::{ENCODER_STEP, LuGre, Plant, heavier};
use rig::{Rig, raw, segment_body};

const POSE: [f64; 6] = [0.3, 0.8, -0.9, 0.4, 0.7, 0.2];

/// Range of the observed values of one joint during the position hold.
#[derive(Clone, Copy, Debug)]
struct Seen {
    low: f64,
    high: f64,
}

impl Seen {
    const NOTHING: Self = Self { low: f64::INFINITY, high: f64::NEG_INFINITY };

    fn take(&mut self, x: f64) {
        (self.low, self.high) = (self.low.min(x), self.high.max(x));
    }

    fn width(self) -> f64 {
        self.high - self.low
    }
}

/// Returns the ranges of the correction torque (N·m) and of the true position (rad) of each joint over `ticks`.
fn watch(arm: &mut Plant, rig: &mut Rig, ticks: usize) -> [(Seen, Seen); 6] {
    let mut seen = [(Seen::NOTHING, Seen::NOTHING); 6];
    for _ in 0..ticks {
        arm.tick(rig);
        for (j, (torque, position)) in seen.iter_mut().enumerate() {
            let t = &rig.controller.telemetry().joints[j];
            torque.take(t.torque - t.torque_model);
            position.take(arm.q[j]);
        }
    }
    seen
}

/// Returns the default arm's friction, with this ratio of stiction to Coulomb friction and these bristle parameters.
fn sticky(ratio: f64, stribeck: f64, stiffness: f64, damping: f64) -> [LuGre; 6] {
    core::array::from_fn(|j| LuGre { stribeck, stiffness, damping, ..LuGre::avena(j, ratio) })
}

/// Checks that every joint is quiet. The torque may vary by less than 4 N·m, because a toggle of the last encoder bit
/// causes 3.8 N·m of P and D torque on the large joints. The position error may be as large as the error at which the
/// integral stops changing.
fn assert_quiet(arm: &mut Plant, rig: &mut Rig, what: &str) {
    for (j, (torque, position)) in watch(arm, rig, 6000).iter().enumerate() {
        let joint = j + 1;
        assert!(torque.width() < 4.0, "{what}: joint {joint}: {:.1} N·m peak to peak", torque.width());
        let steps = position.width() / ENCODER_STEP;
        assert!(steps < 0.3, "{what}: joint {joint} moves by {steps:.1} encoder steps");
        let error = rig.controller.telemetry().joints[j].position_error().abs() / ENCODER_STEP;
        assert!(error < 4.1, "{what}: joint {joint} stands {error:.1} encoder steps off");
    }
    assert_eq!(rig.errors(), 0);
}

#[test]
fn j41_no_joint_hunts_or_buzzes_in_stiction() {
    for ratio in [1.2, 1.5, 2.0] {
        for stribeck in [0.005, 0.02] {
            for stiffness in [20_000.0, 100_000.0, 300_000.0] {
                for damping in [0.5, 20.0, 300.0] {
                    let friction = sticky(ratio, stribeck, stiffness, damping);
                    let mut arm = Plant::new(&heavier(Parameters::avena().model, 1.1), friction, POSE);
                    let mut rig = arm.holding(Config::avena());
                    arm.run(&mut rig, 12_000);
                    let what = format!("{:?}", friction[0]);
                    assert_quiet(&mut arm, &mut rig, &what);
                }
            }
        }
    }
}

/// If the integral never stops changing, an error below the resolution of the encoder leads to a limit cycle. The simulation in this test
/// shows this limit cycle.
#[test]
fn j41_an_integral_that_is_never_held_hunts() {
    let mut arm =
        Plant::new(&heavier(Parameters::avena().model, 1.1), sticky(1.5, 0.02, 300_000.0, 20.0), POSE);
    let mut rig = arm.holding(Config { encoder_step: 0.0, ..Config::avena() });
    arm.run(&mut rig, 12_000);
    let seen = watch(&mut arm, &mut rig, 20_000);
    let most = seen.iter().map(|(torque, _)| torque.width()).fold(0.0, f64::max);
    assert!(most > 8.0, "{most} N·m peak to peak");
}

#[test]
fn j41_a_motion_ends_without_hunting() {
    for (ratio, stiffness, damping) in
        [(1.2, 100_000.0, 300.0), (1.5, 100_000.0, 20.0), (1.5, 300_000.0, 20.0)]
    {
        let friction = sticky(ratio, 0.02, stiffness, damping);
        let mut arm = Plant::new(&heavier(Parameters::avena().model, 1.1), friction, POSE);
        let mut rig = arm.holding(Config::avena());
        arm.run(&mut rig, 3000);
        // The motion moves the arm by 0.3 rad in 2 s, and back in 2 s.
        let points: Vec<_> = (0..=400).map(|i| point(&rig, f64::from(i) / 200.0)).collect();
        rig.send(FrameType::Trajectory, &segment_body(7, 0, 1, 10, &points));
        rig.send(FrameType::TrajSetExecStatus, &[3]);
        let mut worst = 0.0f64;
        for _ in 0..4400 {
            arm.tick(&mut rig);
            for t in &rig.controller.telemetry().joints {
                worst = worst.max(t.position_error().abs());
            }
        }
        assert_eq!((rig.trajectory(), rig.errors()), (TrajectoryState::Finish, 0));
        assert!(worst < 0.003, "{:.2} mrad while moving", 1e3 * worst);
        arm.run(&mut rig, 12_000);
        assert_quiet(&mut arm, &mut rig, &format!("stiction {ratio}, bristles {stiffness}"));
    }
}

/// Returns a point of a motion from the hold position. The motion goes out by 0.3 rad (`u` from 0 to 1) and back (`u` from 1 to 2), in 2 s
/// each.
fn point(rig: &Rig, u: f64) -> RawPoint {
    let (u, back) = if u > 1.0 { (2.0 - u, -1.0) } else { (u, 1.0) };
    let way = 0.3 * u * u * u * (10.0 + u * (6.0 * u - 15.0));
    let speed = back * 0.3 * 30.0 * u * u * (1.0 - u) * (1.0 - u) / 2.0;
    let acceleration = 0.3 * 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / 4.0;
    let held = rig.controller.telemetry().joints.map(|j| j.set_position);
    RawPoint {
        position: held.map(|q| raw(q + way, 3.141592)),
        velocity: [raw(speed, 6.283185); 6],
        acceleration: [raw(acceleration, 12.566370); 6],
    }
}
