//! Tests of a controller with extensions: identity, arm, speed and jogging (J-52 to J-58).

use crate::common;

use common::{Sim, jtc, motion};
use serde_json::Value;

/// Writes an arm file with a gain, a joint limit and a controller setting that differ from the values of the built-in
/// arm.
fn another(sim: &Sim) -> String {
    let text = include_str!("../../../arms/avena.toml")
        .replacen("name = \"avena\"", "name = \"another\"", 1)
        .replacen("velocity_max_rad_s = 1.5", "velocity_max_rad_s = 1.2", 1)
        .replacen("kd = 80.0", "kd = 75.0", 1);
    sim.file("another.toml", &(text + "\n[settings]\nramp_ms = 300\n"))
}

fn names(value: &Value) -> Vec<&str> {
    value["differences"].as_array().unwrap().iter().map(|d| d["name"].as_str().unwrap()).collect()
}

#[test]
fn j52_a_controller_tells_who_it_is() {
    let sim = Sim::start(&["--no-throttle"]);
    let info = sim.json(&["info"], 0);
    assert_eq!((info["extension"].as_u64(), info["arm"].as_str()), (Some(1), Some("avena")));
    assert_eq!(info["missing"].as_array().unwrap().len(), 3);
    assert_eq!((info["boots"].as_u64(), info["boot_cause"].as_str()), (Some(1), Some("power-on")));
    for key in ["firmware", "revision", "board", "hash", "uptime_s", "lost_records"] {
        assert!(!info[key].is_null(), "{key}: {info}");
    }
    let text = sim.jtc(&["info"]).ends(0).out;
    assert!(text.contains(info["hash"].as_str().unwrap()) && text.contains("started:   once"), "{text}");
    // The hash of the arm does not change when the parameters are sent.
    let sim = sim.with_parameters();
    assert_eq!(sim.json(&["info"], 0)["hash"], info["hash"]);
    let avena = concat!(env!("CARGO_MANIFEST_DIR"), "/../../arms/avena.toml");
    let diff = sim.json(&["arm", "diff", avena], 0);
    assert_eq!((&diff["equal"], names(&diff).len()), (&Value::Bool(true), 0));
}

#[test]
fn j54_j55_a_whole_arm_is_pushed_stored_read_back_and_compared() {
    let sim = Sim::start(&["--no-throttle"]);
    let arm = another(&sim);
    let file = sim.file("motion.csv", &motion(0.2));
    // Before the push, only these three values differ between the file and the controller. The controller still uses
    // its built-in gains and friction.
    let diff = sim.json(&["arm", "diff", &arm], 4);
    assert_eq!(names(&diff), ["velocity_max_rad_s", "ramp_ms", "pid.kd"]);

    let pushed = sim.json(&["arm", "push", &arm, "--store"], 0);
    assert_eq!(pushed["stored_number"], 1);
    let info = sim.json(&["info"], 0);
    assert_eq!((info["arm"].as_str(), info["defaults"].as_str()), (Some("another"), Some("stored")));
    assert_eq!((&info["hash"], info["missing"].as_array().unwrap().len()), (&pushed["hash"], 3));
    assert_eq!(sim.json(&["arm", "diff", &arm], 0)["equal"], true);

    // The new arm is now the default of the controller. A run is checked with the new arm, and a run with a different
    // arm file is rejected.
    sim.jtc(&["recover", "--defaults"]).ends(0);
    let sim = sim.held();
    assert_eq!(sim.json(&["info"], 0)["hash"], pushed["hash"]);
    sim.jtc(&["traj", "run", &file, "--arm", &arm]).ends(0);
    let avena = concat!(env!("CARGO_MANIFEST_DIR"), "/../../arms/avena.toml");
    let refused = sim.json(&["traj", "run", &file, "--arm", avena], 4);
    assert_eq!(names(&refused), ["velocity_max_rad_s", "ramp_ms", "pid.kd"]);
    assert_eq!(refused["error"]["code"], "other-arm");
    let named = sim.jtc(&["traj", "run", &file]).ends(0).err;
    assert!(named.contains("checked with the arm of the controller, another"), "{named}");

    // The arm file that is read from the controller is equal to the arm file that was sent.
    let pulled = sim.path("pulled.toml");
    assert_eq!(sim.json(&["arm", "pull", "-o", &pulled], 0)["hash"], pushed["hash"]);
    assert_eq!(sim.json(&["arm", "diff", &pulled], 0)["equal"], true);
    sim.jtc(&["arm", "pull", "-o", &pulled]).ends(4);
    let shown = sim.json(&["arm", "show"], 0);
    assert_eq!(shown["arm"], "another");

    // Settings of the arm can change only while the drives produce no torque.
    let refused = sim.jtc(&["arm", "push", avena]).ends(1);
    assert!(
        refused.err.contains("jtc disable") && refused.err.contains("nothing was changed"),
        "{}",
        refused.err
    );
    assert_eq!(sim.json(&["info"], 0)["hash"], pushed["hash"]);
    // Without a terminal, no user can confirm that the torque may be switched off. Therefore the command rejects the
    // request.
    sim.jtc(&["disable"]).ends(4);
    assert_eq!(sim.json(&["disable", "--yes"], 0)["status"]["state"], "Init");
    sim.jtc(&["arm", "push", avena]).ends(0);
    assert_eq!(sim.json(&["arm", "diff", avena], 0)["equal"], true);
}

/// An arm without gains is incomplete, so `jtc arm push` does not send it.
#[test]
fn j55_an_arm_that_is_not_whole_is_not_pushed() {
    let text: String = include_str!("../../../arms/avena.toml")
        .lines()
        .filter(|line| !line.starts_with("pid ="))
        .map(|line| format!("{line}\n"))
        .collect();
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("arm.toml");
    std::fs::write(&path, text).unwrap();
    let output = jtc(&["arm", "push", path.to_str().unwrap(), "--port", "/nowhere/tty"]).ends(2);
    assert!(
        output.err.contains("values missing in the file: PID gains") && output.err.contains("jtc arm check"),
        "{}",
        output.err
    );
}

#[test]
fn j57_the_speed_of_a_motion_changes_while_it_runs() {
    let sim = Sim::start(&["--no-throttle"]).held();
    let file = sim.file("motion.csv", &motion(0.2));
    assert_eq!(sim.json(&["traj", "speed"], 0)["speed_percent"], 100.0);
    let whole = sim.json(&["traj", "run", &file], 0)["recorded_s"].as_f64().unwrap();
    assert_eq!(sim.json(&["traj", "speed", "50"], 0)["speed_percent"], 50.0);
    let run = sim.jtc(&["--json", "traj", "run", &file]).ends(0);
    assert!(run.err.contains("speed override of the controller is 50 %"), "{}", run.err);
    let executed = run.json()["recorded_s"].as_f64().unwrap();
    // At 50 %, the motion takes twice the time. The recorded time also contains short times before and after the
    // motion, which do not depend on the speed.
    assert!(executed > 1.6 * whole && executed < 2.1 * whole, "{whole} s became {executed} s");
    for wrong in ["4", "101", "nan"] {
        sim.jtc(&["traj", "speed", wrong]).ends(2);
    }
    assert_eq!(sim.json(&["traj", "speed"], 0)["speed_percent"], 50.0);
}

#[test]
fn j58_a_joint_is_jogged_for_as_long_as_the_command_lives() {
    let sim = Sim::start(&["--no-throttle"]).held();
    let way = sim.json(&["jog", "3", "0.2", "--duration", "1"], 0);
    let at = |value: &Value, j: usize| value[j].as_f64().unwrap();
    let moved = at(&way["to_rad"], 2) - at(&way["from_rad"], 2);
    // The permitted range is wide: on a busy computer, the command may repeat the jog too late, and the arm then
    // comes to rest in between.
    assert!((0.05..0.25).contains(&moved), "{moved}");
    assert!((at(&way["to_rad"], 0) - at(&way["from_rad"], 0)).abs() < 1e-3);
    let back = sim.json(&["jog", "3", "-10", "--deg", "--duration", "0.5"], 0);
    assert!(at(&back["to_rad"], 2) < at(&way["to_rad"], 2) - 0.05);
    // The controller must stop the arm by itself, because a killed command cannot send a Stop.
    let mut child = sim.command(&["jog", "1", "0.3"]).spawn().unwrap();
    std::thread::sleep(std::time::Duration::from_millis(600));
    child.kill().unwrap();
    child.wait().unwrap();
    std::thread::sleep(std::time::Duration::from_secs(1));
    let rests = |status: Value| {
        let joints = status["joints"].as_array().unwrap().clone();
        joints.iter().all(|joint| joint["velocity_rad_s"].as_f64().unwrap().abs() < 0.01)
    };
    assert!(rests(sim.json(&["status"], 0)));
    let too_fast = sim.jtc(&["jog", "1", "5"]).ends(1);
    assert!(too_fast.err.contains("velocity limit"), "{}", too_fast.err);
    sim.jtc(&["jog"]).ends(2);
    sim.jtc(&["jog", "7", "0.1"]).ends(2);
    sim.jtc(&["disable", "--yes"]).ends(0);
    let refused = sim.jtc(&["jog", "1", "0.1"]).ends(1);
    assert!(refused.err.contains("jtc recover"), "{}", refused.err);
}

/// If an error switches off the torque during a jog, the command ends with exit code 5 and reports the error and its
/// reason.
#[test]
fn j21_j58_a_jog_in_which_the_arm_is_released_ends_with_exit_5_and_the_reason() {
    let fault =
        "format = 2\n[[fault]]\nkind = \"node-silent\"\njoint = 4\nin_state = \"hold\"\nafter_s = 10\n";
    // Joint 4 stops answering 10 s after the controller enters HoldPos; the drives are enabled after 4 s. The fault
    // therefore occurs during the jog, which would otherwise take a minute.
    let sim = Sim::with_faults(&["--no-throttle"], fault).held();
    let output = sim.jtc(&["--json", "jog", "2", "0.01", "--duration", "60"]).ends(5);
    let error = &output.json()["error"];
    let message = error["message"].as_str().unwrap();
    assert!(message.contains("released the arm") && message.contains("joint 4 does not answer"), "{error}");
    assert!(error.to_string().contains("jtc recover"), "{error}");
}

/// The simulated board stores its arm in a file, as a real board stores its arm in flash. The file still exists after the simulator has
/// ended.
#[test]
fn j54_the_simulator_keeps_a_stored_arm_in_its_file() {
    let dir = tempfile::tempdir().unwrap();
    let kept = dir.path().join("flash.bin");
    let kept = kept.to_str().unwrap();
    let sim = Sim::start(&["--no-throttle", "--speed", "max", "--store", kept]);
    let arm = another(&sim);
    let pushed = sim.json(&["arm", "push", &arm, "--store"], 0);
    let status = sim.json(&["status"], 0);
    assert_eq!(
        (&status["state"], status["missing_parameters"].as_array().unwrap().len()),
        (&"Init".into(), 3)
    );
    // The torque of a held arm is switched off only if the user confirms this.
    sim.jtc(&["recover", "--defaults"]).ends(0);
    let refused = sim.jtc(&["arm", "push", &arm, "--store"]).ends(1);
    assert!(
        refused.err.contains("HoldPos; nothing was sent") && refused.err.contains("jtc disable"),
        "{}",
        refused.err
    );
    assert_eq!(sim.json(&["status"], 0)["state"], "HoldPos");
    assert_eq!(sim.end("-TERM").0, 0);
    let sim = Sim::start(&["--no-throttle", "--speed", "max", "--store", kept]);
    let info = sim.json(&["info"], 0);
    assert_eq!((info["arm"].as_str(), info["missing"].as_array().unwrap().len()), (Some("another"), 3));
    sim.jtc(&["recover", "--defaults"]).ends(0);
    assert_eq!(sim.json(&["info"], 0)["hash"], pushed["hash"]);
    drop(sim);
    std::fs::write(kept, "no arm").unwrap();
    let refused = jtc(&["sim", "--serial", "/nowhere/tty", "--store", kept]).ends(2);
    assert!(refused.err.contains("the file contains no stored arm"), "{}", refused.err);
}

/// If the simulator is started with another arm, its controller has stored this arm, like a real board.
#[test]
fn j55_the_controller_of_another_simulated_arm_has_it_stored() {
    let dir = tempfile::tempdir().unwrap();
    let text = include_str!("../../../arms/avena.toml").replacen("name = \"avena\"", "name = \"mine\"", 1);
    let arm = dir.path().join("mine.toml");
    std::fs::write(&arm, text.replacen("velocity_max_rad_s = 1.5", "velocity_max_rad_s = 1.1", 1)).unwrap();
    let arm = arm.to_str().unwrap();
    let sim = Sim::start(&["--no-throttle", "--speed", "max", "--arm", arm]);
    sim.jtc(&["recover", "--defaults"]).ends(0);
    let info = sim.json(&["info"], 0);
    assert_eq!((info["arm"].as_str(), info["defaults"].as_str()), (Some("mine"), Some("stored")));
    assert_eq!(sim.json(&["arm", "diff", arm], 0)["equal"], true);
}

/// While `arm push --store` only stores an arm, the controller must not start position hold with the new parameters.
#[test]
fn j54_an_arm_that_is_stored_is_not_held_in_between() {
    let dir = tempfile::tempdir().unwrap();
    let record = dir.path().join("each.csv");
    let sim = Sim::start(&["--no-throttle", "--speed", "max", "--record", record.to_str().unwrap()]);
    let arm = another(&sim);
    let held = |path: &std::path::Path| {
        let text = std::fs::read_to_string(path).unwrap();
        text.lines().filter(|line| line.split(',').nth(1) == Some("2")).count()
    };
    sim.json(&["arm", "push", &arm, "--store"], 0);
    std::thread::sleep(std::time::Duration::from_millis(500));
    assert_eq!(sim.json(&["status"], 0)["state"], "Init");
    assert_eq!(sim.end("-TERM").0, 0);
    assert_eq!(held(&record), 0);
}
