//! Tests with the simulator: moves to poses, motions through waypoints, and repeated, replayed and resumed runs.
#![cfg(unix)]

use crate::common;

use common::{Sim, at, jtc, moving_while, place, slow_motion};
use jtc_host::recording::Recording;
use serde_json::Value;
use test_kit::patience::Patience;

const FAST: [&str; 3] = ["--speed", "max", "--no-throttle"];
const WAYPOINTS: &str =
    "q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0\n0.5,0.2,-0.4,0.3,0.6,0\n0.1,0.4,-0.9,0,0.6,0.5\n0,0,0,0,0,0\n";

fn ready() -> Sim {
    Sim::start(&FAST).held()
}

fn arm(sim: &Sim) -> String {
    sim.file("arm.toml", include_str!("../../../arms/avena.toml"))
}

/// If the user specifies no speed, a move and an approach are slow, and the command prints the speed.
#[test]
fn j52_a_move_without_a_speed_is_slow() {
    // The simulator runs in real time, because a run reports its duration.
    let sim = Sim::start(&["--no-throttle"]).held();
    let default = "at 25 % of the limits; --speed sets it";
    let to = |words: &[&str]| {
        let output = sim.jtc(&[&["--json", "move", "--to", "0.4,0.2,-0.3,0,0,0"], words].concat()).ends(0);
        sim.jtc(&["move", "--to", "0,0,0,0,0,0", "--speed", "100"]).ends(0);
        (output.json()["executed_s"].as_f64().unwrap(), output.err)
    };
    let (slow, said) = to(&[]);
    assert!(said.contains(default), "{said}");
    let (same, named) = to(&["--speed", "25"]);
    assert!((slow - same).abs() < 0.4 && !named.contains("of the limits"), "{slow} s, {same} s: {named}");
    let (full, _) = to(&["--speed", "100"]);
    assert!(slow > 1.7 * full, "{slow} s, {full} s");
    let folder = sim.path("examples");
    sim.jtc(&["example", "motion", "-o", &folder]).ends(0);
    let motion = format!("{folder}/motion.csv");
    let approach = |words: &[&str]| {
        sim.jtc(&["move", "--to", "0.4,0.2,-0.3,0,0,0", "--speed", "100"]).ends(0);
        sim.jtc(&[&["traj", "run", &motion, "--approach"], words].concat()).ends(0).err
    };
    let said = approach(&[]);
    assert!(said.contains("s to the first point, ") && said.contains(default), "{said}");
    assert!(!approach(&["--speed", "100"]).contains("of the limits"));
}

/// J-55: the command checks the complete run with the arm, limits and payload of the controller before an approach
/// begins.
#[test]
fn j55_a_run_that_the_controller_s_arm_or_payload_forbids_moves_nothing() {
    let sim = Sim::start(&FAST);
    let slow = include_str!("../../../arms/avena.toml")
        .replace("velocity_max_rad_s = 1.5", "velocity_max_rad_s = 0.4");
    let arm = sim.file("slow.toml", &slow);
    let folder = sim.path("examples");
    sim.jtc(&["example", "motion", "-o", &folder]).ends(0);
    let motion = format!("{folder}/motion.csv");
    let elsewhere = [0.3, 0.2, -0.3, 0.0, 0.0, 0.0];
    let refused = |sim: &Sim, kind: &str| {
        // The controller may use a payload that the simulated arm does not carry. The move is slow, so that the arm
        // can still follow it.
        sim.jtc(&["move", "--to", "0.3,0.2,-0.3,0,0,0", "--speed", "20"]).ends(0);
        let refused = sim.json(&["traj", "run", &motion, "--approach"], 4);
        let kinds: Vec<_> =
            refused["verdict"]["problems"].as_array().unwrap().iter().map(|p| p["kind"].clone()).collect();
        assert!(kinds.iter().any(|k| k == kind) && kinds.iter().any(|k| k == "start_pose"), "{kinds:?}");
        at(sim, elsewhere);
    };
    let narrow = Sim::start(&[&FAST[..], &["--arm", &arm]].concat()).held();
    refused(&narrow, "velocity");
    let loaded = sim.held();
    loaded.jtc(&["payload", "set", "--mass", "7", "--com", "0,0,0.1"]).ends(0);
    refused(&loaded, "torque");
    loaded.jtc(&["payload", "clear"]).ends(0);
    loaded.jtc(&["traj", "run", &motion, "--approach", "--speed", "100"]).ends(0);
}

/// The arm moves to a flange pose in joint space, and then on a straight line. The command rejects impossible moves before the
/// arm moves.
#[test]
fn an_arm_moves_to_poses_of_the_flange_and_on_lines() {
    let sim = ready();
    let record = sim.path("line.csv");
    sim.json(&["move", "--to-flange", "0.6,-0.2,0.4,0,0,0", "--speed", "100"], 0);
    let words = [
        "move",
        "--to-flange",
        "0.6,0.2,0.4,0,0,10",
        "--deg",
        "--line",
        "--speed",
        "100",
        "--record",
        &record,
    ];
    sim.json(&words, 0);
    let kinematics = {
        use jtc_host::{Arm, plan::kinematics::Kinematics};
        Kinematics::new(&Arm::avena().model, &[(0.0, 0.0); 6])
    };
    let flange = |q: &[f64]| kinematics.flange(&std::array::from_fn(|j| q[j]));
    let there = flange(&place(&sim));
    assert!((there.position[1] - 0.2).abs() < 3e-3, "{there:?}");
    assert!((there.rotation[1][0] - 10f64.to_radians().sin()).abs() < 5e-3, "{there:?}");
    // The recording contains the commanded positions of the move.
    let text = std::fs::read_to_string(&record).unwrap();
    let mut lines = text.lines().skip_while(|line| !line.contains("set_position_rad"));
    let head: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let columns: Vec<usize> = (0..head.len()).filter(|i| head[*i].contains("set_position_rad")).collect();
    assert_eq!(columns.len(), 6, "{head:?}");
    let mut passed = 0;
    for line in lines {
        let cells: Vec<&str> = line.split(',').collect();
        let q: Vec<f64> = columns.iter().filter_map(|i| cells[*i].parse().ok()).collect();
        let [x, y, z] = if q.len() == 6 { flange(&q).position } else { continue };
        // The tolerance is 3 mm, because the line starts at the measured position of the arm, which differs slightly
        // from the previous target.
        assert!((x - 0.6).abs() < 3e-3 && (z - 0.4).abs() < 3e-3, "{x} {y} {z}");
        passed += usize::from(y.abs() < 0.1);
    }
    assert!(passed > 5, "{passed} places on the way");
    let before = place(&sim);
    for (words, code, message) in [
        (vec!["--to-flange", "2,0,0.4,0,0,0"], 4, "no move to 2,0,0.4,0,0,0: out of reach"),
        (vec!["--to-flange", "2,0,0.4,0,0,0", "--line"], 4, "out of reach"),
        (vec!["--to", "0,0,0,0,0,0", "--line"], 4, "nothing was sent"),
        (vec!["--to-flange", "1,2,3"], 2, "3 numbers, not 6"),
        (vec!["--line"], 2, "--to"),
    ] {
        let output = sim.jtc(&[&["move"], &words[..]].concat()).ends(code);
        assert!(output.err.contains(message), "{words:?}: {}", output.err);
    }
    for (a, b) in place(&sim).iter().zip(before) {
        assert!((a - b).abs() < 1e-3);
    }
}

#[test]
fn an_arm_moves_between_positions_and_the_poses_that_were_saved() {
    let sim = ready();
    let arm = arm(&sim);
    let before = std::fs::read_to_string(&arm).unwrap();
    sim.jtc(&["pose", "save", "home", "--arm", &arm]).ends(0);
    let moved = sim.json(&["move", "--to", "0.4,0.2,-0.5,0.3,0.6,-0.2"], 0);
    assert_eq!((&moved["outcome"], &moved["phase"]), (&"finished".into(), &"motion".into()));
    at(&sim, [0.4, 0.2, -0.5, 0.3, 0.6, -0.2]);
    let saved = sim.json(&["pose", "save", "up", "--arm", &arm], 0);
    assert!((saved["position_rad"][4].as_f64().unwrap() - 0.6).abs() < 3e-3, "{saved}");
    sim.json(&["move", "--to", "home", "--arm", &arm, "--speed", "100"], 0);
    at(&sim, [0.0; 6]);
    sim.json(&["move", "--to", "10,0,0,0,0,-20", "--deg"], 0);
    at(&sim, [10f64.to_radians(), 0.0, 0.0, 0.0, 0.0, (-20f64).to_radians()]);
    let list = jtc(&["--json", "pose", "list", "--arm", &arm]).ends(0).json();
    assert_eq!(list["poses_rad"].as_object().unwrap().len(), 2);
    // The command overwrites an existing pose only if the user requests this. After the command has removed a pose, only the end of
    // the file is different.
    let refused = sim.jtc(&["pose", "save", "up", "--arm", &arm]).ends(4);
    assert!(refused.err.contains("pose \"up\" exists already"), "{}", refused.err);
    sim.jtc(&["pose", "save", "up", "--arm", &arm, "--overwrite"]).ends(0);
    jtc(&["pose", "remove", "up", "--arm", &arm]).ends(0);
    let left = jtc(&["pose", "list", "--arm", &arm]).ends(0).out;
    assert!(left.contains("home") && !left.contains("up "), "{left}");
    assert!(std::fs::read_to_string(&arm).unwrap().starts_with(before.trim_end()));
}

#[test]
fn what_is_no_move_or_pose_is_refused_before_anything_moves() {
    let sim = ready();
    let arm = arm(&sim);
    sim.jtc(&["pose", "save", "home", "--arm", &arm]).ends(0);
    for (words, code, message) in [
        (
            vec!["move", "--to", "hone", "--arm", &arm],
            2,
            "has no pose \"hone\"; the arm has home; nothing was sent",
        ),
        (vec!["move", "--to", "home"], 2, "has no pose \"home\"; the arm has no poses"),
        (vec!["move", "--to", "0,0,0"], 2, "3 numbers, not 6"),
        (
            vec!["move", "--to", "0,1.6,0,0,0,0"],
            4,
            "joint 2: 1.6 rad is outside -1.57..1.57 rad; nothing was sent",
        ),
        (vec!["move", "--to", "90,0,0,0,0,0"], 4, "no move to 90,0,0,0,0,0: joint 1: 90 rad is outside"),
        (vec!["move", "--to", "90,0,0,0,0,0"], 4, "in degrees with --deg"),
        (
            vec!["move", "--to", "0,0,0,0,0,0", "--speed", "0"],
            2,
            "speed 0 % is out of range, expected 1..100 %; nothing was sent",
        ),
        (vec!["move", "--to", "0.1,0,0,0,0,0", "--record", "run.txt"], 2, "run.txt"),
        (vec!["pose", "save", "1st", "--arm", &arm], 2, "is not a valid name of a pose"),
        (vec!["pose", "save", "new", "--arm", "nothing.toml"], 2, "nothing.toml: No such file"),
    ] {
        let output = sim.jtc(&words).ends(code);
        assert!(output.err.contains(message), "{words:?}: {}", output.err);
    }
    let output = jtc(&["pose", "remove", "hone", "--arm", &arm]).ends(2);
    assert!(output.err.contains("did you mean \"home\"?"), "{}", output.err);
    at(&sim, [0.0; 6]);
    // A move can begin only in HoldPos. In another state, its error is the same as the error of `traj run`.
    let sim = Sim::start(&FAST);
    let all_are_there = || sim.json(&["status"], 0)["missing_nodes"].as_array().unwrap().is_empty();
    assert!((0..100).any(|_| all_are_there()), "the drives are brought up");
    let (moved, run) = (sim.jtc(&["move", "--to", "0.1,0,0,0,0,0"]), sim.path("motion.csv"));
    std::fs::write(&run, slow_motion(20)).unwrap();
    let run = sim.jtc(&["traj", "run", &run]);
    assert!(moved.code == 1 && run.code == 1 && run.err.ends_with(&moved.err), "{}{}", moved.err, run.err);
}

/// A command executes the motion of a waypoint file several times, and reports the results of each run.
#[test]
fn waypoints_are_run_several_times() {
    let sim = ready();
    let (file, out) = (sim.file("waypoints.csv", WAYPOINTS), sim.path("cycle.csv"));
    jtc(&["plan", &file, "-o", &out, "--blend", "0.1"]).ends(0);
    let (record, page) = (sim.path("run.mcap"), sim.path("run.html"));
    let words = ["traj", "run", &out, "--repeat", "3", "--record", &record, "--report", &page];
    let value = sim.json(&words, 0);
    let runs = value["runs"].as_array().unwrap();
    assert_eq!(runs.len(), 3, "{value}");
    for (n, run) in runs.iter().enumerate() {
        assert_eq!((run["run"].as_u64(), &run["outcome"]), (Some(n as u64 + 1), &"finished".into()));
        for joint in run["joints"].as_array().unwrap() {
            assert!(joint["max_error_mrad"].as_f64().unwrap() < 5.0, "{joint}");
            assert!(joint["torque_share"].as_f64().unwrap() < 0.97, "{joint}");
        }
    }
    assert!(std::fs::metadata(&page).unwrap().len() > 1000);
    // The recording contains the trajectory and all runs in sequence, even if the clock of the simulator runs ahead
    // of real time.
    let recording = Recording::read(std::path::Path::new(&record)).unwrap();
    let points: Vec<u32> = recording.samples.iter().filter(|s| s.is_operating()).map(|s| s.point).collect();
    assert_eq!(points.windows(2).filter(|pair| pair[1] < pair[0]).count(), 2, "{points:?}");
    let report = jtc(&["--json", "report", &record, "--out", &sim.path("all.html")]).ends(0).json();
    let executed: f64 = runs.iter().map(|run| run["executed_s"].as_f64().unwrap()).sum();
    assert!(report["executed_s"].as_f64().unwrap() > executed - 1e-6, "{report} {executed}");
    let again = sim.json(&["traj", "replay", &record, "--approach"], 0);
    assert_eq!(again["outcome"], "finished");
}

/// The user can plan the example with straight lines as its text describes, and execute the motion.
#[test]
fn the_example_of_lines_is_run() {
    let sim = ready();
    let dir = sim.dir.path().to_str().unwrap();
    let written = jtc(&["--json", "example", "lines", "-o", dir]).ends(0).json();
    let next =
        written["next"].as_str().unwrap().replace("lines.csv --", &format!("{} --", sim.path("lines.csv")));
    let words: Vec<&str> = next.split_whitespace().skip(1).collect();
    let planned = jtc(&[&["--json"], &words[..]].concat()).ends(0).json();
    assert_eq!((&planned["waypoints"], &planned["notes"]), (&8.into(), &Value::Array(vec![])), "{planned}");
    let value = sim.json(&["traj", "run", &sim.path("lines.csv")], 0);
    assert_eq!(value["outcome"], "finished");
    for joint in value["joints"].as_array().unwrap() {
        assert!(joint["max_error_mrad"].as_f64().unwrap() < 5.0, "{joint}");
    }
}

/// A path that does not end at its start point is repeated only with `--approach`.
#[test]
fn an_open_path_is_repeated_with_approaches() {
    let sim = ready();
    let file = sim.file("open.csv", "q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0\n0.4,0.1,-0.2,0,0.3,0\n");
    let out = sim.path("there.csv");
    jtc(&["plan", &file, "-o", &out]).ends(0);
    let refused = sim.jtc(&["traj", "run", &out, "--repeat", "2"]).ends(4);
    assert!(refused.err.contains("ends 0.400 rad from where it begins (joint 1)"), "{}", refused.err);
    at(&sim, [0.0; 6]);
    let value = sim.json(&["traj", "run", &out, "--repeat", "2", "--approach"], 0);
    let phases: Vec<&str> =
        value["runs"].as_array().unwrap().iter().map(|r| r["phase"].as_str().unwrap()).collect();
    assert_eq!(phases, ["motion", "approach", "motion"], "{value}");
    at(&sim, [0.4, 0.1, -0.2, 0.0, 0.3, 0.0]);
}

/// The test imports and simulates the robot description of a small arm with the proportions of a UR5. The arm then
/// moves through waypoints.
#[test]
fn another_arm_is_led_through_waypoints() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    std::fs::write(path("ur5.urdf"), ur5()).unwrap();
    jtc(&["arm", "import", &path("ur5.urdf"), "-o", &path("ur5.toml")]).ends(0);
    let (arm, urdf_waypoints) = (path("ur5.toml"), path("waypoints.csv"));
    let text = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n0,0,0,0,0,0\n30,-60,70,-20,40,10\n-20,-40,50,-60,10,50\n0,0,0,0,0,0\n";
    std::fs::write(&urdf_waypoints, text).unwrap();
    let out = path("cycle.csv");
    let planned = jtc(&["--json", "plan", &urdf_waypoints, "-o", &out, "--arm", &arm, "--blend", "0.05"])
        .ends(0)
        .json();
    assert!(planned["duration_s"].as_f64().unwrap() > 1.0, "{planned}");
    let sim = Sim::start_in(dir, &[&FAST[..], &["--arm", &arm]].concat()).held();
    let value = sim.json(&["traj", "run", &out, "--arm", &arm, "--repeat", "2"], 0);
    assert_eq!(
        (&value["outcome"], value["runs"].as_array().unwrap().len()),
        (&"finished".into(), 2),
        "{value}"
    );
    for joint in value["joints"].as_array().unwrap() {
        assert!(joint["max_error_mrad"].as_f64().unwrap() < 10.0, "{joint}");
    }
}

/// Returns a robot description with the origins, axes, masses and limits of a UR5. The links of the arm are rods.
fn ur5() -> String {
    let half = std::f64::consts::FRAC_PI_2;
    let joints = [
        ("shoulder_pan", "0 0 0.089159", 0.0, "0 0 1", 3.7, "0 0 0", 150.0),
        ("shoulder_lift", "0 0.13585 0", half, "0 1 0", 8.393, "0 0 0.28", 150.0),
        ("elbow", "0 -0.1197 0.425", 0.0, "0 1 0", 2.275, "0 0 0.25", 150.0),
        ("wrist_1", "0 0 0.39225", half, "0 1 0", 1.219, "0 0.0 0", 28.0),
        ("wrist_2", "0 0.093 0", 0.0, "0 0 1", 1.219, "0 0 0", 28.0),
        ("wrist_3", "0 0 0.09465", 0.0, "0 1 0", 0.1879, "0 0 0", 28.0),
    ];
    let mut text = String::from(
        "<robot name=\"ur5\"><link name=\"base\"><inertial><mass value=\"4\"/>\
        <inertia ixx=\"0.01\" ixy=\"0\" ixz=\"0\" iyy=\"0.01\" iyz=\"0\" izz=\"0.01\"/></inertial></link>",
    );
    let mut parent = "base".to_owned();
    for (name, xyz, pitch, axis, mass, com, effort) in joints {
        let inertia = 0.02 * mass;
        text += &format!(
            "<link name=\"{name}_link\"><inertial><origin xyz=\"{com}\"/><mass value=\"{mass}\"/><inertia ixx=\"{inertia}\" ixy=\"0\" \
             ixz=\"0\" iyy=\"{inertia}\" iyz=\"0\" izz=\"{inertia}\"/></inertial></link>\
             <joint name=\"{name}\" type=\"revolute\"><origin xyz=\"{xyz}\" rpy=\"0 {pitch} 0\"/><parent link=\"{parent}\"/>\
             <child link=\"{name}_link\"/><axis xyz=\"{axis}\"/><limit lower=\"-2.9\" upper=\"2.9\" effort=\"{effort}\" velocity=\"1.5\"/></joint>"
        );
        parent = format!("{name}_link");
    }
    text + "</robot>"
}

/// J-33: like a run, a move stops on its path, and the arm comes to rest.
#[test]
fn j33_a_move_is_stopped_on_its_path() {
    let sim = Sim::start(&["--no-throttle"]).held();
    let child = moving_while(&sim, &["move", "--to", "1.5,0,0,0,0,0", "--speed", "30"], 0.6);
    cli_kit::testing::signal(&child, "-INT");
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(5));
    let value: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(value["outcome"], "stopped");
    let status = sim.json(&["status"], 0);
    assert_eq!((&status["state"], &status["trajectory"]), (&"HoldPos".into(), &"Stop".into()));
    let here = place(&sim);
    assert!((0.02..1.4).contains(&here[0]), "{here:?}");
    // The move has no motion in joints 2 to 6, so these joints stay at rest.
    assert!(here[1..].iter().all(|q| q.abs() < 3e-3), "{here:?}");
}

/// J-55: if an arm file differs from the arm of the controller, the arm does not move. Without an arm file, the limits of the controller
/// apply.
#[test]
fn j55_a_move_for_another_arm_is_refused() {
    let sim = ready();
    let slower = include_str!("../../../arms/avena.toml").replacen(
        "velocity_max_rad_s = 1.5",
        "velocity_max_rad_s = 1.2",
        1,
    );
    let arm = sim.file("slower.toml", &slower);
    let words = ["move", "--to", "0.5,0,0,0,0,0", "--arm", &arm];
    let value = sim.json(&words, 4);
    assert_eq!(value["differences"].as_array().unwrap().len(), 1, "{value}");
    at(&sim, [0.0; 6]);
    sim.json(&[&words[..], &["--accept-device-limits"]].concat(), 0);
    at(&sim, [0.5, 0.0, 0.0, 0.0, 0.0, 0.0]);
}

/// A hand guides the arm. The command converts the motion to waypoints and plans it, or replays the motion as measured.
#[test]
fn a_motion_by_hand_is_waypoints_or_run_again() {
    let dir = tempfile::tempdir().unwrap();
    let recording = dir.path().join("sim.mcap").to_str().unwrap().to_owned();
    let mut sim = Sim::start_in(dir, &["--no-throttle", "--record", &recording]).held();
    let lead = sim.file("lead.csv", &lead());
    sim.write_line(&format!("hand {lead}"));
    let (taught, out) = (sim.path("taught.csv"), sim.path("out.csv"));
    let words = ["teach", "record", &taught, "--waypoints", "--tolerance", "0.02", "--duration", "5"];
    let value = sim.json(&words, 0);
    let count = value["waypoints"].as_u64().unwrap();
    assert!((3..12).contains(&count), "{value}");
    let planned = jtc(&["--json", "plan", &taught, "-o", &out, "--blend", "0.02"]).ends(0).json();
    assert_eq!(planned["waypoints"].as_u64(), Some(count));
    sim.jtc(&["traj", "run", &out, "--approach"]).ends(0);
    // The replayed motion is the motion of the hand, which moves joint 1 by 0.3 rad and back.
    let replay = ["traj", "replay", &recording, "--measured", "--approach"];
    let mut patience = Patience::begin();
    let output = loop {
        let output = sim.jtc(&[&["--json"], &replay[..]].concat());
        if output.code == 0 {
            break output;
        }
        patience.pause(format_args!("that it is run again: {}", output.err));
    };
    assert!(output.err.contains("the last teaching in the recording, as measured"), "{}", output.err);
    assert!(output.json()["verdict"]["joints"][0]["position_max_rad"].as_f64().unwrap() > 0.25);
    for wrong in ["0", "-1", "nan", "2"] {
        let refused = sim
            .jtc(&["teach", "record", &sim.path("no.csv"), "--waypoints", &format!("--tolerance={wrong}")])
            .ends(2);
        assert!(refused.err.contains("nothing was sent"), "{}", refused.err);
    }
}

/// Returns a motion of joint 1 in 3 s, forward and back. Gravity causes no torque at joint 1.
fn lead() -> String {
    let row = |i: i32| {
        let q = 0.15 - 0.15 * (std::f64::consts::TAU * f64::from(i) / 300.0).cos();
        format!("{:.2},{q},0,0,0,0,0\n", f64::from(i) * 0.01)
    };
    "t,q1,q2,q3,q4,q5,q6\n".to_owned() + &(0..=300).map(row).collect::<String>()
}
