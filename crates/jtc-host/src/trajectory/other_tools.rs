//! Tests of files that other programs write.

use super::*;

fn names() -> [String; JOINTS] {
    std::array::from_fn(|i| format!("joint_{}", i + 1))
}

fn read_for(text: &str, joints: &[String; JOINTS]) -> Result<Loaded, FileError> {
    Loaded::parse(text, Some(ArmNames { arm: "avena", joints }))
}

fn read(text: &str) -> Loaded {
    read_for(text, &names()).unwrap_or_else(|e| panic!("{e}: {text}"))
}

fn problem(text: &str) -> String {
    let text = read_for(text, &names()).expect_err(text).to_string();
    assert!(!text.chars().any(char::is_control), "{text:?}");
    text
}

const JOINTS_OF_ARM: &str = "[joint_1, joint_2, joint_3, joint_4, joint_5, joint_6]";

/// Returns a JointTrajectory in JSON that ends at `end` after 1 s.
fn message(end: f64) -> String {
    let names = names().map(|name| format!("\"{name}\"")).join(",");
    let point = |sec: u8, q: f64| {
        format!(
            "{{\"positions\":[{q},0,0,0,0,0],\"velocities\":[],\"time_from_start\":{{\"sec\":{sec},\"nanosec\":0}}}}"
        )
    };
    format!("{{\"joint_names\":[{names}],\"points\":[{},{}]}}", point(0, 0.0), point(1, end))
}

const EMPTY: &str = "{\"joint_names\":[],\"points\":[]}";

/// Each message of a planner or a bridge that carries a JointTrajectory is read, and a note names its keys.
#[test]
fn a_trajectory_is_found_in_any_message() {
    let m = message(0.1);
    for (text, keys) in [
        (
            format!(
                "{{\"model_id\":\"x\",\"trajectory\":[{{\"joint_trajectory\":{m},\"multi_dof_joint_trajectory\":{EMPTY}}}]}}"
            ),
            "trajectory[0].joint_trajectory",
        ),
        (format!("{{\"joint_trajectory\":{m},\"multi_dof_joint_trajectory\":{EMPTY}}}"), "joint_trajectory"),
        (
            format!("{{\"motion_plan_response\":{{\"trajectory\":{{\"joint_trajectory\":{m}}}}}}}"),
            "motion_plan_response.trajectory.joint_trajectory",
        ),
        (
            format!(
                "{{\"result\":{{\"planned_trajectory\":{{\"joint_trajectory\":{m}}},\"executed_trajectory\":{{\"joint_trajectory\":{EMPTY}}}}}}}"
            ),
            "result.planned_trajectory.joint_trajectory",
        ),
        (format!("{{\"goal\":{{\"trajectory\":{m}}}}}"), "goal.trajectory"),
        (format!("{{\"op\":\"publish\",\"topic\":\"/t\",\"msg\":{m}}}"), "msg"),
        (format!("[{m}]"), "[0]"),
        (format!("{{\"op\":\"advertise\"}}\n{{\"op\":\"publish\",\"msg\":{m}}}\n"), "message 2.msg"),
        (
            format!("# JSON is YAML\nmodel_id: x\ntrajectory:\n- joint_trajectory: {m}\n"),
            "trajectory[0].joint_trajectory",
        ),
    ] {
        let loaded = read(&text);
        assert_eq!(loaded.trajectory.points.last().unwrap().position[0], 0.1, "{text}");
        assert_eq!(loaded.notes[0], format!("the trajectory is the value of {keys}"), "{text}");
    }
    assert!(!read(&m).notes[0].contains("value of"));
}

#[test]
fn several_trajectories_are_listed_and_refused() {
    let (a, b) = (message(0.1), message(0.2));
    for text in [
        format!("{{\"trajectory\":[{{\"joint_trajectory\":{a}}},{{\"joint_trajectory\":{b}}}]}}"),
        format!("{{\"planned_trajectory\":{a},\"executed_trajectory\":{b}}}"),
        format!("{a}\n{b}\n"),
        format!("trajectory: [{a}, {b}]\n"),
    ] {
        assert!(problem(&text).contains("2 trajectories in the file ("), "{text}");
    }
    assert!(problem(&format!("{{\"trajectory\":[{EMPTY}]}}")).contains("trajectory[0].points: no points"));
}

#[test]
fn documents_without_a_trajectory_name_the_way_out() {
    for (text, words) in [
        (
            "[[0,0,0,0,0,0,0],[1,0,0,0,0,0,0]]",
            "a list of 2 lists, whose numbers have no names; expected {\"points\"",
        ),
        ("{\"waypoints\":[{\"pose\":\"home\"}]}", "`jtc plan` makes a trajectory"),
        ("[{\"q1\":0}]", "`jtc plan` makes a trajectory"),
        ("{\"error_code\":{\"val\":1},\"a\":2}", "its keys are error_code, a"),
        (
            "{\"time_s\":0,\"position_rad\":[0,0,0,0,0,0]}\n{\"time_s\":1,\"position_rad\":[0,0,0,0,0,0]}\n",
            "2 JSON values one after the other",
        ),
    ] {
        let found = problem(text);
        assert!(found.contains(words), "{text}: {found}");
    }
    let list =
        "[{\"time_s\":0,\"position_rad\":[0,0,0,0,0,0]},{\"time_s\":1,\"position_rad\":[0.1,0,0,0,0,0]}]";
    assert_eq!(read(list).form, Form::Json);
}

/// The text that `ros2 topic echo` writes for several messages or for omitted elements leads to its options.
#[test]
fn messages_that_echo_has_cut_name_the_option() {
    let head = format!("joint_names: {JOINTS_OF_ARM}\npoints:\n");
    let point = |q: &str| format!("- positions: {q}\n  time_from_start: {{sec: 0, nanosec: 0}}\n");
    let whole = head.clone() + &point("[0, 0, 0, 0, 0, 0]");
    for text in [
        format!("{whole}---\n{whole}---\n"),
        format!("---\n{whole}---\n{whole}"),
        format!("{whole}--- \n{whole}"),
    ] {
        assert!(problem(&text).contains("2 messages in the file"), "{text}");
        assert!(problem(&text).contains("`ros2 topic echo --once`"), "{text}");
    }
    assert!(read_for(&format!("---\n{whole}---\n"), &names()).is_ok());
    for text in [
        format!("{whole}- '...'\n"),
        head.clone() + &point("[0, 0, '...']"),
        "joint_names: '...'\npoints: []\n".into(),
        format!("joint_names: [joint_1, '...']\npoints:\n{}", point("[0]")),
        format!("joint_names: {JOINTS_OF_ARM}\npoints: '...'\n"),
    ] {
        let found = problem(&text);
        assert!(found.contains("--full-length") || found.contains("no points"), "{text}: {found}");
    }
    let none = format!("joint_names: {JOINTS_OF_ARM}\npoints: '<sequence type: x, length: 3>'\n");
    assert!(problem(&none).contains("omit --no-arr"));
}

/// No message contains the words of a library, and each message has a line or the name of a value.
#[test]
fn parser_errors_are_in_our_own_words() {
    let head = format!("joint_names: {JOINTS_OF_ARM}\npoints:\n");
    let bad = [
        format!("{head}- positions: [0, 0\n"),
        format!("{head}A message was lost!!!\n\ttotal count change: 1\n"),
        format!("{head}- positions: {{}}\n"),
        format!("{head}- 5\n"),
        format!("{head}- positions: [a, 0, 0, 0, 0, 0]\n  time_from_start: 0\n"),
        format!("{head}- positions: [.nan, 0, 0, 0, 0, 0]\n  time_from_start: 0\n"),
        format!("{head}- positions: [0, 0, 0, 0, 0, 0]\n  time_from_start: {{nanosec: 0}}\n"),
        format!("{head}- positions: [0, 0, 0, 0, 0, 0]\n"),
        format!("{head}{head}"),
        format!("joint_names: *a\n{head}"),
        format!("{head}\t- positions: []\n"),
        "{\"points\":[{\"position_rad\":[0,0,0,0,0,\"x\"],\"time_s\":0}]}".into(),
        "{\"points\":[{\"position_rad\":[0,0,0,0,0],\"time_s\":0}]}".into(),
        "{\"points\":[{\"position_rad\":[0,0,0,0,0,0],\"speed\":0}]}".into(),
        "{\"position_rad\":1}".into(),
        "{\"points\": [{}".into(),
        "{\"a\": 1,}".into(),
        "{\"a\" 1}".into(),
        "{a: 1}".into(),
        "{\"a\": 1e999}".into(),
        "{\"a\": \"\u{1b}\"}".into(),
        "[".repeat(300),
    ];
    for text in bad {
        let found = problem(&text).to_lowercase();
        for word in [
            "serde",
            "from_str",
            "mapping",
            "sequence",
            "struct",
            "f64",
            "u16",
            "untagged",
            "expected value",
            "visitor",
            "deserial",
            "eof ",
        ] {
            assert!(!found.contains(word), "{text}: {found}");
        }
        assert!(found.starts_with(", "), "{text}: {found}");
    }
}

#[test]
fn nan_in_json_is_named_as_in_csv() {
    for (value, words) in [
        ("NaN", "NaN is not a finite number"),
        ("-Infinity", "inf is not a finite number"),
        ("nan", "NaN is not"),
    ] {
        for text in [
            message(0.5).replace("0.5", value),
            format!("{{\"points\":[{{\"time_s\":0,\"position_rad\":[0,{value},0,0,0,0]}}]}}"),
        ] {
            let found = problem(&text);
            assert!(found.starts_with(", line 1, column ") && found.contains(words), "{text}: {found}");
        }
    }
}

/// Returns a table with a header and eleven rows at steps of 0.1 s. Joint 1 moves by 0.1 rad, or by 0.1 of another unit.
fn table(header: &str, row: impl Fn(f64) -> String) -> String {
    (0..=10).fold(format!("{header}\n"), |text, i| text + &row(f64::from(i) / 10.0) + "\n")
}

#[test]
fn tables_of_other_programs_are_read() {
    let plain = |t: f64| format!("{t:.1},{:.2},0,0,0,0,0", t / 10.0);
    let own = "t,q1,q2,q3,q4,q5,q6";
    let quoted = |t: f64| format!("\"{t:.1}\",\"{:.2}\",\"0\",\"0\",\"0\",\"0\",\"0\"", t / 10.0);
    let full = |t: f64| plain(t) + ",0.1,0,0,0,0,0";
    let degrees = |t: f64| format!("{t:.1},{},0,0,0,0,0", (t / 10.0).to_degrees());
    let names = "joint_1,joint_2,joint_3,joint_4,joint_5,joint_6";
    let each = |text: &str| (0..6).map(|j| text.replace('#', &j.to_string())).collect::<Vec<_>>().join(",");
    let from_1 = |text: &str| (1..7).map(|j| text.replace('#', &j.to_string())).collect::<Vec<_>>().join(",");
    for (text, words) in [
        (table("\"t\",\"q1\",\"q2\",\"q3\",\"q4\",\"q5\",\"q6\"", quoted), ""),
        (table(own, plain).replace('\n', "\r"), ""),
        (table(own, plain).replace('\n', "\r\n"), ""),
        (table(own, |t| plain(t) + ","), ""),
        (table(&format!("{own},"), |t| plain(t) + ","), ""),
        (table(&format!("{own}\ns,rad,rad,rad,rad,rad,rad"), plain), ""),
        (table(&format!("{own}\n[s],[deg],[deg],[deg],[deg],[deg],[deg]"), degrees), ""),
        (table("time (s),q1 (deg),q2 (deg),q3 (deg),q4 (deg),q5 (deg),q6 (deg)", degrees), ""),
        (
            table("t_ms,q1,q2,q3,q4,q5,q6", |t| {
                plain(t).replacen(&format!("{t:.1}"), &format!("{}", (t * 1e3).round()), 1)
            }),
            "",
        ),
        (
            table("time_ns,q1,q2,q3,q4,q5,q6", |t| {
                plain(t).replacen(&format!("{t:.1}"), &format!("{}", (t * 1e9).round()), 1)
            }),
            "",
        ),
        (table(&format!("__time,{}", from_1("/joint_states/joint_#/position")), plain), ""),
        (table(&format!("{},{}", "timestamp", names), plain), ""),
        (table(&format!("time,{}", names.to_uppercase()), plain), ""),
        (table(&format!("t,{}", from_1("avena_joint_#")), plain), ""),
        (table(&format!("t,{}", from_1("joint_#.pos")), plain), ""),
        (table(&format!("t,{},{}", each("q#"), each("dq#")), full), ""),
        (table(&format!("timestamp,{},{}", each("actual_q_#"), each("actual_qd_#")), full), ""),
        (table(&format!("timestamp,{}", each("target_q_#")), plain), ""),
        (table(&format!("t,{}", each("observation.state.#")), plain), "in the order of the columns"),
        (
            table(&format!("%time,{},{}", each("field.position#"), each("field.velocity#")), |t| {
                full(t).replacen(
                    &format!("{t:.1}"),
                    &format!("{}", 1_700_000_000_000_000_000u64 + (t * 1e9).round() as u64),
                    1,
                )
            }),
            "nanoseconds since 1970",
        ),
        (
            table(&format!(",{own}"), |t| format!("{},{}", (t * 10.0).round(), plain(t))),
            "columns left out: column 1 (without a name)",
        ),
        (
            table(&format!("{own},gripper,note"), |t| plain(t) + ",1,hello"),
            "columns left out: \"gripper\", \"note\"",
        ),
        (
            table(&format!("{own},{}", from_1("joint_#_effort")), |t| plain(t) + ",1,2,3,4,5,6"),
            "\"joint_1_effort\"",
        ),
        (
            table(&format!("{own},{}", each("actual_q_#")), |t| plain(t) + ",1,2,3,4,5,6"),
            "columns left out: \"actual_q_0\"",
        ),
        (table(&format!("{own},x,y,z"), |t| plain(t) + ",1,2,3"), "columns left out: \"x\""),
    ] {
        let loaded = read(&text);
        let points = &loaded.trajectory.points;
        assert_eq!((points.len(), loaded.trajectory.step_ms), (11, 100), "{text}: {:?}", loaded.notes);
        assert!((points[10].position[0] - 0.1).abs() < 1e-9, "{text}: {:?}", points[10]);
        assert!(loaded.notes.concat().contains(words), "{text}: {:?}", loaded.notes);
    }
    // The names of the joints are in cells of the row.
    let names = "joint_2,joint_1,joint_3,joint_4,joint_5,joint_6";
    let text = table(&format!("%time,{},{}", each("field.name#"), each("field.position#")), |t| {
        format!("{t},{names},0,{},0,0,0,0", t / 10.0)
    });
    assert!((read(&text).trajectory.points[10].position[0] - 0.1).abs() < 1e-9);
}

#[test]
fn tables_that_have_two_meanings_are_refused() {
    let each = |text: &str| (0..6).map(|j| text.replace('#', &j.to_string())).collect::<Vec<_>>().join(",");
    let from_1 = |text: &str| (1..7).map(|j| text.replace('#', &j.to_string())).collect::<Vec<_>>().join(",");
    let zeros = |n: usize| vec!["0"; n].join(",");
    for (header, columns, words) in [
        (
            format!("timestamp,{},{}", each("target_q_#"), each("actual_q_#")),
            13,
            "2 sets of positions, which begin with the columns \"actual_q_0\", \"target_q_0\"",
        ),
        (
            format!("timestamp,{},{}", each("observation.state.#"), each("action.#")),
            13,
            "2 sets of positions",
        ),
        (
            format!("%time,{},{}", each("field.actual.positions#"), each("field.desired.positions#")),
            13,
            "2 sets of positions",
        ),
        (format!("t,time,{}", from_1("q#")), 8, "t, time are all times; keep one of these columns"),
        (
            format!("t,{}", from_1("left_joint_#")),
            7,
            "none of these names is a joint, expected the joints of the arm avena",
        ),
        (format!("t,{}", from_1("j#")), 7, "none of these names is a joint"),
        (format!("t,{},q7", from_1("q#")), 8, "\"q7\": unknown column"),
        (format!("t,{},qd1,qd2", from_1("q#")), 9, "column qd3 is missing"),
        (format!("t,{},dq0,dq1", each("q#")), 9, "column qd2 is missing"),
        (format!("t,{}", from_1("q#_mrad").replace("_mrad", " (mrad)")), 7, "unknown unit \"mrad\""),
        (format!("t,{}", from_1("q# (deg/s)")), 7, "expected rad or deg"),
        (
            format!("t,{}\ns,deg,deg,deg,deg,deg,deg", from_1("q#_rad")),
            7,
            "this unit and the unit in the name of the column differ",
        ),
        (format!("t,{},pose", from_1("q#")), 8, "`jtc plan` makes a trajectory"),
    ] {
        let found = problem(&format!("{header}\n{}\n", zeros(columns)));
        assert!(found.contains(words), "{header}: {found}");
    }
}

#[test]
fn a_decimal_comma_is_named() {
    let head = "t;q1;q2;q3;q4;q5;q6";
    for text in [
        format!("{head}\n0,0;0,1;0;0;0;0;0\n"),
        format!("{head}\n0,0;0,1;0;0;0;0;0\n").replace(';', "\t"),
        format!("{head}\n0,0;0,1;0;0;0;0;0\n").replace(';', "  "),
        format!("{head}\n0,0;0,1;0;0;0;0;0\n")
            .replace(';', "\",\"")
            .replace('\n', "\"\n\"")
            .replacen("t\"", "\"t\"", 1),
        "t,q1,q2,q3,q4,q5,q6\n0,0,0,1,0,0,0,0,0\n".into(),
        vec!["0,5"; 19].join(" "),
        vec!["0,5"; 19].join("\t"),
    ] {
        assert!(problem(&text).contains("decimal comma"), "{text}: {}", problem(&text));
    }
}

#[test]
fn control_characters_never_reach_the_terminal() {
    for text in [
        "t,\u{1b}[31mq1\n0,0\n".to_owned(),
        "t,q1,q2,q3,q4,q5,q6\n0,\u{7}x\u{1b}[0m,0,0,0,0,0\n".into(),
        format!("joint_names: [\"\\e[31m\", b, c, d, e, f]\npoints: []\n{}", "x: 1\n"),
        "joint_names: [\"a\\r\\nb\", b, c, d, e, f]\npoints:\n- {positions: [0, 0, 0, 0, 0, 0], time_from_start: 0}\n".into(),
        "{\"\\u001b[2J\": 1}".into(),
        "{\"\\u001b[2J\": {\"joint_names\": [], \"points\": 5}}".into(),
    ] {
        problem(&text);
    }
    let note = read(&format!("{{\"a\\u001b\": {}}}", message(0.1))).notes.concat();
    assert!(!note.chars().any(char::is_control), "{note:?}");
    assert!(note.contains("a\\u{1b}"));
}

/// Times without a unit that are probably not in s are read with a note, or refused with the name of a column that states the unit.
#[test]
fn times_that_are_probably_not_seconds_are_named() {
    let head = "t,q1,q2,q3,q4,q5,q6\n";
    let rows = |step: u64, from: u64| {
        (0..=100).fold(head.to_owned(), |text, i| text + &format!("{},0,0,0,0,0,0\n", from + i * step))
    };
    for (step, words) in [
        (
            20,
            "are read as seconds: a mean step of 20.000 s, 2000.000 s in all; for milliseconds, name the column t_ms",
        ),
        (1, "mean step of 1.000 s"),
    ] {
        assert!(read(&rows(step, 0)).notes.concat().contains(words), "{step}");
    }
    for (step, words) in [
        (20_000, "t_us"),
        (20_000_000, "nanoseconds, name the column t_ns"),
        (900, "milliseconds, name the column t_ms"),
    ] {
        assert!(problem(&rows(step, 0)).contains(words), "{step}");
    }
    for (step, from, unit) in [
        (20_000_000, 1_700_000_000_000_000_000, "nano"),
        (20_000, 1_700_000_000_000_000, "micro"),
        (20, 1_700_000_000_000, "milli"),
    ] {
        let loaded = read(&rows(step, from));
        assert!(loaded.notes[0].contains(unit), "{:?}", loaded.notes);
        assert_eq!((loaded.trajectory.step_ms, loaded.trajectory.points.len()), (20, 101));
    }
    let slow = read(&(0..5).fold(head.to_owned(), |text, i| text + &format!("{},0,0,0,0,0,0\n", 2 * i)));
    assert_eq!(slow.notes[1..], ["the step of 2 s is longer than 1 s: resampled to 10 ms"]);
    let small = format!("0{}\n2,1{}\n4,2{}\n", ",0".repeat(18), ",0".repeat(17), ",0".repeat(17));
    assert!(read(&small).notes[0].contains("write decimal points"));
}

/// A file that names the joints of another arm is refused. The caller can request the order of the numbers instead.
#[test]
fn joints_of_another_arm_are_refused() {
    let with = |names: &str| {
        let point = |t: u8| format!("- positions: [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]\n  time_from_start: {t}\n");
        format!("joint_names: [{names}]\npoints:\n{}{}", point(0), point(1))
    };
    let from_1 =
        |text: &str| (1..7).map(|j| text.replace('#', &j.to_string())).collect::<Vec<_>>().join(", ");
    for other in ["left_joint_#", "finger_#", "axis#", "joint#", "avena2_joint_#", "joint_#_2"] {
        let error = read_for(&with(&from_1(other)), &names()).expect_err(other);
        assert!(error.to_string().contains("expected the joints of the arm avena: joint_1"), "{error}");
    }
    let error = read_for(&with(&from_1("left_joint_#")), &names()).unwrap_err();
    let next = host_kit::Diagnose::diagnosis(&error).next;
    assert!(next.names(host_kit::Action::JointsByNumber), "{next}");
    assert!(problem(&with("joint_1, joint_2, joint_3, joint_4, joint_5, elbow")).contains("joint_6 missing"));
    assert!(
        problem(&with("joint_1, avena_joint_1, joint_2, joint_3, joint_4, joint_5, joint_6"))
            .contains("the same joint")
    );
    for own in ["joint_#", "avena_joint_#", "Avena/joint_#"] {
        assert!(read(&with(&from_1(own))).notes.iter().all(|note| !note.contains("joint")), "{own}");
    }
    // The names of the arm can have the prefix, too.
    let long = std::array::from_fn(|i| format!("avena_joint_{}", i + 1));
    assert!(read_for(&with(&from_1("joint_#")), &long).is_ok());
    let by_number = Loaded::parse(&with(&from_1("left_joint_#")), None).unwrap();
    assert!(by_number.notes[0].contains("in the order of the numbers in their names: left_joint_1"));
}

#[test]
fn utf_16_is_read() {
    let directory = tempfile::tempdir().unwrap();
    let text = table("t\tq1\tq2\tq3\tq4\tq5\tq6", |t| format!("{t}\t{t}\t0\t0\t0\t0\t0"));
    for little in [true, false] {
        let path = directory.path().join("motion.csv");
        let words = "\u{feff}".chars().chain(text.chars()).map(|c| c as u16);
        let bytes: Vec<u8> =
            words.flat_map(|w| if little { w.to_le_bytes() } else { w.to_be_bytes() }).collect();
        std::fs::write(&path, &bytes).unwrap();
        assert_eq!(Loaded::load(&path, None).unwrap().trajectory.points.len(), 11);
        std::fs::write(&path, &bytes[..bytes.len() - 1]).unwrap();
        assert!(Loaded::load(&path, None).unwrap_err().to_string().contains("save the file as UTF-8"));
    }
}
