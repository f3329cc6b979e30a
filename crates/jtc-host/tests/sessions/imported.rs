//! An arm that is imported from a robot description runs in the simulator with what was proposed for it.

use std::fmt::Write as _;
use std::time::Duration;

use jtc_host::arm::ArmChoice;
use jtc_host::port::sim::SimPort;
use jtc_host::session::{Flow, Outcome};
use jtc_host::{Arm, CheckOptions, CheckedTrajectory, Session, plan};
use jtc_sim::{SimConfig, World};

/// A six-axis arm of `scale` times a metre, with axes along y and z and what goes with its size: masses with the third power,
/// torques with the fourth.
fn description(scale: f64) -> String {
    // Axis, way to the next joint, mass, torque limit.
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

/// From a small arm to a large one: held, moved, and followed to a few mrad.
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
            assert!(error < 2.0, "scale {scale}, joint {}: {error} mrad", j + 1);
        }
    }
}
