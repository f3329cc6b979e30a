//! Tests of a simulated arm whose gains change while the arm is held (J-71). The controller refuses gains that would
//! drop the arm. If gains make the arm unstable, the controller restores the earlier gains.
use jtc_bus::NodeState;
use jtc_core::{Config, ControllerState, Parameters, PidGains, error, joint_error};
use jtc_wire::{DataStatus, FrameType, SettingValue, StopKind, StoreState};

use crate::plant::{self, LuGre, Plant, loaded};
use crate::rig::{Rig, floats};

const POSE: [f64; 6] = [0.0, 0.6, -1.0, 0.3, 0.4, 0.0];

type Gains = [PidGains; 6];

fn shipped() -> Gains {
    Parameters::avena().pid
}

fn times(factor: f64) -> Gains {
    shipped().map(|g| PidGains {
        kp: factor * g.kp,
        ki: (factor * g.ki).min(50_000.0),
        kd: factor * g.kd,
        ..g
    })
}

fn of(each: [[f64; 3]; 6]) -> Gains {
    let [own, ..] = shipped();
    each.map(|[kp, ki, kd]| PidGains { kp, ki, kd, ..own })
}

fn body(gains: &Gains) -> Vec<u8> {
    floats(gains.iter().flat_map(|g| [g.kp, g.ki, g.kd, g.int_min, g.int_max].map(|x| x as f32)))
}

/// Returns an arm without brakes that is held at rest, with an unmodelled load of 2 kg.
fn held_with(friction: f64) -> (Plant, Rig) {
    let model = loaded(Parameters::avena().model, 2.0);
    let friction = if friction > 0.0 { LuGre::of_avena_times(friction) } else { [LuGre::NONE; 6] };
    let mut arm = Plant::new(&model, friction, POSE);
    let mut rig = arm.holding(Config::avena());
    arm.brakes = false;
    arm.run(&mut rig, 4_000);
    (arm, rig)
}

fn give(arm: &mut Plant, rig: &mut Rig, gains: &Gains) -> DataStatus {
    let before = rig.records().len();
    rig.send(FrameType::PidParam, &body(gains));
    while rig.records().len() == before {
        arm.tick(rig);
    }
    rig.records().last().unwrap().data
}

/// Returns the largest distance of a joint from `from` within the next `ms`, rad.
fn farthest(arm: &mut Plant, rig: &mut Rig, from: &[f64; 6], ms: usize) -> f64 {
    let mut farthest = 0.0f64;
    for _ in 0..ms {
        arm.tick(rig);
        farthest = arm.q.iter().zip(from).fold(farthest, |f, (q, from)| f.max((q - from).abs()));
    }
    farthest
}

/// Earlier versions accepted all of these gains, and the arm then fell by one radian, or moved by 42 mrad. The
/// controller must refuse these gains.
#[test]
fn j71_gains_that_drop_the_arm_are_refused_while_it_is_held() {
    for (factor, expected) in [
        (0.0, DataStatus::IncorrectValue),
        (3.0, DataStatus::IncorrectValue),
        (5.0, DataStatus::IncorrectValue),
        (0.05, DataStatus::NoError),
        (1.5, DataStatus::NoError),
    ] {
        let (mut arm, mut rig) = held_with(1.0);
        let from = arm.q;
        assert_eq!(give(&mut arm, &mut rig, &times(factor)), expected, "times {factor}");
        let farthest = farthest(&mut arm, &mut rig, &from, 4_000);
        println!("times {factor}: {:.1} mrad", 1e3 * farthest);
        let held = (rig.state(), rig.errors(), rig.controller.telemetry().joints.map(|j| j.internal));
        assert_eq!(held, (ControllerState::HoldPos, 0, [0; 6]), "times {factor}");
        assert!(farthest < 0.005, "times {factor}: {farthest} rad");
    }
}

/// If the host switches the integral off, the proportional part must hold the load, which requires a position error.
/// The controller accepts gains without an integral if this error is small.
#[test]
fn j71_an_integral_is_given_up_where_the_joint_sags_little() {
    for (kp, expected) in [(1.0, DataStatus::NoError), (0.08, DataStatus::IncorrectValue)] {
        let (mut arm, mut rig) = held_with(0.3);
        let gains = shipped().map(|g| PidGains { kp: kp * g.kp, ki: 0.0, ..g });
        let from = arm.q;
        assert_eq!(give(&mut arm, &mut rig, &gains), expected, "Kp times {kp}");
        let farthest = farthest(&mut arm, &mut rig, &from, 3_000);
        println!("Kp times {kp}: {:.1} mrad", 1e3 * farthest);
        assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0), "Kp times {kp}");
        assert!(farthest < 0.25 * 0.09, "{farthest} rad");
    }
}

/// The controller accepts gains that are in use on arms like this one. The controller refuses gains that are in use on
/// a heavier arm, because they are not suitable for this arm.
#[test]
fn j71_gains_in_use_are_taken_by_the_arm_they_are_for() {
    let stronger = of([
        [8000.0, 14_000.0, 160.0],
        [8000.0, 14_000.0, 160.0],
        [8000.0, 14_000.0, 160.0],
        [4000.0, 24_000.0, 100.0],
        [4000.0, 24_000.0, 100.0],
        [4000.0, 24_000.0, 100.0],
    ]);
    let soft = of([[420.0, 160.0, 20.0]; 6]);
    let others = of([
        [28_000.0, 24_000.0, 220.0],
        [28_000.0, 24_000.0, 260.0],
        [24_000.0, 24_000.0, 120.0],
        [4000.0, 24_000.0, 100.0],
        [2000.0, 12_000.0, 120.0],
        [4000.0, 24_000.0, 100.0],
    ]);
    for (name, gains, expected) in [
        ("shipped", shipped(), DataStatus::NoError),
        ("stronger", stronger, DataStatus::NoError),
        ("soft", soft, DataStatus::NoError),
        ("for a heavier arm", others, DataStatus::IncorrectValue),
    ] {
        let (mut arm, mut rig) = held_with(1.0);
        let from = arm.q;
        assert_eq!(give(&mut arm, &mut rig, &gains), expected, "{name}");
        let farthest = farthest(&mut arm, &mut rig, &from, 3_000);
        println!("{name}: {:.1} mrad", 1e3 * farthest);
        assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0), "{name}");
        assert!(farthest < 0.01, "{name}: {farthest} rad");
    }
}

/// Returns the effective position gain of a joint, N·m/rad.
fn stiffness(rig: &Rig, joint: usize) -> f64 {
    let joint = rig.controller.telemetry().joints[joint];
    joint.torque_p / (joint.due_position - joint.position)
}

/// Returns the first cause of the last held stop (J-69).
fn found(rig: &Rig) -> StopKind {
    rig.controller.reactions().stop.expect("a held stop").0.kind
}

/// Returns the causes of a held stop that the status contains now.
fn causes(rig: &mut Rig) -> u16 {
    rig.status().joints.iter().fold(0, |all, joint| all | joint.internal)
}

/// The arm begins to swing because the integral is too strong for the inertia of the joints. The checks of the
/// controller cannot detect this in advance. The arm swings within the two seconds of the trial, and the controller
/// restores the earlier gains.
#[test]
fn j71_gains_that_make_the_arm_swing_are_taken_back() {
    // The last gains in this list cause so little torque that only the growth of the swing is detected.
    for [kp, ki, kd] in
        [[8000.0, 50_000.0, 20.0], [2000.0, 50_000.0, 20.0], [8000.0, 14_000.0, 5.0], [400.0, 4000.0, 0.0]]
    {
        let (mut arm, mut rig) = held_with(0.0);
        let from = arm.q;
        let swinging = of([[kp, ki, kd]; 6]);
        assert_eq!(give(&mut arm, &mut rig, &swinging), DataStatus::NoError);
        // The arm is at rest when the trial begins. A short, light push is sufficient to start the swing.
        arm.run(&mut rig, 550);
        arm.push = [10.0, 20.0, 15.0, 5.0, 4.0, 4.0];
        arm.run(&mut rig, 30);
        arm.push = [0.0; 6];
        let farthest = farthest(&mut arm, &mut rig, &from, 6_000);
        println!("{kp} {ki} {kd}: {:.1} mrad", 1e3 * farthest);
        let causes = causes(&mut rig);
        assert_eq!(rig.state(), ControllerState::HoldPos, "{kp} {ki} {kd}");
        assert_eq!(found(&rig), StopKind::Gains, "{kp} {ki} {kd}: causes {causes:#x}");
        assert!(farthest < 0.05, "{kp} {ki} {kd}: {farthest} rad");
        // After the clear, the controller must hold the arm with the earlier gains.
        assert_eq!(rig.clear(true, 0), DataStatus::NoError);
        arm.run(&mut rig, 1_000);
        let before = shipped();
        for j in 0..6 {
            let stiffness = stiffness(&rig, j);
            assert!(!stiffness.is_finite() || (stiffness - before[j].kp).abs() < 1.0, "{stiffness}");
        }
        assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0), "{kp} {ki} {kd}");
        assert!(arm.v.iter().all(|v| v.abs() < 0.02), "{:?}", arm.v);
    }
}

/// If a push overloads a joint during a trial of gains (J-71), the controller must restore the earlier gains. After
/// the trial, a push must not change the gains.
#[test]
fn j71_gains_on_trial_are_taken_back_when_the_arm_is_pushed() {
    for (wait, taken_back) in [(600, true), (1_700, true), (2_300, false)] {
        let (mut arm, mut rig) = held_with(1.0);
        assert_eq!(give(&mut arm, &mut rig, &times(0.5)), DataStatus::NoError);
        arm.run(&mut rig, wait);
        arm.push[1] = -90.0;
        arm.run(&mut rig, 150);
        arm.push[1] = 0.0;
        arm.run(&mut rig, 1_500);
        let causes = causes(&mut rig);
        assert_eq!(causes, joint_error::TORQUE, "after {wait} ms");
        let kind = if taken_back { StopKind::Gains } else { StopKind::Push };
        assert_eq!(found(&rig), kind, "after {wait} ms");
        assert_eq!(rig.clear(true, 0), DataStatus::NoError);
        // The push causes a position error, from which the test computes the stiffness.
        arm.push[0] = 15.0;
        arm.run(&mut rig, 20);
        let expected = if taken_back { 8000.0 } else { 4000.0 };
        assert!((stiffness(&rig, 0) - expected).abs() < 1.0, "after {wait} ms: {}", stiffness(&rig, 0));
    }
}

/// An external force makes a joint swing with a growing amplitude, far below its torque limit. During a trial of
/// gains, the controller must restore the earlier gains. After the trial, it must keep the new gains.
#[test]
fn j71_a_swing_that_grows_ends_the_trial() {
    for (wait, taken_back) in [(600, true), (2_300, false)] {
        let (mut arm, mut rig) = held_with(0.3);
        assert_eq!(give(&mut arm, &mut rig, &times(0.1)), DataStatus::NoError);
        arm.run(&mut rig, wait);
        let mut fastest = 0.0f64;
        for ms in 0..1_000 {
            let time = f64::from(ms) * 1e-3;
            arm.push[0] = 15.0 * time * (std::f64::consts::TAU * 2.0 * time).sin();
            arm.tick(&mut rig);
            fastest = fastest.max(arm.v[0].abs());
        }
        arm.push[0] = 0.0;
        arm.run(&mut rig, 1_500);
        let stopped = rig.controller.reactions().stop.map(|(cause, _)| cause.kind);
        println!("after {wait} ms: {stopped:?}, {fastest:.3} rad/s");
        assert_eq!(stopped, taken_back.then_some(StopKind::Gains), "after {wait} ms, {fastest} rad/s");
    }
}

/// The torque does not step when gains change, for any share of the integral in the torque.
#[test]
fn j71_gains_come_in_without_a_step_of_the_torque() {
    let worst_step = |gains: Option<Gains>| {
        let (mut arm, mut rig) = held_with(0.3);
        if let Some(gains) = gains {
            rig.send(FrameType::PidParam, &body(&gains));
        }
        let (mut last, mut worst) = (rig.torque, 0.0f64);
        for _ in 0..1_500 {
            arm.tick(&mut rig);
            worst = (0..6).map(|j| (rig.torque[j] - last[j]).abs()).fold(worst, f64::max);
            last = rig.torque;
        }
        (worst, rig.controller.telemetry().joints[1].torque_i)
    };
    let (quiet, integral) = worst_step(None);
    for gains in [times(1.5), times(0.1), shipped().map(|g| PidGains { ki: 1.0, ..g })] {
        let (worst, kept) = worst_step(Some(gains));
        println!(
            "{worst:.2} N·m a tick, {quiet:.2} without new gains; integral {integral:.1}, then {kept:.1} N·m"
        );
        // This is the change of torque that one encoder step causes with gains that are 1.5 times as high as the
        // delivered gains.
        let encoder = 1.5 * (8000.0 + 80.0 / 0.005) * plant::ENCODER_STEP;
        assert!(worst <= encoder + 0.1, "{worst} N·m, a step of the encoder makes {encoder}");
        assert!((kept - integral).abs() < 1.0, "{integral}, then {kept} N·m");
    }
}

/// The control loop of a joint is unstable when the joints are enabled. No earlier gains exist, so the controller uses softer gains, which
/// hold the arm.
#[test]
fn j66_a_joint_whose_loop_is_unstable_gets_softer_gains() {
    let model = Parameters::avena().model;
    let mut arm = Plant::new(&loaded(model, 2.0), LuGre::of_avena_times(0.05), POSE);
    let mut rig = Rig::new(Config::avena());
    rig.follow = false;
    arm.report(&mut rig);
    rig.defaults();
    let swinging = of([[8000.0, 50_000.0, 5.0]; 6]);
    assert_eq!(rig.ask(FrameType::PidParam, &body(&swinging)), DataStatus::NoError);
    while rig.nodes[..6].iter().any(|node| node.report.state != NodeState::ENABLED) {
        arm.tick(&mut rig);
    }
    arm.brakes = false;
    let from = arm.q;
    let farthest = farthest(&mut arm, &mut rig, &from, 8_000);
    println!("{farthest} rad");
    let causes = causes(&mut rig);
    assert_eq!(rig.state(), ControllerState::HoldPos);
    assert_eq!(found(&rig), StopKind::Unstable, "{causes:#x}");
    assert!(farthest < 0.09, "{farthest} rad");
    // The softer gains hold the arm, and a touch does not cause a lasting swing.
    assert_eq!(rig.clear(true, 0), DataStatus::NoError);
    arm.run(&mut rig, 2_000);
    arm.push[1] = 20.0;
    arm.run(&mut rig, 50);
    arm.push[1] = 0.0;
    arm.run(&mut rig, 5_000);
    assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
    let speeds = arm.v.map(f64::abs);
    assert!(speeds.iter().all(|v| *v < 0.02), "{speeds:?}");
}

/// Returns the effective Kp of joint 1 after a small push, N·m/rad.
fn stiffness_when_pushed(arm: &mut Plant, rig: &mut Rig) -> f64 {
    arm.push[0] = 15.0;
    arm.run(rig, 20);
    arm.push[0] = 0.0;
    stiffness(rig, 0)
}

/// During a trial of gains, the operator presses the emergency stop because the arm shakes, or a drive reports a
/// fault. When the controller enables the arm again, it must use the earlier gains.
#[test]
fn j71_gains_on_trial_are_taken_back_when_the_arm_is_released() {
    for (wait, taken_back) in [(1_000, true), (2_300, false)] {
        for drive in [false, true] {
            let (mut arm, mut rig) = held_with(1.0);
            assert_eq!(give(&mut arm, &mut rig, &times(0.5)), DataStatus::NoError);
            arm.run(&mut rig, wait);
            arm.brakes = true;
            if drive {
                rig.nodes[2].fault();
            } else {
                rig.safety_input = false;
            }
            arm.run(&mut rig, 50);
            assert_eq!(rig.state(), ControllerState::Error);
            rig.safety_input = true;
            arm.run(&mut rig, 50);
            rig.clear(true, 0x7F);
            arm.run(&mut rig, 6_000);
            arm.brakes = false;
            arm.run(&mut rig, 2_000);
            assert_eq!(rig.state(), ControllerState::HoldPos, "drive {drive}, {wait} ms");
            let expected = if taken_back { 8000.0 } else { 4000.0 };
            let stiffness = stiffness_when_pushed(&mut arm, &mut rig);
            assert!((stiffness - expected).abs() < 1.0, "drive {drive}, {wait} ms: {stiffness}");
            let told = rig.controller.reactions().stop.map(|(cause, _)| (cause.kind, cause.joint));
            assert_eq!(told, taken_back.then_some((StopKind::Gains, 0)));
        }
    }
}

/// Teaching does not test the gains, so their trial continues after Teaching.
#[test]
fn j71_teaching_does_not_end_a_trial() {
    let (mut arm, mut rig) = held_with(1.0);
    assert_eq!(give(&mut arm, &mut rig, &times(0.5)), DataStatus::NoError);
    arm.run(&mut rig, 600);
    rig.send(FrameType::TeachingModeEnable, &[]);
    let mut ticks = 0;
    while rig.state() != ControllerState::Teaching && ticks < 9_000 {
        arm.tick(&mut rig);
        ticks += 1;
    }
    assert!(ticks < 1_000, "{ticks} ms of the trial");
    arm.run(&mut rig, 5_000);
    rig.send(FrameType::TeachingModeDisable, &[]);
    arm.run(&mut rig, 800);
    assert_eq!(rig.state(), ControllerState::HoldPos);
    arm.push[1] = -90.0;
    arm.run(&mut rig, 150);
    arm.push[1] = 0.0;
    arm.run(&mut rig, 1_500);
    assert_eq!(found(&rig), StopKind::Gains);
}

/// After Disable, the controller accepts gains, model and settings that do not match, but it does not store such an
/// arm. In this test, the rotors have too little inertia for the gains.
#[test]
fn j71_an_arm_that_would_be_refused_is_not_stored() {
    use FrameType::{Disable, SetSettings, StoreArm};
    let setting = jtc_core::settings::named("rotor_inertia_kg_m2").expect("a setting").number;
    let rotors: Vec<u8> =
        (1..=6).flat_map(|joint| SettingValue { setting, joint, value: 0.05 }.emit()).collect();
    let mut rig = Rig::holding();
    rig.press_stop(5);
    rig.controller.set_store_state(StoreState::Empty, 0);
    assert_eq!(rig.ask(Disable, &[]), DataStatus::NoError);
    assert_eq!(rig.ask(SetSettings, &rotors), DataStatus::NoError);
    assert_eq!(rig.ask(StoreArm, &[]), DataStatus::IncorrectValue);
}

/// Gains, model and settings arrive in separate frames. If they do not match, the controller refuses the frame that
/// arrives last, and this frame must have no effect. After Disable, a host can upload another arm in any order.
#[test]
fn j71_j53_parts_that_do_not_go_together_are_refused_whichever_comes_last() {
    use FrameType::{
        ArmModelUseDefault, Disable, FrictionPolynomialUseDefault, PidParam, PidParamUseDefault, SetSettings,
    };
    let rotors = |rotor: f64| -> Vec<u8> {
        let setting = jtc_core::settings::named("rotor_inertia_kg_m2").expect("a setting").number;
        (1..=6).flat_map(|joint| SettingValue { setting, joint, value: rotor }.emit()).collect()
    };
    let (good, bad) = (DataStatus::NoError, DataStatus::IncorrectValue);
    let mut rig = Rig::holding();
    rig.press_stop(5);
    assert_eq!(rig.state(), ControllerState::Error);
    // The controller refuses rotors with low inertia while the gains in use are too high for these rotors. The host must set lower gains
    // first.
    assert_eq!(rig.ask(SetSettings, &rotors(0.05)), bad);
    assert_eq!(rig.ask(PidParam, &body(&times(3.0))), bad);
    assert_eq!(rig.ask(PidParam, &body(&times(0.1))), good);
    assert_eq!(rig.ask(SetSettings, &rotors(0.05)), good);
    assert_eq!(rig.ask(PidParamUseDefault, &[]), bad);
    assert_eq!(rig.ask(ArmModelUseDefault, &[]), good);
    // After Disable, the controller cannot compare gains and model until it has received gains and model again.
    assert_eq!(rig.ask(Disable, &[]), good);
    assert_eq!(rig.ask(PidParamUseDefault, &[]), good);
    assert_eq!(rig.ask(ArmModelUseDefault, &[]), bad);
    assert_eq!(rig.ask(SetSettings, &rotors(0.7)), good);
    assert_eq!(rig.ask(ArmModelUseDefault, &[]), good);
    assert_eq!(rig.ask(FrictionPolynomialUseDefault, &[]), good);
    rig.clear(true, 0);
    rig.until(2_000, |rig| rig.state() == ControllerState::HoldPos);
    // The controller processes a model in parts, each in a separate tick, so that no tick becomes too long.
    rig.send(ArmModelUseDefault, &[]);
    let ticks = rig.until(100, |rig| rig.waiting() == 0);
    assert!((18..=20).contains(&ticks), "{ticks}");
}

/// Simulates jerks of joint 1 of an arm without physics. In each jerk, the torque reaches both limits, but for a time that is too short to
/// overload the joint.
fn jerks(rig: &mut Rig, pauses_ms: &[usize]) {
    rig.follow = false;
    for pause in pauses_ms {
        rig.nodes[0].report.position = 4e-3;
        rig.run(2);
        rig.nodes[0].report.position = 0.0;
        rig.run(*pause);
    }
}

/// Two joints swing with new gains, so the controller restores the earlier gains. The swing of the second joint began
/// with the new gains. The controller must therefore not soften the restored gains because of this swing.
#[test]
fn j66_j71_gains_that_came_back_are_not_softened_for_what_was_before_them() {
    let mut config = Config::avena();
    (config.joints[0].torque_max, config.joints[5].torque_max) = (10.0, 10.0);
    (config.parameter_bounds.friction_max, config.parameter_bounds.slow_friction_max) = (10.0, 10.0);
    let mut rig = Rig::holding_with(config);
    rig.run(1_000);
    assert_eq!(rig.ask(FrameType::PidParam, &body(&times(0.9))), DataStatus::NoError);
    rig.run(3_000);
    rig.follow = false;
    let jerk = |rig: &mut Rig, joints: &[usize]| {
        joints.iter().for_each(|j| rig.nodes[*j].report.position = 4e-3);
        rig.run(2);
        joints.iter().for_each(|j| rig.nodes[*j].report.position = 0.0);
        rig.run(40);
    };
    jerk(&mut rig, &[0]);
    jerk(&mut rig, &[0, 5]);
    jerk(&mut rig, &[5]);
    assert_eq!(found(&rig), StopKind::Gains);
    rig.run(1_000);
    assert_eq!(rig.clear(true, 0), DataStatus::NoError);
    for (j, kp) in [(0, 8000.0), (5, 4000.0)] {
        rig.nodes[j].report.position = 1e-3;
        rig.run(20);
        let stiffness = stiffness(&rig, j);
        assert!((stiffness - kp).abs() < 1.0, "joint {}: {stiffness}", j + 1);
    }
}

#[test]
fn j66_a_torque_that_goes_from_limit_to_limit_gets_softer_gains() {
    let holding = || {
        let mut config = Config::avena();
        config.joints[0].torque_max = 10.0;
        // With these parameter bounds, a joint may have more friction than its torque limit.
        (config.parameter_bounds.friction_max, config.parameter_bounds.slow_friction_max) = (10.0, 10.0);
        let mut rig = Rig::holding_with(config);
        rig.run(1_000);
        rig
    };
    // Single jerks with long pauses do not count as a swing of the control loop.
    let mut rig = holding();
    jerks(&mut rig, &[250, 250, 250]);
    assert_eq!(causes(&mut rig), 0);
    jerks(&mut rig, &[110, 20]);
    assert_eq!((causes(&mut rig), found(&rig)), (joint_error::TORQUE, StopKind::Unstable));
    assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, error::INTERNAL_JOINTS));
    rig.run(1_000);
    assert_eq!(rig.clear(true, 0), DataStatus::NoError);
    rig.nodes[0].report.position = 1e-3;
    rig.run(20);
    assert!((stiffness(&rig, 0) - 0.3 * 8000.0).abs() < 1.0, "{}", stiffness(&rig, 0));
    assert_eq!(rig.controller.telemetry().joints[0].torque_i, 0.0);
}
