//! Example files, and the documentation page about file formats.
//!
//! The trajectories begin and end at the zero pose, in which `jtc sim` starts.

mod demo;

use std::f64::consts::PI;
use std::fmt::Write as _;

use jtc_core::JOINTS;

use crate::Arm;
use crate::arm::AVENA_TOML;
use crate::trajectory::{Point, Trajectory};
pub use demo::demo_motion;

/// Page about the file formats, with an example of each format.
pub const FORMS: &str = include_str!("example/forms.md");

/// Example file with faults for a simulated arm.
const FAULTS: &str = include_str!("example/faults.toml");

/// Waypoints of a cyclic motion, which ends at its first waypoint.
const CYCLE: &str = include_str!("example/cycle.csv");

/// Waypoints between which the flange moves along lines and an arc.
const LINES: &str = include_str!("example/lines.csv");

/// Largest deflection of each joint in the examples, rad.
const BEND: [f64; JOINTS] = [0.8, 0.45, -0.7, 0.9, 0.6, -1.2];
/// Duration of the example motion, s. `STEP_MS` is the time between its points, ms.
const DURATION_S: f64 = 6.0;
const STEP_MS: u16 = 10;
/// Times of the waypoints of the example motion, s.
const WAYPOINTS_S: [f64; 9] = [0.0, 0.75, 1.5, 2.25, 3.0, 3.75, 4.5, 5.25, 6.0];

/// Example file.
#[derive(Clone, Copy, Debug)]
pub struct Example {
    /// Name of the example.
    pub name: &'static str,
    /// Name of the example file.
    pub file: &'static str,
    /// Description of the example.
    pub what: &'static str,
    /// Command that uses the example. `{}` in this text stands for the file name.
    pub next: &'static str,
    text: fn() -> String,
}

impl Example {
    /// Returns the content of the example file.
    pub fn text(&self) -> String {
        (self.text)()
    }

    /// Returns the example named `name`.
    pub fn named(name: &str) -> Option<&'static Self> {
        EXAMPLES.iter().find(|example| example.name == name)
    }
}

/// All examples.
pub const EXAMPLES: [Example; 9] = [
    Example {
        name: "motion",
        file: "motion.csv",
        what: "trajectory: each joint bends and returns; position, velocity, acceleration every 10 ms",
        next: "jtc traj run {} --record run.mcap",
        text: || motion().to_csv(),
    },
    Example {
        name: "waypoints",
        file: "waypoints.csv",
        what: "trajectory of nine positions in degrees, joined smoothly",
        next: "jtc traj check {}",
        text: waypoints_csv,
    },
    Example {
        name: "cycle",
        file: "cycle-waypoints.csv",
        what: "waypoints in degrees without times, for `jtc plan`: a cycle from the zero pose and back",
        next: "jtc plan {} -o cycle.csv --blend 0.05",
        text: || CYCLE.to_owned(),
    },
    Example {
        name: "lines",
        file: "line-waypoints.csv",
        what: "poses of the flange, for `jtc plan`: lines and an arc, from the zero pose and back",
        next: "jtc plan {} -o lines.csv --blend-m 0.02",
        text: || LINES.to_owned(),
    },
    Example {
        name: "json",
        file: "waypoints.json",
        what: "the same positions as JSON, in radians",
        next: "jtc traj check {}",
        text: waypoints_json,
    },
    Example {
        name: "joint-trajectory",
        file: "joint_trajectory.yaml",
        what: "the same as trajectory_msgs/JointTrajectory, as `ros2 topic echo` prints it",
        next: "jtc traj check {}",
        text: joint_trajectory,
    },
    Example {
        name: "lead",
        file: "lead.csv",
        what: "path of a hand that leads the simulated arm in Teaching: type `hand lead.csv` into `jtc sim`",
        next: "jtc teach record taught.csv",
        text: waypoints_csv,
    },
    Example {
        name: "arm",
        file: "my-arm.toml",
        what: "arm file of the built-in arm, which you can change",
        next: "jtc params show {}",
        text: || AVENA_TOML.to_owned(),
    },
    Example {
        name: "faults",
        file: "faults.toml",
        what: "faults of a simulated run: a push, noise on the bus, a silent drive",
        next: "jtc sim --serial /tmp/jtc --faults {}",
        text: || FAULTS.to_owned(),
    },
];

/// Returns the point of the example motion at the time `t`. The motion follows a `sin⁴` curve over the whole duration. The velocity and the
/// acceleration are 0 at the start and at the end of the motion.
fn point(t: f64) -> Point {
    // The formula follows from sin⁴x = (3 − 4 cos 2x + cos 4x) / 8.
    let (x, w) = (PI * t / DURATION_S, PI / DURATION_S);
    let shape = (3.0 - 4.0 * (2.0 * x).cos() + (4.0 * x).cos()) / 8.0;
    let rate = w * ((2.0 * x).sin() - 0.5 * (4.0 * x).sin());
    let change = w * w * (2.0 * (2.0 * x).cos() - 2.0 * (4.0 * x).cos());
    Point {
        position: BEND.map(|b| b * shape),
        velocity: BEND.map(|b| b * rate),
        acceleration: BEND.map(|b| b * change),
    }
}

fn motion() -> Trajectory {
    let count = (1e3 * DURATION_S) as usize / usize::from(STEP_MS);
    let points = (0..=count).map(|k| point(k as f64 * f64::from(STEP_MS) / 1e3)).collect();
    Trajectory { step_ms: STEP_MS, points }
}

/// Returns the waypoints of the example motion. The example files contain these waypoints with rounded numbers.
fn waypoints() -> impl Iterator<Item = (f64, [f64; JOINTS])> {
    WAYPOINTS_S.into_iter().map(|t| (t, point(t).position))
}

fn row(values: [f64; JOINTS], digits: usize) -> String {
    values
        .map(|v| {
            // The addition of 0.0 changes −0 to 0.
            let scale = 10f64.powi(digits as i32);
            format!("{:.digits$}", (v * scale).round() / scale + 0.0)
        })
        .join(", ")
}

fn waypoints_csv() -> String {
    let mut text = String::from("t, q1_deg, q2_deg, q3_deg, q4_deg, q5_deg, q6_deg\n");
    for (t, q) in waypoints() {
        let _ = writeln!(text, "{t}, {}", row(q.map(f64::to_degrees), 1));
    }
    text
}

fn waypoints_json() -> String {
    let points: Vec<String> = waypoints()
        .map(|(t, q)| format!("    {{ \"time_s\": {t}, \"position_rad\": [{}] }}", row(q, 4)))
        .collect();
    format!("{{\n  \"points\": [\n{}\n  ]\n}}\n", points.join(",\n"))
}

fn joint_trajectory() -> String {
    let mut text = format!("joint_names: [{}]\npoints:\n", Arm::avena().joint_names.join(", "));
    for (t, q) in waypoints() {
        let (s, ns) = (t.floor(), (t.fract() * 1e9).round());
        let _ =
            writeln!(text, "- positions: [{}]\n  time_from_start: {{ sec: {s}, nanosec: {ns} }}", row(q, 4));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::Checker;
    use crate::plan::Planner;
    use crate::trajectory::Loaded;
    use crate::waypoints::WaypointFile;
    use jtc_core::Config;

    /// Each example trajectory passes the check for the built-in arm from the start pose of `jtc sim`.
    #[test]
    fn the_trajectories_pass_the_check_from_the_zero_pose() {
        let arm = Arm::avena();
        for example in
            EXAMPLES.iter().filter(|e| !e.file.ends_with(".toml") && !e.file.ends_with("-waypoints.csv"))
        {
            let read = Loaded::parse(&example.text(), Some(arm.names())).unwrap();
            let config = Config::avena();
            let friction = arm.friction();
            let checker = Checker {
                model: Some(&arm.model),
                friction: friction.as_ref(),
                start: Some([0.0; JOINTS]),
                ..Checker::new(&config)
            };
            let verdict = checker.check(&read.trajectory);
            assert!(verdict.is_ok(), "{}: {:?}", example.name, verdict.problems);
            assert!(read.trajectory.points[0].position.iter().all(|q| q.abs() < 1e-9), "{}", example.name);
            assert!((read.trajectory.duration_s() - DURATION_S).abs() < 1e-9, "{}", example.name);
        }
    }

    /// The example waypoints can be planned without changes. A cyclic motion ends at its first waypoint.
    #[test]
    fn the_waypoints_of_a_cycle_can_be_planned() {
        let arm = Arm::avena();
        let (config, friction) = (arm.config(), arm.friction());
        let file = WaypointFile::parse(CYCLE).unwrap();
        let waypoints = file.positions(&arm).unwrap();
        let planner =
            Planner { model: Some(&arm.model), friction: friction.as_ref(), ..Planner::new(&config) };
        for blend in [0.0, 0.05] {
            let planned = Planner { blend, ..planner.clone() }.through(&waypoints).unwrap();
            assert_eq!(
                planned.trajectory.points.last().unwrap().position,
                planned.trajectory.points[0].position
            );
            assert!(planned.notes.is_empty(), "{:?}", planned.notes);
        }
    }

    #[test]
    fn the_motion_is_one_motion() {
        let points = motion().points;
        let h = f64::from(STEP_MS) / 1e3;
        for w in points.windows(3) {
            for j in 0..JOINTS {
                let rate = (w[2].position[j] - w[0].position[j]) / (2.0 * h);
                let change = (w[2].velocity[j] - w[0].velocity[j]) / (2.0 * h);
                assert!(
                    (rate - w[1].velocity[j]).abs() < 1e-3 && (change - w[1].acceleration[j]).abs() < 1e-3
                );
            }
        }
    }

    /// Each code block of the page about file formats is a file that the library can read.
    #[test]
    fn the_page_shows_files_that_can_be_read() {
        let arm = Arm::avena();
        let mut blocks = 0;
        for part in FORMS.split("```").skip(1).step_by(2) {
            let (kind, text) = part.split_once('\n').unwrap();
            match kind {
                "csv" if text.contains("leg") => {
                    let file = WaypointFile::parse(text).unwrap();
                    file.route(&arm, false, (0.0, 0.01)).unwrap_or_else(|e| panic!("{e}: {text}"));
                }
                "csv" | "json" if text.contains("pose") => {
                    let poses = [("home", [0.0; JOINTS]), ("pick", [0.2; JOINTS])]
                        .map(|(name, q)| (name.to_owned(), q));
                    let arm = Arm { poses: poses.into(), ..arm.clone() };
                    WaypointFile::parse(text)
                        .unwrap()
                        .positions(&arm)
                        .unwrap_or_else(|e| panic!("{e}: {text}"));
                }
                "csv" | "json" | "yaml" => {
                    Loaded::parse(text, Some(arm.names())).unwrap_or_else(|e| panic!("{e}: {text}"));
                }
                "toml" => assert!(
                    text.lines()
                        .all(|line| line.is_empty() || AVENA_TOML.contains(line.split(" #").next().unwrap()))
                        || text.starts_with("[poses]"),
                    "{text}"
                ),
                other => panic!("a block of {other}"),
            }
            blocks += 1;
        }
        assert_eq!(blocks, 10);
    }
}
