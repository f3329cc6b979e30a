//! Tests of arm files and robot descriptions, including files that the command rejects.

use crate::common;

use cli_kit::testing::CommandOutput;
use common::{Dir, Sim, jtc, motion};

/// Writes an arm file whose first two joints have lower speed limits than the controller.
fn slower(dir: &std::path::Path) -> String {
    let arm = include_str!("../../../arms/avena.toml").replacen(
        "velocity_max_rad_s = 1.5",
        "velocity_max_rad_s = 1.2",
        2,
    );
    let path = dir.join("slower.toml");
    std::fs::write(&path, arm).unwrap();
    path.to_str().unwrap().to_owned()
}

/// J-55: the command lists the parameters of an arm file that the controller does not use, and rejects them before it
/// sends any frame.
#[test]
fn j55_an_arm_with_other_limits_is_refused_with_each_value() {
    let dir = tempfile::tempdir().unwrap();
    let (arm, motion_file) = (slower(dir.path()), dir.path().join("motion.csv"));
    std::fs::write(&motion_file, motion(0.3)).unwrap();
    let file = motion_file.to_str().unwrap();
    // The command first requests the data of the controller. If the controller does not answer, the command reports an error of
    // the link.
    let port = ["--port", "/nowhere/tty"];
    jtc(&["params", "push", &arm, port[0], port[1]]).ends(3);
    let sim = Sim::start(&["--no-throttle"]).held();
    for words in [
        vec!["params", "push", &arm],
        vec!["traj", "run", file, "--arm", &arm],
        vec!["recover", "--arm", &arm],
    ] {
        let output = sim.jtc(&[&["--json"], &words[..]].concat()).ends(4);
        let value = output.json();
        let differences = value["differences"].as_array().unwrap();
        assert_eq!(differences.len(), 2, "{words:?}: {value}");
        assert_eq!(differences[1]["joint"], 2);
        assert_eq!(
            (differences[1]["file"].as_f64(), differences[1]["device"].as_f64()),
            (Some(1.2), Some(1.5))
        );
        assert!(
            output.err.contains("joint 2, velocity_max_rad_s: 1.2 rad/s in the file, 1.5 rad/s"),
            "{}",
            output.err
        );
        sim.jtc(&[&words[..], &["--accept-device-limits"]].concat()).ends(0);
    }
}

/// J-55: without an arm file, a trajectory is checked with the arm of the controller, not with the built-in arm.
#[test]
fn j55_a_run_without_an_arm_file_is_checked_with_the_arm_of_the_controller() {
    let dir = Dir::new();
    let text = include_str!("../../../arms/avena.toml");
    let wide = dir.file("wide.toml", &text.replacen("position_max_rad = 2.97", "position_max_rad = 2.99", 1));
    // Joint 1 moves to 2.98 rad and back. The limit of the built-in arm is 2.97 rad, and the limit in `wide` is 2.99
    // rad. The motion must therefore pass only with the arm `wide`.
    let mut motion = String::from("t,q1,q2,q3,q4,q5,q6\n");
    for i in 0..=500 {
        let s = f64::from(i) / 500.0;
        motion += &format!("{:.3},{},0,0,0,0,0\n", 10.0 * s, 2.98 * (std::f64::consts::PI * s).sin().powi(4));
    }
    let file = dir.file("motion.csv", &motion);
    let refused = |output: CommandOutput| {
        let value = output.ends(4).json();
        let problems = value["verdict"]["problems"].as_array().unwrap().clone();
        assert!(problems.iter().all(|problem| problem["kind"] == "position"), "{value}");
    };

    // The motion is refused if no controller can be reached, or if the controller has the built-in arm.
    refused(jtc(&["--json", "traj", "run", &file, "--port", "/nowhere/tty"]));
    refused(Sim::start(&["--no-throttle"]).held().jtc(&["--json", "traj", "run", &file]));
    let sim = Sim::start(&["--no-throttle", "--arm", &wide]).held();
    let output = sim.jtc(&["traj", "run", &file]).ends(0);
    assert!(output.err.contains("checked with the arm of the controller"), "{}", output.err);
    // An arm file that the user has specified is checked before the command connects to the controller.
    let narrow = concat!(env!("CARGO_MANIFEST_DIR"), "/../../arms/avena.toml");
    refused(jtc(&["--json", "traj", "run", &file, "--arm", narrow, "--port", "/nowhere/tty"]));
}

/// Parameters that a URDF cannot contain are unknown, not zero. The command does not list unknown parameters as differences from the
/// controller. A check reports that it does not use the unknown parameters.
#[test]
fn j55_what_a_urdf_cannot_say_is_not_given() {
    let dir = tempfile::tempdir().unwrap();
    let (urdf, motion_file) = (dir.path().join("arm.urdf"), dir.path().join("motion.csv"));
    let arm = jtc_host::Arm::avena();
    std::fs::write(&urdf, arm.to_urdf()).unwrap();
    std::fs::write(&motion_file, motion(0.3)).unwrap();
    let (urdf, file) = (urdf.to_str().unwrap(), motion_file.to_str().unwrap());
    // The limits are equal to the limits of the controller. Therefore the command continues and opens the port, which
    // does not exist.
    let output = jtc(&["params", "push", urdf, "--port", "/nowhere/tty"]).ends(3);
    assert!(!output.err.contains("rotor_inertia"), "{}", output.err);

    let output = jtc(&["traj", "check", file, "--arm", urdf]).ends(0);
    let line = output.out.lines().find(|line| line.contains("friction and rotor inertia")).expect("named");
    assert!(line.contains("arms/avena.toml") && line.contains("--arm"), "{line}");
    let left_out =
        |arm: &str| jtc(&["--json", "traj", "check", file, "--arm", arm]).ends(0).json()["left_out"].clone();
    assert_eq!(left_out(urdf), serde_json::json!(["friction", "rotor inertia"]));
    let whole = concat!(env!("CARGO_MANIFEST_DIR"), "/../../arms/avena.toml");
    assert_eq!(left_out(whole), serde_json::json!([]));
    // A run uses the rotor values of the controller, so only the friction is missing.
    let sim = Sim::start(&["--no-throttle"]).held();
    let output = sim.jtc(&["traj", "run", file, "--arm", urdf]).ends(0);
    assert!(output.err.contains("without friction: the file"), "{}", output.err);
}

/// J-55: a URDF does not contain friction and gains. The command does not replace the missing values by the values of
/// another arm.
#[test]
fn j55_recover_refuses_an_arm_that_is_not_whole() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("arm.toml");
    let text: String = include_str!("../../../arms/avena.toml")
        .lines()
        .filter(|line| !line.starts_with("pid ="))
        .map(|line| format!("{line}\n"))
        .collect();
    std::fs::write(&path, text).unwrap();
    let output = jtc(&["recover", "--arm", path.to_str().unwrap(), "--port", "/nowhere/tty"]).ends(4);
    assert!(output.err.contains("PID gains missing") && output.err.contains("avena.toml"), "{}", output.err);
    jtc(&["recover", "--arm", path.to_str().unwrap(), "--defaults", "--port", "/nowhere/tty"]).ends(2);
}

/// `jtc arm import` converts a robot description with a gripper to a usable arm file.
#[test]
fn an_arm_file_is_made_from_a_robot_description() {
    let dir = tempfile::tempdir().unwrap();
    let (urdf, toml) = (dir.path().join("z1.urdf"), dir.path().join("z1.toml"));
    let gripper = "<link name=\"finger\"/><joint name=\"grip\" type=\"revolute\"><parent link=\"flange\"/>\
                   <child link=\"finger\"/><axis xyz=\"0 0 1\"/></joint></robot>";
    let arm = jtc_host::arm::Arm::avena();
    std::fs::write(&urdf, arm.to_urdf().replace("</robot>", gripper)).unwrap();
    let (urdf, toml) = (urdf.to_str().unwrap(), toml.to_str().unwrap());

    let output = jtc(&["params", "show", urdf]).ends(2);
    let joints = arm.joint_names.join(",");
    assert!(
        output.err.contains(&format!("jtc arm import {urdf} --joints {joints} -o arm.toml")),
        "{}",
        output.err
    );
    jtc(&["arm", "import", urdf, "-o", toml]).ends(2);
    assert!(!std::path::Path::new(toml).exists());

    let output = jtc(&["--json", "arm", "import", urdf, "--joints", &joints, "-o", toml]).ends(0);
    assert_eq!(output.json()["missing"], serde_json::json!([]));
    assert_eq!(output.json()["warnings"][0]["place"], "joint grip");
    assert_eq!(output.json()["warnings"][0]["change"], "left_out");
    let proposed = output.json()["proposed"].clone();
    let of = |name: &str| proposed.as_array().unwrap().iter().filter(|v| v["name"] == name).count();
    assert_eq!((of("pid.kp"), of("rotor_inertia_kg_m2"), of("torque_max_nm")), (6, 6, 0), "{proposed}");
    let read = jtc_host::arm::Arm::load(std::path::Path::new(toml)).unwrap();
    assert_eq!((read.model, read.joint_names), (arm.model, arm.joint_names));
    jtc(&["arm", "import", urdf, "--joints", &joints, "-o", toml]).ends(4);
    let output = jtc(&["arm", "import", toml, "-o", urdf]).ends(2);
    assert!(output.err.contains("is not a robot description"), "{}", output.err);

    // The text output of the import also shows the changes and proposals. The arm file passes its check with warnings.
    let output = jtc(&["arm", "import", urdf, "--joints", &joints, "-o", toml, "--overwrite"]).ends(0);
    for words in [
        "left out: ",
        "joint grip: revolute: is held at 0",
        "proposed: starting values that a URDF does not contain",
        "pid.kp",
        "next: jtc arm check",
    ] {
        assert!(output.out.contains(words), "{words}: {}", output.out);
    }
    let output = jtc(&["--json", "arm", "check", toml]).ends(0);
    let value = output.json();
    assert_eq!((value["ok"].as_bool(), value["holding"].as_array().map(Vec::len)), (Some(true), Some(6)));
    let codes: Vec<&str> =
        value["findings"].as_array().unwrap().iter().filter_map(|f| f["code"].as_str()).collect();
    assert!(codes.contains(&"proposed") && codes.contains(&"holding"), "{codes:?}");
}

/// J-06, J-35: the check and the controller reject the same values. The check reports the joint, value, limit and next step.
#[test]
fn j06_j35_a_file_that_no_controller_takes_is_refused_with_each_finding() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("arm.toml");
    let text = include_str!("../../../arms/avena.toml")
        .replacen("velocity_max_rad_s = 1.5", "velocity_max_rad_s = 1.6", 1)
        .replacen("mass_kg = 7.5", "mass_kg = -7.5", 1)
        .replacen("torque_max_nm = 180.0", "torque_max_nm = -180.0", 1);
    std::fs::write(&path, text).unwrap();
    let path = path.to_str().unwrap();
    let output = jtc(&["--json", "arm", "check", path]).ends(4);
    let value = output.json();
    let problems: Vec<_> =
        value["findings"].as_array().unwrap().iter().filter(|f| f["severity"] == "problem").collect();
    assert_eq!((value["ok"].as_bool(), problems.len()), (Some(false), 3), "{value}");
    let speed = problems.iter().find(|f| f["name"] == "velocity_max_rad_s").unwrap();
    assert_eq!((speed["joint"].as_u64(), speed["limit"].as_f64()), (Some(1), Some(1.8)));
    assert!(problems.iter().all(|f| f["next"].as_str().is_some_and(|next| !next.is_empty())), "{value}");
    let output = jtc(&["arm", "check", path]).ends(4);
    assert!(
        output.out.contains("✗ joint 2, torque_max_nm: -180") && output.out.contains("refused: "),
        "{}",
        output.out
    );
    // The exit code is 2 if the file does not exist or is not an arm file.
    jtc(&["arm", "check", "nowhere.toml"]).ends(2);
    jtc(&["arm", "check", "Cargo.toml"]).ends(2);
}

#[test]
fn an_arm_is_shown_with_units_ranges_and_sources() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("arm.toml");
    let text = include_str!("../../../arms/avena.toml")
        .replacen("velocity_max_rad_s = 1.5\n", "", 1)
        .replacen("torque_max_nm = 180.0\n", "torque_max_nm = 180.0\nproposed = [\"torque_max_nm\"]\n", 1);
    std::fs::write(&path, text).unwrap();
    let path = path.to_str().unwrap();
    let output = jtc(&["arm", "show", path]).ends(0);
    let row = |name: &str| output.out.lines().find(|l| l.starts_with(name)).expect("a row").to_owned();
    let torque = row("torque_max_nm");
    for word in ["80 ", "180*", "N·m", "0.01..360", "file, proposed"] {
        assert!(torque.contains(word), "{word}: {torque}");
    }
    assert!(row("velocity_max_rad_s").contains("1.5d") && row("position_min_rad").contains("±2.9905"));
    assert!(output.out.contains("0.8437") && output.out.contains("* proposed"));
    let deg = jtc(&["arm", "show", path, "--deg"]).ends(0);
    assert!(deg.out.contains("±171.34") && deg.out.contains("roll °"), "{}", deg.out);
    let value = jtc(&["--json", "arm", "show", path, "--deg"]).ends(0).json();
    let values = value["values"].as_array().unwrap();
    let one =
        |name: &str, joint: u64| values.iter().find(|v| v["name"] == name && v["joint"] == joint).unwrap();
    let speed = one("velocity_max_rad_s", 1);
    assert_eq!((speed["unit"].as_str(), speed["from"].as_str()), (Some("°/s"), Some("default")));
    assert!((speed["value"].as_f64().unwrap() - 85.943_669).abs() < 1e-5);
    assert_eq!(one("torque_max_nm", 2)["from"], "proposed");
    assert_eq!(one("pid.kp", 2)["value"].as_f64(), Some(8000.0));
}

/// J-71: the check rejects unstable gains, and no command sends unstable gains to a controller.
#[test]
fn j71_gains_that_are_not_stable_are_refused_by_each_command() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("arm.toml");
    let good = include_str!("../../../arms/avena.toml");
    std::fs::write(&path, good.replacen("kd = 80.0", "kd = 350.0", 1)).unwrap();
    let path = path.to_str().unwrap();
    let output = jtc(&["arm", "check", path]).ends(4);
    assert!(output.out.contains("✗ joint 1") && output.out.contains("Kd 350"), "{}", output.out);
    assert!(!output.out.contains("a controller accepts this arm"), "{}", output.out);
    let value = jtc(&["--json", "arm", "check", path]).ends(4).json();
    assert_eq!((value["ok"].as_bool(), &value["rotor_margins"]), (Some(false), &serde_json::Value::Null));
    let whole = concat!(env!("CARGO_MANIFEST_DIR"), "/../../arms/avena.toml");
    let value = jtc(&["--json", "arm", "check", whole]).ends(0).json();
    assert!(value["rotor_margins"]["all"]["down"].as_f64().is_some_and(|down| down < 0.5), "{value}");
    assert_eq!(value["rotor_margins"]["joints"].as_array().map(Vec::len), Some(6));

    let sim = Sim::start(&["--no-throttle"]);
    for words in [
        vec!["arm", "push", path],
        vec!["arm", "push", path, "--store"],
        vec!["params", "push", path],
        vec!["recover", "--arm", path],
    ] {
        let output = sim.jtc(&words).ends(4);
        for part in ["joint 1", "Kd 350", "nothing was sent", "jtc arm check FILE"] {
            assert!(output.err.contains(part), "{words:?}, {part}: {}", output.err);
        }
    }
    sim.jtc(&["arm", "push", whole]).ends(0);
}

/// The import rejects a robot description in degrees, and writes no file. If the header of a file contains degrees as unit, the
/// command converts the values only once.
#[test]
fn degrees_are_neither_taken_for_radians_nor_turned_twice() {
    let dir = tempfile::tempdir().unwrap();
    let file = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let (urdf, toml) = (file("arm.urdf"), file("arm.toml"));
    let text = jtc_host::Arm::avena().to_urdf();
    let limits = |upper: &str| {
        let (before, after) = text.split_once("upper=\"").unwrap();
        let (_, after) = after.split_once('"').unwrap();
        format!("{before}upper=\"{upper}\"{after}")
    };
    std::fs::write(&urdf, limits("150")).unwrap();
    let output = jtc(&["arm", "import", &urdf, "-o", &toml]).ends(2);
    assert!(output.err.contains("150° are 2.618 rad"), "{}", output.err);
    assert!(!std::path::Path::new(&toml).exists());
    std::fs::write(&urdf, limits("2.5")).unwrap();
    jtc(&["arm", "import", &urdf, "-o", &toml]).ends(0);

    let (waypoints, motion) = (file("w.csv"), file("o.csv"));
    std::fs::write(&waypoints, "Q1_DEG,Q2_DEG,Q3_DEG,Q4_DEG,Q5_DEG,Q6_DEG\n0,0,0,0,0,0\n60,20,-30,0,20,0\n")
        .unwrap();
    let output = jtc(&["plan", &waypoints, "-o", &motion, "--deg"]).ends(2);
    assert!(output.err.contains("omit --deg"), "{}", output.err);
    assert!(!std::path::Path::new(&motion).exists());
    jtc(&["plan", &waypoints, "-o", &motion]).ends(0);
    let last = std::fs::read_to_string(&motion).unwrap();
    let cells: Vec<f64> = last.lines().last().unwrap().split(',').map(|cell| cell.parse().unwrap()).collect();
    assert!((cells[1] - 60f64.to_radians()).abs() < 1e-3, "{cells:?}");
}

/// A name in a file may contain escape sequences of a terminal. The commands print them as codes, also in errors.
#[test]
fn escape_sequences_of_a_file_are_printed_as_codes() {
    let dir = Dir::new();
    let arm = include_str!("../../../arms/avena.toml");
    let name = arm.lines().find(|line| line.starts_with("name = ")).unwrap();
    let arm = arm.replacen(name, "name = \"a\\u001B]0;t\\u0007\\u009B1m\\u202Eb\"", 1);
    let header = "t,q1,q2,q3,q4,q5,q6,\u{1b}[31mq7\r\n0,0,0,0,0,0,0,0\n";
    let (arm, motion) = (dir.file("arm.toml", &arm), dir.file("motion.csv", header));
    for words in [
        &["arm", "show", &arm][..],
        &["arm", "check", &arm],
        &["--json", "arm", "show", &arm],
        &["traj", "check", &motion],
        &["--json", "traj", "check", &motion],
    ] {
        let output = jtc(words);
        let hidden = |c: char| host_kit::is_hidden(c) && c != '\n';
        assert!(
            !output.out.contains(hidden) && !output.err.contains(hidden),
            "{words:?}: {}{}",
            output.out,
            output.err
        );
    }
    let shown = jtc(&["arm", "show", &arm]).ends(0).out;
    assert!(shown.contains(r"a\u001b]0;t\u0007\u009b1m\u202eb"), "{shown}");
}
