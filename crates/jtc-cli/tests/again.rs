//! Tests of interrupted runs. `jtc traj continue` runs the remainder of the trajectory from the right position.
#![cfg(unix)]

use crate::common;

use common::{Sim, at, jtc, moving_after, moving_while, place, slow_motion};
use serde_json::Value;

const FAST: [&str; 3] = ["--speed", "max", "--no-throttle"];

fn phases(value: &Value) -> Vec<&str> {
    value["runs"].as_array().unwrap().iter().map(|run| run["phase"].as_str().unwrap()).collect()
}

/// The controller is restarted while the arm is at the point at which a closed path begins and ends. This position
/// does not show how much of the path was executed. Therefore the command executes the whole path.
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
        output.err.contains("no later position (trajectory Stop")
            || output.err.contains("no later position (trajectory Null"),
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
    // The recording is replayed twice: first the complete trajectory, then only the measured motion.
    let output = sim.jtc(&["--json", "traj", "replay", &record, "--approach"]).ends(0);
    assert!(output.err.contains("the whole trajectory of the recording; the run reached"), "{}", output.err);
    assert!((output.json()["verdict"]["duration_s"].as_f64().unwrap() - whole).abs() < 0.1);
    let output = sim.jtc(&["--json", "traj", "replay", &record, "--approach", "--measured"]).ends(0);
    let part = &output.json()["verdict"]["joints"][0];
    assert!(part["position_min_rad"].as_f64().unwrap() > -0.01, "{part}");
}

/// A CSV recording contains only a part of a motion, because the run was interrupted. The error of `traj replay`
/// suggests `--measured` and `traj continue`, and both suggestions work.
#[test]
fn the_part_of_a_motion_that_was_recorded_is_run_from_rest_to_rest() {
    let sim = Sim::start(&["--no-throttle"]).held();
    let (file, record) = (sim.file("motion.csv", &slow_motion(50)), sim.path("part.csv"));
    let run = moving_while(&sim, &["traj", "run", &file, "--record", &record], 1.5);
    cli_kit::testing::signal(&run, "-INT");
    run.wait_with_output().unwrap();
    let refused = sim.jtc(&["traj", "replay", &record, "--approach"]).ends(4);
    assert!(refused.err.contains(" --measured` runs the measured part"), "{}", refused.err);
    assert!(refused.err.contains("jtc traj continue "), "{}", refused.err);
    let value = sim.json(&["traj", "replay", &record, "--approach", "--measured"], 0);
    assert_eq!(value["outcome"], "finished");
    sim.json(&["traj", "continue", &record, "--trajectory", &file], 0);
}

/// The recording contains a motion that is as fast as the limits allow. The command replays the measured motion within the
/// limits.
#[test]
fn a_measured_motion_at_its_limits_is_run_again() {
    let sim = Sim::start(&["--no-throttle"]).held();
    let (file, record, again) = (sim.path("cycle.csv"), sim.path("run.mcap"), sim.path("again.mcap"));
    jtc(&["example", "cycle", "-o", sim.dir.path().to_str().unwrap()]).ends(0);
    jtc(&["plan", &sim.path("cycle-waypoints.csv"), "-o", &file, "--blend", "0.05"]).ends(0);
    sim.jtc(&["traj", "run", &file, "--record", &record]).ends(0);
    let words = ["traj", "replay", &record, "--measured", "--approach", "--record", &again];
    let value = sim.json(&words, 0);
    let executed = value["verdict"]["duration_s"].as_f64().unwrap();
    // The motion takes 2.4 s. The measured end time of the motion is accurate to 0.1 s, so the replay takes at least
    // 2.3 s.
    assert!((2.3..8.0).contains(&executed), "{executed} s");
    let most = value["verdict"]["joints"][0]["position_max_rad"].as_f64().unwrap();
    assert!((most - 45f64.to_radians()).abs() < 0.05, "{most} rad");
}

/// The user cannot save a pose during a motion, including the start of the motion, when the velocity is still zero.
#[test]
fn a_pose_is_not_saved_while_a_trajectory_is_executed() {
    let sim = Sim::start(&["--no-throttle"]).held();
    let (file, arm) = (
        sim.file("motion.csv", &slow_motion(600)),
        sim.file("arm.toml", include_str!("../../../arms/avena.toml")),
    );
    let mut run = moving_while(&sim, &["traj", "run", &file], 0.1);
    cli_kit::testing::signal(&run, "-KILL");
    run.wait().unwrap();
    let refused = sim.jtc(&["pose", "save", "there", "--arm", &arm]).ends(4);
    assert!(refused.err.contains("the arm is on the path of a trajectory"), "{}", refused.err);
    assert_eq!(std::fs::read_to_string(&arm).unwrap(), include_str!("../../../arms/avena.toml"));
    sim.jtc(&["traj", "pause"]).ends(0);
    std::thread::sleep(std::time::Duration::from_millis(800));
    sim.jtc(&["pose", "save", "there", "--arm", &arm]).ends(0);
}

/// Options that would have no effect are rejected before any frame is sent.
#[test]
fn options_without_a_meaning_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    std::fs::write(path("w.csv"), "q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0\n0.4,0,0,0,0,0\n").unwrap();
    for out in ["out.mcap", "out.yaml", "out.YML", "out.json"] {
        let refused = jtc(&["plan", &path("w.csv"), "-o", &path(out)]).ends(2);
        assert!(refused.err.contains("out.csv`"), "{}", refused.err);
        assert!(!std::path::Path::new(&path(out)).exists());
    }
    assert!(jtc(&["plan", &path("w.csv"), "-o", "-"]).ends(2).err.contains("- is not a file"));
    jtc(&["plan", &path("w.csv"), "-o", &path("out.csv")]).ends(0);
    for quaternion in ["0,0,0,0", "0,0,0,2"] {
        std::fs::write(
            path("q.csv"),
            format!("x,y,z,qx,qy,qz,qw\n0.3,0,0.8,{quaternion}\n0.3,0,0.7,0,0,0,1\n"),
        )
        .unwrap();
        let refused = jtc(&["plan", &path("q.csv"), "-o", &path("q-out.csv")]).ends(2);
        assert!(refused.err.contains("the quaternion has the length"), "{}", refused.err);
    }
    let words = ["move", "--to", "home", "--deg", "--port", "/dev/null"];
    assert!(jtc(&words).ends(2).err.contains("--deg applies only to joint positions"));
    let words = ["teach", "record", &path("t.csv"), "--tolerance", "0.1", "--port", "/dev/null"];
    assert!(jtc(&words).ends(2).err.contains("--waypoints"));
}

/// Starts a recorded run in real time and waits until the arm has moved for one second.
fn moving(sim: &Sim, file: &str, record: &str) -> std::process::Child {
    moving_with(sim, &[file, "--record", record])
}

fn moving_with(sim: &Sim, words: &[&str]) -> std::process::Child {
    moving_while(sim, &[&["traj", "run"], words].concat(), 1.0)
}

/// After a Stop by the user, or if the program was killed, the command runs the remainder of the trajectory from the
/// last recorded position.
#[test]
fn a_run_that_was_broken_off_goes_on_where_it_was() {
    let sim = Sim::start(&["--no-throttle"]).held();
    let file = sim.file("motion.csv", &slow_motion(60));
    for (record, signal) in [("stopped.mcap", "-INT"), ("killed.mcap", "-KILL")] {
        let record = sim.path(record);
        let mut child = moving(&sim, &file, &record);
        cli_kit::testing::signal(&child, signal);
        child.wait().unwrap();
        if signal == "-KILL" {
            sim.jtc(&["traj", "stop"]).ends(0);
            std::thread::sleep(std::time::Duration::from_millis(800));
        }
        let before = place(&sim);
        assert!(before[0] > 0.01, "{before:?}");
        let output = sim.jtc(&["--json", "traj", "continue", &record]).ends(0);
        // If the recording contains the stop, the motion continues from the position at which the arm came to rest.
        // The recording of a killed program may end before the stop; the command then reports that it has no later
        // position.
        let stands =
            output.err.contains("and the arm is at rest there: the motion continues from that position");
        assert!(stands || signal == "-KILL" && output.err.contains("no later position"), "{}", output.err);
        let value = output.json();
        assert_eq!(value["outcome"], "finished");
        let executed = value["executed_s"].as_f64().unwrap();
        assert!((3.0..6.0).contains(&executed), "{executed} s of the 6 s are left");
        at(&sim, [0.0; 6]);
    }
    // The recorded run had another speed, so the points of the trajectory file do not match the recording. The
    // command must refuse it.
    let half = sim.path("half.csv");
    let mut child = moving_with(&sim, &[&file, "--speed", "80", "--record", &half]);
    cli_kit::testing::signal(&child, "-INT");
    child.wait().unwrap();
    let output = sim.jtc(&["traj", "continue", &half, "--trajectory", &file]).ends(4);
    assert!(output.err.contains("at another speed"), "{}", output.err);
    // A CSV recording does not contain the complete trajectory, so the command needs the trajectory file. The
    // recorded run has finished, so no part of it remains, and the command is refused.
    let (other, whole, rest) =
        (sim.file("other.csv", &slow_motion(30)), sim.path("whole.csv"), sim.path("rest.mcap"));
    sim.jtc(&["traj", "run", &other, "--approach", "--record", &whole]).ends(0);
    let output = sim.jtc(&["traj", "continue", &whole]).ends(2);
    assert!(output.err.contains("does not contain the whole trajectory"), "{}", output.err);
    let output = sim.jtc(&["traj", "continue", &whole, "--trajectory", &other, "--record", &rest]).ends(4);
    assert!(output.err.contains("no part of it remains"), "{}", output.err);
    assert!(!std::path::Path::new(&rest).exists());
}

/// After an error, the user must first recover the arm. If the arm was moved after the interruption, an approach moves it to the
/// resume point.
#[test]
fn a_run_that_ended_in_an_error_goes_on_after_an_approach() {
    let faults =
        "format = 2\n[[fault]]\nkind = \"motor-fault\"\njoint = 3\nbits = 2\nfor_s = 0.05\nat_point = 1500\n";
    // The simulator runs in real time, so that the recording contains a status for every 40 ms of the path.
    let sim = Sim::with_faults(&["--no-throttle"], faults).held();
    let (file, record) = (sim.file("motion.csv", &slow_motion(60)), sim.path("fault.mcap"));
    sim.jtc(&["traj", "run", &file, "--record", &record]).ends(5);
    let refused = sim.jtc(&["traj", "continue", &record]).ends(1);
    assert!(refused.err.contains("jtc recover"), "{}", refused.err);
    sim.jtc(&["recover"]).ends(0);
    sim.jtc(&["move", "--to", "0,0,0,0,0,0"]).ends(0);
    let output = sim.jtc(&["--json", "traj", "continue", &record]).ends(0);
    assert!(output.err.contains("after an approach, the motion continues from there"), "{}", output.err);
    let value = output.json();
    let phases: Vec<&str> =
        value["runs"].as_array().unwrap().iter().map(|r| r["phase"].as_str().unwrap()).collect();
    assert_eq!((phases, &value["outcome"]), (vec!["approach", "motion"], &"finished".into()));
    at(&sim, [0.0; 6]);
}

/// If the second of three runs is interrupted, the command executes the remainder of this run, and then the third
/// run. The test also covers the recording of a continued run, and a run that the controller has finished after its
/// program was killed.
#[test]
fn the_runs_that_are_left_are_run() {
    let sim = Sim::start(&["--no-throttle"]).held();
    let path = |name: &str| sim.path(name);
    let (file, run, rest) = (sim.file("motion.csv", &slow_motion(20)), path("run.mcap"), path("rest.mcap"));
    let words = ["traj", "run", &file, "--repeat", "3", "--record", &run];
    let child = moving_after(&sim, &words, "run 1 of 3 finished", 0.7);
    cli_kit::testing::signal(&child, "-INT");
    child.wait_with_output().unwrap();
    // The second interruption occurs during the last run.
    let words = ["traj", "continue", &run, "--record", &rest];
    let child = moving_after(&sim, &words, "run 1 of 2 finished", 0.7);
    cli_kit::testing::signal(&child, "-KILL");
    child.wait_with_output().unwrap();
    std::thread::sleep(std::time::Duration::from_secs(3));
    let output = sim.jtc(&["traj", "continue", &rest]).ends(4);
    assert!(output.err.contains("no part of it remains"), "{}", output.err);
    // Both runs of this recording have finished, so `--repeat 3` requests one more run.
    let value = sim.json(&["traj", "continue", &rest, "--repeat", "3"], 0);
    assert_eq!((phases(&value), &value["runs_finished"]), (vec!["motion"], &1.into()), "{value}");
    // The test continues from the first recording again, after the controller has executed another motion. The command executes the
    // remainder of the second run, and then the third run.
    sim.jtc(&["move", "--to", "0.1,0,0,0,0,0"]).ends(0);
    let output = sim.jtc(&["--json", "traj", "continue", &run]).ends(0);
    assert!(output.err.contains("then the whole trajectory runs once"), "{}", output.err);
    let value = output.json();
    assert_eq!(value["runs_finished"], 2, "{value}");
    assert!((value["verdict"]["duration_s"].as_f64().unwrap() - 2.0).abs() < 1e-6, "{value}");
    // A CSV recording does not contain the number of runs, and the command reports this.
    let csv = path("run.csv");
    let words = ["traj", "run", &file, "--repeat", "2", "--record", &csv];
    let child = moving_after(&sim, &words, "run 1 of 2 finished", 0.7);
    cli_kit::testing::signal(&child, "-INT");
    child.wait_with_output().unwrap();
    let output = sim.jtc(&["--json", "traj", "continue", &csv, "--trajectory", &file]).ends(0);
    assert!(output.err.contains("does not contain the number of runs"), "{}", output.err);
    assert_eq!(output.json()["runs_finished"], 1);
}
