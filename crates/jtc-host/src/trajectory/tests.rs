//! Tests of all file forms, and of the errors for invalid files.

use proptest::prelude::*;

use test_kit::existing;

use super::*;

fn parse(text: &str) -> Result<Loaded, FileError> {
    Loaded::parse(text, None)
}

fn problem(text: &str) -> String {
    parse(text).expect_err("accepted").to_string()
}

proptest! {
    /// The integers of the int16 format are sent unchanged.
    #[test]
    fn the_int16_form_round_trips_exactly(raw in prop::collection::vec(any::<i16>(), 18)) {
        let mut text = String::from("0");
        raw.iter().for_each(|v| text += &format!(",{v}"));
        let loaded = parse(&text).unwrap();
        prop_assert_eq!(loaded.form, Form::Int16);
        let p = loaded.trajectory.raw().unwrap()[0];
        let back: Vec<i16> = p.position.iter().chain(&p.velocity).chain(&p.acceleration).copied().collect();
        prop_assert_eq!(back, raw);
    }

    #[test]
    fn csv_and_json_round_trip(points in prop::collection::vec(prop::array::uniform18(-3.0..3.0f64), 2..20), step in 1u16..1000) {
        let part = |p: &[f64; 18], from: usize| std::array::from_fn(|j| p[from + j]);
        let points = points
            .iter()
            .map(|p| Point { position: part(p, 0), velocity: part(p, 6), acceleration: part(p, 12) })
            .collect();
        let trajectory = Trajectory { step_ms: step, points };
        let csv = parse(&trajectory.to_csv()).unwrap();
        prop_assert_eq!((&csv.trajectory, csv.form, csv.notes.len()), (&trajectory, Form::Csv, 0));
        let json = parse(&trajectory.to_json()).unwrap();
        prop_assert_eq!((&json.trajectory, json.form, json.notes.len()), (&trajectory, Form::Json, 0));
    }

    #[test]
    fn no_text_panics(text in "[-0-9a-z.,;:{}\\[\\]\"\n ]{0,200}") {
        let _ = parse(&text);
    }
}

#[test]
fn every_int16_value_round_trips() {
    for v in i16::MIN..=i16::MAX {
        let raw = RawPoint { position: [v; 6], velocity: [v; 6], acceleration: [v; 6] };
        assert_eq!(Point::from(&raw).raw(0).unwrap(), raw);
    }
}

/// An encoder rejects a value that is out of range (section 1 of the requirements). The encoder does not wrap or clip the value.
#[test]
fn values_outside_the_scale_are_refused_by_name() {
    let mut point = Point::default();
    point.velocity[3] = -6.3;
    let text = point.raw(17).unwrap_err().to_string();
    assert_eq!(text, "point 17, joint 4: velocity -6.3 is outside the scale of ±6.283185 rad/s");
    point.velocity[3] = f64::NAN;
    assert!(point.raw(0).is_err());
}

#[test]
fn header_columns_may_come_in_any_order_and_some_may_be_missing() {
    let loaded = parse("q6,q5,q4,q3,q2,q1,t\n6,5,4,3,2,1,0\n6,5,4,3,2,1,0.02\n").unwrap();
    assert_eq!(loaded.trajectory.step_ms, 20);
    assert_eq!(loaded.trajectory.points[1].position, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    assert_eq!(loaded.trajectory.points[1].velocity, [0.0; 6]);
    assert_eq!(loaded.notes.len(), 1);
}

#[test]
fn errors_name_line_column_and_value() {
    let head = "t,q1,q2,q3,q4,q5,q6\n";
    assert_eq!(problem(&format!("{head}0,1,2,3,x4,5,6\n")), ", line 2, column 5, q4: \"x4\" is not a number");
    assert_eq!(problem(&format!("{head}0,1,2,3,4,5\n")), ", line 2: 6 columns, but the lines before have 7");
    assert_eq!(
        problem(&format!("{head}0,0,0,0,0,0,NaN\n")),
        ", line 2, column 7, q6: NaN is not a finite number"
    );
    let back = problem(&format!("{head}0,0,0,0,0,0,0\n0.01,0,0,0,0,0,0\n0.005,0,0,0,0,0,0\n"));
    assert_eq!(back, ", line 4, time: 0.005 s is not after 0.01 s of the line before");
    assert!(problem("t,q1,q2,q3,q4,q5\n").contains("column q6 is missing"));
    assert!(problem("t,q1,q2,q3,q4,q5,q6,speed\n").contains("\"speed\""));
    assert!(problem("0,1,2\n").contains("3 columns without a header"));
    assert!(problem(&vec!["1"; 22].join(",")).contains("seven axes"));
    let wide = problem(&format!("0,40000{}\n", ",0".repeat(17)));
    assert_eq!(wide, ", line 1, column 2, q1: \"40000\" is not an int16, expected -32768..32767");
    assert!(problem("").contains("empty"));
}

const ROS: &str = "\
header: {stamp: {sec: 1, nanosec: 2}, frame_id: base}
joint_names: [arm_joint_2, arm_joint_1, arm_joint_3, arm_joint_4, arm_joint_5, arm_joint_6]
points:
- positions: [0.2, 0.1, 0.3, 0.4, 0.5, 0.6]
  velocities: [0, 0, 0, 0, 0, 0]
  time_from_start: {sec: 0, nanosec: 0}
- positions: [0.3, 0.1, 0.3, 0.4, 0.5, 0.6]
  velocities: [0, 0, 0, 0, 0, 0]
  time_from_start: {sec: 1, nanosec: 500000000}
---
";

/// Units are recognised in upper and lower case, as in waypoint files. If a file states a unit, an option cannot
/// convert the numbers again.
#[test]
fn a_unit_in_a_header_counts_in_letters_of_any_case() {
    let zeros = ",0,0,0,0,0\n";
    for (header, position) in [
        ("t,Q1_DEG,Q2_DEG,Q3_DEG,Q4_DEG,Q5_DEG,Q6_DEG", 1f64.to_radians()),
        ("T,q1_Deg,q2,q3,q4,q5,q6", 1f64.to_radians()),
        ("t,\"Q1_DEG\",q2,q3,q4,q5,q6", 1f64.to_radians()),
        ("TIME_S,Q1_RAD,Q2,Q3,Q4,Q5,Q6", 1.0),
        ("t,Q1,Q2,Q3,Q4,Q5,Q6_Deg", 1.0),
    ] {
        let text = format!("{header}\n0,0{zeros}0.1,0{zeros}1,1{zeros}");
        let loaded = parse(&text).unwrap();
        let last = loaded.trajectory.points.last().unwrap().position[0];
        assert!((last - position).abs() < 1e-9, "{header}: {last}");
        let error = loaded.in_degrees().expect_err(header).to_string();
        assert!(error.contains("states its units"), "{header}: {error}");
    }
    assert!(parse(&format!("t,Q1,Q2,Q3,Q4,Q5,Q6\n0,0{zeros}1,1{zeros}")).unwrap().in_degrees().is_ok());
    let both = problem(&format!("t,q1,Q1_DEG,q2,q3,q4,q5,q6\n0,0,0{zeros}"));
    assert!(both.contains("\"Q1_DEG\": this column occurs twice"), "{both}");
}

/// If a trajectory file contains a column that only waypoint files have, the error names the column and the command
/// for waypoint files.
#[test]
fn columns_of_waypoints_are_known_as_such() {
    for name in "pose leg x y z qx qy qz qw roll pitch yaw x_m roll_deg".split(' ') {
        let text = problem(&format!("t,{name}\n0,0\n"));
        assert!(text.contains(name) && text.contains("`jtc plan` makes a trajectory"), "{text}");
    }
    assert!(problem("t,q7\n0,0\n").contains("unknown column"));
}

#[test]
fn joint_trajectories_are_read_in_the_order_of_their_names() {
    let loaded = parse(ROS).unwrap();
    assert_eq!(loaded.form, Form::JointTrajectory);
    let points = &loaded.trajectory.points;
    assert_eq!((loaded.trajectory.step_ms, points.len()), (10, 151));
    assert_eq!(points[0].position, [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]);
    assert!((points[150].position[1] - 0.3).abs() < 1e-9);
    let names = std::array::from_fn(|i| format!("arm_joint_{}", i + 1));
    assert_eq!(
        Loaded::parse(ROS, Some(ArmNames { arm: "", joints: &names })).unwrap().trajectory,
        loaded.trajectory
    );
    let other = ROS.replace("arm_joint_6", "elbow");
    let text = Loaded::parse(&other, Some(ArmNames { arm: "", joints: &names })).unwrap_err().to_string();
    assert!(text.contains("elbow") && text.contains("arm_joint_6"), "{text}");
}

#[test]
fn joint_trajectories_may_be_json_inside_other_messages() {
    let point = |t: f64, p: f64| format!(r#"{{"positions":[{p},0,0,0,0,0],"time_from_start":{t}}}"#);
    let text = format!(
        r#"{{"trajectory":{{"joint_names":["a1","a2","a3","a4","a5","a6"],"points":[{},{}]}}}}"#,
        point(0.0, 0.0),
        point(0.1, 0.01)
    );
    let loaded = parse(&text).unwrap();
    assert_eq!((loaded.trajectory.step_ms, loaded.trajectory.points.len()), (100, 2));
}

#[test]
fn the_existing_files_are_read() {
    for (name, form) in [("TrajectoryInt.csv", Form::Int16), ("TrajectoryFloat.csv", Form::Float)] {
        let Some(path) = existing::file(name) else { continue };
        let loaded = Loaded::load(&path, None).unwrap();
        let points = loaded.trajectory.points.len();
        assert_eq!((loaded.form, points, loaded.trajectory.step_ms, loaded.notes.len()), (form, 1054, 10, 0));
    }
    if let Some(path) = existing::file("TrajectoryInt_Long.csv") {
        let loaded = Loaded::load(&path, None).unwrap();
        assert_eq!((loaded.form, loaded.trajectory.points.len()), (Form::Int16, 12_000));
        assert!(loaded.notes[0].contains("line 1055"), "{:?}", loaded.notes);
    }
}
