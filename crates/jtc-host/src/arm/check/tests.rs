//! Tests that each fault of an arm causes exactly one finding, and that this finding describes the fault.

use proptest::prelude::*;

use super::*;
use crate::arm::AVENA_TOML;
use crate::arm::toml_form;

fn of(from: &str, to: &str) -> Arm {
    assert!(AVENA_TOML.contains(from), "{from}");
    toml_form::read(&AVENA_TOML.replacen(from, to, 1)).unwrap()
}

/// Returns the code, severity and joint of each finding that is a warning or a problem.
fn found(arm: &Arm) -> Vec<(&'static str, Severity, Option<u8>)> {
    let bad = arm.check().findings.into_iter().filter(|f| f.finding.severity != Severity::Good);
    bad.map(|f| (f.code, f.finding.severity, f.joint.map(Joint::number))).collect()
}

#[test]
fn the_delivered_arm_has_nothing_wrong() {
    let checked = Arm::avena().check();
    assert!(checked.findings.iter().all(|f| f.finding.severity == Severity::Good), "{:?}", checked.findings);
    assert_eq!((checked.holding.len(), checked.is_refused()), (JOINTS, false));
}

#[test]
fn j06_j35_j43_what_a_controller_refuses_is_a_problem_of_its_joint() {
    use Severity::Problem;
    for (from, to, expected) in [
        ("torque_max_nm = 80.0", "torque_max_nm = -80.0", ("limit", Some(1))),
        ("velocity_max_rad_s = 1.5", "velocity_max_rad_s = nan", ("limit", Some(1))),
        ("position_min_rad = -2.9\n", "position_min_rad = 2.95\n", ("limit", Some(3))),
        ("rotor_inertia_kg_m2 = 0.7", "rotor_inertia_kg_m2 = -0.7", ("limit", Some(1))),
        ("position_max_rad = 2.9\n", "position_max_rad = 3.05\n", ("drives", Some(3))),
        ("velocity_max_rad_s = 1.5", "velocity_max_rad_s = 1.51", ("drives", Some(1))),
        ("mass_kg = 7.5", "mass_kg = -7.5", ("physical", None)),
        ("mass_kg = 7.5", "mass_kg = 0.0", ("physical", None)),
        ("mass_kg = 7.5", "mass_kg = 75.0", ("bounds", None)),
        ("inertia_kg_m2 = [0.8437,", "inertia_kg_m2 = [8.437,", ("physical", None)),
        ("kp = 8000.0", "kp = 80000.0", ("bounds", Some(1))),
        ("int_min_rad_s = -100.0", "int_min_rad_s = 1000.1", ("bounds", Some(2))),
        ("friction_polynomial = [5.9", "friction_polynomial = [559.0", ("bounds", Some(3))),
    ] {
        let arm = of(from, to);
        let all = found(&arm);
        assert!(all.contains(&(expected.0, Problem, expected.1)), "{to}: {all:?}");
        assert!(arm.check().is_refused(), "{to}");
        let problems: Vec<_> = all.iter().filter(|f| f.1 == Problem).collect();
        assert!(problems.iter().all(|f| f.2 == expected.1), "{to}: {problems:?}");
    }
}

#[test]
fn all_that_is_wrong_is_found_at_once() {
    let text = AVENA_TOML
        .replace("mass_kg = 1.96", "mass_kg = -1.96")
        .replace("torque_max_nm = 40.0", "torque_max_nm = 0.0")
        .replace("kd = 80.0", "kd = 800.0");
    let all = found(&toml_form::read(&text).unwrap());
    let count = |code: &str| all.iter().filter(|f| f.0 == code).count();
    assert_eq!((count("physical"), count("limit"), count("bounds")), (2, 2, 3), "{all:?}");
}

#[test]
fn what_is_missing_is_said_and_only_what_no_controller_starts_without_is_refused() {
    let lacking = |key: &str| {
        let lines = AVENA_TOML.lines().filter(|l| !l.starts_with(key));
        let arm = toml_form::read(&lines.map(|l| format!("{l}\n")).collect::<String>()).unwrap();
        (found(&arm), arm.check().is_refused())
    };
    use Severity::{Problem, Warning};
    assert_eq!(lacking("pid"), (vec![("missing", Problem, None)], true));
    assert_eq!(lacking("gravity"), (vec![("missing", Warning, None)], false));
    assert_eq!(lacking("rotor"), (vec![("missing", Warning, None)], false));
    assert_eq!(lacking("velocity_max"), (vec![("default", Warning, None)], false));
    // Without the polynomial the file still has a friction table, so the check does not report missing friction.
    assert_eq!(lacking("friction_polynomial"), (vec![], false));
}

#[test]
fn an_arm_that_its_drives_cannot_hold_is_named_with_joint_pose_and_share() {
    let arm = of("torque_max_nm = 180.0", "torque_max_nm = 100.0");
    let checked = arm.check();
    assert!(!checked.is_refused(), "the controller takes it");
    let f = checked.findings.iter().find(|f| f.code == "holding").unwrap();
    assert_eq!((f.joint.map(Joint::number), f.limit), (Some(2), Some(100.0)));
    let dynamics = jtc_dynamics::Dynamics::new(&arm.model, arm.config().gravity);
    let there = dynamics.gravity_torque(&f.pose_rad.unwrap())[1].abs();
    assert!((there - f.value.unwrap()).abs() < 1e-3 && there > 100.0, "{there} {f:?}");
    assert!(f.finding.what.contains("N·m of 100 N·m (132 %) at q = ("), "{}", f.finding.what);
    let tight = found(&of("torque_max_nm = 180.0", "torque_max_nm = 150.0"));
    assert_eq!(tight, [("holding", Severity::Warning, Some(2))]);
    // With these narrow position ranges, the arm cannot reach the poses with the greatest gravity torque. Therefore a
    // torque limit of 100 N·m is sufficient, and the check reports no problem.
    let narrow = of("torque_max_nm = 180.0", "torque_max_nm = 100.0");
    let mut narrow = Arm { ..narrow };
    (narrow.joints[1].position_min, narrow.joints[1].position_max) = (-0.3, 0.3);
    (narrow.joints[2].position_min, narrow.joints[2].position_max) = (-0.3, 0.3);
    assert!(!found(&narrow).iter().any(|f| f.0 == "holding"), "{:?}", narrow.check());
}

#[test]
fn torque_limits_in_another_unit_are_suspected() {
    let mut arm = Arm::avena();
    for link in &mut arm.model.links {
        link.mass *= 0.01;
        link.inertia = link.inertia.map(|i| i * 0.01);
    }
    assert!(found(&arm).contains(&("unit", Severity::Warning, None)));
}

/// The check reports unstable gains as a problem.
#[test]
fn j41_j71_gains_that_are_not_stable_are_refused_joint_by_joint() {
    use Severity::Problem;
    let with = |change: &dyn Fn(&mut [jtc_core::PidGains; JOINTS])| {
        let mut arm = Arm::avena();
        change(arm.pid.as_mut().unwrap());
        let checked = arm.check();
        let gains: Vec<_> = found(&arm).into_iter().filter(|f| f.0 == "gains").collect();
        assert_eq!(checked.is_refused(), !gains.is_empty());
        assert_eq!(checked.rotor_margins.is_some(), gains.is_empty());
        gains
    };
    let of = |joints: &[u8]| joints.iter().map(|j| ("gains", Problem, Some(*j))).collect::<Vec<_>>();
    assert_eq!(with(&|pid| (pid[3].kd, pid[4].kd) = (400.0, 1.0)), of(&[4, 5]));
    assert_eq!(with(&|pid| pid[0].ki = 0.0), of(&[]));
    assert_eq!(with(&|pid| pid[5].kd = 300.0), of(&[6]));
    assert_eq!(with(&|pid| pid[1].ki = 50_000.0), of(&[2]));
    assert_eq!(with(&|pid| pid[2].kp = 1.0), of(&[3]));
    assert_eq!(with(&|pid| pid[2].kd = 0.0), of(&[3]));
    assert_eq!(with(&|pid| pid.iter_mut().for_each(|g| g.kd *= 30.0)).len(), JOINTS);
    assert_eq!(with(&|pid| pid.iter_mut().for_each(|g| g.kd *= 1.2)), of(&[]));
}

/// Rotor margins: the gains are stable within the allowed factors of the rotor inertias, and unstable slightly
/// outside these factors.
#[test]
fn j71_the_rotor_margin_is_where_the_check_changes() {
    let arm = Arm::avena();
    let margins = arm.check().rotor_margins.unwrap();
    let scaled = |of: &dyn Fn(usize) -> bool, factor: f64| {
        let mut arm = Arm::avena();
        let joints = arm.joints.iter_mut().enumerate().filter(|(j, _)| of(*j));
        joints.for_each(|(_, limits)| limits.rotor_inertia *= factor);
        arm.check().findings.iter().any(|f| f.code == "gains" && f.finding.severity == Severity::Problem)
    };
    let all = |_: usize| true;
    assert!(margins.all.down > 0.0 && margins.all.down < 0.5 && margins.all.up > 2.0, "{margins:?}");
    assert!(!scaled(&all, 1.02 * margins.all.down) && scaled(&all, 0.98 * margins.all.down));
    assert!(!scaled(&all, 0.98 * margins.all.up) && scaled(&all, 1.02 * margins.all.up));
    for (j, alone) in margins.joints.iter().enumerate() {
        assert!(alone.down <= margins.all.down && alone.up >= margins.all.up, "{margins:?}");
        let one = |k: usize| k == j;
        assert!(!scaled(&one, 1.02 * alone.down) && !scaled(&one, 0.98 * alone.up), "joint {}", j + 1);
        assert!(alone.down == 0.0 || scaled(&one, 0.97 * alone.down), "joint {}", j + 1);
    }
    let words = |arm: &Arm| {
        arm.check().findings.into_iter().find(|f| f.code == "gains").map(|f| f.finding.what).unwrap()
    };
    assert!(words(&arm).contains(" times the rotor inertias; each joint alone "), "{}", words(&arm));
}

/// For proposed rotor inertias the check requires a wider stable range than for measured rotor inertias.
#[test]
fn gains_that_do_not_tolerate_a_proposed_rotor_are_refused() {
    let with = |proposed: bool, factor: f64| {
        let mut arm = Arm::avena();
        arm.pid.as_mut().unwrap().iter_mut().for_each(|g| {
            (g.kp, g.ki, g.kd) = (g.kp * factor, g.ki * factor * factor, g.kd * factor);
        });
        if proposed {
            Joint::ALL.into_iter().for_each(|j| arm.sources.propose((Some(j), "rotor_inertia_kg_m2")));
        }
        found(&arm).into_iter().filter(|f| f.0 == "gains").collect::<Vec<_>>()
    };
    assert_eq!(with(false, 1.5), []);
    assert_eq!(with(true, 1.5), [("gains", Severity::Problem, None)]);
    assert_eq!(with(true, 0.5), []);
}

#[test]
fn proposals_are_found_with_their_joints() {
    let marked = of("torque_max_nm = 80.0\n", "torque_max_nm = 80.0\nproposed = [\"torque_max_nm\"]\n");
    let checked = marked.check();
    let f = checked.findings.iter().find(|f| f.code == "proposed").unwrap();
    assert_eq!((f.name, checked.is_refused()), (Some("torque_max_nm"), false));
    assert!(f.finding.what.contains("proposed for joint 1; "), "{}", f.finding.what);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// The check does not panic for any value of a number of the arm. If the number is NaN or infinite, the check
    /// refuses the arm.
    #[test]
    fn no_number_is_too_odd_for_the_check(place in 0..11usize, joint in 0..JOINTS, value in prop::num::f64::ANY) {
        let mut arm = Arm::avena();
        let (limits, link) = (&mut arm.joints[joint], &mut arm.model.links[joint]);
        match place {
            0 => limits.position_min = value,
            1 => limits.position_max = value,
            2 => limits.velocity_max = value,
            3 => limits.torque_max = value,
            4 => limits.rotor_inertia = value,
            5 => link.mass = value,
            6 => link.inertia[3] = value,
            7 => link.origin.xyz[1] = value,
            8 => arm.pid.as_mut().unwrap()[joint].kd = value,
            9 => arm.polynomial.as_mut().unwrap()[joint][1] = value,
            _ => arm.model.joints[joint].rpy[0] = value,
        }
        let checked = arm.check();
        prop_assert!(!checked.findings.is_empty());
        if !value.is_finite() {
            prop_assert!(checked.is_refused(), "{checked:?}");
        }
    }
}

/// The check refuses gains that a controller would refuse because the inertia of the joint is too small. The error
/// contains the joint and the required inertia.
#[test]
fn j71_a_joint_that_is_too_light_for_its_gains_is_refused() {
    let mut arm = Arm::avena();
    arm.pid.as_mut().unwrap()[0].kd = 170.0;
    let findings = arm.check().findings;
    let light = findings.iter().find(|f| f.code == "too-light").expect("too light");
    assert_eq!((light.finding.severity, light.joint.map(Joint::number)), (Severity::Problem, Some(1)));
    // The gains of this arm are barely stable, so the stability check reports no problem. The gains are refused only
    // because the inertia of the joint is too small for them.
    assert!(!findings.iter().any(|f| f.code == "gains" && f.finding.severity == Severity::Problem));
    assert!(arm.check_gains().unwrap_err().to_string().contains("kg·m²"));
    // If the rotor inertias are missing in the file, the stability is unknown, but the check still refuses gains that are too high.
    let mut arm = Arm { rotors_given: [false; JOINTS], ..Arm::avena() };
    arm.joints.iter_mut().for_each(|joint| joint.rotor_inertia = 0.0);
    assert!(arm.check_gains().is_ok());
    arm.pid.as_mut().unwrap()[5].kd = 200.0;
    assert!(arm.check_gains().is_err());
}

/// An integral gain that is too high for the heaviest payload causes a warning. With the integral gain that the
/// warning recommends, the warning disappears.
#[test]
fn j71_gains_that_do_not_damp_a_joint_with_a_load_are_warned_of() {
    let warned = |ki: f64| {
        let mut arm = Arm::avena();
        arm.pid.as_mut().unwrap()[1].ki = ki;
        arm.check().findings.into_iter().find(|f| f.code == "damping")
    };
    assert_eq!(warned(14_000.0), None, "the shipped gains damp the arm with 5 kg");
    let warning = warned(23_000.0).expect("a warning");
    assert_eq!((warning.finding.severity, warning.value), (Severity::Warning, Some(80.0)));
    assert!(warning.finding.what.contains(" kg at the flange"), "{}", warning.finding.what);
    let advice: f64 = warning
        .finding
        .next
        .to_string()
        .split("lower Ki to ")
        .nth(1)
        .unwrap()
        .split(' ')
        .next()
        .unwrap()
        .parse()
        .unwrap();
    assert_eq!(warned(advice - 1.0), None, "{}", warning.finding.next);
    assert!(warned(advice + 100.0).is_some());
}

/// The drives of the wrist supply at most 79 N·m. A limit above this maximum is refused in the file, by the check and for a plan, unless
/// the file names stronger drives.
#[test]
fn a_torque_limit_above_the_drive_is_a_finding() {
    let text = AVENA_TOML.replacen("torque_max_nm = 40.0", "torque_max_nm = 140.0", 1);
    let arm = toml_form::read(&text).unwrap();
    let found: Vec<_> = arm.check().findings.into_iter().filter(|f| f.code == "drives").collect();
    let [finding] = found.as_slice() else { panic!("{found:?}") };
    assert_eq!((finding.value, finding.limit), (Some(140.0), Some(79.0)));
    assert_eq!((finding.joint.map(Joint::number), finding.name), (Some(5), Some("torque_max_nm")));
    assert!(finding.finding.what.contains("joint 5") && arm.check().is_refused(), "{finding:?}");
    let error = Arm::parse(&text).unwrap_err().to_string();
    assert!(error.contains("joint_5, torque_max_nm: 140 N·m exceed the 79 N·m"), "{error}");

    let stronger =
        text.replacen("torque_max_nm = 140.0", "torque_max_nm = 140.0\ndrive_torque_max_nm = 150.0", 1);
    let arm = Arm::parse(&stronger).unwrap();
    assert_eq!(arm.drive_torque_max, [364.0, 364.0, 364.0, 79.0, 150.0, 79.0]);
    assert!(!arm.check().findings.iter().any(|f| f.code == "drives"));
    assert_eq!(Arm::parse(&arm.to_toml()).unwrap().drive_torque_max, arm.drive_torque_max);
    let weaker =
        AVENA_TOML.replacen("torque_max_nm = 180.0", "torque_max_nm = 180.0\ndrive_torque_max_nm = 90.0", 1);
    assert!(Arm::parse(&weaker).unwrap_err().to_string().contains("180 N·m exceed the 90 N·m"));
    for wrong in ["0.0", "-5.0", "nan"] {
        let text = stronger.replacen("150.0", wrong, 1);
        assert!(Arm::parse(&text).unwrap_err().to_string().contains("drive_torque_max_nm"), "{wrong}");
    }
}

/// The joint bus carries torques in steps of 0.011 N·m. Below 100 steps the check says so.
#[test]
fn a_torque_limit_of_few_steps_of_the_bus_is_a_finding() {
    let found = |torque: f64| {
        let mut arm = Arm::avena();
        arm.joints[5].torque_max = torque;
        arm.check().findings.into_iter().filter(|f| f.code == "resolution").count()
    };
    assert_eq!((found(1.0), found(1.2), found(40.0)), (1, 0, 0));
}
