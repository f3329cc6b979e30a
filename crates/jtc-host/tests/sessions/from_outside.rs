//! Tests with an arm without brakes that has fallen to an end stop, slightly outside a position limit. From this position, motions back
//! into the limits are permitted (J-36, J-58).

use std::time::Duration;

use jtc_core::JOINTS;
use jtc_host::plan::Planner;
use jtc_host::port::sim::SimPort;
use jtc_host::run::Order;
use jtc_host::session::{Flow, Outcome};
use jtc_host::{Arm, CheckOptions, CheckedTrajectory, Session, Trajectory};
use jtc_sim::{SimConfig, World};

use super::Sim;

/// Returns a session with the arm in position hold and joint 3 at this position.
fn held_at(position: f64) -> Sim {
    let start = [0.0, 0.0, position, 0.0, 0.0, 0.0];
    let world = World::new(SimConfig { baud: None, start, ..SimConfig::default() });
    let mut session = Session::new(SimPort::new(world));
    session.use_defaults().unwrap();
    session.wait_hold(Duration::from_secs(15)).unwrap();
    session
}

fn finishes(session: &mut Sim, checked: &CheckedTrajectory) {
    session.upload(checked, |_| Flow::Continue).expect("the controller takes it");
    let run = session.run(checked, |_| Flow::Continue);
    assert!(matches!(run.outcome, Ok(Outcome::Finished(_))), "{:?}", run.outcome);
    let status = session.fresh_status().unwrap();
    assert_eq!((status.errors, status.occurred), (0, 0));
    let end = checked.trajectory().points.last().unwrap().position;
    for (joint, (is, wanted)) in status.positions().iter().zip(end).enumerate() {
        assert!((is - wanted).abs() < 3e-3, "joint {}: {is} in place of {wanted}", joint + 1);
    }
}

#[test]
fn j58_an_arm_outside_a_limit_is_moved_back_inside() {
    let arm = Arm::avena();
    let (config, friction) = (arm.config(), arm.friction());
    let (low, high) = (config.joints[2].position_min, config.joints[2].position_max);
    let planner = Planner { model: Some(&arm.model), friction: friction.as_ref(), ..Planner::new(&config) };
    for (at, to) in [(high + 0.017, high - 0.4), (low - 0.017, low + 0.4), (high + 0.01, high)] {
        let mut session = held_at(at);
        let here = session.fresh_status().unwrap().positions();
        assert!(!(low..=high).contains(&here[2]), "{} is inside", here[2]);
        let planned = planner.to(&here, &[0.1, 0.0, to, 0.0, 0.2, 0.0]).unwrap();
        let options = CheckOptions::default();
        let checked = CheckedTrajectory::check(&planned.trajectory, &arm, &here, &options).unwrap();
        finishes(&mut session, &checked);
    }
}

#[test]
fn j58_an_arm_outside_a_limit_approaches_a_trajectory() {
    let arm = Arm::avena();
    let high = arm.config().joints[2].position_max;
    let to = |q: [f64; JOINTS]| jtc_host::plan::joint_move(&[0.0; JOINTS], &q, &arm.config(), 50.0).unwrap();
    let motion = to([0.3, 0.0, -0.2, 0.0, 0.0, 0.0]);
    let mut session = held_at(high + 0.017);
    let here = session.fresh_status().unwrap().positions();
    let order = Order {
        arm: &arm,
        options: &CheckOptions::default(),
        trajectory: &motion,
        later: &motion,
        runs: 1,
        approach_pct: Some(50.0),
    };
    let start = order.start(1, &here).unwrap();
    assert!(start.is_approach);
    finishes(&mut session, &start.checked);
}

/// The trajectory file begins at the position of the fallen arm. Hosts of existing systems write such files.
#[test]
fn j36_a_file_that_begins_outside_a_limit_and_goes_inwards_is_run() {
    let arm = Arm::avena();
    let high = arm.config().joints[2].position_max;
    let mut session = held_at(high + 0.015);
    let here = session.fresh_status().unwrap().positions();
    let far = |config: &mut jtc_core::Config| config.joints[2].position_max += 0.1;
    let mut wide = arm.config();
    far(&mut wide);
    let mut to = here;
    to[2] -= 0.5;
    let inwards = jtc_host::plan::joint_move(&here, &to, &wide, 40.0).unwrap();
    assert!((inwards.points[0].position[2] - here[2]).abs() < 1e-9);
    let checked = CheckedTrajectory::check(&inwards, &arm, &here, &CheckOptions::default()).unwrap();
    finishes(&mut session, &checked);
    // The reversed motion leaves the limits, so it is rejected.
    let mut points = inwards.points.clone();
    points.reverse();
    points.iter_mut().for_each(|point| point.velocity = point.velocity.map(|v| -v));
    let here = session.fresh_status().unwrap().positions();
    let outwards = Trajectory { step_ms: inwards.step_ms, points };
    let refused = CheckedTrajectory::check(&outwards, &arm, &here, &CheckOptions::default()).unwrap_err();
    assert!(refused.to_string().contains("position over its limit"), "{refused}");
}
