//! Tests with an imported UR5 and an imported Z1, with proposed gains. Both arms are jogged (J-58) and begin paths (J-34) in random poses.
//! The controller knows the loads of the arms, and no joint reaches its torque limit.
use jtc_core::{Config, ControllerState, TrajectoryState};
use jtc_dynamics::Dynamics;
use jtc_wire::{DataStatus, ExecCommand, FrameType, RawPoint, UrgentCommand};

use crate::plant::{ArmFile, Plant, Random, highest};
use crate::rig::{Rig, floats, raw, rest};

/// Number of poses of each arm that the test uses. A single longer run of this test has used 500 poses.
const TRIALS: usize = 120;
const START_TOLERANCE: f64 = 0.3;

fn arms() -> [ArmFile; 2] {
    [ArmFile::ur5(), ArmFile::z1()]
}

fn held(arm: &ArmFile, q: [f64; 6]) -> (Plant, Rig) {
    let mut plant = Plant::of(arm, &arm.model, arm.friction(1.0), q);
    let mut rig = plant.holding_arm(arm);
    plant.brakes = false;
    plant.run(&mut rig, 1_500);
    assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0), "{} at {q:.2?}", arm.name);
    (plant, rig)
}

#[test]
fn j58_an_imported_arm_is_jogged_within_its_torque_limits_in_any_pose() {
    println!("seed 19");
    let mut random = Random(19);
    for arm in arms() {
        let (mut refused, mut most) = (0, 0.0_f64);
        for trial in 0..TRIALS {
            let (q, standing) = arm.pose(&mut random, 0.0, 0.95);
            let standing = highest(&standing);
            let (mut plant, mut rig) = held(&arm, q);
            let chosen = (random.between(0.0, 6.0) as usize).min(5);
            let single = random.next() < 0.6;
            let rates: [f32; 6] = std::array::from_fn(|j| {
                let rate = arm.config.joints[j].velocity_max * random.between(-1.0, 1.0);
                if single && j != chosen { 0.0 } else { rate as f32 }
            });
            let (ms, stops) = (random.between(200.0, 1_600.0) as usize, random.next() < 0.5);
            let about = format!("{} trial {trial}: {rates:.2?} for {ms} ms from {q:.2?}", arm.name);
            if rig.ask(FrameType::Jog, &floats(rates)) != DataStatus::NoError {
                refused += 1;
                assert!(standing > 0.8, "{about}: refused at {standing}");
                continue;
            }
            for k in 0..ms + 900 {
                if k < ms && k % 50 == 0 {
                    rig.send(FrameType::Jog, &floats(rates));
                }
                if k == ms && stops {
                    rig.urgent(0, UrgentCommand::Stop);
                } else if k == ms {
                    rig.send(FrameType::Jog, &floats([0.0; 6]));
                }
                plant.tick(&mut rig);
                assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0), "{about}, {k} ms");
                most = most.max(highest(&arm.shares(&rig.torque)));
                let set = rig.controller.telemetry().joints.map(|joint| joint.set_velocity);
                assert!(k < ms + 520 || set == [0.0; 6], "{about}: {set:?} after {} ms", k - ms);
            }
        }
        println!("{}: {refused} of {TRIALS} refused; at most {most} of a torque limit", arm.name);
        assert!(most < 0.995 && refused < TRIALS / 4, "{}: {most}, {refused} refused", arm.name);
    }
}

#[test]
fn j34_an_imported_arm_begins_a_path_within_its_torque_limits_in_any_pose() {
    println!("seed 23");
    let mut random = Random(23);
    for base in arms() {
        let config = Config { start_tolerance_rad: START_TOLERANCE, ..base.config.clone() };
        let arm = ArmFile { config, ..base };
        let (mut refused, mut most) = (0, 0.0_f64);
        for trial in 0..TRIALS {
            let (q, standing) = arm.pose(&mut random, 0.0, 0.95);
            let standing = highest(&standing);
            let (mut plant, mut rig) = held(&arm, q);
            let first: [f64; 6] = std::array::from_fn(|j| {
                let (low, high) = arm.config.position_range(j);
                (q[j] + random.between(-0.9, 0.9) * START_TOLERANCE).clamp(low, high)
            });
            let about = format!("{} trial {trial}: from {q:.2?} to {first:.2?}", arm.name);
            rig.upload(&[RawPoint { position: first.map(|q| raw(q, 3.141592)), ..rest(0) }; 3], 50);
            if rig.exec(ExecCommand::Execute) != DataStatus::NoError {
                // A refusal is permitted only if holding the arm, at its present position or at the first point,
                // takes more than 80 % of a torque limit.
                let there = Dynamics::new(&arm.model, arm.config.gravity).gravity_torque(&first);
                let there = highest(&arm.shares(&there));
                assert!(standing.max(there) > 0.8, "{about}: refused at {standing}, {there}");
                refused += 1;
                continue;
            }
            for _ in 0..6_000 {
                plant.tick(&mut rig);
                assert!(rig.state().has_torque() && rig.errors() == 0, "{about}: {:?}", rig.state());
                most = most.max(highest(&arm.shares(&rig.torque)));
                if rig.trajectory() == TrajectoryState::Finish {
                    break;
                }
            }
            assert_eq!(rig.trajectory(), TrajectoryState::Finish, "{about}");
        }
        println!("{}: {refused} of {TRIALS} refused; at most {most} of a torque limit", arm.name);
        assert!(most < 0.995 && refused < TRIALS / 4, "{}: {most}, {refused} refused", arm.name);
    }
}
