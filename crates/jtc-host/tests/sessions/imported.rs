//! Tests of arms that are imported from a robot description and run in the simulator with the proposed parameters.

use std::fmt::Write as _;
use std::time::Duration;

use jtc_host::arm::ArmChoice;
use jtc_host::port::sim::SimPort;
use jtc_host::session::{Flow, Outcome};
use jtc_host::{Arm, CheckOptions, CheckedTrajectory, Diagnose, Session, plan};
use jtc_sim::{SimConfig, World};

/// Returns a six-axis arm with a length of `scale` metres and axes along y and z. The masses are proportional to the
/// third power of `scale`, and the torques to the fourth power.
fn description(scale: f64) -> String {
    // Axis, offset to the next joint (m), mass (kg) and torque limit (N·m) of a joint.
    let parts = [
        ("0 0 1", [0.0, 0.0, 0.1], 4.0, 150.0),
        ("0 1 0", [0.0, 0.1, 0.1], 8.0, 150.0),
        ("0 1 0", [0.0, 0.0, 0.42], 3.0, 100.0),
        ("0 1 0", [0.0, 0.0, 0.39], 1.2, 28.0),
        ("0 0 1", [0.0, 0.1, 0.0], 1.2, 28.0),
        ("0 -1 0", [0.0, 0.0, 0.1], 0.3, 28.0),
    ];
    let mut text = String::from("<robot name=\"r\"><link name=\"l0\"/>");
    for (i, (axis, way, mass, torque)) in parts.into_iter().enumerate() {
        let [x, y, z] = way.map(|v| v * scale);
        let (mass, torque) = (mass * scale.powi(3), torque * scale.powi(4));
        let inertia = mass * 0.02 * scale * scale;
        let _ = write!(
            text,
            "<link name=\"l{}\"><inertial><origin xyz=\"0 0 {}\"/><mass value=\"{mass}\"/><inertia ixx=\"{inertia}\" ixy=\"0\" \
             ixz=\"0\" iyy=\"{inertia}\" iyz=\"0\" izz=\"{inertia}\"/></inertial></link><joint name=\"j{}\" type=\"revolute\">\
             <parent link=\"l{i}\"/><child link=\"l{}\"/><origin xyz=\"{x} {y} {z}\"/><axis xyz=\"{axis}\"/>\
             <limit lower=\"-3\" upper=\"3\" effort=\"{torque}\" velocity=\"3\"/></joint>",
            i + 1,
            0.1 * scale,
            i + 1,
            i + 1
        );
    }
    text + "</robot>"
}

/// Sends the parameters of `arm` to a controller whose real arm is `plant`. The controller moves the arm, and then holds the arm for 5 s.
/// Returns the largest position error of each joint during the motion, mrad.
fn moved(arm: &Arm, plant: &Arm, percent: f64) -> Result<Vec<f64>, String> {
    let config = SimConfig {
        baud: None,
        controller: arm.config(),
        ..SimConfig::new(plant.config(), &plant.parameters())
    };
    let start = config.start;
    let mut session = Session::new(SimPort::new(World::new(config)));
    session.push(&arm.parameter_set(), |_| {}).map_err(|e| e.to_string())?;
    session.wait_ready(Duration::from_secs(15)).map_err(|e| e.to_string())?;
    let to = std::array::from_fn(|j| start[j] + if j == 1 { -0.3 } else { 0.3 });
    let motion = plan::joint_move(&start, &to, &arm.config(), percent).map_err(|e| e.to_string())?;
    let options = CheckOptions { accept_device_limits: true, ..CheckOptions::default() };
    let checked = CheckedTrajectory::check(&motion, arm, &start, &options).map_err(|e| e.to_string())?;
    session.upload(&checked, |_| Flow::Continue).map_err(|e| e.to_string())?;
    let run = session.run(&checked, |_| Flow::Continue);
    if !matches!(run.outcome, Ok(Outcome::Finished(_))) {
        return Err(format!("{:?}", run.outcome));
    }
    let end = session.now() + Duration::from_secs(5);
    while session.now() < end {
        let status = session.next_status().map_err(|e| e.to_string())?;
        if status.errors != 0 {
            return Err(jtc_host::labels::errors_line(&status));
        }
    }
    let joints = run.summary(arm).joints;
    Ok(joints.iter().map(|joint| joint.max_error_mrad.unwrap_or_default()).collect())
}

/// The rotors of the real arm are lighter or heavier than the proposed rotor inertias in the controller. The
/// controller must still hold and move the arm.
#[test]
fn j41_j71_the_gains_that_are_proposed_move_an_arm_with_other_rotors() {
    let plain = include_str!("plain.urdf");
    let efforts = ["150", "180", "110", "45", "40", "30"];
    let effortless = efforts
        .iter()
        .fold(plain.to_owned(), |text, effort| text.replace(&format!("effort=\"{effort}\""), "effort=\"0\""));
    let strong_wrist = plain.replace("effort=\"30\"", "effort=\"60\"");
    for (name, text) in [
        ("plain", plain.to_owned()),
        ("without efforts", effortless),
        ("strong wrist", strong_wrist),
        ("0.6 m", description(0.6)),
        ("1 m", description(1.0)),
        ("1.2 m", description(1.2)),
    ] {
        let arm = Arm::import_text(&text, &ArmChoice::default()).unwrap();
        let checked = arm.check();
        assert!(!checked.is_refused(), "{name}: {:?}", checked.findings);
        let margins = checked.rotor_margins.expect("stable gains");
        assert!(margins.all.down <= 0.2 && margins.all.up >= 3.0, "{name}: {margins:?}");
        for factor in [0.1, 0.2, 0.5, 3.0] {
            let mut plant = arm.clone();
            plant.joints.iter_mut().for_each(|joint| joint.rotor_inertia *= factor);
            let errors =
                moved(&arm, &plant, 50.0).unwrap_or_else(|e| panic!("{name}, rotors x{factor}: {e}"));
            assert!(errors.iter().all(|e| *e < 40.0), "{name}, rotors x{factor}: {errors:?} mrad");
        }
    }
}

/// J-71: gains that the check of the arm rejects are not sent to the controller.
#[test]
fn j71_gains_that_are_not_stable_are_given_to_no_controller() {
    let mut arm = Arm::avena();
    arm.pid.as_mut().unwrap()[4].kd = 300.0;
    let mut session =
        Session::new(SimPort::new(World::new(SimConfig { baud: None, ..SimConfig::default() })));
    let before = session.device_arm().ok();
    for error in [
        session.push_arm(&arm, |_| panic!("nothing is sent")).unwrap_err(),
        session.push_and_store_arm(&arm, |_| panic!("nothing is sent")).unwrap_err(),
    ] {
        assert_eq!((error.kind(), error.code()), (jtc_host::ErrorKind::Refused, "unstable-gains"), "{error}");
        let text = error.to_string();
        assert!(
            text.contains("joint 5") && text.contains("Kd 300") && text.contains("nothing was sent"),
            "{text}"
        );
    }
    assert_eq!(session.device_arm().ok(), before);
}

/// The controller holds and moves small and large imported arms with an error of a few mrad.
#[test]
fn j41_an_imported_arm_follows_with_the_gains_that_are_proposed() {
    for scale in [0.6, 1.0, 1.2] {
        let arm = Arm::import_text(&description(scale), &ArmChoice::default()).unwrap();
        assert!(!arm.check().is_refused(), "{:?}", arm.check());
        let config = SimConfig { baud: None, ..SimConfig::new(arm.config(), &arm.parameters()) };
        let mut session = Session::new(SimPort::new(World::new(config)));
        session.push(&arm.parameter_set(), |_| {}).unwrap();
        session.wait_ready(Duration::from_secs(15)).unwrap();
        let to = [0.8, 0.9, -1.1, 0.7, 0.6, -1.0];
        let motion = plan::joint_move(&[0.0; 6], &to, &arm.config(), 60.0).unwrap();
        let options = CheckOptions { accept_device_limits: true, ..CheckOptions::default() };
        let checked = CheckedTrajectory::check(&motion, &arm, &[0.0; 6], &options).unwrap();
        session.upload(&checked, |_| Flow::Continue).unwrap();
        let run = session.run(&checked, |_| Flow::Continue);
        assert!(matches!(run.outcome, Ok(Outcome::Finished(_))), "scale {scale}: {:?}", run.outcome);
        for (j, joint) in run.summary(&arm).joints.iter().enumerate() {
            let error = joint.max_error_mrad.unwrap();
            assert!(error < 8.0, "scale {scale}, joint {}: {error} mrad", j + 1);
        }
    }
}
