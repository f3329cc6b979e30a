//! Runs that were broken off: what is run of them again, and from which place.
#![cfg(unix)]

mod common;

use common::{Sim, jtc, moving_while, slow_motion};
use serde_json::Value;

const FAST: [&str; 3] = ["--speed", "max", "--no-throttle"];

fn phases(value: &Value) -> Vec<&str> {
    value["runs"].as_array().unwrap().iter().map(|run| run["phase"].as_str().unwrap()).collect()
}

/// A closed path that begins and ends where a controller stands that was started anew: nothing of it is left out.
#[test]
fn a_controller_that_was_started_anew_shows_no_place_of_a_run() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let (waypoints, file, record) = (path("waypoints.csv"), path("cycle.csv"), path("run.mcap"));
    std::fs::write(
        &waypoints,
        "q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0\n0.4,0,0,0,0,0\n-0.4,0,0,0,0,0\n0,0,0,0,0,0\n",
    )
    .unwrap();
    let planned = jtc(&["--json", "plan", &waypoints, "-o", &file, "--speed", "20"]).ends(0).json();
    let whole = planned["duration_s"].as_f64().unwrap();
    let sim = Sim::start(&["--no-throttle"]).held();
    let run = moving_while(&sim, &["traj", "run", &file, "--record", &record], 1.2);
    sim.end("-KILL");
    run.wait_with_output().unwrap();
    let sim = Sim::start(&FAST).held();
    let output = sim.jtc(&["--json", "traj", "continue", &record]).ends(0);
    assert!(
        output.err.contains("no later place of it (trajectory Stop")
            || output.err.contains("no later place of it (trajectory Null"),
        "{}",
        output.err
    );
    let value = output.json();
    assert_eq!((phases(&value), &value["outcome"]), (vec!["approach", "motion"], &"finished".into()));
    let executed = value["verdict"]["duration_s"].as_f64().unwrap();
    assert!(executed > whole - 2.5, "{executed} s of {whole} s");
    let of_first = &value["verdict"]["joints"][0];
    assert!(of_first["position_max_rad"].as_f64().unwrap() > 0.399, "{of_first}");
    assert!(of_first["position_min_rad"].as_f64().unwrap() < -0.399, "{of_first}");
}

/// Also where it begins, and has no speed yet.
#[test]
fn a_pose_is_not_saved_while_a_trajectory_is_executed() {
    let sim = Sim::start(&["--no-throttle"]).held();
    let (file, arm) = (
        sim.file("motion.csv", &slow_motion(600)),
        sim.file("arm.toml", include_str!("../../../arms/avena.toml")),
    );
    let mut run = moving_while(&sim, &["traj", "run", &file], 0.1);
    cli_kit::trial::signal(&run, "-KILL");
    run.wait().unwrap();
    let refused = sim.jtc(&["pose", "save", "there", "--arm", &arm]).ends(4);
    assert!(refused.err.contains("the arm is on the path of a trajectory"), "{}", refused.err);
    assert_eq!(std::fs::read_to_string(&arm).unwrap(), include_str!("../../../arms/avena.toml"));
    sim.jtc(&["traj", "pause"]).ends(0);
    std::thread::sleep(std::time::Duration::from_millis(800));
    sim.jtc(&["pose", "save", "there", "--arm", &arm]).ends(0);
}
