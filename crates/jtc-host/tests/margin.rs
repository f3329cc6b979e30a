//! Tests of the torque margin of plans. The tests compute the margin independently of the planner, from the inverse dynamics and the
//! friction law. The margin is computed at each millisecond of the motion, as in the controller.
//!
//! The tests use the shipped arm, and imported arms with the proportions of a UR5 and a Z1. The environment variable
//! `JTC_TEST_ARMS` can list further arm files or robot descriptions, separated by `:`.

use std::fmt::Write as _;
use std::path::Path;
use std::sync::LazyLock;

use jtc_core::{Config, Friction, JOINTS, friction};
use jtc_dynamics::Dynamics;
use jtc_host::arm::ArmChoice;
use jtc_host::check::Checker;
use jtc_host::plan::{self, MARGIN_PCT, PlanError, Planned, Planner, Waypoint};
use jtc_host::{Arm, Diagnose as _, ErrorKind};
use proptest::prelude::*;

/// Axis, offset from the previous joint (m), mass (kg), centre of mass (m), torque limit (N·m) and friction (N·m) of a
/// joint.
type Part = (&'static str, [f64; 3], f64, [f64; 3], f64, f64);

const UR5: [Part; JOINTS] = [
    ("0 0 1", [0.0, 0.0, 0.089], 3.7, [0.0, 0.0, 0.0], 150.0, 8.0),
    ("0 1 0", [0.0, 0.136, 0.0], 8.393, [0.0, 0.0, 0.28], 150.0, 8.0),
    ("0 1 0", [0.0, -0.12, 0.425], 2.275, [0.0, 0.0, 0.25], 150.0, 8.0),
    ("0 1 0", [0.0, 0.0, 0.392], 1.219, [0.0, 0.0, 0.0], 28.0, 2.0),
    ("0 0 1", [0.0, 0.093, 0.0], 1.219, [0.0, 0.0, 0.0], 28.0, 2.0),
    ("0 1 0", [0.0, 0.0, 0.095], 0.188, [0.0, 0.0, 0.0], 28.0, 2.0),
];

const Z1: [Part; JOINTS] = [
    ("0 0 1", [0.0, 0.0, 0.0585], 0.673, [0.0, 0.0, 0.024], 30.0, 1.0),
    ("0 1 0", [0.0, 0.0, 0.045], 1.191, [-0.11, 0.024, 0.0], 60.0, 2.0),
    ("0 1 0", [-0.35, 0.0, 0.0], 0.839, [0.106, 0.005, 0.035], 30.0, 1.0),
    ("0 1 0", [0.218, 0.0, 0.057], 0.564, [0.044, 0.004, 0.001], 30.0, 1.0),
    ("0 0 1", [0.07, 0.0, 0.0], 0.389, [0.031, 0.0, 0.005], 30.0, 1.0),
    ("1 0 0", [0.049, 0.0, 0.0], 0.288, [0.026, 0.0, -0.002], 30.0, 1.0),
];

fn imported(name: &str, parts: &[Part; JOINTS]) -> Arm {
    let words = |v: [f64; 3]| format!("{} {} {}", v[0], v[1], v[2]);
    let mut text = format!("<robot name=\"{name}\"><link name=\"l0\"/>");
    for (i, (axis, way, mass, com, torque, friction)) in parts.iter().enumerate() {
        let (inertia, n) = (0.01 * mass, i + 1);
        let _ = write!(
            text,
            "<link name=\"l{n}\"><inertial><origin xyz=\"{}\"/><mass value=\"{mass}\"/><inertia ixx=\"{inertia}\" ixy=\"0\" ixz=\"0\" \
             iyy=\"{inertia}\" iyz=\"0\" izz=\"{inertia}\"/></inertial></link><joint name=\"j{n}\" type=\"revolute\"><parent link=\"l{i}\"/>\
             <child link=\"l{n}\"/><origin xyz=\"{}\"/><axis xyz=\"{axis}\"/><limit lower=\"-2.9\" upper=\"2.9\" effort=\"{torque}\" \
             velocity=\"3.1\"/><dynamics friction=\"{friction}\" damping=\"{friction}\"/></joint>",
            words(*com),
            words(*way),
        );
    }
    let arm = Arm::import_text(&(text + "</robot>"), &ArmChoice::default()).unwrap();
    assert!(arm.friction().is_some(), "{name}");
    arm
}

/// Arms used in the tests.
static ARMS: LazyLock<Vec<Arm>> = LazyLock::new(|| {
    let mut arms = vec![Arm::avena(), imported("ur5", &UR5), imported("z1", &Z1)];
    let further = std::env::var("JTC_TEST_ARMS").unwrap_or_default();
    arms.extend(further.split(':').filter(|file| !file.is_empty()).map(|file| {
        let path = Path::new(file);
        Arm::load(path).unwrap_or_else(|error| panic!("{file}: {error}"))
    }));
    arms
});

/// Returns the friction of a joint at a bearing temperature, N·m.
fn friction_at(friction: Option<&Friction>, config: &Config, j: usize, v: f64, celsius: f64) -> f64 {
    match friction {
        Some(Friction::Polynomial(c)) => friction::polynomial(&c[j], v, celsius, config.friction_sign_width),
        Some(Friction::Table(t)) => friction::table(&t[j], v, celsius).unwrap(),
        None => 0.0,
    }
}

/// Bearing temperatures of a plan and of a run, °C.
const TEMPERATURES: [f64; 2] = [20.0, 30.0];

/// Checks a plan that must leave the share `margin` of each torque limit unused. Returns a text with all torque
/// problems, and the smallest share of a limit that is unused.
fn judge(arm: &Arm, config: &Config, planned: &Planned, margin: f64) -> (String, f64) {
    let (friction, mut wrong, mut left) = (arm.friction(), String::new(), f64::INFINITY);
    let of = |j: usize, v: f64, celsius: f64| friction_at(friction.as_ref(), config, j, v, celsius);
    let dynamics = Dynamics::with_payload(&arm.model, config.gravity, &config.payload);
    let end = (planned.trajectory.duration_s() * 1e3).round() as u32;
    // Breakaway friction: the greatest friction at speeds up to `fastest`. Up to the speed `friction_sign_width`, the
    // friction changes its sign gradually, and `fastest` is slightly above this speed.
    let breakaway: [f64; JOINTS] = std::array::from_fn(|j| {
        let fastest = config.friction_sign_width + config.joints[j].velocity_max / 128.0;
        let speeds = (-20..=20).map(|i| f64::from(i) / 20.0 * fastest);
        speeds.flat_map(|v| TEMPERATURES.map(|t| of(j, v, t).abs())).fold(0.0, f64::max)
    });
    for ms in 0..=end {
        let at = planned.trajectory.at_ms(ms).unwrap();
        let rigid = dynamics.inverse(&at.position, &at.velocity, &at.acceleration);
        let hold = dynamics.inverse(&at.position, &[0.0; JOINTS], &[0.0; JOINTS]);
        for j in 0..JOINTS {
            let limit = config.joints[j].torque_max;
            let rigid = rigid[j] + config.joints[j].rotor_inertia * at.acceleration[j];
            let torques = TEMPERATURES.map(|t| (rigid + of(j, at.velocity[j], t)).abs());
            let torque = torques[0].max(torques[1]);
            left = left.min(1.0 - torque / limit);
            let stands = hold[j].abs() + breakaway[j];
            let moves = (0.25 * (limit - stands)).max(0.02 * limit);
            let usable = ((1.0 - margin) * limit).max(stands + moves).min(limit);
            if torque > usable * (1.0 + 1e-6) && wrong.len() < 500 {
                let _ = writeln!(
                    wrong,
                    "joint {}: {torque:.3} of {usable:.3} N·m (limit {limit:.1}) at {ms} ms",
                    j + 1
                );
            }
        }
    }
    (wrong, left)
}

fn planner<'a>(arm: &'a Arm, config: &'a Config, friction: Option<&'a Friction>) -> Planner<'a> {
    Planner { model: Some(&arm.model), friction, ..Planner::new(config) }
}

fn share() -> impl Strategy<Value = [f64; JOINTS]> {
    prop::array::uniform6(-1.0..1.0f64)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// For random waypoints, the plan keeps the margin at each millisecond, and the plan reports the correct margin.
    #[test]
    fn plans_keep_the_margin_at_each_millisecond(
        which in 0..64usize,
        places in prop::collection::vec(share(), 2..5),
        margin in prop_oneof![Just(MARGIN_PCT), 0.0..=50.0f64],
        speed in prop_oneof![Just(100.0), 10.0..100.0f64],
        blend in prop_oneof![Just(0.0), 0.01..0.3f64],
        jerk: bool,
        load in prop_oneof![Just(0.0), 0.0..2.0f64],
    ) {
        let arm = &ARMS[which % ARMS.len()];
        let mut config = arm.config();
        config.payload.mass = load;
        let friction = arm.friction();
        let planner = Planner {
            margin_pct: margin, speed_pct: speed, blend, jerk, ..planner(arm, &config, friction.as_ref())
        };
        let waypoints: Vec<Waypoint> = places.iter().map(|place| Waypoint::from(std::array::from_fn(|j| {
            let (low, high) = config.position_range(j);
            0.5 * (low + high) + 0.3 * place[j] * (high - low)
        }))).collect();
        let planned = match planner.through(&waypoints) {
            Ok(planned) => planned,
            // With this load, gravity alone exceeds the torque limits of the arm.
            Err(PlanError::Plan(jtc_plan::PlanError::Torque { .. })) => return Ok(()),
            Err(PlanError::Refused(verdict)) => {
                use jtc_host::check::ProblemKind::{HoldTorque, NoStop, Torque};
                prop_assert!(
                    verdict.refusals().all(|p| matches!(p.kind, HoldTorque | NoStop | Torque)), "{}: {verdict}", arm.name
                );
                return Ok(());
            }
            Err(error) => return Err(TestCaseError::fail(format!("{}: {error}", arm.name))),
        };
        let (wrong, left) = judge(arm, &config, &planned, 0.01 * margin);
        prop_assert!(wrong.is_empty(), "{}, margin {margin} %: {wrong}", arm.name);
        let reported = planned.verdict.margin.unwrap();
        prop_assert!((reported.percent - 100.0 * left).abs() < 1e-6, "{reported}, {left}");
        prop_assert_eq!(reported.is_low(), reported.percent < 10.0);
    }
}

/// Returns the arm with a payload. In the stretched pose, the weight of the payload needs the fraction `share` of the
/// torque limit of joint 2.
fn stretched(share: f64) -> (Arm, Config) {
    let (arm, mut config) = (Arm::avena(), Arm::avena().config());
    let hold = |config: &Config| {
        let dynamics = Dynamics::with_payload(&arm.model, config.gravity, &config.payload);
        dynamics.inverse(&OUT, &[0.0; JOINTS], &[0.0; JOINTS])[1].abs() / config.joints[1].torque_max
    };
    while hold(&config) < share {
        config.payload.mass += 0.01;
    }
    (arm, config)
}

const OUT: [f64; JOINTS] = [0.0, 1.5, 0.0, 0.0, 0.0, 0.0];

/// A pose that needs more torque than the margin permits can be the start or the end of a motion. At all other
/// positions the plan keeps the margin. If the margin of the motion is below 10 %, the plan contains a warning.
#[test]
fn a_pose_that_takes_more_than_the_margin_leaves_is_reached_and_left() {
    for share in [0.6, 0.7, 0.8, 0.86, 0.9, 0.94] {
        let (arm, config) = stretched(share);
        let friction = arm.friction();
        let plan = planner(&arm, &config, friction.as_ref());
        let waypoints = [[0.0; JOINTS], OUT, [0.5; JOINTS]].map(Waypoint::from);
        let planned = plan.through(&waypoints).unwrap_or_else(|error| panic!("{share}: {error}"));
        let back = plan.to(&OUT, &[0.0; JOINTS]).unwrap_or_else(|error| panic!("{share}: {error}"));
        for planned in [&planned, &back] {
            let (wrong, left) = judge(&arm, &config, planned, 0.15);
            assert!(wrong.is_empty(), "{share}: {wrong}");
            let margin = planned.verdict.margin.unwrap();
            assert_eq!(margin.warning().is_some(), left < 0.1, "{share}: {margin}");
            let noted = planned.notes.iter().any(|note| note.contains("instead of 15 %"));
            assert_eq!(noted, left < 0.149, "{share}: {margin}, {:?}", planned.notes);
            assert!(planned.trajectory.duration_s() < 30.0, "{share}: {}", planned.trajectory.duration_s());
        }
    }
}

/// With the default margin of a plan, an arm with 10 % more mass and 20 % more friction than its model stays within each
/// limit.
#[test]
fn the_default_margin_suffices_for_ten_percent_of_mass_and_twenty_of_friction() {
    let places =
        [[0.0; JOINTS], [1.2, 0.4, -0.9, 0.8, 0.6, 1.0], [-1.2, -0.5, 0.9, -0.8, -0.6, -1.0], [0.0; JOINTS]];
    for arm in ARMS.iter().take(3) {
        let (config, friction) = (arm.config(), arm.friction());
        let planner = planner(arm, &config, friction.as_ref());
        let planned = planner.through(&places.map(Waypoint::from)).unwrap();
        let mut heavier = arm.clone();
        for link in &mut heavier.model.links {
            link.mass *= 1.1;
            link.inertia.iter_mut().for_each(|i| *i *= 1.1);
        }
        if let Some(polynomial) = &mut heavier.polynomial {
            polynomial.iter_mut().for_each(|c| c[..4].iter_mut().for_each(|c| *c *= 1.2));
        }
        let (wrong, left) = judge(&heavier, &config, &planned, 0.0);
        assert!(wrong.is_empty() && left > 0.0, "{}: {left} {wrong}", arm.name);
    }
}

/// A margin out of range causes a usage error that contains the range. Every margin within the range is accepted.
#[test]
fn a_margin_is_zero_to_fifty_percent() {
    let arm = Arm::avena();
    let (config, friction) = (arm.config(), arm.friction());
    let to = |margin_pct: f64| {
        let planner = Planner { margin_pct, ..planner(&arm, &config, friction.as_ref()) };
        planner.to(&[0.0; JOINTS], &[0.5; JOINTS])
    };
    for wrong in [-0.1, -15.0, 50.001, 100.0, 1e9, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let error = to(wrong).unwrap_err();
        assert!(matches!(error, PlanError::Margin { .. }), "{error}");
        let (text, diagnosis) = (error.to_string(), error.diagnosis());
        assert!(
            text.contains(&wrong.to_string()) && text.contains("0 to 50 %") && text.contains("15"),
            "{text}"
        );
        assert!(
            diagnosis.kind == ErrorKind::Usage && diagnosis.next.to_string().contains("0 plans"),
            "{diagnosis:?}"
        );
        assert!(plan::margin_of(&wrong.to_string()).is_err(), "{wrong}");
    }
    for text in ["", "x", "15%", "1,5", "0x10", "--", "15 %"] {
        let error = plan::margin_of(text).unwrap_err();
        assert!(error.contains("not a number") && error.contains("0 to 50"), "{error}");
    }
    let mut before = 0.0;
    for margin in [0.0, 15.0, 30.0, 50.0] {
        let seconds = to(margin).unwrap().trajectory.duration_s();
        assert!(seconds >= before, "{margin} %: {seconds} s after {before} s");
        assert_eq!(plan::margin_of(&format!(" {margin} ")), Ok(margin));
        before = seconds;
    }
}

/// A check reports the torque margin of any trajectory, and warns if this margin is below 10 %.
#[test]
fn a_check_names_the_margin_and_warns_below_ten_percent() {
    let arm = Arm::avena();
    let (config, friction) = (arm.config(), arm.friction());
    let checker = Checker { model: Some(&arm.model), friction: friction.as_ref(), ..Checker::new(&config) };
    let with = |margin_pct: f64| {
        let planner = Planner { margin_pct, jerk: false, ..planner(&arm, &config, friction.as_ref()) };
        let planned = planner.to(&[0.0, -1.2, 1.2, 0.0, 0.0, 0.0], &[1.5, 1.2, -1.2, 0.0, 0.0, 0.0]).unwrap();
        checker.check(&planned.trajectory).margin.unwrap()
    };
    let (tight, kept) = (with(0.0), with(15.0));
    assert!(tight.percent < 10.0 && kept.percent >= 15.0, "{tight}; {kept}");
    let warning = tight.warning().unwrap();
    assert!(warning.contains("below 10 %") && warning.contains(&tight.joint.to_string()), "{warning}");
    assert_eq!(kept.warning(), None);
    assert!(kept.to_string().starts_with("torque margin "), "{kept}");
    let share = 100.0 * (1.0 - tight.torque_nm.abs() / tight.limit_nm);
    assert!((share - tight.percent).abs() < 1e-9);
    // If the arm has no model, the check reports no margin.
    assert_eq!(Checker::new(&config).check(&jtc_host::Trajectory::default()).margin, None);
}
