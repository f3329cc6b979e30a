//! Tests with robot descriptions that have arbitrary axes, fixed joints, gripper fingers, and missing, duplicated or wrong numbers.

use std::f64::consts::FRAC_PI_2;

use jtc_dynamics::Dynamics;
use proptest::prelude::*;

use crate::arm::{Arm, ArmChoice, Change, Source};
use host_kit::Diagnose;

/// Joint of a robot description: origin and axis of the joint, mass and centre of mass of its link.
#[derive(Clone, Debug)]
struct Part {
    xyz: [f64; 3],
    rpy: [f64; 3],
    axis: [f64; 3],
    mass: f64,
    com: [f64; 3],
}

fn three(v: &[f64; 3]) -> String {
    format!("{} {} {}", v[0], v[1], v[2])
}

fn body(name: &str, mass: f64, com: &[f64; 3]) -> String {
    format!(
        "<link name=\"{name}\">\n<inertial><origin xyz=\"{}\"/><mass value=\"{mass}\"/><inertia ixx=\"0.01\" ixy=\"0\" ixz=\"0\" \
         iyy=\"0.01\" iyz=\"0\" izz=\"0.01\"/></inertial>\n<visual><geometry><mesh filename=\"package://nowhere/{name}.stl\"/>\
         </geometry></visual></link>\n",
        three(com)
    )
}

fn joint(name: &str, kind: &str, (parent, child): (&str, &str), inside: &str) -> String {
    format!(
        "<joint name=\"{name}\" type=\"{kind}\">\n<parent link=\"{parent}\"/><child link=\"{child}\"/>\n{inside}</joint>\n"
    )
}

const LIMIT: &str = "<limit lower=\"-1.5\" upper=\"1.5\" effort=\"50\" velocity=\"1.2\"/>\n";

/// Returns a description with six joints a1..a6 and links b1..b6 on link b0, followed by the text `more`. The description names mesh files
/// that do not exist.
fn robot(parts: &[Part], more: &str) -> String {
    let mut text = format!("<?xml version=\"1.0\"?>\n<robot name=\"arm\">\n{}", body("b0", 2.0, &[0.0; 3]));
    for (i, p) in parts.iter().enumerate() {
        text += &body(&format!("b{}", i + 1), p.mass, &p.com);
        let (parent, child) = (format!("b{i}"), format!("b{}", i + 1));
        let inside = format!(
            "<origin xyz=\"{}\" rpy=\"{}\"/><axis xyz=\"{}\"/>\n{LIMIT}",
            three(&p.xyz),
            three(&p.rpy),
            three(&p.axis)
        );
        text += &joint(&format!("a{}", i + 1), "revolute", (&parent, &child), &inside);
    }
    format!("{text}{more}</robot>\n")
}

/// Returns a simple arm with parallel and crossing axes.
fn parts() -> Vec<Part> {
    let axes = [
        [0.0, 0.0, 1.0],
        [0.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, -1.0, 0.0],
        [1.0, 0.0, 0.0],
    ];
    let part = |axis| Part { xyz: [0.1, 0.0, 0.2], rpy: [0.0; 3], axis, mass: 1.0, com: [0.05, 0.0, 0.02] };
    axes.map(part).to_vec()
}

fn six(names: &str) -> ArmChoice {
    ArmChoice { joints: Some(names.split(',').map(String::from).collect()), ..ArmChoice::default() }
}

fn changes(arm: &Arm, change: Change) -> Vec<String> {
    arm.warnings.iter().filter(|w| w.change == change).map(ToString::to_string).collect()
}

type Matrix = [[f64; 3]; 3];

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

fn applied(a: &Matrix, v: &[f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| (0..3).map(|k| a[i][k] * v[k]).sum())
}

/// Returns the rotation matrix for an angle about an axis, by Rodrigues' formula. This function does not use code of the importer.
fn turn(axis: [f64; 3], angle: f64) -> Matrix {
    let norm = axis.iter().map(|v| v * v).sum::<f64>().sqrt();
    let [x, y, z] = axis.map(|v| v / norm);
    let (s, c) = angle.sin_cos();
    let d = 1.0 - c;
    [
        [c + x * x * d, x * y * d - z * s, x * z * d + y * s],
        [y * x * d + z * s, c + y * y * d, y * z * d - x * s],
        [z * x * d - y * s, z * y * d + x * s, c + z * z * d],
    ]
}

/// Returns the potential energy (J) of the masses in the description.
fn energy(parts: &[Part], q: &[f64; 6], gravity: &[f64; 3]) -> f64 {
    let (mut rotation, mut place, mut sum) = (turn([1.0, 0.0, 0.0], 0.0), [0.0; 3], 0.0);
    for (p, q) in parts.iter().zip(q) {
        let moved = applied(&rotation, &p.xyz);
        place = std::array::from_fn(|i| place[i] + moved[i]);
        let [roll, pitch, yaw] = p.rpy;
        for next in [
            turn([0.0, 0.0, 1.0], yaw),
            turn([0.0, 1.0, 0.0], pitch),
            turn([1.0, 0.0, 0.0], roll),
            turn(p.axis, *q),
        ] {
            rotation = product(&rotation, &next);
        }
        let com = applied(&rotation, &p.com);
        sum -= p.mass * (0..3).map(|i| gravity[i] * (place[i] + com[i])).sum::<f64>();
    }
    sum
}

fn any_part() -> impl Strategy<Value = Part> {
    let vector = |most: f64| [-most..most, -most..most, -most..most];
    let special = prop_oneof![
        Just([0.0, 0.0, 1.0]),
        Just([0.0, 0.0, -1.0]),
        Just([0.0, -2.0, 0.0]),
        Just([1.0, 0.0, 0.0]),
        vector(1.0).prop_filter("a direction", |a| a.iter().any(|v| v.abs() > 0.01)),
    ];
    (vector(0.5), vector(3.0), special, 0.1..5.0, vector(0.3)).prop_map(|(xyz, rpy, axis, mass, com)| Part {
        xyz,
        rpy,
        axis,
        mass,
        com,
    })
}

proptest! {
    /// The gravity torques of the imported arm equal the gradient of the potential energy in the description.
    #[test]
    fn j40_any_axis_and_any_origin_are_the_same_arm(
        parts in prop::collection::vec(any_part(), 6),
        q in [-3.0..3.0, -3.0..3.0, -3.0..3.0, -3.0..3.0, -3.0..3.0, -3.0..3.0f64],
    ) {
        let gravity = [0.7, -1.3, -9.6];
        let arm = Arm::from_urdf(&robot(&parts, "")).unwrap();
        // Angles within 2 µrad of a multiple of π/2 are rounded to this multiple in the arm dynamics. Therefore the
        // test skips arms with such angles.
        let off = |angle: f64| (angle - FRAC_PI_2 * (angle / FRAC_PI_2).round()).abs();
        let angles = arm.model.joints.iter().flat_map(|origin| origin.rpy);
        prop_assume!(angles.map(off).all(|off| !(1e-9..3e-6).contains(&off)));
        let torque = Dynamics::new(&arm.model, gravity).gravity_torque(&q);
        for j in 0..6 {
            let at = |step: f64| {
                let mut q = q;
                q[j] += step;
                energy(&parts, &q, &gravity)
            };
            let slope = (at(1e-4) - at(-1e-4)) / 2e-4;
            prop_assert!((torque[j] - slope).abs() < 1e-5, "joint {}: {} {slope}", j + 1, torque[j]);
        }
    }
}

/// A plate between two joints and a tool after two fixed joints are merged into the links that carry them. The
/// resulting masses must equal the masses of links that already contain the plate and the tool.
#[test]
fn fixed_joints_are_merged_into_the_link_that_carries_them() {
    let flange =
        joint("flange", "fixed", ("b6", "tool0"), "<origin xyz=\"0 0 0.1\"/>") + "<link name=\"tool0\"/>";
    let tool = joint("mount", "fixed", ("tool0", "tool"), "<origin xyz=\"0.1 0 0\"/>")
        + &body("tool", 0.5, &[0.0; 3]);
    let text = robot(&parts(), &(flange + &tool));
    let arm = Arm::from_urdf(&text).unwrap();
    assert_eq!(arm.model.links[6].mass, 1.5);
    assert_eq!((arm.flange_name.as_str(), arm.link_names[6].as_str()), ("flange", "b6"));
    assert_eq!(changes(&arm, Change::Merged), ["link tool: 0.5 kg: merged into link b6"]);

    let plate = joint("bolt", "fixed", ("b2", "plate"), "<origin xyz=\"0 0.3 0\" rpy=\"0 0 1\"/>")
        + &body("plate", 0.2, &[0.0; 3]);
    let text = robot(&parts(), &plate)
        .replace("<parent link=\"b2\"/><child link=\"b3\"/>", "<parent link=\"plate\"/><child link=\"b3\"/>");
    let arm = Arm::from_urdf(&text).unwrap();
    assert_eq!(arm.model.links[2].mass, 1.2);
    let merged = changes(&arm, Change::Merged);
    assert!(
        merged.contains(&"joint bolt: is fixed: merged into joint a3, which this joint carries".to_owned()),
        "{merged:?}"
    );
    assert!(merged.contains(&"link plate: 0.2 kg: merged into link b2".to_owned()), "{merged:?}");
}

/// Fingers that mimic each other, a wheel and a slide are not part of the arm.
#[test]
fn j40_fingers_and_what_follows_them_are_left_out() {
    let finger = joint("left", "prismatic", ("b6", "l"), LIMIT) + &body("l", 0.1, &[0.0; 3]);
    let mimic = joint("right", "prismatic", ("b6", "r"), &format!("<mimic joint=\"left\"/>{LIMIT}"))
        + &body("r", 0.1, &[0.0; 3]);
    // In the first description, the joint `right` follows an arm joint, so the user does not need to select the six
    // joints. In the second description, a finger moves independently, so the user must select them.
    let follower = mimic.replace("\"left\"", "\"a1\"");
    let arm = Arm::from_urdf(&robot(&parts(), &follower)).unwrap();
    assert_eq!(
        changes(&arm, Change::LeftOut),
        ["joint right: prismatic, follows a1: is held at 0, because it is not one of the six joints"]
    );
    let text = robot(&parts(), &(finger + &mimic));
    let error = Arm::from_urdf(&text).unwrap_err().in_file("a.urdf".as_ref());
    assert!(error.to_string().contains("left (prismatic) moves as well"), "{error}");
    assert!(
        error.hint().contains("jtc arm import a.urdf --joints a1,a2,a3,a4,a5,a6 -o arm.toml"),
        "{}",
        error.hint()
    );
    let arm = Arm::from_urdf_with(&text, &six("a1,a2,a3,a4,a5,a6")).unwrap();
    assert_eq!(changes(&arm, Change::LeftOut).len(), 2);
    assert!((arm.model.links[6].mass - 1.2).abs() < 1e-12);
    let error = Arm::from_urdf_with(&text, &six("a1,a2,a3,a4,a5,right")).unwrap_err();
    assert!(error.to_string().contains("joint right: is prismatic, not rotary"), "{error}");
    let turning = text.replace("prismatic", "revolute");
    let error = Arm::from_urdf_with(&turning, &six("a2,a3,a4,a5,a6,right")).unwrap_err();
    assert!(error.to_string().contains("joint right: follows another joint (mimic)"), "{error}");
    assert!(error.hint().contains("--joints takes the names"), "{}", error.hint());
}

#[test]
fn five_axes_and_a_gripper_are_six_joints_with_a_word_about_it() {
    let text = robot(&parts(), "").replace("name=\"a6\"", "name=\"gripper\"");
    let doubt = changes(&Arm::from_urdf(&text).unwrap(), Change::Doubtful);
    assert!(doubt.len() == 1 && doubt[0].starts_with("joint gripper: seems to move a gripper"), "{doubt:?}");
    let named = Arm::from_urdf_with(&text, &six("a1,a2,a3,a4,a5,gripper")).unwrap();
    assert!(changes(&named, Change::Doubtful).is_empty(), "who names it means it");
}

#[test]
fn limits_that_are_missing_or_none_are_filled_in_and_known_as_such() {
    let third = |limit: &str| {
        let (before, after) =
            robot(&parts(), "").split_once("name=\"a3\"").map(|(a, b)| (a.to_owned(), b.to_owned())).unwrap();
        let text = format!("{before}name=\"a3\"{}", after.replacen(LIMIT, limit, 1));
        Arm::from_urdf(&text).unwrap_or_else(|e| panic!("{limit}: {e}"))
    };
    let three = jtc_wire::Joint::from_number(3);
    for (limit, filled) in [
        ("", &["position_min_rad", "position_max_rad", "velocity_max_rad_s", "torque_max_nm"][..]),
        ("<limit/>", &["position_min_rad", "position_max_rad", "velocity_max_rad_s", "torque_max_nm"]),
        ("<limit lower=\"-1\" upper=\"1\" effort=\"9\"/>", &["velocity_max_rad_s"]),
        ("<limit lower=\"-1\" upper=\"1\" effort=\"9\" velocity=\"-1\"/>", &["velocity_max_rad_s"]),
        ("<limit lower=\"-1\" upper=\"1\" velocity=\"1\"/>", &["torque_max_nm"]),
        ("<limit lower=\"-1\" upper=\"1\" effort=\"-9\" velocity=\"1\"/>", &["torque_max_nm"]),
        ("<limit effort=\"9\" velocity=\"1\"/>", &["position_min_rad", "position_max_rad"]),
    ] {
        let arm = third(limit);
        for key in ["position_min_rad", "position_max_rad", "velocity_max_rad_s", "torque_max_nm"] {
            let expected = if filled.contains(&key) { Source::Default } else { Source::File };
            assert_eq!(arm.sources.of((three, key)), expected, "{limit}: {key}");
        }
        let assumed = changes(&arm, Change::LimitAssumed);
        assert!(
            !assumed.is_empty() && assumed.iter().all(|w| w.starts_with("joint a3: ")),
            "{limit}: {assumed:?}"
        );
    }
    // If the torque limit is missing, the importer computes a limit from the masses of this arm. The importer does not
    // copy the limit of another arm.
    let text = robot(&parts(), "").replace("effort=\"50\"", "");
    let arm = Arm::import_text(&text, &ArmChoice::default()).unwrap();
    assert!(arm.joints.iter().all(|j| j.torque_max < 60.0 && j.torque_max > 0.5), "{:?}", arm.joints);
    let holding = arm.check().holding;
    assert!(holding.iter().all(|h| h.torque_nm <= 0.53 * h.limit_nm), "{holding:?}");
    let assumed = changes(&arm, Change::LimitAssumed);
    let words = format!("effort limit 0: {} N·m is used", arm.joints[1].torque_max);
    assert!(assumed.contains(&format!("joint a2: {words}")), "{assumed:?}");
}

/// An invalid limit is never replaced by the widest range of the drives, because the joint could then hit its end stops.
#[test]
fn position_limits_that_are_no_range_in_rad_are_refused_with_joint_and_rad() {
    let with = |limits: &str| {
        robot(&parts(), "").replacen("lower=\"-1.5\" upper=\"1.5\"", limits, 2).replacen(
            limits,
            "lower=\"-1\" upper=\"1\"",
            1,
        )
    };
    for (limits, words) in [
        (
            "lower=\"-90\" upper=\"90\"",
            "-90..90 rad exceed one turn. If they are degrees: -90° are -1.5708 rad, 90° are 1.5708 rad",
        ),
        ("lower=\"-170\" upper=\"170\"", "170° are 2.9671 rad"),
        (
            "lower=\"-1.57\" upper=\"90\"",
            "-1.57..90 rad exceed one turn. If they are degrees: 90° are 1.5708 rad. Write rad",
        ),
        ("lower=\"-90\" upper=\"1.57\"", "If they are degrees: -90° are -1.5708 rad. Write rad"),
        ("lower=\"0\" upper=\"150\"", "150° are 2.618 rad"),
        ("lower=\"-150\" upper=\"0\"", "-150° are -2.618 rad"),
        ("lower=\"-10\" upper=\"170\"", "-10° are -0.1745 rad, 170° are 2.9671 rad"),
        ("lower=\"-5\" upper=\"7\"", "7° are 0.1222 rad"),
        ("lower=\"10\" upper=\"12\"", "10° are 0.1745 rad, 12° are 0.2094 rad"),
        ("lower=\"-360\" upper=\"360\"", "360° are 6.2832 rad"),
        ("lower=\"-1e6\" upper=\"1e6\"", "type=\"continuous\" for a joint without stops"),
        ("lower=\"-inf\" upper=\"90\"", "90° are 1.5708 rad"),
        ("lower=\"nan\" upper=\"1\"", "position limit NaN is not a number"),
        ("lower=\"-1\" upper=\"NaN\"", "position limit NaN is not a number"),
        ("lower=\"0\" upper=\"0\"", "position limits 0..0 rad leave no range of motion"),
        ("lower=\"0.5\" upper=\"0.5\"", "position limits 0.5..0.5 rad leave no range of motion"),
        ("lower=\"0\"", "position limits 0..0 rad leave no range of motion"),
    ] {
        let text = with(limits);
        for error in [
            Arm::from_urdf(&text).expect_err(limits),
            Arm::import_text(&text, &ArmChoice::default()).expect_err(limits),
        ] {
            let error = error.to_string();
            assert!(error.starts_with(", joint a2: ") && error.contains(words), "{limits}: {error}");
        }
        // A continuous joint does not have end stops, so the reader accepts the joint with any limits.
        let endless = text.replacen("\"a2\" type=\"revolute\"", "\"a2\" type=\"continuous\"", 1);
        assert!(Arm::from_urdf(&endless).is_ok(), "{limits}");
    }
}

/// The reader keeps a position limit that is narrower than the limit of the drives. A missing limit is marked as a
/// default. A limit of more than one turn is reduced and marked.
#[test]
fn position_limits_in_rad_are_taken_and_an_open_side_is_marked() {
    let second = |limits: &str| {
        let text = robot(&parts(), "");
        let (before, after) = text.split_once("name=\"a2\"").unwrap();
        let after = after.replacen("lower=\"-1.5\" upper=\"1.5\"", limits, 1);
        Arm::import_text(&format!("{before}name=\"a2\"{after}"), &ArmChoice::default()).unwrap()
    };
    let (file, proposed) = (Source::File, Source::Proposed);
    for (limits, range, sources) in [
        ("lower=\"-1.57\" upper=\"1.2\"", (-1.57, 1.2), (file, file)),
        ("lower=\"-0.1\" upper=\"0\"", (-0.1, 0.0), (file, file)),
        ("upper=\"2\"", (0.0, 2.0), (file, file)),
        ("lower=\"-3.1416\" upper=\"3.1416\"", (-2.9905, 2.9905), (file, file)),
        ("lower=\"-6.2832\" upper=\"6.2832\"", (-2.9905, 2.9905), (file, file)),
        ("lower=\"-6.9813\" upper=\"6.9813\"", (-2.9905, 2.9905), (proposed, proposed)),
        (
            "lower=\"-12.566370614359172\" upper=\"12.566370614359172\"",
            (-2.9905, 2.9905),
            (proposed, proposed),
        ),
        ("lower=\"-1\" upper=\"inf\"", (-1.0, 2.9905), (file, proposed)),
        ("lower=\"-inf\" upper=\"1\"", (-2.9905, 1.0), (proposed, file)),
        ("lower=\"-inf\" upper=\"inf\"", (-2.9905, 2.9905), (proposed, proposed)),
        ("", (-2.9905, 2.9905), (proposed, proposed)),
    ] {
        let arm = second(limits);
        let joint = &arm.joints[1];
        assert_eq!((joint.position_min, joint.position_max), range, "{limits}");
        let two = jtc_wire::Joint::from_number(2);
        let of = |key| arm.sources.of((two, key));
        assert_eq!((of("position_min_rad"), of("position_max_rad")), sources, "{limits}");
        let marked =
            arm.check().findings.iter().any(|f| f.code == "proposed" && f.name == Some("position_max_rad"));
        assert_eq!(marked, sources.1 == proposed, "{limits}");
        assert_eq!(arm.sources.of((jtc_wire::Joint::from_number(3), "position_min_rad")), file, "{limits}");
    }
}

/// A velocity above the speed of any arm is probably in degrees per second, or is a placeholder. The reader assumes degrees per second,
/// because this speed is lower, and marks the value for the check.
#[test]
fn a_velocity_that_is_not_believed_is_marked_and_never_the_fastest_in_silence() {
    for (velocity, used, marked) in [
        ("1.2", 1.2, false),
        ("3.15", 1.5, false),
        ("7.33", 1.5, false),
        ("15.7", 1.5, false),
        ("17", 17f64.to_radians(), true),
        ("20", 20f64.to_radians(), true),
        ("30", 30f64.to_radians(), true),
        ("45", 45f64.to_radians(), true),
        ("85", 85f64.to_radians(), true),
        ("90", 1.5, true),
        ("100", 1.5, true),
        ("180", 1.5, true),
        ("1000", 1.5, true),
        ("1e30", 1.5, true),
    ] {
        let text = robot(&parts(), "").replacen("velocity=\"1.2\"", &format!("velocity=\"{velocity}\""), 1);
        let arm = Arm::import_text(&text, &ArmChoice::default()).unwrap();
        assert!(
            (arm.joints[0].velocity_max - used).abs() < 1e-9,
            "{velocity}: {}",
            arm.joints[0].velocity_max
        );
        let one = jtc_wire::Joint::from_number(1);
        let source = arm.sources.of((one, "velocity_max_rad_s"));
        assert_eq!(source == Source::Proposed, marked, "{velocity}");
        let found = arm.check().findings.into_iter().any(|f| {
            f.code == "proposed"
                && f.name == Some("velocity_max_rad_s")
                && f.finding.what.contains("joint 1; ")
        });
        assert_eq!(found, marked, "{velocity}");
        let said = changes(&arm, Change::LimitAssumed);
        assert_eq!(
            said.iter().any(|w| w.contains("too high for an arm in rad/s")),
            marked,
            "{velocity}: {said:?}"
        );
    }
}

#[test]
fn j43_limits_beyond_the_drives_are_cut_with_a_word_and_never_turned_around() {
    let with = |limit: &str| robot(&parts(), "").replacen(LIMIT, limit, 1);
    let arm =
        Arm::from_urdf(&with("<limit lower=\"0.8\" upper=\"5.5\" effort=\"900\" velocity=\"9\"/>")).unwrap();
    let j = arm.joints[0];
    assert_eq!((j.position_min, j.position_max, j.velocity_max, j.torque_max), (0.8, 2.9905, 1.5, 360.0));
    let cut = changes(&arm, Change::LimitCut);
    assert!(cut.len() == 3 && cut[0].contains("with the zero of the joint at 3.15 rad"), "{cut:?}");
    let error = Arm::from_urdf(&with("<limit lower=\"3.1\" upper=\"6.0\" effort=\"9\" velocity=\"1\"/>"))
        .unwrap_err();
    assert!(error.to_string().contains("joint a1: position limits 3.1..6 rad are outside"), "{error}");
    let error =
        Arm::from_urdf(&with("<limit lower=\"1\" upper=\"-1\" effort=\"9\" velocity=\"1\"/>")).unwrap_err();
    assert!(error.to_string().contains("joint a1: lower limit 1 is not below upper limit -1"), "{error}");
}

#[test]
fn what_cannot_be_read_is_named_with_its_place() {
    let good = robot(&parts(), "");
    let error_of = |from: &str, to: &str| {
        assert!(good.contains(from), "{from}");
        Arm::from_urdf(&good.replacen(from, to, 1)).expect_err(to).to_string()
    };
    let twice = format!("{LIMIT}{LIMIT}");
    for (from, to, place, problem) in [
        (
            "velocity=\"1.2\"",
            "velocity=\"fast\"",
            ", line 12, joint a1",
            "velocity is \"fast\", not a number",
        ),
        (LIMIT, twice.as_str(), ", line 13, joint a1", "second element <limit>, the first is in line 12"),
        ("<mass value=\"1\"/>", "<mass/>", ", line 7, link b1", "<mass> has no attribute value"),
        (
            "<mass value=\"1\"/>",
            "<mass value=\"1\"/><mass value=\"1\"/>",
            ", line 7, link b1",
            "second element <mass>, the first is in line 7",
        ),
        (
            "xyz=\"0.05 0 0.02\"",
            "xyz=\"0.05 0\"",
            ", line 7, link b1",
            "<origin> xyz has 2 numbers, expected 3",
        ),
        ("<child link=\"b1\"/>", "", ", line 9, joint a1", "has no element <child>"),
        ("type=\"revolute\"", "type=\"hinge\"", ", line 9, joint a1", "hinge"),
    ] {
        let text = error_of(from, to);
        assert!(text.contains(place) && text.contains(problem), "{to}: {text}");
    }
    assert!(error_of("</robot>", "").contains("is incomplete"));
    assert!(error_of("<inertial>", "<inertial").contains("link b0"));
    assert!(error_of("name=\"a2\"", "name=\"a3\"").contains("two joints are named a3"));
    assert!(error_of("name=\"b2\"", "name=\"b3\"").contains("two links are named b3"));
    assert!(
        error_of("<child link=\"b5\"/>", "<child link=\"b6\"/>")
            .contains("link b6 is the child of joints a5 and a6")
    );
    assert!(
        error_of("axis xyz=\"0 1 0\"", "axis xyz=\"0 0 0\"")
            .contains("joint a2: axis 0 0 0 has no direction")
    );
    // The reader ignores text in an XML comment.
    let text = good.replacen("<link", "<!-- <link name=\"b1\"> <limit> --><link", 1);
    assert_eq!(Arm::from_urdf(&text).unwrap().model, Arm::from_urdf(&good).unwrap().model);
}

#[test]
fn j06_masses_that_are_none_are_named_by_their_link() {
    let good = robot(&parts(), "");
    for (from, to, place) in [
        ("<mass value=\"1\"/>", "<mass value=\"-1\"/>", "link b1: link 1: mass is -1 kg"),
        ("<mass value=\"1\"/>", "<mass value=\"nan\"/>", "link b1: link 1: mass is NaN"),
        ("<mass value=\"1\"/>", "<mass value=\"0\"/>", "link b1: link 1: mass is 0"),
    ] {
        let text = Arm::parse(&good.replacen(from, to, 1)).expect_err(to).to_string();
        assert!(text.contains(place), "{text}");
    }
    let text = Arm::parse(&good.replace("izz=\"0.01\"", "izz=\"0.5\"")).unwrap_err().to_string();
    assert!(text.contains("link b1: link 1: largest principal moment"), "{text}");
}

/// If an arm is mounted upside down or on a wall, the proposed gravity still points down.
#[test]
fn gravity_is_proposed_as_the_description_mounts_the_arm() {
    let mount = |rpy: &str| {
        let world =
            joint("mount", "fixed", ("world", "b0"), &format!("<origin xyz=\"0 0 1\" rpy=\"{rpy}\"/>"));
        let arm =
            Arm::import_text(&robot(&parts(), &(world + "<link name=\"world\"/>")), &ArmChoice::default())
                .unwrap();
        assert_eq!(changes(&arm, Change::Base).len(), 1);
        assert_eq!(arm.sources.of((None, "gravity_m_s2")), Source::Proposed);
        arm.gravity.unwrap().map(|v| (v * 1e6).round() / 1e6)
    };
    assert_eq!(mount("0 0 1"), [0.0, 0.0, -9.81]);
    assert_eq!(mount("3.14159265358979 0 0"), [0.0, 0.0, 9.81]);
    // After a rotation by 90° about y, the x axis of the base points down.
    assert_eq!(mount("0 1.5707963267948966 0"), [9.81, 0.0, 0.0]);
}

/// The arm file that `jtc arm import` writes keeps the marks of the proposed values, and the check finds no problem in this file.
#[test]
fn proposals_are_marked_in_the_file_and_found_again() {
    let text = robot(&parts(), "").replacen(
        LIMIT,
        "<dynamics damping=\"0.5\" friction=\"0.25\"/><limit effort=\"50\"/>",
        1,
    );
    let arm = Arm::import_text(&text, &ArmChoice { friction: true, ..ArmChoice::default() }).unwrap();
    let file = arm.to_toml();
    let back = Arm::parse(&file).unwrap();
    assert_eq!(Arm { warnings: arm.warnings.clone(), ..back.clone() }, arm);
    assert!(back.warnings.len() == 1 && back.warnings[0].to_string().contains("`jtc arm check` lists them"));
    assert!(file.contains("#   pid: J is the least inertia"), "{file}");
    assert!(arm.settings_not_given().is_empty() && arm.parameter_set().missing().is_empty());
    assert_eq!(arm.polynomial.unwrap()[0], [0.25, 0.5, 0.0, 0.0, 0.0, 0.0]);
    assert_eq!(arm.polynomial.unwrap()[1], [0.0; 6]);
    let one = jtc_wire::Joint::from_number(1);
    assert_eq!(back.sources.of((one, "velocity_max_rad_s")), Source::Proposed);
    assert_eq!(back.sources.of((one, "torque_max_nm")), Source::File);
    assert!(!back.check().is_refused(), "{:?}", back.check());

    let marked = |from: &str, to: &str| Arm::parse(&file.replacen(from, to, 1)).unwrap_err().to_string();
    let text = marked("\"pid\"", "\"gains\"");
    assert!(text.contains("joint a1, proposed") && text.contains("\"gains\" is not a key"), "{text}");
    let list = file.lines().find(|l| l.starts_with("rotor_inertia")).unwrap();
    assert!(marked(list, "").contains("rotor_inertia_kg_m2 is listed as proposed, but has no value"));
}

/// Friction of a description is often made for a simulator, and too much compensation drives a joint. The import therefore compensates
/// friction only on request, but the file keeps the numbers in comments.
#[test]
fn friction_of_a_description_is_compensated_only_on_request() {
    let dynamics = "<dynamics damping=\"0.5\" friction=\"0.25\"/><limit effort=\"50\"/>";
    let text = robot(&parts(), "").replacen(LIMIT, dynamics, 1);
    let arm = Arm::import_text(&text, &ArmChoice::default()).unwrap();
    assert_eq!(arm.polynomial, Some([[0.0; 6]; 6]));
    let found = changes(&arm, Change::NotCarried);
    assert!(
        found.len() == 1 && found[0].contains("0.25 N·m") && found[0].contains("--friction"),
        "{found:?}"
    );
    let file = arm.to_toml();
    let comments = file.matches("# friction_polynomial = [0.25, 0.5, 0.0, 0.0, 0.0, 0.0]").count();
    assert_eq!(comments, 1, "{file}");
    assert_eq!(Arm::parse(&file).unwrap().polynomial, arm.polynomial);
}

/// A drive limits a torque above its maximum without a report, so an imported limit is cut to this maximum.
#[test]
fn an_effort_above_the_drive_of_the_joint_is_cut() {
    let mut text = robot(&parts(), "");
    text = text.replace(LIMIT, &LIMIT.replace("effort=\"50\"", "effort=\"140\""));
    assert!(text.contains("effort=\"140\""), "{text}");
    let arm = Arm::import_text(&text, &ArmChoice::default()).unwrap();
    assert_eq!(arm.joints.map(|j| j.torque_max), [140.0, 140.0, 140.0, 79.0, 79.0, 79.0]);
    let cut = changes(&arm, Change::LimitCut);
    assert!(cut.iter().filter(|c| c.contains("effort limit 140: 79 N·m")).count() == 3, "{cut:?}");
}
