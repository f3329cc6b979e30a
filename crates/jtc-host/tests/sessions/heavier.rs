//! Tests of the torque margin of plans, for an arm that is heavier than its model and has more friction.

use std::time::Duration;

use jtc_core::JOINTS;
use jtc_host::plan::{MARGIN_PCT, Planner};
use jtc_host::port::sim::SimPort;
use jtc_host::session::{Flow, Outcome};
use jtc_host::{Arm, CheckOptions, CheckedTrajectory, Session};
use jtc_sim::{ModelError, SimConfig, World};

/// Returns the pose that belongs to this number, within the limits of the arm. Different numbers give different
/// poses.
fn place(number: u64, arm: &Arm) -> [f64; JOINTS] {
    let config = arm.config();
    std::array::from_fn(|j| {
        let (low, high) = config.position_range(j);
        0.5 * (low + high) + 0.35 * (high - low) * (12.9 * number as f64 + 7.3 * j as f64).sin()
    })
}

/// Moves an arm with the default parameters, but with all masses × 1.1 and all friction × 1.2. The motions are planned with the torque
/// margin `margin_pct` (%) and at full speed. Returns the largest share of a torque limit that the controller commanded, or the reason why
/// a motion did not finish.
fn moved(margin_pct: f64, seed: u64) -> Result<f64, String> {
    let arm = Arm::avena();
    let model_error = ModelError {
        mass_factors: Some([1.1; 7]),
        friction_factors: Some([1.2; JOINTS]),
        ..ModelError::NONE
    };
    let world = World::new(SimConfig { baud: None, model_error, seed, ..SimConfig::default() });
    let mut session = Session::new(SimPort::new(world));
    session.use_defaults().map_err(|e| e.to_string())?;
    session.wait_hold(Duration::from_secs(15)).map_err(|e| e.to_string())?;
    let (config, friction) = (arm.config(), arm.friction());
    let planner =
        Planner { model: Some(&arm.model), friction: friction.as_ref(), margin_pct, ..Planner::new(&config) };
    let mut most = 0.0f64;
    for n in 0..6 {
        let here = session.fresh_status().map_err(|e| e.to_string())?.positions();
        let planned = planner.to(&here, &place(6 * seed + n, &arm)).map_err(|e| e.to_string())?;
        let options = CheckOptions::default();
        let checked = CheckedTrajectory::check(&planned.trajectory, &arm, &here, &options)
            .map_err(|e| e.to_string())?;
        session.upload(&checked, |_| Flow::Continue).map_err(|e| e.to_string())?;
        let run = session.run(&checked, |_| Flow::Continue);
        if !matches!(run.outcome, Ok(Outcome::Finished(_))) {
            return Err(format!("{:?}", run.outcome));
        }
        for joint in run.summary(&arm).joints {
            let (peak, limit) = (joint.peak_torque_nm, joint.torque_limit_nm);
            most = most.max(peak.unwrap_or(f64::NAN) / limit.unwrap_or(f64::NAN));
        }
    }
    Ok(most)
}

/// With the default margin, moves of the heavier arm stay below every torque limit. Without a margin, some moves
/// reach a torque limit.
#[test]
fn a_heavier_arm_follows_plans_with_the_default_margin_below_its_torque_limits() {
    let mut reached = 0;
    for seed in 0..4 {
        let most = moved(MARGIN_PCT, seed).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        assert!(most < 1.0, "seed {seed}: {most} of a torque limit");
        reached += u32::from(match moved(0.0, seed) {
            Ok(most) => most > 0.999,
            Err(error) => error.contains("orque"),
        });
    }
    assert!(reached > 0, "the moves are no test of the margin");
}
