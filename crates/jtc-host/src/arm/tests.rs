//! Tests of arm files and parameter files, and of the errors for invalid files.

use std::path::PathBuf;

use jtc_dynamics::{Dynamics, Origin};

use test_kit::existing;

use super::*;
use host_kit::Diagnose;

/// The values that the host reads from the delivered arm file equal the built-in defaults of the controller.
#[test]
fn the_delivered_arm_is_the_controller_s_default() {
    let arm = Arm::avena();
    assert_eq!(arm.config(), Config::avena());
    assert_eq!(arm.parameters(), Parameters::avena());
    assert!(arm.warnings.is_empty());
    arm.parameter_set().check().unwrap();
}

#[test]
fn a_file_of_another_kind_is_called_no_arm_file() {
    for (text, begin) in [("\nt,q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0,0\n", "t,q1,q2,q3,q4,q5,q6"), ("", "")] {
        let message = Arm::parse(text).unwrap_err().to_string();
        assert!(
            message.contains("not an arm file") && message.contains(&format!("\"{begin}\"")),
            "{message}"
        );
    }
    assert!(!Arm::parse("name = ").unwrap_err().to_string().contains("not an arm file"));
}

#[test]
fn an_arm_file_says_its_format_and_an_unknown_one_is_refused_by_name() {
    let whole = Arm::avena();
    assert!(AVENA_TOML.contains("\nformat = 2\n") && whole.to_toml().starts_with("format = 2\n"));
    // Older arm files do not have a `format` key. The reader reads these files in the same way.
    assert_eq!(Arm::parse(&AVENA_TOML.replace("\nformat = 2\n", "\n")).unwrap(), whole);
    for other in ["3", "1", "\"two\""] {
        // If the format number is not supported, the reader reports only this error, and not the unknown key
        // `new_key`.
        let text = AVENA_TOML.replace("\nformat = 2\n", &format!("\nformat = {other}\nnew_key = 1\n"));
        let message = Arm::parse(&text).unwrap_err().to_string();
        assert!(message.contains(&format!("format = {other} is not supported")), "{message}");
        assert!(message.contains("expected `format = 2`"), "{message}");
    }
}

/// Returns a simple robot description with six joints.
fn urdf(axis: &str, joint: &str) -> String {
    let arm = Arm::avena();
    let mut text = String::from("<robot name=\"t\"><link name=\"world\"/>");
    let three = |v: [f64; 3]| format!("{} {} {}", v[0], v[1], v[2]);
    for (i, l) in arm.model.links.iter().enumerate() {
        let [xx, xy, xz, yy, yz, zz] = l.inertia;
        text += &format!(
            "<link name=\"l{i}\"><inertial><origin xyz=\"{}\" rpy=\"{}\"/><mass value=\"{}\"/><inertia ixx=\"{xx}\" \
             ixy=\"{xy}\" ixz=\"{xz}\" iyy=\"{yy}\" iyz=\"{yz}\" izz=\"{zz}\"/></inertial></link>",
            three(l.origin.xyz),
            three(l.origin.rpy),
            l.mass
        );
    }
    text += "<link name=\"flange\"/>";
    text += "<joint name=\"base\" type=\"fixed\"><parent link=\"world\"/><child link=\"l0\"/></joint>";
    for (i, o) in arm.model.joints.iter().enumerate() {
        let (kind, child) = if i < 6 { (joint, format!("l{}", i + 1)) } else { ("fixed", "flange".into()) };
        text += &format!(
            "<joint name=\"j{}\" type=\"{kind}\"><origin xyz=\"{}\" rpy=\"{}\"/><parent link=\"l{i}\"/><child link=\"{child}\"/>\
             <axis xyz=\"{axis}\"/><limit lower=\"-1.5\" upper=\"1.5\" effort=\"50\" velocity=\"1.2\"/></joint>",
            i + 1,
            three(o.xyz),
            three(o.rpy)
        );
    }
    text + "</robot>"
}

#[test]
fn a_plain_urdf_is_carried_over_exactly() {
    let arm = Arm::parse(&urdf("0 0 1", "revolute")).unwrap();
    assert_eq!(arm.model, Arm::avena().model);
    assert_eq!(arm.joint_names[5], "j6");
    assert_eq!(
        (arm.joints[2].position_max, arm.joints[2].torque_max, arm.joints[2].velocity_max),
        (1.5, 50.0, 1.2)
    );
    assert!(arm.warnings.is_empty(), "{:?}", arm.warnings);
}

/// If all joint axes are −z instead of z, each joint turns in the opposite direction. For the mirrored motion, the
/// torques must have the same magnitude and the opposite sign.
#[test]
fn joints_about_minus_z_keep_positions_and_torques() {
    let (plain, turned) = (Arm::avena(), Arm::parse(&urdf("0 0 -1", "revolute")).unwrap());
    assert_eq!(turned.warnings.len(), 6);
    let gravity = [0.3, -0.2, -9.81];
    let (a, b) = (Dynamics::new(&plain.model, gravity), Dynamics::new(&turned.model, gravity));
    let q = [0.3, -0.7, 1.1, 0.4, -0.9, 2.0];
    let (v, acc) = ([0.5, -0.4, 0.3, 0.2, 0.7, -0.6], [1.0, 2.0, -3.0, 0.5, 0.1, 4.0]);
    let minus = |x: [f64; 6]| x.map(|x| -x);
    let expected = minus(a.inverse(&minus(q), &minus(v), &minus(acc)));
    for (x, y) in expected.iter().zip(b.inverse(&q, &v, &acc)) {
        assert!((x - y).abs() < 1e-9, "{x} {y}");
    }
}

/// A tool on the last link and a plate between two joints are merged into the links that carry them. The imported arm
/// equals an arm whose links have the combined masses.
#[test]
fn fixed_bodies_become_part_of_their_link() {
    let tool = "<link name=\"tool\"><inertial><origin xyz=\"0 0 0.1\"/><mass value=\"1\"/><inertia ixx=\"0.01\" ixy=\"0\" ixz=\"0\" \
                iyy=\"0.01\" iyz=\"0\" izz=\"0.01\"/></inertial></link><joint name=\"t\" type=\"fixed\"><origin xyz=\"0.2 0 0\"/>\
                <parent link=\"flange\"/><child link=\"tool\"/></joint></robot>";
    let arm = Arm::parse(&urdf("0 0 1", "revolute").replace("</robot>", tool)).unwrap();
    let link = arm.model.links[6];
    assert!((link.mass - 1.082).abs() < 1e-12);
    assert!((link.origin.xyz[0] - 0.2 / 1.082).abs() < 1e-12);
    assert!((link.origin.xyz[2] - (0.0181 + 0.1) / 1.082).abs() < 1e-12);
    // By the parallel-axis theorem, the inertia about z increases by the reduced mass times the squared distance. The
    // bodies have 1 kg and 0.082 kg, and their distance is 0.2 m.
    let izz = 8e-5 + 0.01 + 0.082 / 1.082 * 0.04;
    assert!((link.inertia[5] - izz).abs() < 1e-12, "{} {izz}", link.inertia[5]);
    assert!(arm.warnings.iter().any(|w| w.place == "link tool"));
}

#[test]
fn what_no_arm_of_ours_can_be_is_refused_by_name() {
    let error_of = |text: &str| Arm::parse(text).expect_err("accepted").to_string();
    assert!(error_of(&urdf("0 0 0", "revolute")).contains("no direction"));
    assert!(error_of("<robot name=\"x\"></robot>").contains("0 rotary joints"));
    // If the description has too few joints, another file format or another option would not help. Therefore the hint
    // must suggest neither.
    let hint = Arm::parse("<robot name=\"x\"></robot>").expect_err("accepted").hint();
    assert!(hint.contains("six revolute or continuous joints") && !hint.contains("help files"), "{hint}");
    assert!(error_of(&"<a>".repeat(100_000)).contains("nested"));
    // A `>` inside an attribute value does not end the tag, so these tags also count as nested.
    assert!(error_of(&"<a x='/>'>".repeat(60_000)).contains("nested"));
    assert!(error_of(&"<a x=\"'/>\">".repeat(60_000)).contains("nested"));
    assert!(
        error_of(&urdf("0 0 1", "revolute").replace("<mass value=\"7.5\"/>", "<mass value=\"-7.5\"/>"))
            .contains("arm model")
    );
    let toml = AVENA_TOML;
    assert!(error_of(&toml.replacen("mass_kg = 7.5", "mass_kg = -7.5", 1)).contains("arm model"));
    assert!(error_of(&toml.replacen("kp = ", "kq = ", 1)).contains("line"));
    assert!(
        error_of(&toml.replacen("torque_max_nm = 80.0", "torque_max_nm = -80.0", 1))
            .contains("torque_max_nm")
    );
    assert!(
        error_of(&toml.replacen("position_min_rad = -2.97", "position_min_rad = 4", 1))
            .contains("position_min_rad")
    );
}

/// Returns the URDF text of a joint of type `kind` on `parent`, with a link of 1 kg.
fn more(name: &str, kind: &str, parent: &str) -> String {
    format!(
        "<link name=\"of_{name}\"><inertial><mass value=\"1\"/><inertia ixx=\"0.01\" ixy=\"0\" ixz=\"0\" iyy=\"0.01\" \
         iyz=\"0\" izz=\"0.01\"/></inertial></link><joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/>\
         <child link=\"of_{name}\"/><axis xyz=\"0 0 1\"/><limit lower=\"-1\" upper=\"1\" effort=\"9\" velocity=\"1\"/></joint>\
         </robot>"
    )
}

#[test]
fn a_continuous_joint_has_the_working_area_of_its_drive() {
    let text = urdf("0 0 1", "continuous").replace("lower=\"-1.5\" upper=\"1.5\"", "");
    let arm = Arm::parse(&text).unwrap();
    assert_eq!(arm.model, Arm::avena().model);
    assert_eq!((arm.joints[1].position_min, arm.joints[1].position_max), (-2.9905, 2.9905));
    assert!(arm.warnings.iter().any(|w| w.place == "joint j2" && w.problem.contains("no position limits")));
}

/// The descriptions of a Z1, a UR with a gripper and a redundant arm have more than six joints. The error lists the additional joints and
/// the command that selects six joints.
#[test]
fn joints_beyond_the_arm_are_named_and_held_at_zero_once_the_arm_is_said() {
    let plain = urdf("0 0 1", "revolute");
    let with = |end: String| plain.replace("</robot>", &end);
    let error_of = |text: &str| Arm::parse(text).expect_err("accepted").to_string();

    let seven = with(more("gripper", "revolute", "flange"));
    let error = Arm::parse(&seven).expect_err("accepted").in_file(Path::new("z1.urdf"));
    let text = error.to_string();
    assert!(text.contains("7 rotary joints form a chain (j1, j2, j3, j4, j5, j6, gripper)"), "{text}");
    let command = "jtc arm import z1.urdf --joints j1,j2,j3,j4,j5,j6 -o arm.toml";
    assert!(error.hint().contains(command), "{}", error.hint());
    let finger = with(more("finger", "prismatic", "flange"));
    assert!(
        error_of(&finger).contains("6 rotary joints")
            && error_of(&finger).contains("finger (prismatic) moves as well")
    );
    let branch = with(more("head", "revolute", "l0"));
    assert!(error_of(&branch).contains("head (revolute) moves as well"), "{}", error_of(&branch));
    let five = plain.replacen("type=\"revolute\"", "type=\"fixed\"", 1);
    assert!(error_of(&five).contains("5 rotary joints form a chain (j2, j3, j4, j5, j6), expected six"));

    let names = |text: &str| Some(text.split(',').map(String::from).collect());
    let import = |text: &str, joints, tip: Option<&str>| {
        Arm::from_urdf_with(text, &ArmChoice { joints, tip: tip.map(String::from), friction: false })
    };
    for (text, body) in [(&seven, "gripper"), (&finger, "finger")] {
        let arm = import(text, names("j1,j2,j3,j4,j5,j6"), None).unwrap();
        assert_eq!(arm.model.joints, Arm::avena().model.joints);
        assert_eq!(arm.model.links[6].mass, Arm::avena().model.links[6].mass + 1.0, "it is carried");
        let held = |w: &Warning| w.place == format!("joint {body}") && w.problem.contains("held at 0");
        assert!(arm.warnings.iter().any(held), "{:?}", arm.warnings);
    }
    // If a tip link is selected, only joints on the path to this link belong to the arm.
    let arm = import(&seven, None, Some("flange")).unwrap();
    assert_eq!((arm.joint_names[5].as_str(), arm.model.joints[6]), ("j6", Arm::avena().model.joints[6]));
    let arm = import(&branch, None, Some("l6")).unwrap();
    assert_eq!(arm.model.joints[6], Origin::default(), "the flange is the tip");
    // The selected tip is the link that the gripper joint carries. The importer fixes this joint at position 0, so
    // the flange does not change.
    let arm = import(&seven, names("j1,j2,j3,j4,j5,j6"), Some("of_gripper")).unwrap();
    assert_eq!(arm.model.joints[6], Arm::avena().model.joints[6]);

    let refused =
        |joints: &str, tip: Option<&str>| import(&seven, names(joints), tip).unwrap_err().to_string();
    assert!(
        refused("j1,j2,j3,j4,j5,j8", None).contains("joint j8 does not exist; the moving joints are j1, j2")
    );
    assert!(refused("j1,j2,j3,j4,j5", None).contains("5 joints are named"));
    assert!(
        refused("j2,j1,j3,j4,j5,j6", None).contains("joint j1: is not carried by the joint named before it")
    );
    assert!(refused("j1,j2,j3,j4,j5,base", None).contains("joint base: is fixed, not rotary"));
    assert!(refused("j1,j2,j3,j4,j5,j6", Some("l2")).contains("link l2 is not carried by joint j6"));
    assert!(import(&seven, None, Some("tool")).unwrap_err().to_string().contains("link tool does not exist"));
    assert!(
        import(&seven, names("j1,j2,j3,j4,j5,x"), None)
            .unwrap_err()
            .hint()
            .contains("--joints takes the names")
    );
    assert!(
        import(&seven, None, Some("l5"))
            .unwrap_err()
            .to_string()
            .contains("check that --tip names the last link")
    );
}

/// The importer fixes a seventh joint in the middle of the chain at position 0. The imported arm equals the arm
/// without this joint.
#[test]
fn a_joint_that_is_held_keeps_its_place() {
    let plain = urdf("0 0 1", "revolute");
    let elbow = more("elbow", "revolute", "l3").replace("</robot>", "");
    let text = plain
        .replace("<parent link=\"l3\"/>", "<parent link=\"of_elbow\"/>")
        .replace("</robot>", &format!("{elbow}</robot>"));
    let choice =
        ArmChoice { joints: Some((1..7).map(|j| format!("j{j}")).collect()), ..ArmChoice::default() };
    let arm = Arm::from_urdf_with(&text, &choice).unwrap();
    assert_eq!(arm.model.links[3].mass, Arm::avena().model.links[3].mass + 1.0);
    let (a, b) = (&arm.model.joints[3], &Arm::avena().model.joints[3]);
    assert!(a.xyz.iter().zip(b.xyz).all(|(x, y)| (x - y).abs() < 1e-9), "{a:?} {b:?}");
}

#[test]
fn j35_j43_limits_that_the_drives_cannot_keep_are_refused_and_those_of_a_description_narrowed() {
    let error_of = |from: &str, to: &str| {
        Arm::parse(&AVENA_TOML.replacen(from, to, 1)).expect_err("accepted").to_string()
    };
    let text = error_of("position_max_rad = 2.9\n", "position_max_rad = 3.05\n");
    assert!(text.contains("joint_3") && text.contains("3.05") && text.contains("2.9905"), "{text}");
    let text = error_of("velocity_max_rad_s = 1.5", "velocity_max_rad_s = 3.15");
    assert!(text.contains("joint_1") && text.contains("3.780"), "{text}");
    let wide = urdf("0 0 1", "revolute").replace("\"1.5\"", "\"6.28\"").replace("\"1.2\"", "\"3.15\"");
    let arm = Arm::parse(&wide).unwrap();
    assert_eq!((arm.joints[2].position_min, arm.joints[2].position_max), (-1.5, 2.9905));
    assert_eq!(arm.joints[2].velocity_max, 1.5);
    assert_eq!(arm.warnings.len(), 12, "{:?}", arm.warnings);
    let used = |w: &Warning| w.place == "joint j3" && w.problem.contains("1.5 rad/s is used");
    assert!(arm.warnings.iter().any(used), "{:?}", arm.warnings);
}

#[test]
fn parts_of_an_arm_file_may_be_missing() {
    let no_gains: String = AVENA_TOML
        .lines()
        .filter(|l| !l.starts_with("pid") && !l.starts_with("friction_polynomial"))
        .map(|l| format!("{l}\n"))
        .collect();
    let arm = Arm::parse(&no_gains).unwrap();
    assert!(arm.pid.is_none() && arm.polynomial.is_none() && arm.table.is_some());
    let one: String = AVENA_TOML.replacen("pid = ", "# pid = ", 1);
    assert!(Arm::parse(&one).unwrap_err().to_string().contains("pid is missing"));
}

#[test]
fn arms_come_back_from_their_own_files() {
    let mut arm = Arm::avena();
    assert_eq!(Arm::parse(&arm.to_toml()).unwrap(), arm);
    arm.table.as_mut().unwrap()[3].torque[2][1] = 7.5;
    arm.name = "a \"b\" <c>".into();
    assert_eq!(Arm::parse(&arm.to_toml()).unwrap(), arm);
    let back = Arm::parse(&arm.to_urdf()).unwrap();
    assert_eq!((&back.model, &back.joint_names, &back.name), (&arm.model, &arm.joint_names, &arm.name));
    assert_eq!((back.joints[1].torque_max, back.joints[4].position_min), (180.0, -2.97));
    assert!(back.warnings.is_empty(), "{:?}", back.warnings);
}

#[test]
fn a_reversed_polynomial_file_is_noticed() {
    let Some(c) = Arm::avena().polynomial else { panic!() };
    let text = |rows: &[[f64; 6]], n: usize, reverse: bool| -> String {
        rows.iter()
            .map(|r| {
                let mut cells: Vec<String> = r[..n].iter().map(f64::to_string).collect();
                if reverse {
                    cells.reverse();
                }
                cells.join(",") + "\n"
            })
            .collect()
    };
    for n in [4, 6] {
        assert!(csv::read(&text(&c, n, false)).is_ok());
        let error = csv::read(&text(&c, n, true)).expect_err("accepted").to_string();
        assert!(error.contains("descending"), "{error}");
    }
}

#[test]
fn the_existing_parameter_files_are_read() {
    let arm = Arm::avena();
    let load = |name| existing::file(name).map(|p| ParameterFile::load(&p).unwrap());
    if let Some(file) = load("FricPolynomialCoeffs.csv") {
        assert_eq!(file.polynomial, arm.polynomial);
    }
    let six = |head: &str| -> Option<ParameterFile> {
        let paths: Option<Vec<PathBuf>> = (0..6).map(|j| existing::file(&format!("{head}{j}.csv"))).collect();
        paths.map(|paths| ParameterFile::load_all(&paths).unwrap())
    };
    if let Some(file) = six("FricTableJoint") {
        assert_eq!((file.table, file.warnings.len()), (arm.table.clone(), 0));
    }
    if let Some(file) = load("friction_table_default.csv") {
        assert_eq!(file.table, arm.table);
    }
    if let Some(file) = six("PidParamJoint") {
        assert_eq!(file.pid, arm.pid);
    }
    if let Some(file) = load("model_default.txt") {
        let model = file.model.unwrap();
        // The old default arm differs from the present default arm only in the sign of the z offset of joint 4.
        assert_eq!((model.joints[3].xyz[2], model.links), (0.005, arm.model.links));
    }
    if let Some(file) = load("avena_arm_id.urdf") {
        let found = file.arm.unwrap();
        assert_eq!(found.joint_names[0], "avena_joint_1");
        assert_eq!((found.model.links[2].mass, found.joints[1].torque_max), (9.0, 180.0));
        let limits = file.warnings.iter().filter(|w| w.problem.contains("velocity limit 0: 1.5")).count();
        let area = file.warnings.iter().filter(|w| w.problem.contains("working area")).count();
        assert_eq!((limits, area, file.warnings.len()), (6, 4, 10), "{:?}", file.warnings);
    }
    if let Some(file) = load("Avena.urdf") {
        let found = file.arm.unwrap();
        assert_eq!(found.model.joints[6].xyz, [0.0, 0.0, 0.0181]);
        assert_eq!(found.joints[2].position_max, 2.9905);
        assert!(file.warnings.iter().any(|w| w.problem.contains("no position limits")));
    }
    if let Some(dir) = existing::file("Avena.urdf").and_then(|p| p.parent().map(Path::to_owned)) {
        let file = ParameterFile::load(&dir).unwrap();
        assert!(
            file.polynomial.is_some() && file.table.is_some() && file.pid.is_some() && file.model.is_none()
        );
    }
}

/// Writes the gains of one joint in the format of the existing programs. Each joint has its own Kp.
fn gains_file(dir: &Path, joint: usize) -> PathBuf {
    let path = dir.join(format!("PidParamJoint{joint}.csv"));
    std::fs::write(&path, format!("{},10,5,-1,1\n", 1000 + joint)).unwrap();
    path
}

#[test]
fn gains_of_one_joint_are_never_those_of_six() {
    let dir = tempfile::tempdir().unwrap();
    let all: Vec<PathBuf> = (0..6).map(|j| gains_file(dir.path(), j)).collect();
    let kp = |file: ParameterFile| file.pid.unwrap().map(|g| g.kp);
    let expected = [1000.0, 1001.0, 1002.0, 1003.0, 1004.0, 1005.0];
    assert_eq!(kp(ParameterFile::load_all(&all).unwrap()), expected);
    let backwards: Vec<PathBuf> = all.iter().rev().cloned().collect();
    assert_eq!(kp(ParameterFile::load_all(&backwards).unwrap()), expected);
    assert_eq!(kp(ParameterFile::load(dir.path()).unwrap()), expected);

    // The test passes only one of the six existing files to the loader. The loader reads no other file, so it reports
    // that five files are missing.
    let error_of = |paths: &[PathBuf]| ParameterFile::load_all(paths).unwrap_err().to_string();
    let text = error_of(&all[2..3]);
    assert!(
        text.contains("PidParamJoint0.csv (joint 1)") && text.contains("PidParamJoint5.csv (joint 6)"),
        "{text}"
    );
    assert!(!text.contains("(joint 3)"), "{text}");
    let text = error_of(&[&all[..3], &all[4..]].concat());
    assert!(text.contains("missing: ") && text.contains("PidParamJoint3.csv (joint 4). "), "{text}");
    assert!(error_of(&[&all[..], &all[..1]].concat()).contains("joint 1"));

    // In this case, the file of one joint is missing in the directory.
    std::fs::remove_file(&all[3]).unwrap();
    let text = ParameterFile::load(dir.path()).unwrap_err().to_string();
    assert!(text.contains("PidParamJoint3.csv (joint 4)") && !text.contains("(joint 5)"), "{text}");

    let nameless = dir.path().join("gains.csv");
    std::fs::write(&nameless, "1000,10,5,-1,1\n").unwrap();
    assert!(error_of(&[nameless]).contains("has no joint number"));
}
