//! Tests of fault files that the reader accepts, and of mistakes that it reports.
use proptest::prelude::*;

use super::*;

#[test]
fn the_documented_example_is_read() {
    let lines = FAULT_FILE_HELP.lines().skip_while(|l| *l != "```toml").skip(1);
    let text: Vec<_> = lines.take_while(|l| *l != "```").collect();
    let plan = FaultPlan::from_toml(&text.join("\n")).unwrap();
    let expected = [
        Fault { kind: FaultKind::NodeSilent { node: 2 }, trigger: Trigger::At(3500), duration_ms: Some(50) },
        Fault {
            kind: FaultKind::EncoderJump { joint: Joint::ALL[1], rad: 0.3 },
            trigger: Trigger::InState(ControllerState::Operate, 1000),
            duration_ms: None,
        },
        Fault {
            kind: FaultKind::FramesLost { probability: 0.01 },
            trigger: Trigger::AtPoint(4000),
            duration_ms: Some(2000),
        },
        Fault {
            kind: FaultKind::Push { joint: Joint::ALL[2], torque: 12.0 },
            trigger: Trigger::InState(ControllerState::HoldPos, 2000),
            duration_ms: Some(500),
        },
        Fault {
            kind: FaultKind::Wall {
                position: [0.0, 0.0, 0.1],
                normal: [0.0, 0.0, 1.0],
                stiffness: 50_000.0,
                damping: 200.0,
            },
            trigger: Trigger::At(0),
            duration_ms: None,
        },
    ];
    assert_eq!(plan.faults, expected);
}

#[test]
fn every_kind_is_read_by_its_own_name() {
    for kind in FaultKind::NAMES {
        let keys = "joint = 1\ngripper = true\ntorque_nm = 3\nfile = \"a.csv\"\nfor_s = 1\nbits = 4\nrad = 0.1\nfactor = 2\ncelsius = 30\nprobability = 0.5\n\
                    position_m = [0, 0, 1]\nnormal = [0, 0, 1]\nstiffness_n_m = 1e4\ndamping_ns_m = 10\nside = \"above\"\n\
                    stiffness_nm_rad = 1e4\ndamping_nms_rad = 10\nmass_kg = 2\ncom_m = [0, 0, 0.1]\n";
        // The test starts with all keys. The test removes the key that each error message reports, until the file is
        // accepted.
        let mut keys: Vec<&str> = keys.lines().collect();
        let fault = loop {
            let text = format!("format = 2\n[[fault]]\nkind = \"{kind}\"\nat_s = 1\n{}", keys.join("\n"));
            match FaultPlan::from_toml_with(&text, |_| Ok(path())) {
                Ok(plan) => break plan.faults[0],
                Err(FaultFileError::Device { .. }) => keys.retain(|line| !line.starts_with("gripper")),
                Err(FaultFileError::Superfluous { key, .. }) => keys.retain(|line| !line.starts_with(key)),
                Err(error) => panic!("{error}"),
            }
        };
        assert_eq!(fault.kind.name(), kind);
    }
}

const WALL: &str = "[[fault]]\nkind = \"wall\"\nat_s = 1\n";
const JOINT_WALL: &str = "[[fault]]\nkind = \"joint-wall\"\nat_s = 1\njoint = 1\nrad = 0.5\n";

#[test]
fn mistakes_are_named() {
    let message = |text: &str| FaultPlan::from_toml(&format!("format = 2\n{text}")).unwrap_err().to_string();
    for (text, part) in [
        ("[[fault]]\nkind = \"node-quiet\"\nat_s = 1", "unknown kind `node-quiet`"),
        ("[[fault]]\nkind = \"node-silent\"\nat_s = 1", "exactly one of `joint = 1..6` and `gripper = true`"),
        ("[[fault]]\nkind = \"bus-off\"\njoint = 1\nat_s = 1", "`joint` has no meaning for `bus-off`"),
        ("[[fault]]\nkind = \"bus-off\"", "exactly one of at_s, in_state, at_point"),
        ("[[fault]]\nkind = \"bus-off\"\nat_s = 1\nat_point = 2", "exactly one of"),
        ("[[fault]]\nkind = \"bus-off\"\nin_state = \"holding\"", "unknown state `holding`"),
        ("[[fault]]\nkind = \"bus-off\"\nat_s = 1\nafter_s = 2", "`after_s` has no meaning"),
        (
            "[[fault]]\nkind = \"frames-lost\"\nprobability = 2\nat_s = 1",
            "probability = 2 is out of range, expected 0..1",
        ),
        (
            "[[fault]]\nkind = \"node-silent\"\njoint = 7\nat_s = 1",
            "joint = 7 is out of range, expected 1..6",
        ),
        (
            "[[fault]]\nkind = \"fault-state\"\njoint = 0\nat_s = 1",
            "joint = 0 is out of range, expected 1..6",
        ),
        ("[[fault]]\nkind = \"push\"\njoint = 1\ntorque_nm = 1\nat_s = 1", "`push` needs the key `for_s`"),
        ("[[fault]]\nkind = \"hand\"\nfile = \"a.csv\"\nat_s = 1", "a.csv: files cannot be read here"),
        ("[[fault]]\nkind = \"node-silent\"\njoint = 1.5\nat_s = 1", "joint = 1.5 is not a whole number"),
        ("[[fault]]\nkind = \"bus-off\"\nat_s = nan", "at_s = NaN is out of range"),
        ("[[fault]]\nkind = \"bus-off\"\nwhen = 3", "unknown field `when`"),
        (
            &format!("{WALL}position_m = [0, 0]"),
            "position_m has 2 numbers, expected 3: `position_m = [x, y, z]`",
        ),
        (&format!("{WALL}position_m = [0, 0, 11]"), "position_m = 11 is out of range, expected -10..10"),
        (&format!("{WALL}position_m = 3"), "invalid type"),
        (WALL, "`wall` needs the key `position_m`"),
        (&format!("{WALL}position_m = [0, 0, 0]"), "`wall` needs the key `normal`"),
        (
            &format!("{WALL}position_m = [0, 0, 0]\nnormal = [0, 0, 0]"),
            "normal = [0, 0, 0] has no direction; write the direction out of the wall",
        ),
        (
            &format!("{WALL}position_m = [0, 0, 0]\nnormal = [0, 0, 1]\nstiffness_n_m = 2e6"),
            "stiffness_n_m = 2000000 is out of range, expected 1..1000000",
        ),
        (
            &format!(
                "{WALL}position_m = [0, 0, 0]\nnormal = [0, 0, 1]\nstiffness_n_m = 2\ndamping_ns_m = -1"
            ),
            "damping_ns_m = -1 is out of range, expected 0..10000",
        ),
        (&format!("{JOINT_WALL}side = \"left\""), "unknown side `left`; the sides are above, below"),
        (JOINT_WALL, "`joint-wall` needs the key `side`"),
        (&format!("{JOINT_WALL}side = \"above\""), "`joint-wall` needs the key `stiffness_nm_rad`"),
        (
            "[[fault]]\nkind = \"payload\"\nat_s = 1\nmass_kg = 0",
            "mass_kg = 0 is out of range, expected 0.001..100",
        ),
        (
            "[[fault]]\nkind = \"payload\"\nat_s = 1\nmass_kg = 2\ncom_m = [3, 0, 0]",
            "com_m = 3 is out of range, expected -2..2",
        ),
        (
            "[[fault]]\nkind = \"bus-off\"\nat_s = 1\ncom_m = [0, 0, 0]",
            "`com_m` has no meaning for `bus-off`",
        ),
        ("fault = 3", "invalid type"),
    ] {
        let message = message(text);
        assert!(message.contains(part), "{text}\n→ {message}");
    }
    assert_eq!(FaultPlan::from_toml("format = 2").unwrap(), FaultPlan::default());
}

/// A file of format 1, in which joints are counted from 0, must be rejected, because its faults would affect the
/// wrong joints.
#[test]
fn files_that_counted_from_0_are_refused_with_what_to_change() {
    let old = "[[fault]]\nkind = \"fault-state\"\njoint = 2\nat_s = 1";
    for text in ["", old] {
        let message = FaultPlan::from_toml(text).unwrap_err().to_string();
        assert!(message.contains("`format = 2`") && message.contains("add 1 to every `joint`"), "{message}");
    }
    let message = FaultPlan::from_toml(&format!("format = 1\n{old}")).unwrap_err().to_string();
    assert!(message.contains("format = 1 is not supported"), "{message}");
    // A file with an unknown format is rejected, independent of its keys.
    let later = "format = 3\nepoch = \"noon\"\n[[fault]]\nkind = \"push\"\nlimb = 1";
    let message = FaultPlan::from_toml(later).unwrap_err().to_string();
    assert!(message.contains("format = 3 is not supported"), "{message}");
    for (node, instead) in [("2", "write joint = 3"), ("6", "write gripper = true")] {
        let text = format!("format = 2\n[[fault]]\nkind = \"node-silent\"\nnode = {node}\nat_s = 1");
        let message = FaultPlan::from_toml(&text).unwrap_err().to_string();
        assert!(message.contains(instead), "{message}");
    }
}

fn path() -> HandPath {
    HandPath::new(vec![[0.0; 6]], 0.01).unwrap()
}

proptest! {
    #[test]
    fn no_text_makes_the_reader_panic(text in "(\\[\\[fault\\]\\]|kind = \"[a-z-]*\"|[a-z_]+ = -?[0-9.e]+|\\PC|\n){0,40}") {
        let _ = FaultPlan::from_toml(&text);
        let _ = FaultPlan::from_toml(&format!("format = 2\n{text}"));
    }
}
