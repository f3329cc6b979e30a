//! Tests of the damping in Teaching, including joints with little inertia (J-25).
use crate::{plant, rig};

use jtc_bus::NodeState;
use jtc_core::{Config, ControllerState, Parameters};
use jtc_dynamics::ArmModel;
use jtc_wire::{DataStatus, FrameType};
use plant::{LuGre, Plant};
use rig::{Rig, floats, model_body};

const POSE: [f64; 6] = [0.1, 0.5, -0.9, 0.4, 0.7, 0.2];

/// Returns the model of the default arm with its masses and lengths multiplied by these factors.
fn scaled(mass: f64, length: f64) -> ArmModel {
    let mut model = Parameters::avena().model;
    for joint in &mut model.joints {
        joint.xyz = joint.xyz.map(|x| x * length);
    }
    for link in &mut model.links {
        link.mass *= mass;
        link.inertia = link.inertia.map(|i| i * mass * length * length);
        link.origin.xyz = link.origin.xyz.map(|x| x * length);
    }
    model
}

/// Result of a test in which a hand turns `joint` with `push` N·m for 0.6 s, against viscous friction only, and
/// brakes the other joints.
struct Braked {
    /// Highest speed of the joint, rad/s.
    fastest: f64,
    /// Number of changes of the braking torque from growing to shrinking or back, in the last 0.4 s. Only changes of
    /// more than 0.2 N·m in a tick are counted.
    turns: u32,
}

fn braked(model: &ArmModel, rotor: f64, joint: usize, push: f64) -> Braked {
    braked_with(model, rotor, rotor, None, joint, push)
}

/// Like `braked`, but the controller gets a wrong rotor inertia (kg·m²) and another damping (N·m·s/rad).
fn braked_with(
    model: &ArmModel,
    given: f64,
    rotor: f64,
    damping: Option<f64>,
    joint: usize,
    push: f64,
) -> Braked {
    let mut config = Config::avena();
    for j in &mut config.joints {
        j.rotor_inertia = given;
        j.teach_damping = damping.unwrap_or(j.teach_damping);
    }
    let mut arm = Plant::new(model, [LuGre { viscous: 0.3, ..LuGre::NONE }; 6], POSE);
    arm.rotor = [rotor; 6];
    let mut rig = Rig::new(config);
    rig.follow = false;
    arm.report(&mut rig);
    rig.defaults();
    assert_eq!(
        rig.ask(FrameType::PidParam, &floats([50.0, 0.0, 0.5, -1.0, 1.0].repeat(6))),
        DataStatus::NoError
    );
    assert_eq!(rig.ask(FrameType::ArmModel, &model_body(model)), DataStatus::NoError);
    while !rig.nodes[..6].iter().all(|n| n.report.state == NodeState::ENABLED) {
        arm.tick(&mut rig);
    }
    rig.send(FrameType::TeachingModeEnable, &[]);
    while rig.state() != ControllerState::Teaching {
        arm.tick(&mut rig);
        assert_eq!(rig.errors(), 0);
    }
    let mut it = Braked { fastest: 0.0, turns: 0 };
    let (mut last, mut change) = (0.0, 0.0);
    for ms in 0..600 {
        arm.push = arm.v.map(|v| -v);
        arm.push[joint] = push;
        arm.tick(&mut rig);
        assert_eq!(
            (rig.state(), rig.errors()),
            (ControllerState::Teaching, 0),
            "joint {} after {ms} ms",
            joint + 1
        );
        let brake = rig.controller.telemetry().joints[joint].torque_other;
        let now = brake - last;
        it.turns += u32::from(ms > 200 && now * change < 0.0 && now.abs() > 0.2);
        it.fastest = it.fastest.max(arm.v[joint].abs());
        (last, change) = (brake, now);
    }
    it
}

#[test]
fn j25_damping_does_not_drive_light_joints_to_and_fro() {
    let light = scaled(0.5, 0.8);
    for joint in 3..6 {
        for (push, damping) in [-1.5, 1.5].into_iter().flat_map(|p| [(p, None), (p, Some(1000.0))]) {
            let it = braked_with(&light, 0.05, 0.05, damping, joint, push);
            // The damping setting of 1000 N·m·s/rad is limited to the highest damping that the inertia of the joint
            // tolerates. With this damping, a pushed joint swings only until it has reached its final speed.
            let most = if damping.is_some() { 6 } else { 0 };
            assert!(it.turns <= most, "joint {} at {push} N·m, {damping:?}: {}", joint + 1, it.turns);
            // The damping of at least 90 1/s · 0.2 · 0.05 kg·m² = 0.9 N·m·s/rad and the braking torque limit the
            // speed.
            assert!(it.fastest < 1.5, "joint {}: {} rad/s", joint + 1, it.fastest);
        }
    }
}

#[test]
fn j25_the_wrists_of_the_default_arm_are_damped() {
    for joint in 3..6 {
        let push = 0.3 * Config::avena().joints[joint].torque_max;
        let it = braked(&Parameters::avena().model, 0.7, joint, push);
        assert_eq!(it.turns, 0, "joint {}", joint + 1);
        // The controller relies on only a fifth of the rotor inertia, which limits the damping. A push of three
        // tenths of the torque limit then causes a speed of 0.4 to 1.2 rad/s.
        assert!((0.4..1.2).contains(&it.fastest), "joint {}: {} rad/s", joint + 1, it.fastest);
    }
}

/// Every drive has a rotor, even if the arm file does not contain the rotor inertia. Teaching must also damp a joint
/// without a configured rotor inertia.
#[test]
fn j25_a_joint_is_damped_where_no_rotor_inertia_is_given() {
    for joint in 3..6 {
        let it = braked_with(&Parameters::avena().model, 0.0, 0.7, None, joint, 6.0);
        assert!(it.fastest < 1.4, "joint {}: {} rad/s", joint + 1, it.fastest);
    }
}
