//! Tests of `jtc plan`: trajectories through waypoints, and plans that the command rejects.

use crate::common;

use common::{Dir, jtc};
use serde_json::Value;

const WAYPOINTS: &str =
    "q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0\n0.5,0.2,-0.4,0.3,0.6,0\n0.1,0.4,-0.9,0,0.6,0.5\n0,0,0,0,0,0\n";

fn json(words: &[&str], code: i32) -> Value {
    jtc(&[&["--json", "plan"], words].concat()).ends(code).json()
}

/// Returns the time and the positions in each line of a trajectory file.
fn rows(file: &str) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(file).unwrap();
    let mut lines = text.lines();
    assert_eq!(
        lines.next(),
        Some("t,q1,q2,q3,q4,q5,q6,qd1,qd2,qd3,qd4,qd5,qd6,qdd1,qdd2,qdd3,qdd4,qdd5,qdd6")
    );
    lines
        .map(|line| {
            // Values have 17 significant digits, one before the decimal point and 16 after it.
            for cell in line.split(',').skip(1) {
                let digits = cell.trim_start_matches('-').split_once('e').expect("an exponent").0;
                assert_eq!(digits.len(), 18, "{cell}");
            }
            line.split(',').map(|cell| cell.parse().unwrap()).collect()
        })
        .collect()
}

/// With `--deg`, the positions and the blend are in degrees. The command reports each waypoint that the path does not pass because
/// its corner is rounded.
#[test]
fn a_blend_is_in_the_unit_of_the_positions() {
    let dir = Dir::new();
    let header = "q1,q2,q3,q4,q5,q6\n";
    let in_rad = dir.file("rad.csv", &format!("{header}0,0,0,0,0,0\n1,0,0,0,0,0\n1,1,0,0,0,0\n"));
    let degrees = 1f64.to_degrees();
    let in_degrees = format!("{header}0,0,0,0,0,0\n{degrees},0,0,0,0,0\n{degrees},{degrees},0,0,0,0\n");
    let in_degrees = dir.file("degrees.csv", &in_degrees);
    let (out, other) = (dir.path("out.csv"), dir.path("other.csv"));
    for blend in [0.0f64, 0.02, 0.1, 0.3, 0.5] {
        let (rad, deg) = (blend.to_string(), blend.to_degrees().to_string());
        let a = json(&[&in_rad, "-o", &out, "--force", "--blend", &rad], 0);
        let b = json(&[&in_degrees, "-o", &other, "--force", "--deg", "--blend", &deg], 0);
        assert_eq!(a["points"], b["points"], "{blend}");
        for (a, b) in rows(&out).iter().flatten().zip(rows(&other).iter().flatten()) {
            assert!((a - b).abs() < 1e-6, "{blend}: {a}, {b}");
        }
        let missed = a["notes"].to_string().contains("rounded corners: waypoint 2 is missed by 0.");
        assert_eq!(missed, blend >= 0.3, "{blend}: {}", a["notes"]);
    }
}

/// `plan` leaves the requested torque margin and prints it. `plan` and `traj check` print a warning if the margin is below 10 %. The
/// command rejects a margin that is out of range, and the error contains the range.
#[test]
fn a_plan_leaves_the_margin_that_is_asked_for() {
    let dir = Dir::new();
    let swing =
        "q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0\n1.2,0.4,-0.9,0.8,0.6,1\n-1.2,-0.5,0.9,-0.8,-0.6,-1\n0,0,0,0,0,0\n";
    let waypoints = dir.file("waypoints.csv", swing);
    let out = dir.path("out.csv");
    let plan = |words: &[&str]| {
        let output =
            jtc(&[&["--json", "plan", &waypoints, "-o", &out, "--overwrite"], words].concat()).ends(0);
        let checked = jtc(&["--json", "traj", "check", &out]).ends(0);
        let (plan, check) = (output.json(), checked.json());
        assert_eq!(plan["margin"], check["verdict"]["margin"], "{words:?}");
        let left = plan["margin"]["percent"].as_f64().unwrap();
        for err in [&output.err, &checked.err] {
            assert_eq!(err.contains("warning") && err.contains("torque margin"), left < 10.0, "{err}");
        }
        (left, plan["duration_s"].as_f64().unwrap())
    };
    let (default, of_default) = plan(&[]);
    let (none, _) = plan(&["--margin", "0"]);
    assert!(default >= 15.0 && none < 10.0, "{default} % {none} %");
    assert_eq!((default, of_default), plan(&["--margin", "15"]));
    assert_eq!((default, of_default), plan(&["--torque-margin", "15"]));
    let (wide, of_wide) = plan(&["--margin", "30"]);
    assert!(wide >= 30.0 && of_wide > of_default, "{wide} %");
    let text = jtc(&["traj", "check", &out]).ends(0).out;
    assert!(text.contains("\ntorque margin 3") && text.contains("N·m with bearings at"), "{text}");
    for wrong in ["NaN", "-1", "50.1", "100", "1e9", "inf", "x", "", "15%"] {
        for words in [
            &["plan", &waypoints, "-o", &out, "--overwrite", "--margin", wrong][..],
            &["move", "--to", "0,0,0,0,0,0", "--margin", wrong],
        ] {
            let error = jtc(words).ends(2).err;
            assert!(error.contains(&format!("'{wrong}' for '--margin <PERCENT>'")), "{error}");
            assert!(error.contains("0 to 50") && error.contains("by default 15"), "{error}");
        }
    }
}

/// The trajectory passes the check of a run, and the arm is at rest at both ends of the trajectory. The distance of the trajectory from
/// the waypoints is at most the blend distance. Without a jerk limit, or with a blend, the motion is faster. The printed values match
/// the file.
#[test]
fn a_plan_leads_through_its_waypoints_and_passes_the_check() {
    let dir = Dir::new();
    let waypoints = dir.file("waypoints.csv", WAYPOINTS);
    let mut durations = Vec::new();
    for (name, options, blend) in [
        ("stops.csv", vec![], 1e-3),
        ("jumps.csv", vec!["--no-jerk-limit"], 1e-3),
        ("blended.csv", vec!["--blend", "0.1"], 0.1 + 1e-3),
        ("half.csv", vec!["--blend", "0.1", "--speed", "50"], 0.1 + 1e-3),
    ] {
        let out = dir.path(name);
        let value = json(&[&[&waypoints, "-o", &out], &options[..]].concat(), 0);
        let rows = rows(&out);
        let duration = value["duration_s"].as_f64().unwrap();
        assert_eq!(value["points"].as_u64().unwrap() as usize, rows.len());
        assert!((rows.last().unwrap()[0] - duration).abs() < 1e-9);
        let last_end = value["binding"].as_array().unwrap().iter().fold(0.0, |before: f64, bound| {
            let (from, to) = (bound["from_s"].as_f64().unwrap(), bound["to_s"].as_f64().unwrap());
            assert!(from <= to && to <= duration + 1e-9 && from >= before - 1e-9, "{bound}");
            assert!(
                (1..=6).contains(&bound["joint"].as_u64().unwrap()) && bound["limit"].is_string(),
                "{bound}"
            );
            from
        });
        assert!(last_end < duration && value["binding"][0].is_object(), "nothing binds: {value}");
        let check = jtc(&["--json", "traj", "check", &out]).ends(0).json();
        assert_eq!(check["verdict"]["problems"].as_array().unwrap().len(), 0, "{name}: {check}");
        for line in WAYPOINTS.lines().skip(1) {
            let q: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
            let away = |row: &Vec<f64>| (0..6).map(|j| (row[1 + j] - q[j]).abs()).fold(0.0, f64::max);
            let nearest = rows.iter().map(away).fold(f64::INFINITY, f64::min);
            // At 1.5 rad/s and 10 ms per point, the nearest point is at most 7.5 mrad away from the waypoint.
            assert!(nearest <= blend + 8e-3, "{name}: {nearest} rad from {line}");
        }
        for end in [&rows[0], rows.last().unwrap()] {
            assert!(end[1..13].iter().all(|v| v.abs() < 1e-9), "{name}: {end:?}");
        }
        durations.push(duration);
    }
    let [stops, jumps, blended, half] = durations[..] else { panic!("four") };
    assert!(jumps < stops && blended < stops && half > 1.5 * blended, "{durations:?}");
}

/// Waypoints in other units, as poses, and in JSON result in identical motions.
#[test]
fn the_forms_of_waypoints_are_the_same_motion() {
    let dir = Dir::new();
    let arm = include_str!("../../../arms/avena.toml").to_owned()
        + "\n[poses]\nhome = [0, 0, 0, 0, 0, 0]\nup = [0.1, 0.2, -0.4, 0.3, 0.6, 0.0]\n";
    let arm = dir.file("arm.toml", &arm);
    let degrees = [0.1f64, 0.2, -0.4, 0.3, 0.6, 0.0].map(|q| q.to_degrees().to_string()).join(",");
    let mut durations = Vec::new();
    for (name, text, deg) in [
        ("a.csv", "q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0\n0.1,0.2,-0.4,0.3,0.6,0\n".to_owned(), false),
        ("b.csv", "pose\nhome\nup\n".to_owned(), false),
        ("c.csv", format!("q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0\n{degrees}\n"), true),
        (
            "d.json",
            r#"[{"pose": "home"}, {"q1": 0.1, "q2": 0.2, "q3": -0.4, "q4": 0.3, "q5": 0.6, "q6": 0}]"#.into(),
            false,
        ),
    ] {
        let (file, out) = (dir.file(name, &text), dir.path(&format!("{name}.out.csv")));
        let deg: &[&str] = if deg { &["--deg"] } else { &[] };
        let value = json(&[&[&file, "-o", &out, "--arm", &arm], deg].concat(), 0);
        durations.push(value["duration_s"].as_f64().unwrap());
    }
    assert!(durations.iter().all(|d| (d - durations[0]).abs() < 1e-9), "{durations:?}");
}

/// The motion keeps the times in the file exactly to the millisecond. If the file contains no times, the motion is as fast as possible.
#[test]
fn given_times_are_kept() {
    let dir = Dir::new();
    let text = "t,q1,q2,q3,q4,q5,q6\n1,0,0,0,0,0,0\n3.5,0.4,0.1,-0.2,0,0.3,0\n,0.2,0.3,-0.5,0,0.3,0\n8,0,0,0,0,0,0\n";
    let (file, out) = (dir.file("timed.csv", text), dir.path("out.csv"));
    for blend in ["0", "0.05"] {
        let value = json(&[&file, "-o", &out, "--overwrite", "--blend", blend], 0);
        let times: Vec<f64> =
            value["waypoint_times_s"].as_array().unwrap().iter().map(|t| t.as_f64().unwrap()).collect();
        assert!((times[1] - 2.5).abs() < 1e-3 && (times[3] - 7.0).abs() < 1e-3, "{blend}: {times:?}");
        assert!(times[2] > 2.5 && times[2] < 7.0, "{times:?}");
        assert!((value["duration_s"].as_f64().unwrap() - 7.0).abs() < 0.0101, "{value}");
        let row = rows(&out).into_iter().find(|row| (row[0] - 2.5).abs() < 5e-3).expect("a row");
        assert!((row[1] - 0.4).abs() < 0.06, "{row:?}");
    }
}

#[test]
fn what_cannot_be_planned_is_refused_with_its_line() {
    let dir = Dir::new();
    let good = dir.file("good.csv", WAYPOINTS);
    let head = "q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0\n";
    let out = dir.path("out.csv");
    let old =
        include_str!("../../../arms/avena.toml").to_owned() + "\n[poses]\nabove-table = [0, 0, 0, 0, 0, 0]\n";
    let arm = dir.file("arm.toml", &old);
    let with = |name: &str, text: &str| dir.file(name, text);
    let outside = with("outside.csv", &format!("{head}0,1.6,0,0,0,0\n"));
    let one = with("one.csv", head);
    let same = with("same.csv", &format!("{head}0,0,0,0,0,0\n"));
    let word = with("word.csv", &format!("{head}0,0,zero,0,0,0\n"));
    let pose = with("pose.csv", "pose\nabove-table\nabove-tabel\n");
    let far = with("far.csv", "x,y,z,roll_deg,pitch_deg,yaw_deg\n0.3,0,0.3,0,90,0\n9,0,0,0,90,0\n");
    let early = with("early.csv", "t,q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0,0\n0.1,0.5,0,0,0,0,0\n");
    let back = with("back.csv", "t,q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0,0\n2,0.5,0,0,0,0,0\n1,0,0,0,0,0,0\n");
    let missing = dir.path("missing.csv");
    for (words, code, message) in [
        (vec![missing.as_str()], 2, "missing.csv: No such file"),
        (vec![&word], 2, "word.csv, line 3, column 3, q3: \"zero\" is not a number"),
        (
            vec![&pose, "--arm", &arm],
            2,
            "pose.csv, line 3, column 1: the arm avena has no pose \"above-tabel\"; the arm has above-table",
        ),
        (vec![&one], 2, "too few waypoints: 1, expected at least 2"),
        (vec![&same], 4, "all 2 waypoints are at the same position"),
        (vec![&outside], 4, "outside.csv, line 3: waypoint 2, joint 2: 1.6 rad is outside -1.57..1.57 rad"),
        (vec![&far], 4, "far.csv, line"),
        (
            vec![&early],
            4,
            "early.csv, line 3: waypoint 2: 0.100 s after waypoint 1 is too early, joint 1 needs",
        ),
        (vec![&back], 2, "back.csv, line 4: waypoint 3: time 1 s is not after 2 s"),
        (vec![&good, "--blend", "-0.1"], 2, "blend of -0.1 rad"),
        (vec![&good, "--blend", "5"], 2, "blend of 5 rad is out of range, expected 0..0.5 rad"),
        (vec![&good, "--blend", "0.51"], 2, "blend of 0.51 rad is out of range"),
        (vec![&good, "--blend", "inf"], 2, "blend of inf rad is out of range"),
        (vec![&good, "--deg", "--blend", "29"], 2, "blend of 0.506"),
        (vec![&good, "--line", "--blend-m", "20"], 2, "blend of 20 m is out of range, expected 0..0.5 m"),
        (vec![&good, "--speed", "0"], 2, "speed 0 % is out of range, expected 1..100 %"),
        (vec![&good, "--speed", "101"], 2, "speed 101 % is out of range, expected 1..100 %"),
        (vec![&good, "--payload", "25,0,0,0.1"], 4, "good.csv, line"),
        (vec![&good, "--temperature", "500"], 2, "500 °C"),
    ] {
        let output = jtc(&[&["plan"], &words[..], &["-o", &out]].concat()).ends(code);
        assert!(output.err.contains(message), "{words:?}: {}", output.err);
        assert!(!dir.has("out.csv"), "{words:?} leaves an output");
    }
    // If the name of a pose is unknown, the hint suggests a similar name.
    let output = jtc(&["plan", &pose, "--arm", &arm, "-o", &out]).ends(2);
    assert!(output.err.contains("did you mean \"above-table\"?"), "{}", output.err);
    // The command rejects an output file that exists, and an output file that is also the input file.
    jtc(&["plan", &good, "-o", &out]).ends(0);
    let output = jtc(&["plan", &good, "-o", &out]).ends(4);
    assert!(
        output.err.contains("out.csv already exists") && output.err.contains("--overwrite"),
        "{}",
        output.err
    );
    jtc(&["plan", &good, "-o", &out, "--overwrite"]).ends(0);
    jtc(&["plan", &good, "-o", &good, "--overwrite"]).ends(4);
}

/// The command can plan a motion through many waypoints. The command rejects a motion that does not fit in a
/// trajectory.
#[test]
fn ten_thousand_waypoints_are_planned_or_too_long() {
    let dir = Dir::new();
    let mut text = String::from("q1,q2,q3,q4,q5,q6\n");
    for i in 0..10_000 {
        let q = |k: i32| 0.4 * (0.002 * f64::from(i) + f64::from(k)).sin();
        text += &format!("{:.6},{:.6},{:.6},{:.6},{:.6},{:.6}\n", q(0), q(1), q(2), q(3), q(4), q(5));
    }
    let (file, out) = (dir.file("many.csv", &text), dir.path("out.csv"));
    let value = json(&[&file, "-o", &out, "--blend", "0.001"], 0);
    assert_eq!(value["waypoints"], 10_000);
    assert_eq!(value["waypoint_times_s"].as_array().unwrap().len(), 10_000);
    jtc(&["traj", "check", &out]).ends(0);
    let output = jtc(&["plan", &file, "-o", &out, "--overwrite"]).ends(4);
    assert!(
        output.err.contains("12000 points are") && output.err.contains("plan the motion in parts"),
        "{}",
        output.err
    );
}

/// The report page shows the motion, the limits, and the limiting constraints over time. The page needs no other file.
#[test]
fn the_report_names_what_binds_when() {
    let dir = Dir::new();
    let (file, out, page) = (dir.file("w.csv", WAYPOINTS), dir.path("out.csv"), dir.path("plan.html"));
    let value = json(&[&file, "-o", &out, "--report", &page], 0);
    let text = std::fs::read_to_string(&page).unwrap();
    assert!(text.contains("Limits over time") && text.contains("planned, not run"));
    let bound = &value["binding"][0];
    assert!(text.contains(&format!("\"plan\":[{bound}")), "{bound}");
    assert!(text.contains("Limiting constraints and their time") && text.contains("[\"joint 6\","));
    assert!(!text.contains("src=\"http") && text.contains("set_position_rad"));
    // The report page already exists, so the command writes no file.
    let other = dir.path("other.csv");
    jtc(&["plan", &file, "-o", &other, "--report", &page]).ends(4);
    assert!(!dir.has("other.csv"));
}
