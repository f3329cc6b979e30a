//! Tests of the XML reader: parts that the importer does not use, other formats, values that are missing or impossible,
//! joints that follow another joint.

use std::path::Path;

use host_kit::{Diagnose, Severity};

use crate::arm::{Arm, ArmChoice, Change};

/// Returns a description of an arm that passes the check. Each joint and each link has its own line.
fn arm() -> String {
    let bodies = [
        ("0 0 0.05", 5.0, 0.02),
        ("0 0 0.1", 4.0, 0.02),
        ("0 0 0.18", 5.0, 0.05),
        ("0.05 0 0", 3.0, 0.02),
        ("0.1 0 0", 2.0, 0.01),
        ("0.04 0 0", 1.0, 0.003),
        ("0.02 0 0", 0.5, 0.0006),
    ];
    let joints = [
        ("0 0 0.12", "0 0 1", 150),
        ("0 0 0.18", "0 1 0", 180),
        ("0 0 0.38", "0 1 0", 110),
        ("0.11 0 0", "1 0 0", 45),
        ("0.24 0 0", "0 1 0", 40),
        ("0.08 0 0", "1 0 0", 30),
    ];
    let mut text = String::from("<?xml version=\"1.0\"?>\n<robot name=\"sample\">\n");
    for (i, (com, mass, moment)) in bodies.iter().enumerate() {
        text += &format!(
            "<link name=\"l{i}\"><inertial><origin xyz=\"{com}\"/><mass value=\"{mass}\"/><inertia ixx=\"{moment}\" ixy=\"0\" ixz=\"0\" \
             iyy=\"{moment}\" iyz=\"0\" izz=\"{moment}\"/></inertial></link>\n"
        );
    }
    for (i, (xyz, axis, effort)) in joints.iter().enumerate() {
        let n = i + 1;
        text += &format!(
            "<joint name=\"j{n}\" type=\"revolute\"><origin xyz=\"{xyz}\"/><parent link=\"l{i}\"/><child link=\"l{n}\"/><axis xyz=\"{axis}\"/>\
             <limit lower=\"-2.7\" upper=\"2.7\" effort=\"{effort}\" velocity=\"1.5\"/></joint>\n"
        );
    }
    text + "</robot>\n"
}

/// Returns the description with `more` in front of its end.
fn with(more: &str) -> String {
    arm().replace("</robot>", &format!("{more}\n</robot>"))
}

fn import(text: &str) -> Result<Arm, crate::file::FileError> {
    Arm::import_text(text, &ArmChoice::default())
}

fn changes(arm: &Arm, change: Change) -> Vec<String> {
    arm.warnings.iter().filter(|w| w.change == change).map(ToString::to_string).collect()
}

#[test]
fn what_the_importer_does_not_use_cannot_refuse_an_arm() {
    let plain = import(&arm()).unwrap();
    let in_link =
        |inner: &str| arm().replacen("<link name=\"l2\">", &format!("<link name=\"l2\">{inner}"), 1);
    let in_joint =
        |inner: &str| arm().replacen("<axis xyz=\"1 0 0\"/>", &format!("<axis xyz=\"1 0 0\"/>{inner}"), 1);
    for text in [
        in_link(
            "<visual><geometry><box size=\"1\"/></geometry><material name=\"a\"><color rgba=\"0.2 0.2 0.2\"/></material></visual>",
        ),
        in_link("<visual><material name=\"a\"><texture/></material></visual>"),
        in_link("<visual><material name=\"a\"/><material name=\"b\"/></visual>"),
        in_link("<visual/><visual><origin xyz=\"x\"/></visual>"),
        in_link("<collision><geometry><plane normal=\"0 0 1\"/></geometry></collision>"),
        in_link(
            "<visual><geometry><mesh scale=\"0.001\" filename=\"$(find a)/${b}.stl\"/></geometry></visual>",
        ),
        in_link("<visual name=a b='c' b='d'>a & b &c; &lt;</visual>"),
        in_link("<!-- ${a} <xacro:if> -- > --><![CDATA[<xacro:if>]]><?a ${b}?>"),
        in_joint("<drake:joint drake:a=\"1\"/><sensor:x/>"),
        in_joint("<calibration rising=\"x\"/><safety_controller k_velocity=\"x\"/>"),
        arm().replacen("<limit ", "<limit drake:acceleration=\"x\" soft=\"y\" ", 1),
        arm().replacen(
            "<robot name",
            "<!DOCTYPE robot><robot xmlns:xacro=\"http://www.ros.org/wiki/xacro\" version=\"1.0\" name",
            1,
        ),
        with(
            "<material name=\"a\"/><material name=\"a\"/><gazebo><a><b c=\"${d}\"/></a></gazebo><mujoco><compiler/></mujoco>",
        ),
        with("<transmission name=\"t\"><joint name=\"j1\"/><joint name=\"j1\"/></transmission>"),
        with(
            "<link name=\"x\"/><joint name=\"y\" type=\"fixed\"><parent link=\"x\"/><child link=\"l0\"/><limit/><limit lower=\"a\"/></joint>",
        ),
        format!("\u{feff}{}", arm()),
        arm().replace('\n', "\r\n"),
    ] {
        let read = import(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
        assert_eq!((read.model, read.joints), (plain.model, plain.joints), "{text}");
    }
    // Other readers use the first axis, so the importer does, too.
    let text = in_joint("<axis xyz=\"0 1 0\"/>");
    let read = import(&text).unwrap();
    assert_eq!(read.model, plain.model);
    assert!(
        changes(&read, Change::Doubtful).concat().contains("joint j4: has 2 axes"),
        "{:?}",
        read.warnings
    );
}

#[test]
fn a_file_is_read_in_its_own_encoding() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.urdf");
    let umlaut = arm().replace("<robot name=\"sample\">", "<robot name=\"pr\u{fc}f\"><!-- \u{fc} -->");
    let latin =
        |text: &str| -> Vec<u8> { text.chars().map(|c| u8::try_from(c as u32).unwrap_or(b'?')).collect() };
    let declared = umlaut.replace("version=\"1.0\"", "version=\"1.0\" encoding='ISO-8859-1'");
    let wide = |big: bool, mark: bool| -> Vec<u8> {
        let text = if mark { format!("\u{feff}{umlaut}") } else { umlaut.clone() };
        text.encode_utf16()
            .flat_map(|unit| if big { unit.to_be_bytes() } else { unit.to_le_bytes() })
            .collect()
    };
    for bytes in [
        latin(&declared),
        wide(false, true),
        wide(true, true),
        wide(false, false),
        wide(true, false),
        format!("\u{feff}{umlaut}").into_bytes(),
        umlaut.clone().into_bytes(),
    ] {
        std::fs::write(&path, bytes).unwrap();
        let read = Arm::import(&path, &ArmChoice::default()).unwrap();
        assert_eq!(read.name, "pr\u{fc}f");
    }
    // The bytes of a comment need not be valid.
    std::fs::write(&path, latin(&arm().replace("<robot", "<!-- gepr\u{fc}ft --><robot"))).unwrap();
    assert!(Arm::load(&path).is_ok());
}

#[test]
fn xacro_mjcf_and_sdf_are_named_with_the_command_that_converts_them() {
    let file = Path::new("my.xacro");
    let hint = |text: &str| {
        let error = import(text).expect_err(text).in_file(file);
        (error.to_string(), error.hint())
    };
    let spaced = arm().replace("<robot ", "<robot xmlns:x=\"http://wiki.ros.org/xacro\" ");
    for text in [
        with("<xacro:if value=\"true\"><link name=\"g\"/></xacro:if>"),
        with("<gazebo><xacro:g/></gazebo>"),
        spaced.replace("</robot>", "<x:call/></robot>"),
        spaced.replace("</robot>", "<include filename=\"a\"/></robot>"),
        with("<include filename=\"$(find a)/b.xacro\"/>"),
        arm().replacen("0 0 0.38", "0 0 ${a}", 1),
        arm().replacen("value=\"4\"", "value=\"$(arg m)\"", 1),
        arm().replacen("name=\"l3\"", "name=\"${p}l3\"", 1),
        "<robot xmlns:xacro=\"http://ros.org/wiki/xacro\"><xacro:macro name=\"a\"/></robot>".to_owned(),
    ] {
        let (error, next) = hint(&text);
        assert!(error.contains("the file is xacro, not URDF") && error.contains(", line "), "{error}");
        assert!(next.contains("`xacro my.xacro > arm.urdf`"), "{next}");
    }
    let (error, next) = hint("<?xml version='1.0'?>\n<mujoco model=\"a\"><worldbody/></mujoco>");
    assert!(
        error.contains("line 2: <mujoco>: the file is MJCF") && next.contains("convert("),
        "{error} {next}"
    );
    let (error, next) = hint("<sdf version=\"1.6\"><model name=\"a\"/></sdf>");
    assert!(
        error.contains("the file is SDF") && next.contains("sdf2urdf.py my.xacro arm.urdf"),
        "{error} {next}"
    );
    assert!(hint("<html><body/></html>").0.contains("the root element is <html>, expected <robot>"));
}

#[test]
fn files_that_only_cost_time_or_memory_are_refused() {
    let bomb = "<!DOCTYPE r [<!ENTITY a \"aaaa\"><!ENTITY b \"&a;&a;\">]>";
    let text = arm().replacen("<robot", &format!("{bomb}<robot"), 1);
    assert!(import(&text).unwrap_err().to_string().contains("line 2: the file declares XML entities"));
    let many: String = (0..2000).map(|i| format!("<link name=\"m{i}\"/>")).collect();
    assert!(import(&with(&many)).unwrap_err().to_string().contains("more than 1000 joints or links"));
    let deep = with(&"<a>".repeat(100));
    assert!(import(&deep).unwrap_err().to_string().contains("nested"));
}

#[test]
fn missing_masses_are_all_listed_and_the_file_is_written() {
    let without = |n: usize| {
        let text = arm();
        let begin = text.find(&format!("<link name=\"l{n}\">")).unwrap();
        let end = begin + text[begin..].find('\n').unwrap();
        text.replacen(&text[begin..end].to_owned(), &format!("<link name=\"l{n}\"/>"), 1)
    };
    let (two, four) = (without(2), without(4));
    let line = |text: &str, n: usize| {
        text.lines().find(|l| l.contains(&format!("<link name=\"l{n}\""))).unwrap().to_owned()
    };
    let text = two.replace(&line(&two, 4), &line(&four, 4));
    for text in [text.clone(), text.replacen("effort=\"110\" ", "", 1)] {
        let arm = import(&text).unwrap();
        assert_eq!(changes(&arm, Change::Missing).len(), 4, "{:?}", arm.warnings);
        let file = arm.to_toml();
        assert!(Arm::parse(&file).unwrap_err().to_string().contains("missing"), "{file}");
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.toml");
        std::fs::write(&path, &file).unwrap();
        for arm in [Arm::load_unchecked(&path).unwrap(), arm] {
            let checked = arm.check();
            assert!(checked.is_refused());
            let all: Vec<&str> = checked.findings.iter().map(|f| f.finding.what.as_str()).collect();
            assert!(all.contains(&"mass_kg: missing for links l2, l4"), "{all:?}");
            assert!(all.contains(&"inertia_kg_m2: missing for links l2, l4"), "{all:?}");
            assert!(!checked.findings.iter().any(|f| f.finding.severity == Severity::Good), "{all:?}");
            // A value that the file lacks is missing, not 0.
            assert!(checked.findings.iter().all(|f| f.value != Some(0.0)), "{all:?}");
        }
    }
    let no_inertia = arm().replacen(
        "<inertia ixx=\"0.05\" ixy=\"0\" ixz=\"0\" iyy=\"0.05\" iyz=\"0\" izz=\"0.05\"/>",
        "",
        1,
    );
    let all = import(&no_inertia).unwrap().check().findings;
    assert!(all.iter().any(|f| f.finding.what == "inertia_kg_m2: missing for link l2"), "{all:?}");
}

#[test]
fn j06_the_inertia_of_the_base_is_left_out_with_a_word() {
    let text = arm().replacen("izz=\"0.02\"", "izz=\"0.5\"", 1);
    let read = import(&text).unwrap();
    assert_eq!((read.model.links[0].inertia, read.model.links[0].mass), ([0.0; 6], 5.0));
    let said = changes(&read, Change::NotCarried);
    assert!(said.concat().contains("link l0: largest principal moment"), "{said:?}");
    assert!(!read.check().is_refused());
    let read = import(&arm().replacen("value=\"5\"", "value=\"-5\"", 1)).unwrap();
    assert_eq!(read.model.links[0].mass, 0.0);
}

#[test]
fn j06_an_inertia_that_is_wrong_by_rounding_is_written_and_found() {
    let triangle = |izz: &str| {
        let text = arm().replace(
            "ixx=\"0.01\" ixy=\"0\" ixz=\"0\" iyy=\"0.01\"",
            "ixx=\"0.01\" ixy=\"0\" ixz=\"0\" iyy=\"0.0034\"",
        );
        text.replace("izz=\"0.01\"", &format!("izz=\"{izz}\""))
    };
    let read = import(&triangle("0.0135")).unwrap();
    assert!(changes(&read, Change::Impossible).concat().contains("0.0135"), "{:?}", read.warnings);
    let checked = read.check();
    assert!(
        checked.is_refused()
            && checked.findings.iter().any(|f| f.code == "physical" && f.value == Some(0.0135))
    );
    let error =
        import(&triangle("0.02").replacen("iyy=\"0.003\"", "iyy=\"0.3\"", 1)).unwrap_err().to_string();
    assert!(error.contains("link l4") && error.contains("link 5"), "all links are named: {error}");
}

#[test]
fn a_body_that_does_not_fit_the_arm_is_found() {
    let finding = |from: &str, to: &str| {
        assert!(arm().contains(from), "{from}");
        let checked = import(&arm().replacen(from, to, 1)).unwrap().check();
        let body =
            checked.findings.iter().find(|f| f.code == "body").unwrap_or_else(|| panic!("{to}: {checked:?}"));
        let consistent = checked.findings.iter().any(|f| f.code == "physical");
        assert!(!consistent, "{to}");
        (body.finding.severity, body.finding.what.clone())
    };
    let six = "ixx=\"0.0006\" ixy=\"0\" ixz=\"0\" iyy=\"0.0006\" iyz=\"0\" izz=\"0.0006\"";
    let moments = |m: &str| format!("ixx=\"{m}\" ixy=\"0\" ixz=\"0\" iyy=\"{m}\" iyz=\"0\" izz=\"{m}\"");
    let (severity, what) = finding(six, &moments("1"));
    assert!(
        severity == Severity::Problem && what.contains("link l6: 0.5 kg with an inertia of 1 kg·m²"),
        "{what}"
    );
    let (severity, what) = finding(six, &moments("0.2"));
    assert!(severity == Severity::Warning && what.contains("radius of gyration of 0.632 m"), "{what}");
    let (severity, what) = finding("xyz=\"0.02 0 0\"", "xyz=\"20 0 0\"");
    assert!(severity == Severity::Problem && what.contains("link l6: its centre of mass is 20 m"), "{what}");
    let (severity, what) = finding("xyz=\"0 0 0.38\"", "xyz=\"0 0 380\"");
    assert!(severity == Severity::Problem && what.contains("the origin of joint j3 is 380 m"), "{what}");
    let good = import(&arm()).unwrap().check();
    assert!(good.findings.iter().any(|f| f.code == "physical" && f.finding.severity == Severity::Good));
    assert!(!Arm::avena().check().findings.iter().any(|f| f.code == "body"));
}

#[test]
fn j40_a_continuous_joint_keeps_its_narrower_limits() {
    let with = |limits: &str| {
        let text = arm().replacen("\"j6\" type=\"revolute\"", "\"j6\" type=\"continuous\"", 1);
        let (head, tail) = text.split_once("\"j6\"").unwrap();
        let arm =
            import(&format!("{head}\"j6\"{}", tail.replacen("lower=\"-2.7\" upper=\"2.7\"", limits, 1)))
                .unwrap();
        (arm.joints[5].position_min, arm.joints[5].position_max, changes(&arm, Change::LimitAssumed).concat())
    };
    for (limits, min, max, said) in [
        ("lower=\"-1\" upper=\"1\"", -1.0, 1.0, ""),
        ("lower=\"-1\"", -1.0, 0.0, ""),
        ("lower=\"-1\" upper=\"90\"", -1.0, 2.9905, "-1..90 of a continuous joint"),
        ("lower=\"-90\" upper=\"90\"", -2.9905, 2.9905, "-90..90 of a continuous joint"),
        ("lower=\"0\" upper=\"0\"", -2.9905, 2.9905, "0..0 of a continuous joint"),
        ("lower=\"1\" upper=\"-1\"", -2.9905, 2.9905, "1..-1 of a continuous joint"),
        ("", -2.9905, 2.9905, "no position limits"),
    ] {
        let (low, high, words) = with(limits);
        assert_eq!((low, high), (min, max), "{limits}");
        assert!(words.contains(said) && (said.is_empty() == words.is_empty()), "{limits}: {words}");
    }
}

/// A joint that follows another joint is fixed at the position that follows from its leader, or the arm is refused.
#[test]
fn j40_a_mimic_joint_is_right_at_any_place_or_refused() {
    let between = |mimic: &str| {
        arm().replace("<parent link=\"l2\"/>", "<parent link=\"m\"/>").replace(
            "</robot>",
            &format!(
                "<link name=\"m\"/><link name=\"w\"/><joint name=\"passive\" type=\"revolute\"><origin xyz=\"0 0 0.1\"/><parent link=\"l2\"/><child \
                 link=\"m\"/><axis xyz=\"0 1 0\"/>{mimic}</joint><joint name=\"wheel\" type=\"continuous\"><parent link=\"l0\"/><child \
                 link=\"w\"/></joint></robot>"
            ),
        )
    };
    let six = ArmChoice { joints: Some((1..=6).map(|n| format!("j{n}")).collect()), ..ArmChoice::default() };
    let read = |mimic: &str| Arm::import_text(&between(mimic), &six);
    let error = read("<mimic joint=\"j2\" multiplier=\"-1\"/>").unwrap_err().to_string();
    assert!(
        error.contains("joint passive follows joint j2 (mimic) and is itself a part of the chain"),
        "{error}"
    );
    let turned = read("<mimic joint=\"wheel\" multiplier=\"2\" offset=\"0.3\"/>").unwrap();
    let fixed = between("").replace(
        "\"passive\" type=\"revolute\"><origin xyz=\"0 0 0.1\"/>",
        "\"passive\" type=\"fixed\"><origin xyz=\"0 0 0.1\" rpy=\"0 0.3 0\"/>",
    );
    let fixed = Arm::import_text(&fixed, &six).unwrap();
    let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
    for (a, b) in turned.model.joints.iter().zip(&fixed.model.joints) {
        assert!((0..3).all(|i| near(a.xyz[i], b.xyz[i]) && near(a.rpy[i], b.rpy[i])), "{a:?} {b:?}");
    }
    assert!(
        changes(&turned, Change::LeftOut)
            .concat()
            .contains("passive: revolute, follows wheel: is held at 0.3")
    );
    assert!(read("<mimic joint=\"passive\"/>").unwrap_err().to_string().contains("follows itself"));
    // A rod at the side of the arm: its mass moves relative to its link, so a heavy rod is refused.
    let rod = |mass: f64| {
        with(&format!(
            "<link name=\"rod\"><inertial><mass value=\"{mass}\"/><inertia ixx=\"0.001\" iyy=\"0.001\" izz=\"0.001\"/></inertial></link><joint \
             name=\"r\" type=\"revolute\"><parent link=\"l1\"/><child link=\"rod\"/><mimic joint=\"j2\"/></joint>"
        ))
    };
    let light = import(&rod(0.1)).unwrap();
    assert!(
        changes(&light, Change::Doubtful).concat().contains("joint r: follows joint j2, so its 0.1 kg move")
    );
    assert!(
        import(&rod(3.0))
            .unwrap_err()
            .to_string()
            .contains("joint r follows joint j2 (mimic) and moves 3 kg")
    );
}

#[test]
fn the_hint_for_joints_names_the_arm_of_the_robot() {
    let chain = |names: &[&str]| {
        let mut text = String::from("<robot name=\"r\"><link name=\"0\"/>");
        for (i, name) in names.iter().enumerate() {
            let n = i + 1;
            text += &format!(
                "<link name=\"{n}\"/><joint name=\"{name}\" type=\"revolute\"><parent link=\"{i}\"/><child link=\"{n}\"/></joint>"
            );
        }
        let error = import(&(text + "</robot>")).unwrap_err();
        format!("{error} {}", error.hint())
    };
    let hint =
        chain(&["base_joint1", "base_joint2", "a1", "a2", "a3", "a4", "a5", "a6", "a7", "left_finger"]);
    assert!(hint.contains("--joints a1,a2,a4,a5,a6,a7 "), "{hint}");
    let hint = chain(&["shoulder_pan", "shoulder_lift", "elbow", "w1", "w2", "w3", "robotiq_left_knuckle"]);
    assert!(hint.contains("--joints shoulder_pan,shoulder_lift,elbow,w1,w2,w3 "), "{hint}");
    let hint =
        chain(&["waist", "shoulder", "elbow", "forearm_roll", "wrist_angle", "wrist_rotate", "gripper"]);
    assert!(hint.contains("--joints waist,shoulder,elbow,forearm_roll,wrist_angle,wrist_rotate "), "{hint}");
    let hint = chain(&["a1", "a2", "a3", "a4", "a5", "finger_1", "finger_2"]);
    assert!(
        hint.contains("not all of these joints belong to an arm") && !hint.contains("--joints"),
        "{hint}"
    );
    assert!(chain(&["a1"]).contains("1 rotary joint (a1), expected six"));
}
