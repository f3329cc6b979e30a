//! Tests of the hints for errors that new users make in trajectory files and options.

use crate::common;

use common::{Dir, jtc};

/// If a file contains degrees, has no header or is too fast, the error contains a hint. The user can follow each hint
/// with success.
#[test]
fn mistakes_in_a_trajectory_are_named_with_what_helps() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("motion.csv");
    let file = path.to_str().unwrap();
    let rows = |scale: f64, step_s: f64| {
        let rows = (0..=600).map(|i| {
            let q = scale * (std::f64::consts::PI * f64::from(i) / 600.0).sin().powi(2);
            format!("{},{q},{},0,0,0,0\n", f64::from(i) * step_s, 0.5 * q)
        });
        rows.collect::<String>()
    };
    let header = "t,q1,q2,q3,q4,q5,q6\n";

    std::fs::write(&path, header.to_owned() + &rows(45.0, 0.01)).unwrap();
    let output = jtc(&["traj", "check", file]).ends(4);
    assert!(
        output.out.contains("look like degrees: joint 1 is at 45.0") && output.out.contains("--deg"),
        "{}",
        output.out
    );
    assert!(output.out.lines().count() < 30, "{}", output.out);
    assert_eq!(jtc(&["--json", "traj", "check", file]).ends(4).json()["suspicion"], "degrees");
    let output = jtc(&["--json", "traj", "check", file, "--deg"]).ends(0).json();
    let top = output["verdict"]["joints"][0]["position_max_rad"].as_f64().unwrap();
    assert!((top - 45f64.to_radians()).abs() < 1e-3, "{top}");
    // If the header states the unit, the option `--deg` is refused.
    std::fs::write(&path, header.replace("q1,", "q1_deg,") + &rows(45.0, 0.01)).unwrap();
    let output = jtc(&["traj", "info", file, "--deg"]).ends(2);
    assert!(output.err.contains("the file states its units"), "{}", output.err);

    std::fs::write(&path, rows(0.7, 0.01)).unwrap();
    let output = jtc(&["traj", "check", file]).ends(2);
    assert!(
        output.err.contains("header is missing: write the line t,q1,q2,q3,q4,q5,q6 before"),
        "{}",
        output.err
    );

    std::fs::write(&path, header.to_owned() + &rows(0.7, 0.002)).unwrap();
    let output = jtc(&["--json", "traj", "check", file]).ends(4).json();
    assert_eq!(output["suspicion"], "too_fast");
    let percent = output["passing_speed_percent"].as_f64().unwrap();
    let hint = output["hint"].as_str().unwrap();
    assert!(hint.contains(&format!("--speed {percent}`")), "{hint}");
    jtc(&["traj", "check", file, "--speed", &percent.to_string()]).ends(0);
    jtc(&["traj", "check", file, "--speed", &(percent + 5.0).to_string()]).ends(4);

    // The waypoints are too far apart for their times. The error must report this cause, and must not report a gap between two parts
    // of the path.
    let waypoints = "0,0,0,0,0,0,0\n1,0.1,0,0,0,0,0\n2,0.2,0,0,0,0,0\n3,0.3,0,0,0,0,0\n3.4,1.5,0,0,0,0,0\n4.4,1.6,0,0,0,0,0\n\
                     5.4,1.7,0,0,0,0,0\n6.4,1.8,0,0,0,0,0\n";
    std::fs::write(&path, header.to_owned() + waypoints).unwrap();
    let output = jtc(&["--json", "traj", "check", file]).ends(4).json();
    assert_eq!(output["suspicion"], "too_fast", "{output}");
    assert!(output["overshoot"][0]["beyond_rad"].as_f64().unwrap() > 0.05, "{output}");
    let output = jtc(&["traj", "info", file]).ends(0);
    assert!(output.err.contains("the curve exceeds them: joint 1 by"), "{}", output.err);
}

/// The command interprets option values as the user expects, and errors name the options of the command.
#[test]
fn mistakes_in_options_are_named_with_what_helps() {
    let dir = Dir::new();
    let waypoints = dir.file("w.csv", "q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0\n0.4,0,0,0,0,0\n");
    let degrees =
        dir.file("deg.csv", "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n0,0,0,0,0,0\n9,0,0,0,0,0\n");
    std::fs::write(dir.path("bytes.csv"), [0x71, 0xff, 0xfe, 0x0a]).unwrap();
    let (bytes, out) = (dir.path("bytes.csv"), dir.path("out.csv"));
    for (words, code, message) in [
        (&["move"][..], 2, "--to-flange <"),
        (&["move", "--to", ""], 2, "neither six numbers nor the name of a pose"),
        (
            &["move", "--to", "0,0,0,0,0,0", "--speed", "-5"],
            2,
            "speed -5 % is out of range, expected 1..100 %",
        ),
        (
            &["plan", &waypoints, "-o", &out, "--speed", "-5"],
            2,
            "speed -5 % is out of range, expected 1..100 %",
        ),
        (&["plan", &bytes, "-o", &out], 2, "not a text file (its bytes are not valid UTF-8)"),
        (&["plan", &degrees, "-o", &out, "--deg"], 2, "omit --deg"),
        (&["traj", "speed", "-3"], 2, "speed override -3 % is out of range (5 to 100 %)"),
        (&["traj", "check", &waypoints, "--speed", "300"], 2, "column t (time in s) is missing"),
        (&["traj", "continue", "none.mcap"], 2, "check the name"),
        (&["traj", "continue", &waypoints], 2, "jtc traj run FILE --record"),
    ] {
        let output = jtc(words).ends(code);
        assert!(output.err.contains(message), "{words:?}: {}", output.err);
    }
    assert!(!dir.has("out.csv"));
}
