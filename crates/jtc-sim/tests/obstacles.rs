//! Tests of the controller with an arm that touches walls, picks up loads, and has elastic gears and drives with an
//! over-speed trip.
use jtc_bus::{Joint, NodeState};
use jtc_core::{ControllerState, error, joint_error};
use jtc_sim::{
    EncoderPlace, Fault, FaultKind, Gear, ModelError, Operator, Side, SimConfig, Support, Trigger, host,
};
use jtc_wire::{ExecCommand, StopKind};

const FROM: [f64; 6] = [0.1, -0.4, 0.9, 0.2, -0.3, 0.5];
const TO: [f64; 6] = [1.1, 0.4, -0.3, 1.2, 0.8, -0.9];

fn config() -> SimConfig {
    SimConfig { start: FROM, baud: None, model_error: ModelError::NONE, ..SimConfig::default() }
}

fn held(config: SimConfig) -> Operator {
    let mut operator = Operator::new(config);
    operator.bring_up().unwrap();
    operator.run(200);
    operator
}

fn inject(operator: &mut Operator, kind: FaultKind, ms: Option<u64>) {
    let now = Trigger::At(operator.world.now_us() / 1000);
    operator.world.inject(Fault { kind, trigger: now, duration_ms: ms });
}

/// Only joint 1 moves, from 0 to 1 rad and back, with a wall at 0.5 rad. The largest torque of the wall must be the
/// sum of v·√(K·J), from the kinetic energy, and the torque of the drive. The wall must never pull, and its torque
/// must become 0 when the wall is removed.
#[test]
fn a_joint_that_runs_into_a_wall_is_pushed_back() {
    let start = [0.0, -0.4, 0.9, 0.2, -0.3, 0.5];
    for stiffness in [3_000.0, 20_000.0] {
        let mut operator = held(SimConfig { start, ..config() });
        let mut to = start;
        to[0] = 1.0;
        operator.upload(&host::there_and_back(&start, &to, 2.0, 1, 10), 10).unwrap();
        let wall = FaultKind::JointWall {
            joint: Joint::ALL[0],
            rad: 0.5,
            side: Side::Above,
            stiffness,
            damping: 0.0,
        };
        inject(&mut operator, wall, Some(4_000));
        operator.ask(&host::exec(ExecCommand::Execute)).unwrap();
        let (mut strongest, mut speed) = (0.0f64, 0.0);
        for _ in 0..3_000 {
            operator.step();
            let truth = operator.world.truth();
            let torque = truth.outside[0];
            assert!(torque <= 0.0 && truth.outside[1..] == [0.0; 5], "{:?}", truth.outside);
            assert!((torque == 0.0) == (truth.q[0] <= 0.5), "{torque} N·m at {} rad", truth.q[0]);
            if torque == 0.0 && strongest == 0.0 {
                speed = truth.qd[0];
            }
            strongest = strongest.max(-torque);
        }
        let inertia = 7.2;
        let kinetic = speed * f64::sqrt(stiffness * inertia);
        println!(
            "{stiffness} N·m/rad met at {speed:.2} rad/s: {strongest:.0} N·m, {kinetic:.0} N·m by the kinetic energy"
        );
        assert!(strongest > 0.8 * kinetic && strongest < kinetic + 110.0, "{strongest} {kinetic}");
        operator.run(1_500);
        assert_eq!(operator.world.truth().outside, [0.0; 6], "the wall is away");
    }
}

/// The arm picks up a load and drops it. The holding torque must change by the torque of the load's weight, and must
/// then return to its earlier value.
#[test]
fn a_load_that_is_taken_up_is_held_and_dropped() {
    let mut operator = held(config());
    let torque = |operator: &mut Operator| {
        operator.run(3_000);
        operator.world.truth().torque
    };
    let before = torque(&mut operator);
    let (mass, com) = (1.5, [0.0, 0.02, 0.06]);
    inject(&mut operator, FaultKind::Payload { mass, com }, Some(3_000));
    let with = torque(&mut operator);
    let after = torque(&mut operator);
    let config = operator.world.config();
    let of = |payload| {
        jtc_dynamics::Dynamics::with_payload(&config.arm.model, config.arm.gravity, &payload)
            .gravity_torque(&FROM)
    };
    let load = jtc_dynamics::Payload { mass, com, ..jtc_dynamics::Payload::NONE };
    let (loaded, empty) = (of(load), of(jtc_dynamics::Payload::NONE));
    for j in 0..6 {
        // The tolerance is 9 N·m, because stiction carries a part of the weight.
        let weight = loaded[j] - empty[j];
        assert!(
            (with[j] - before[j] - weight).abs() < 9.0,
            "joint {}: {} of {weight}",
            j + 1,
            with[j] - before[j]
        );
        assert!((after[j] - before[j]).abs() < 9.0, "joint {}", j + 1);
    }
    assert!((with[1] - before[1]).abs() > 5.0, "{with:?} {before:?}");
    assert_eq!(operator.state(), ControllerState::HoldPos);
    let events: Vec<_> = operator.world.log().entries().map(|entry| entry.event.to_string()).collect();
    assert!(events.iter().any(|event| event.contains("payload 1.5 kg at (0, 0.02, 0.06) m")), "{events:?}");
}

/// The default drives trip on over-speed before the speed check of the controller (J-35) reports an error. With
/// drives that trip only at 50 rad/s, the controller reports the error.
#[test]
fn j35_the_controller_sees_over_speed_before_drives_that_trip_later() {
    let run = |over_speed: Option<f64>| {
        let mut config = SimConfig { support: Support::Stand, ..config() };
        for drive in &mut config.drives {
            drive.over_speed = over_speed.unwrap_or(drive.over_speed);
        }
        let mut operator = held(config);
        let push = FaultKind::Push { joint: Joint::ALL[4], torque: 150.0 };
        inject(&mut operator, push, Some(300));
        let (mut internal, mut tripped) = (0, false);
        for _ in 0..400 {
            operator.step();
            internal |= operator.world.telemetry().joints[4].internal;
            tripped |= operator.world.node_states()[4] == NodeState::FAULT;
        }
        (internal & joint_error::VELOCITY != 0, tripped)
    };
    assert_eq!(run(None), (false, true), "the drives are first");
    assert_eq!(run(Some(50.0)), (true, false));
}

/// A brake that stays closed must hold its joint against any torque of the drive, and must open when the fault ends.
#[test]
fn a_brake_that_stays_closed_holds_the_joint() {
    for support in [Support::Brakes, Support::Stand] {
        let mut operator = held(SimConfig { support, ..config() });
        operator.upload(&host::there_and_back(&FROM, &TO, 3.0, 1, 10), 10).unwrap();
        inject(&mut operator, FaultKind::BrakeClosed { joint: Joint::ALL[5] }, Some(2_000));
        operator.run(5);
        let before = operator.world.truth().q[5];
        operator.ask(&host::exec(ExecCommand::Execute)).unwrap();
        operator.run(1_500);
        let moved = (operator.world.truth().q[5] - before).abs();
        assert!(moved < 1e-9, "{support:?}: {moved} rad");
        assert_ne!(operator.state(), ControllerState::Operate, "{support:?}: it is noticed");
    }
}

/// With gears of 20,000 N·m/rad, the controller must enable, hold and move the default arm. In this test, the drives
/// report the positions of the motors instead of the links.
#[test]
fn an_arm_with_gears_that_yield_is_held_and_moved() {
    let run = || {
        let mut config = config();
        config.arm.gears = [Gear::new(20_000.0); 6];
        let mut operator = held(config);
        operator.upload(&host::there_and_back(&FROM, &TO, 3.0, 1, 10), 10).unwrap();
        operator.execute(10_000).unwrap();
        operator.run(500);
        let t = operator.world.telemetry();
        assert_eq!((t.state, t.errors & error::INTERNAL), (ControllerState::HoldPos, 0));
        assert!(t.joints.iter().all(|joint| joint.state == NodeState::ENABLED));
        let truth = *operator.world.truth();
        for (j, joint) in t.joints.iter().enumerate() {
            assert!((joint.position - truth.motor[j]).abs() < 2e-4, "joint {}", j + 1);
        }
        truth
    };
    let truth = run();
    let model = run();
    assert_eq!(truth, model, "the same, to the last bit");
    let twist = truth.motor[1] - truth.q[1];
    assert!(twist.abs() > 2e-4 && twist.abs() < 0.02, "joint 2 is loaded: {twist} rad");
}

/// A fault with a duration of 0 ms must be active for one tick.
#[test]
fn a_fault_of_no_duration_is_there_for_a_millisecond() {
    let mut operator = held(config());
    inject(&mut operator, FaultKind::Push { joint: Joint::ALL[2], torque: 5.0 }, Some(0));
    let pushed: Vec<_> = (0..5)
        .map(|_| {
            operator.step();
            operator.world.truth().outside[2]
        })
        .collect();
    assert_eq!(pushed, [5.0, 0.0, 0.0, 0.0, 0.0]);
}

/// An elastic gear twists, so the joint encoder and the motor encoder measure different positions. The controller must
/// not report this twist as an encoder jump or as a different speed scale, regardless of the load or the object that
/// the arm moves or touches. The test covers drives that measure the position at the motor, and drives that measure it
/// at the link.
#[test]
fn j35_gears_that_yield_are_no_false_alarm() {
    for (trial, place) in
        (0..24).flat_map(|trial| [(trial, EncoderPlace::Link), (trial, EncoderPlace::Motor)])
    {
        let mut rng = fastrand::Rng::with_seed(3_500 + trial);
        let mut config = SimConfig { support: Support::Stand, ..config() };
        config.arm.gears = [Gear::new(10_000.0); 6];
        for drive in &mut config.drives {
            (drive.encoder, drive.over_speed) = (place, 50.0);
        }
        let limits = config.controller.joints.map(|joint| joint.torque_max);
        let mut operator = held(config);
        if trial % 3 > 0 {
            operator.upload(&host::there_and_back(&FROM, &TO, 2.5, 1, 10), 10).unwrap();
            operator.ask(&host::exec(ExecCommand::Execute)).unwrap();
            operator.run(300 + (900.0 * rng.f64()) as u64);
        }
        let joint = Joint::ALL[(6.0 * rng.f64()) as usize % 6];
        let torque =
            limits[joint.index()] * (0.3 + 1.2 * rng.f64()) * if rng.f64() < 0.5 { 1.0 } else { -1.0 };
        if trial % 2 == 0 {
            inject(&mut operator, FaultKind::Push { joint, torque }, Some(20 + (500.0 * rng.f64()) as u64));
        } else {
            // The wall is 0.05 rad from the position of the joint, on the side towards which the joint moves.
            let speed = operator.world.truth().qd[joint.index()];
            let side = if speed >= 0.0 { Side::Above } else { Side::Below };
            let rad = operator.world.truth().q[joint.index()] + 0.05 * speed.signum();
            let wall = FaultKind::JointWall { joint, rad, side, stiffness: 20_000.0, damping: 0.0 };
            inject(&mut operator, wall, Some(1_000));
        }
        for ms in 0..1_500 {
            operator.step();
            let what = format!("seed {}, {place:?}, {joint}, {torque:.0} N·m, {ms} ms", 3_500 + trial);
            let controller = operator.world.controller();
            let stop = controller.reactions().stop.map(|(cause, _)| cause);
            let alarm =
                stop.filter(|cause| matches!(cause.kind, StopKind::EncoderJump | StopKind::SpeedScale));
            assert_eq!(alarm, None, "{what}");
            let telemetry = operator.world.telemetry();
            assert_eq!(telemetry.errors & error::EXTERNAL_JOINTS, 0, "{what}");
            if operator.state() == ControllerState::Error {
                // The state Error is only permitted if the push is stronger than the joint can resist. The joint then
                // exceeds its speed limit.
                let fast = telemetry.joints.iter().any(|joint| joint.internal & joint_error::VELOCITY != 0);
                assert!(fast, "{what}: {:?}", telemetry.joints.map(|j| (j.internal, j.velocity, j.torque)));
                break;
            }
        }
    }
}
