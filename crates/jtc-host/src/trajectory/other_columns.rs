//! Tests of columns and times that must not be read with a wrong meaning.

use super::*;

fn read(text: &str) -> Result<Loaded, FileError> {
    let names = std::array::from_fn(|i| format!("joint_{}", i + 1));
    Loaded::parse(text, Some(ArmNames { arm: "avena", joints: &names }))
}

fn table(name: &str, count: usize) -> String {
    let header: String = (1..=count).map(|n| ",".to_owned() + &name.replace('#', &n.to_string())).collect();
    let row = |t: u8| format!("{t}{}\n", format!(",{t}").repeat(count));
    format!("t{header}\n{}{}", row(0), row(1))
}

/// A word with an unknown meaning next to a joint, also the name of another arm, makes the column unknown.
#[test]
fn columns_with_unknown_words_are_not_positions() {
    for name in [
        "q#_deg_meas",
        "q#_mrad",
        "q#_ticks",
        "q#_dot",
        "q#_vel",
        "joint_#_omega",
        "joint_#_rpm",
        "q#_upper",
        "delta_q#",
        "tcp_pos_#",
        "q#'",
        "-q#",
        "joint_#_deg_actual",
        "/deg/joint_#",
        "left/joint_#",
        "right.joint_#",
        "/robot2/joint_#",
        "ur5 joint_#",
        "joint_#_left",
        "joint_#_2",
        "q#_2",
    ] {
        let text = table(name, 6);
        let first = name.replace('#', "1");
        for loaded in [read(&text), Loaded::parse(&text, None)].into_iter().flatten() {
            // Without the names of an arm, the numbers determine the order.
            assert!(
                name.contains("left") || name.contains("right") || name.contains("robot"),
                "{name}: {loaded:?}"
            );
        }
        let error = read(&text).expect_err(name).to_string();
        assert!(error.contains(&first) || name == "q#_vel", "{name}: {error}");
        let beside = format!("{},{first}\n0,0,0,0,0,0,0,5\n", "t,q1,q2,q3,q4,q5,q6");
        if name != "q#_vel" {
            assert!(
                read(&beside).unwrap_or_else(|e| panic!("{name}: {e}")).notes.concat().contains(&first),
                "{name}"
            );
        }
    }
    for name in ["joint_#", "avena/joint_#", "/joint_states/joint_#/position", "q#_meas", "joint_#_deg"] {
        read(&table(name, 6)).unwrap_or_else(|e| panic!("{name}: {e}"));
    }
}

#[test]
fn a_seventh_joint_is_refused() {
    for name in ["q#", "joint_#", "joint_#.pos", "/franka/joint_#"] {
        assert!(read(&table(name, 7)).is_err(), "{name}");
    }
    for name in ["q4294967295", "q4294967296", "joint_4294967295"] {
        assert!(read(&format!("t,{name}\n0,0\n")).is_err());
    }
    assert!(read(&table("x#", 1001)).unwrap_err().to_string().contains("at most 1000"));
}

#[test]
fn commas_with_blanks_separate_columns() {
    assert_eq!(read(&format!("{}\n", vec!["0"; 19].join(", "))).unwrap().form, Form::Int16);
    let rest = ", 0".repeat(18);
    let float = format!("0{rest}\n0.5{rest}\n");
    assert_eq!(read(&float).unwrap().form, Form::Float);
    let zeros = ", 0".repeat(6);
    assert!(read(&format!("t q1 q2 q3 q4 q5 q6\n0{zeros}\n1{zeros}\n")).is_ok());
}

#[test]
fn names_of_joints_do_not_change_between_rows() {
    let each = |text: &str| (0..6).map(|j| text.replace('#', &j.to_string())).collect::<Vec<_>>().join(",");
    let head = format!("t,{},{}\n", each("name_#"), each("position_#"));
    let row = |t: u8, names: &str| format!("{t},{names},0,0,0,0,0,0\n");
    let (own, other) = (
        "joint_1,joint_2,joint_3,joint_4,joint_5,joint_6",
        "joint_2,joint_1,joint_3,joint_4,joint_5,joint_6",
    );
    assert!(read(&(head.clone() + &row(0, own) + &row(1, own))).is_ok());
    let error = read(&(head + &row(0, own) + &row(1, other))).unwrap_err().to_string();
    assert!(error.contains("line 3") && error.contains("another joint"), "{error}");
}

#[test]
fn times_in_two_parts_and_long_times_are_refused() {
    let zeros = ",0,0,0,0,0,0\n";
    for times in ["header.stamp.secs,header.stamp.nsecs", "sec,nanosec", "timestamp_sec,timestamp_nanosec"] {
        let text = format!("{times},q1,q2,q3,q4,q5,q6\n1,0{zeros}2,0{zeros}");
        assert!(read(&text).unwrap_err().to_string().contains("two columns"), "{times}");
    }
    for (from, to) in [("100000000000", "100000000020"), ("1700000000000", "1800000000000")] {
        let text = format!("t,q1,q2,q3,q4,q5,q6\n{from}{zeros}{to}{zeros}");
        assert!(read(&text).unwrap_err().to_string().contains("t_ms, t_us or t_ns"), "{from}");
    }
    let message = |time: &str| {
        format!(
            "joint_names: [joint_1, joint_2, joint_3, joint_4, joint_5, joint_6]\npoints:\n\
             - positions: [0, 0, 0, 0, 0, 0]\n  time_from_start: 0\n- positions: [0, 0, 0, 0, 0, 0]\n  time_from_start: {time}\n"
        )
    };
    assert!(
        read(&message("{sec: 1, nanoseconds: 5}"))
            .unwrap_err()
            .to_string()
            .contains("unknown key nanoseconds")
    );
    assert!(!read(&message("20000000")).unwrap_err().to_string().contains("column"));
}

#[test]
fn a_comment_about_joints_leaves_a_table_a_table() {
    assert_eq!(read(&("# joint_names: a, b\n".to_owned() + &table("q#", 6))).unwrap().form, Form::Csv);
}

#[test]
fn wrong_types_in_json_are_in_our_own_words() {
    for (value, words) in [("[0]", "a list"), ("{}", "an object"), ("true", "true"), ("null", "nothing")] {
        let text = format!("{{\"points\":[{{\"time_s\":0,\"position_rad\":[0,{value},0,0,0,0]}}]}}");
        let error = read(&text).unwrap_err().to_string();
        assert!(error.contains(words) && !error.contains("sequence") && !error.contains("map"), "{error}");
    }
}
