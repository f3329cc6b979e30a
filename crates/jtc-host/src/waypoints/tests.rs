//! Tests of waypoint files, and of the errors for invalid files.

use proptest::prelude::*;

use super::*;
use crate::arm::{Arm, Poses};

fn arm() -> Arm {
    let poses = [("home".to_owned(), [0.0; 6]), ("above-table".to_owned(), [0.1, 0.2, -0.3, 0.4, 0.5, 0.6])];
    Arm { poses: Poses::from(poses), ..Arm::avena() }
}

fn read(text: &str) -> Vec<jtc_plan::Waypoint> {
    WaypointFile::parse(text).unwrap().positions(&arm()).unwrap()
}

#[test]
fn the_forms_say_the_same() {
    let plain = read("q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0\n0.1,0.2,-0.3,0.4,0.5,0.6\n");
    assert_eq!(plain[1].position, [0.1, 0.2, -0.3, 0.4, 0.5, 0.6]);
    let degrees = [0.1f64, 0.2, -0.3, 0.4, 0.5, 0.6].map(|q| q.to_degrees().to_string()).join(";");
    for text in [
        format!("# a comment\nq1_deg;q2_deg;q3_deg;q4_deg;q5_deg;q6_deg\n0;0;0;0;0;0\n{degrees}\n"),
        "pose\nhome\nabove-table\n".into(),
        "pose,q1,q2,q3,q4,q5,q6\nhome,,,,,,\n,0.1,0.2,-0.3,0.4,0.5,0.6\n".into(),
        r#"[{"pose": "home"}, {"q1": 0.1, "q2": 0.2, "q3": -0.3, "q4": 0.4, "q5": 0.5, "q6": 0.6}]"#.into(),
        r#"{"waypoints": [{"q1": 0, "q2": 0, "q3": 0, "q4": 0, "q5": 0, "q6": 0}, {"pose": "above-table"}]}"#
            .into(),
    ] {
        for (waypoint, same) in read(&text).iter().zip(&plain) {
            for j in 0..6 {
                assert!((waypoint.position[j] - same.position[j]).abs() < 1e-12, "{text}");
            }
            assert_eq!(waypoint.time, None);
        }
    }
}

/// The flange pose of a joint position is written to a file, once with a quaternion and once with angles. The reader
/// must find this joint position again.
#[test]
fn poses_of_the_flange_are_found_near_the_waypoint_before() {
    let arm = arm();
    let q = [0.3, 0.2, -0.6, 0.2, 0.5, -0.3];
    let limits = std::array::from_fn(|j| arm.config().position_range(j));
    let pose = Kinematics::new(&arm.model, &limits).flange(&q);
    let [x, y, z] = pose.position;
    let [qx, qy, qz, qw] = kinematics::quaternion_of(&pose);
    let angles = kinematics::rpy_of(&pose);
    let [roll, pitch, yaw] = angles;
    let degrees = angles.map(f64::to_degrees);
    let near = "0.29,0.21,-0.6,0.21,0.5,-0.3";
    for text in [
        format!(
            "q1,q2,q3,q4,q5,q6,x,y,z,qx,qy,qz,qw\n{near},,,,,,,\n,,,,,,{x},{y},{z},{qx},{qy},{qz},{qw}\n"
        ),
        format!(
            "q1,q2,q3,q4,q5,q6,x,y,z,roll,pitch,yaw\n{near},,,,,,\n,,,,,,{x},{y},{z},{roll},{pitch},{yaw}\n"
        ),
        format!(
            "q1,q2,q3,q4,q5,q6,x_m,y_m,z_m,roll_deg,pitch_deg,yaw_deg\n{near},,,,,,\n,,,,,,{x},{y},{z},{},{},{}\n",
            degrees[0], degrees[1], degrees[2]
        ),
        format!(
            r#"[{{"q1":0.29,"q2":0.21,"q3":-0.6,"q4":0.21,"q5":0.5,"q6":-0.3}},
               {{"x":{x},"y":{y},"z":{z},"roll_deg":{},"pitch_deg":{},"yaw_deg":{}}}]"#,
            degrees[0], degrees[1], degrees[2]
        ),
    ] {
        let found = read(&text)[1].position;
        for j in 0..6 {
            assert!((found[j] - q[j]).abs() < 1e-6, "{text}: {found:?}");
        }
    }
    // The poses are invalid: one is too far away, one has no orientation, and one is incomplete.
    let far =
        WaypointFile::parse("x,y,z,roll,pitch,yaw\n9,0,0,0,0,0\n").unwrap().positions(&arm).unwrap_err();
    assert!(far.to_string().starts_with(", line 2: out of reach"), "{far}");
    assert_eq!(far.diagnosis().kind, host_kit::ErrorKind::Refused);
    let long =
        WaypointFile::parse("x,y,z,qx,qy,qz,qw\n0.3,0,0.3,0,0,1,1\n").unwrap().positions(&arm).unwrap_err();
    assert!(long.to_string().contains("the quaternion has the length 1.414"), "{long}");
}

/// The times in a file are counted from the first waypoint, and are optional.
#[test]
fn times_are_from_the_first_waypoint() {
    let times = |text: &str| read(text).iter().map(|w| w.time).collect::<Vec<_>>();
    assert_eq!(times("t,pose\n2,home\n,above-table\n5.5,home\n"), [Some(0.0), None, Some(3.5)]);
    assert_eq!(
        times(r#"[{"t": 0, "pose": "home"}, {"t": 2, "pose": "above-table"}]"#),
        [Some(0.0), Some(2.0)]
    );
}

#[test]
fn degrees_are_taken_only_where_the_file_names_no_unit() {
    let file = WaypointFile::parse("q1,q2,q3,q4,q5,q6\n90,0,0,0,0,0\n").unwrap().in_degrees().unwrap();
    assert_eq!(file.positions(&arm()).unwrap()[0].position[0], std::f64::consts::FRAC_PI_2);
    let named = WaypointFile::parse("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n90,0,0,0,0,0\n").unwrap();
    assert!(named.in_degrees().unwrap_err().to_string().contains("states its units"));
}

/// A unit in the name of a column or key is recognised in upper and lower case. If a name contains a unit, an option cannot convert the
/// numbers again.
#[test]
fn a_unit_in_a_name_counts_in_letters_of_any_case() {
    let joint_headers = [
        "Q1_DEG,Q2_DEG,Q3_DEG,Q4_DEG,Q5_DEG,Q6_DEG",
        "q1_Deg,q2_Deg,q3_Deg,q4_Deg,q5_Deg,q6_Deg",
        "Q1_deg,Q2,Q3,Q4,Q5,Q6",
        "q1_dEG,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg",
        "\"Q1_DEG\",Q2,Q3,Q4,Q5,Q6",
    ];
    for header in joint_headers {
        let text = format!("{header}\n60,0,0,0,0,0\n");
        let file = WaypointFile::parse(&text).unwrap();
        assert!(
            (file.positions(&arm()).unwrap()[0].position[0] - 60f64.to_radians()).abs() < 1e-12,
            "{text}"
        );
        let error = file.in_degrees().expect_err(&text).to_string();
        assert!(error.contains("states its units"), "{text}: {error}");
    }
    let keys = header_keys("Q1_DEG Q2 Q3 Q4 Q5 Q6");
    let mixed = header_keys("q1_Deg q2_deg q3_rad q4 Q5_RAD q6");
    for text in [format!("[{{{keys}}}]"), format!("{{\"waypoints\": [{{{mixed}}}]}}")] {
        let file = WaypointFile::parse(&text).unwrap();
        assert!(
            (file.positions(&arm()).unwrap()[0].position[0] - 60f64.to_radians()).abs() < 1e-12,
            "{text}"
        );
        assert!(file.in_degrees().is_err(), "{text}");
    }
    for named in [
        "Q1_RAD,Q2,Q3,Q4,Q5,Q6\n1,0,0,0,0,0\n",
        "X,Y,Z,ROLL_DEG,PITCH_DEG,YAW_DEG\n0.3,0,0.3,0,0,0\n",
        "x,y,z,Roll,Pitch,Yaw_Rad\n0.3,0,0.3,0,0,0\n",
        "[{\"x\": 0.3, \"y\": 0, \"z\": 0.3, \"ROLL_DEG\": 0, \"pitch\": 0, \"yaw\": 0}]",
        "[{\"x\": 0.3, \"y\": 0, \"z\": 0.3, \"roll\": 0, \"pitch\": 0, \"Yaw_rad\": 0}]",
    ] {
        let error = WaypointFile::parse(named).unwrap().in_degrees().expect_err(named).to_string();
        assert!(error.contains("states its units"), "{named}: {error}");
    }
    let plain = WaypointFile::parse("Q1,Q2,Q3,Q4,Q5,Q6\n90,0,0,0,0,0\n").unwrap();
    assert!(plain.in_degrees().is_ok());
}

/// Returns an object with these keys. The value of the first key is 60, and the values of the other keys are 0.
fn header_keys(names: &str) -> String {
    let value = |i: usize| if i == 0 { 60 } else { 0 };
    names
        .split(' ')
        .enumerate()
        .map(|(i, name)| format!("\"{name}\": {}", value(i)))
        .collect::<Vec<_>>()
        .join(", ")
}

/// If a file contains a value twice under different names, the reader rejects the file, because it cannot know which
/// value is meant.
#[test]
fn two_names_for_one_number_are_refused() {
    let joints = "\"q2\":0,\"q3\":0,\"q4\":0,\"q5\":0,\"q6\":0";
    let pose = "\"x\":0.3,\"y\":0,\"z\":0.3,\"roll\":0.1,\"pitch\":0,\"yaw\":0";
    for (text, words) in [
        (format!("[{{\"q1\":0,\"q1_deg\":0,{joints}}}]"), "waypoint 1: both q1 and q1_deg"),
        (format!("[{{\"q1_rad\":0,\"Q1\":0,{joints}}}]"), "waypoint 1: both q1_rad and Q1"),
        (format!("[{{\"q1\":0,\"q1\":0,{joints}}}]"), "waypoint 1: both q1 and q1"),
        (format!("[{{{pose},\"roll_deg\":90}}]"), "waypoint 1: both roll and roll_deg"),
        (format!("[{{\"roll_deg\":90,{pose}}}]"), "waypoint 1: both roll_deg and roll"),
        (format!("[{{{pose},\"PITCH_DEG\":90}}]"), "waypoint 1: both pitch and PITCH_DEG"),
        (format!("[{{{pose},\"yaw_rad\":1}}]"), "waypoint 1: both yaw and yaw_rad"),
        (format!("[{{{pose},\"x_m\":1}}]"), "waypoint 1: both x and x_m"),
        ("[{\"pose\":\"home\",\"name\":\"home\"}]".into(), "waypoint 1: both pose and name"),
        ("[{\"pose\":\"home\",\"t\":1,\"time\":1}]".into(), "waypoint 1: both t and time"),
        ("x,y,z,roll,pitch,yaw,roll_deg\n0,0,0,0,0,0,0\n".into(), "\"roll_deg\": this column occurs twice"),
        ("x,y,z,roll,pitch,yaw,YAW_DEG\n0,0,0,0,0,0,0\n".into(), "\"YAW_DEG\": this column occurs twice"),
    ] {
        let error = WaypointFile::parse(&text).expect_err(&text).to_string();
        assert!(error.contains(words), "{text}: {error}");
    }
}

#[test]
fn a_broken_file_is_refused_with_its_place() {
    for (text, words) in [
        ("", "the file is empty, expected waypoints"),
        ("0,0,0,0,0,0\n1,0,0,0,0,0\n", ", line 1: 6 columns without a header: write q1,q2"),
        ("q1,q2,q3,q4,q5,q6\n", ", line 1: the file has a header but no waypoints"),
        ("q1,q2,q3,q4,q5\n0,0,0,0,0\n", ", line 1: column q6 is missing"),
        ("q1,q2,q3,q4,q5,q7\n0,0,0,0,0,0\n", ", line 1, column 6, \"q7\": unknown column; expected q1..q6"),
        ("q1,q2,q3,q4,q5,q6,q6_deg\n0,0,0,0,0,0,0\n", "column 7, \"q6_deg\": this column occurs twice"),
        ("t,q1,q2,q3,q4,q5,q6,qd1\n0,0,0,0,0,0,0,0\n", "a file with velocities is a trajectory"),
        ("q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0\n0,0,0,0,x,0\n", ", line 3, column 5, q5: \"x\" is not a number"),
        ("q1,q2,q3,q4,q5,q6\n0,0,0,0,0\n", ", line 2: 5 columns, but the header has 6"),
        ("q1;q2;q3;q4;q5;q6\n0;0;0;0;0;1,5\n", "has a decimal comma"),
        ("t,pose\nsoon,home\n", ", line 2, column 1, t: \"soon\" is not a number"),
        ("pose,q1,q2,q3,q4,q5,q6\nhome,0,0,0,0,0,0\n", "both the pose \"home\" and positions"),
        ("pose,q1,q2,q3,q4,q5,q6\n,,,,,,\n", ", line 2: the waypoint has neither a pose nor positions"),
        ("x,y,z,roll,pitch\n0.3,0,0.3,0,0\n", ", line 2: yaw is missing: a pose of the flange has"),
        ("x,y,z,roll,pitch,yaw,qw\n0.3,0,0.3,0,0,0,1\n", "both a quaternion and roll, pitch, yaw"),
        ("pose,x,y,z,roll,pitch,yaw\nhome,1,0,0,0,0,0\n", "both the pose \"home\" and one of the flange"),
        ("[{\"pose\": \"home\", \"x\": 0}]", ", waypoint 1: y is missing"),
        ("[{\"q1\": 0}]", ", waypoint 1: q2 is missing"),
        ("[{\"q1\": 0, \"q1_deg\": 0}]", ", waypoint 1: both q1 and q1_deg"),
        ("[\n {\"pose\": 3}]", ", line 2, column 11: JSON: invalid type"),
        ("[{\"where\": 3}]", "JSON: unknown field `where`"),
        ("[]", "no waypoints"),
    ] {
        let error = WaypointFile::parse(text).unwrap_err().to_string();
        assert!(error.contains(words), "{text:?}: {error}");
    }
    let error = WaypointFile::parse("pose\nhome\nabove-tabel\n").unwrap().positions(&arm()).unwrap_err();
    assert_eq!(
        error.to_string(),
        ", line 3, column 1: the arm avena has no pose \"above-tabel\"; the arm has above-table, home"
    );
    assert!(error.diagnosis().next.to_string().contains("did you mean \"above-table\"?"));
    let many = "pose\n".to_owned() + &"home\n".repeat(WAYPOINTS_MAX + 1);
    assert!(
        WaypointFile::parse(&many)
            .unwrap_err()
            .to_string()
            .contains("10001 waypoints, expected at most 10000")
    );
}

proptest! {
    /// The reader reads or rejects any file content without a panic.
    #[test]
    fn any_text_is_read_or_refused(text in "(q[1-6](_deg)?,|t,|pose,|[0-9.e-]{1,4},|\n|[{}\\[\\]\":a-z]){0,60}") {
        let _ = WaypointFile::parse(&text).map(|file| file.positions(&arm()));
    }

    #[test]
    fn what_is_written_is_read(q in prop::collection::vec(prop::array::uniform6(-3.0..3.0f64), 1..20)) {
        let back = read(&to_csv(&q));
        prop_assert_eq!(back.len(), q.len());
        for (a, b) in back.iter().zip(&q) {
            for j in 0..6 {
                prop_assert!((a.position[j] - b[j]).abs() < 1e-6);
            }
        }
    }
}
