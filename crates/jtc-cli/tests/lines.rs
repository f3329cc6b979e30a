//! Tests of `jtc plan` with the flange on lines and arcs. The tests check the flange positions in the written trajectory, and the plans
//! that the command rejects.

use crate::common;
#[path = "../../jtc-plan/tests/robots/mod.rs"]
#[allow(dead_code, reason = "the tests of jtc-plan use more")]
mod robots;

use common::{Dir, jtc};
use jtc_core::{SetPoint, interpolate};
use jtc_dynamics::Pose;
use serde_json::Value;

type Vec3 = [f64; 3];

impl Dir {
    /// Plans the waypoints in `text`. Returns the output, and ten flange poses in each interval of the written
    /// trajectory. The poses are interpolated in the same way as in the controller.
    fn plan(&self, text: &str, options: &[&str]) -> (Value, Vec<(f64, Pose)>) {
        let name = if text.starts_with('[') { "waypoints.json" } else { "waypoints.csv" };
        let (file, out) = (self.file(name, text), self.path("out.csv"));
        let words = [&["--json", "plan", &file, "-o", &out, "--overwrite"], options].concat();
        let printed = jtc(&words).ends(0).json();
        jtc(&["traj", "check", &out]).ends(0);
        (printed, flange(&std::fs::read_to_string(out).unwrap()))
    }

    /// Checks that the command rejects a plan and writes no file. Returns the output of the command.
    fn refused(&self, text: &str, options: &[&str], code: i32) -> String {
        let (file, out) = (self.file("refused.csv", text), self.path("none.csv"));
        let output = jtc(&[&["plan", &file, "-o", &out], options].concat()).ends(code);
        assert!(!std::path::Path::new(&out).exists(), "{text} leaves an output");
        output.err.clone()
    }
}

fn flange(csv: &str) -> Vec<(f64, Pose)> {
    let rows = csv.lines().skip(1).map(|line| {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        let six = |from: usize| std::array::from_fn(|j| cells[from + j]);
        (cells[0], SetPoint { position: six(1), velocity: six(7), acceleration: six(13) })
    });
    let (rows, model): (Vec<(f64, SetPoint)>, _) = (rows.collect(), robots::avena());
    let mut all = Vec::new();
    for pair in rows.windows(2) {
        let h = pair[1].0 - pair[0].0;
        for k in 0..=10 {
            let u = f64::from(k) / 10.0;
            let at = interpolate(&pair[0].1, &pair[1].1, h, u).position;
            all.push((pair[0].0 + u * h, robots::pose(&model, &at)));
        }
    }
    all
}

fn sub(a: Vec3, b: Vec3) -> Vec3 {
    std::array::from_fn(|i| a[i] - b[i])
}

fn norm(a: Vec3) -> f64 {
    a.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// Returns the distance of `p` from the straight segment between `a` and `b`.
fn off_leg(p: Vec3, a: Vec3, b: Vec3) -> f64 {
    let (leg, way) = (sub(b, a), sub(p, a));
    let dot: f64 = (0..3).map(|i| leg[i] * way[i]).sum();
    let share = (dot / norm(leg).powi(2)).clamp(0.0, 1.0);
    norm(std::array::from_fn(|i| way[i] - share * leg[i]))
}

fn times(printed: &Value) -> Vec<f64> {
    printed["waypoint_times_s"].as_array().unwrap().iter().map(|t| t.as_f64().unwrap()).collect()
}

const HEAD: &str = "x,y,z,qx,qy,qz,qw\n";
const TWO: &str = "x,y,z,qx,qy,qz,qw\n0.6,-0.3,0.4,0,0,0,1\n0.6,0.3,0.4,0,0,0,1\n";

#[test]
fn a_line_is_straight_and_a_leg_in_joint_space_says_that_it_is_not() {
    let dir = Dir::new();
    let (a, b) = ([0.6, -0.3, 0.4], [0.6, 0.3, 0.4]);
    let furthest =
        |all: &[(f64, Pose)]| all.iter().map(|(_, p)| off_leg(p.position, a, b)).fold(0.0, f64::max);
    // Without `--line`, the motion is straight in joint space. The flange leaves the line, and the command prints its
    // largest distance from the line.
    let (printed, all) = dir.plan(TWO, &[]);
    let note = printed["notes"][0].as_str().unwrap();
    let mm: f64 = note.split_once("by up to ").unwrap().1.split_once(" mm").unwrap().0.parse().unwrap();
    assert!((1e3 * furthest(&all) - mm).abs() < 0.5 && mm > 50.0, "{note}: {}", furthest(&all));
    assert!(note.contains("between waypoints 1 and 2") && note.contains("`--line`"), "{note}");
    // The user can request a line by an option, by a column of the file, and in JSON. The command plans the line at any speed, with and
    // without steps in the acceleration.
    let column = TWO.replace("qw", "qw,leg").replace("0.3,0.4,0,0,0,1\n", "0.3,0.4,0,0,0,1,line\n");
    let json = r#"[{"x":0.6,"y":-0.3,"z":0.4,"qx":0,"qy":0,"qz":0,"qw":1},
        {"x":0.6,"y":0.3,"z":0.4,"qx":0,"qy":0,"qz":0,"qw":1,"leg":"line"}]"#;
    let mut durations = Vec::new();
    for (text, options) in [
        (TWO, &["--line"][..]),
        (column.as_str(), &[]),
        (json, &[]),
        (TWO, &["--line", "--no-jerk-limit"]),
        (TWO, &["--line", "--speed", "3"]),
    ] {
        let (printed, all) = dir.plan(text, options);
        assert_eq!(printed["notes"], serde_json::json!([]), "{options:?}");
        assert!(furthest(&all) < 1e-4, "{options:?}: {} m", furthest(&all));
        for (_, pose) in &all {
            let turned = (0..3).map(|i| (pose.rotation[i][i] - 1.0).abs()).fold(0.0, f64::max);
            assert!(turned < 1e-6, "{options:?}: {turned}");
        }
        let (first, last) = (all.first().unwrap().1.position, all.last().unwrap().1.position);
        assert!(norm(sub(first, a)) < 1e-6 && norm(sub(last, b)) < 1e-6);
        assert!(printed["binding"][0]["joint"].is_u64(), "{printed}");
        durations.push(printed["duration_s"].as_f64().unwrap());
    }
    assert!((durations[0] - durations[1]).abs() < 1e-9 && (durations[0] - durations[2]).abs() < 1e-9);
    assert!(durations[3] < durations[0], "{durations:?}");
}

#[test]
fn corners_are_sharp_stops_or_rounded_within_the_blend() {
    let dir = Dir::new();
    let corners: [Vec3; 4] = [[0.5, -0.2, 0.4], [0.7, -0.2, 0.4], [0.7, 0.1, 0.5], [0.5, 0.1, 0.4]];
    let rows = corners.map(|[x, y, z]| format!("{x},{y},{z},0,0,0,1\n")).concat();
    let text = format!("{HEAD}{rows}");
    let mut durations = Vec::new();
    for blend in [0.0, 0.005, 0.1] {
        let (printed, all) = dir.plan(&text, &["--line", "--blend-m", &blend.to_string()]);
        for (time, pose) in &all {
            let off =
                corners.windows(2).map(|c| off_leg(pose.position, c[0], c[1])).fold(f64::INFINITY, f64::min);
            let corner =
                corners[1..3].iter().map(|c| norm(sub(pose.position, *c))).fold(f64::INFINITY, f64::min);
            assert!(off < 1e-4 || corner < blend + 1e-4, "{off} m off the legs at {time} s");
        }
        for (time, corner) in times(&printed).iter().zip(corners) {
            let there =
                &all.iter().min_by(|a, b| (a.0 - time).abs().total_cmp(&(b.0 - time).abs())).unwrap().1;
            assert!(norm(sub(there.position, corner)) < blend + 2e-3);
        }
        durations.push(printed["duration_s"].as_f64().unwrap());
    }
    // With blends, the motion is not slower than with stops at the waypoints.
    assert!(durations[1] <= durations[0] && durations[2] < durations[1], "{durations:?}");
}

/// The arc is a quarter circle about the vertical axis of the base. The command ignores the orientation of the point
/// on the arc, so the file can omit it.
#[test]
fn an_arc_is_round() {
    let dir = Dir::new();
    let at = |angle: f64| format!("{},{},0.4", 0.6 * angle.cos(), 0.6 * angle.sin());
    for via in [",,,", "0,1,0,0"] {
        let text = format!(
            "x,y,z,qx,qy,qz,qw,leg\n{},0,0,0,1,\n{},{via},via\n{},0,0,0,1,arc\n",
            at(-0.7),
            at(0.2),
            at(0.8)
        );
        let (printed, all) = dir.plan(&text, &[]);
        for (time, pose) in &all {
            let [x, y, z] = pose.position;
            assert!(
                (x.hypot(y) - 0.6).abs() < 1e-4 && (z - 0.4).abs() < 1e-4,
                "{:?} at {time}",
                pose.position
            );
            assert!(y.atan2(x) > -0.7 - 1e-4 && y.atan2(x) < 0.8 + 1e-4);
        }
        let passed = times(&printed)[1];
        let (_, there) =
            all.iter().min_by(|a, b| (a.0 - passed).abs().total_cmp(&(b.0 - passed).abs())).unwrap();
        let angle = there.position[1].atan2(there.position[0]);
        assert!((angle - 0.2).abs() < 3e-3 && printed["waypoints"] == 3, "{angle}");
    }
}

/// The end points can be named poses and joint positions. The file can also contain times, and segments in joint space
/// between lines.
#[test]
fn waypoints_of_any_kind_may_be_ends_of_lines() {
    let dir = Dir::new();
    let q = [0.3, -0.2, 1.2, 0.4, 0.9, 0.2];
    let arm = include_str!("../../../arms/avena.toml").to_owned()
        + "\n[poses]\nhome = [0, 0, 0, 0, 0, 0]\nup = [0.3, -0.2, 1.2, 0.4, 0.9, 0.2]\n";
    let arm = dir.file("arm.toml", &arm);
    let a = robots::pose(&robots::avena(), &q);
    let [x, y, z] = a.position;
    let [r, p, w] = jtc_host::plan::kinematics::rpy_of(&a);
    let text = format!(
        "t,pose,x,y,z,roll,pitch,yaw,q1,q2,q3,q4,q5,q6,leg\n0,home,,,,,,,,,,,,,\n,up,,,,,,,,,,,,,\n5,,{},{y},{z},{r},{p},{w},,,,,,,line\n\
         ,,,,,,,,0.3,-0.2,1.2,0.4,0.9,0.2,line\n12,home,,,,,,,,,,,,,joint\n",
        x - 0.2
    );
    let (printed, all) = dir.plan(&text, &["--arm", &arm]);
    let (times, b) = (times(&printed), [x - 0.2, y, z]);
    assert!((times[2] - 5.0).abs() < 1e-3 && (times[4] - 12.0).abs() < 1e-3, "{times:?}");
    let on_lines = all.iter().filter(|(t, _)| *t >= times[1] && *t <= times[3]);
    let off = on_lines.map(|(_, pose)| off_leg(pose.position, a.position, b)).fold(0.0, f64::max);
    assert!(off < 1e-4, "{off}");
    let early = text.replace("\n5,", "\n0.2,");
    let refused = dir.refused(&early, &["--arm", &arm], 4);
    assert!(refused.contains("line 4: waypoint 3: 0.200 s after waypoint 1 is too early"), "{refused}");
    // Another set of joint positions reaches the same flange pose, but a line cannot end with these positions.
    let other = robots_other(&q);
    let cells = other.map(|v| v.to_string()).join(",");
    let refused =
        dir.refused(&text.replace("0.3,-0.2,1.2,0.4,0.9,0.2,line", &(cells + ",line")), &["--arm", &arm], 4);
    assert!(refused.contains("line 5: waypoint 4: the line ends there with joint "), "{refused}");
}

/// Returns different joint positions with the same flange pose.
fn robots_other(q: &[f64; 6]) -> [f64; 6] {
    use jtc_host::plan::kinematics::Kinematics;
    let all =
        Kinematics::new(&robots::avena(), &robots::avena_limits()).all(&robots::pose(&robots::avena(), q));
    let away = |other: &[f64; 6]| (0..6).map(|j| (other[j] - q[j]).abs()).fold(0.0, f64::max);
    all.into_iter().find(|other| away(other) > 0.1).unwrap()
}

#[test]
fn lines_and_arcs_that_cannot_be_are_refused_with_their_place() {
    let dir = Dir::new();
    let legs = |legs: &[&str]| {
        let rows =
            legs.iter().enumerate().map(|(i, leg)| format!("0.6,{},0.4,0,0,0,1,{leg}\n", 0.1 * i as f64));
        format!("x,y,z,qx,qy,qz,qw,leg\n{}", rows.collect::<String>())
    };
    // In each of these files, the column `leg` has an error, which the command must report.
    for (kinds, message) in [
        (&["", "via", "line"][..], "refused.csv, line 3: `via` (a point on an arc) is not followed by `arc`"),
        (&["", "line", "via"], "refused.csv, line 4: `via`"),
        (&["", "arc"], "refused.csv, line 3: `arc` (the end of an arc) does not follow `via`"),
        (&["via", "arc"], "refused.csv, line 2: `via` is not valid for the first waypoint"),
        (
            &["", "curve"],
            "refused.csv, line 3, column 8, leg: \"curve\" is not a valid leg, expected joint, line, via or arc",
        ),
    ] {
        let refused = dir.refused(&legs(kinds), &[], 2);
        assert!(refused.contains(message), "{kinds:?}: {refused}");
    }
    // Three collinear points do not define an arc, so the plan is refused.
    let refused = dir.refused(&legs(&["", "via", "arc"]), &[], 4);
    assert!(
        refused.contains("line 4: waypoint 3: the three points of the arc are not on a circle"),
        "{refused}"
    );
    // The last waypoint is out of reach of the arm. The error must name this waypoint.
    let far = "x,y,z,qx,qy,qz,qw\n0.6,0,0.4,0,0,0,1\n0.6,0.2,0.4,0,0,0,1\n2.6,0,0.4,0,0,0,1\n";
    let refused = dir.refused(far, &["--line"], 4);
    assert!(refused.contains("line 4: waypoint 3: out of reach"), "{refused}");
    // The line passes through a singular pose of the arm. The error reports the joints and the position on the line.
    let through = "q1,q2,q3,q4,q5,q6\n0.3,-0.2,1.2,0.4,0.3,0.2\n0.5,-0.1,1.1,0.4,-0.3,0.2\n";
    let refused = dir.refused(through, &["--line"], 4);
    let place = refused.split_once("line 3: leg 1 (to waypoint 2), ").map(|(_, rest)| rest);
    let distance: f64 = place.and_then(|rest| rest.split_once(" m of ")).unwrap().0.parse().unwrap();
    assert!(distance > 0.05 && distance < 0.25, "{refused}");
    assert!(refused.contains("wrist singularity (the axes of joints 4 and 6 in line)"), "{refused}");
    assert!(dir.refused(TWO, &["--line", "--blend-m", "-1"], 2).contains("a blend radius of -1 m"));
}
