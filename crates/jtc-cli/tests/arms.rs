//! Arm files and robot descriptions without a port: what they give, and what is refused of them.

mod common;

use common::{jtc, motion};

/// An arm file whose first two joints may not turn as fast as the controller lets them.
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

/// J-55: what the controller does not use of an arm file is listed and refused before a port is opened.
#[test]
fn j55_an_arm_with_other_limits_is_refused_with_each_value() {
    let dir = tempfile::tempdir().unwrap();
    let (arm, motion_file) = (slower(dir.path()), dir.path().join("motion.csv"));
    std::fs::write(&motion_file, motion(0.3)).unwrap();
    let file = motion_file.to_str().unwrap();
    let port = ["--port", "/nowhere/tty"];
    for words in [
        vec!["params", "push", &arm],
        vec!["traj", "run", file, "--arm", &arm],
        vec!["recover", "--arm", &arm],
    ] {
        let output = jtc(&[&["--json"], &words[..], &port].concat()).ends(4);
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
        // Accepted, it fails only at the port that is not there.
        jtc(&[&words[..], &port, &["--accept-device-limits"]].concat()).ends(3);
    }
}

/// What a URDF cannot give is not zero: no difference to the controller, and a check that leaves it out reports it.
#[test]
fn j55_what_a_urdf_cannot_say_is_not_given() {
    let dir = tempfile::tempdir().unwrap();
    let (urdf, motion_file) = (dir.path().join("arm.urdf"), dir.path().join("motion.csv"));
    let arm = jtc_host::Arm::avena();
    std::fs::write(&urdf, arm.to_urdf()).unwrap();
    std::fs::write(&motion_file, motion(0.3)).unwrap();
    let (urdf, file) = (urdf.to_str().unwrap(), motion_file.to_str().unwrap());
    // Its limits are the controller's own: it goes on to the port, which is not there.
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
    // A run counts the rotors that the controller computes with.
    let output = jtc(&["traj", "run", file, "--arm", urdf, "--port", "/nowhere/tty"]).ends(3);
    assert!(output.err.contains("without friction, which"), "{}", output.err);
}

/// J-55: a URDF has neither friction nor gains, and those of another arm are not filled in.
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

/// From a description with a gripper on it to an arm file that can be used.
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
    assert_eq!(output.json()["missing"], serde_json::json!(["friction", "PID gains"]));
    assert_eq!(output.json()["warnings"][0]["place"], "joint grip");
    let read = jtc_host::arm::Arm::load(std::path::Path::new(toml)).unwrap();
    assert_eq!((read.model, read.joint_names), (arm.model, arm.joint_names));
    jtc(&["arm", "import", urdf, "--joints", &joints, "-o", toml]).ends(4);
    let output = jtc(&["arm", "import", toml, "-o", urdf]).ends(2);
    assert!(output.err.contains("is no robot description"), "{}", output.err);
}
