//! Tests of `jtc bench`, which declares that joints are absent (J-53).

use crate::common;

use common::{Sim, motion};

/// Fault file for an arm whose joint 3 is missing on the joint bus.
const WITHOUT: &str = "format = 2\n[[fault]]\nkind = \"node-silent\"\njoint = 3\nat_s = 0\n";

#[test]
fn j53_absent_joints_leave_the_others_to_be_jogged() {
    let sim = Sim::with_faults(&["--no-throttle"], WITHOUT);
    // Joint 3 is not declared absent yet. Therefore the controller does not reach HoldPos: it waits for the drive of
    // joint 3, or reports an error.
    std::thread::sleep(std::time::Duration::from_secs(3));
    assert_ne!(sim.json(&["status"], 0)["state"], "HoldPos");
    let set = sim.json(&["bench", "absent", "3=30", "--deg"], 0);
    assert_eq!(set["absent"][0]["joint"], 3);
    sim.jtc(&["recover", "--defaults"]).ends(0);

    let angle = 30f64.to_radians();
    let shown = sim.json(&["bench", "show"], 0);
    assert_eq!(
        (&shown["absent"][0]["joint"], shown["absent"][0]["position_rad"].as_f64()),
        (&3.into(), Some(angle))
    );
    assert_eq!(sim.json(&["info"], 0)["absent"], shown["absent"]);
    let status = sim.json(&["status"], 0);
    let joint = &status["joints"][2];
    assert_eq!(
        (joint["state"].as_str(), joint["torque_nm"].as_f64()),
        (Some("absent"), Some(0.0)),
        "{status}"
    );
    assert!((joint["position_rad"].as_f64().unwrap() - angle).abs() < 1e-6);
    let doctor = sim.jtc(&["doctor"]).ends(0).out;
    assert!(doctor.contains("joint 3 is marked as absent"), "{doctor}");

    // The controller rejects motions and teaching. The user can jog all joints except joint 3.
    let file = sim.file("motion.csv", &motion(0.1));
    let refused = sim.jtc(&["traj", "run", &file]).ends(4).err;
    assert!(
        refused.contains("joint 3: marked as absent") && refused.contains("jtc bench present"),
        "{refused}"
    );
    let refused = sim.jtc(&["teach", "on"]).ends(1).err;
    assert!(refused.contains("absent"), "{refused}");
    let refused = sim.jtc(&["jog", "3", "0.1", "--duration", "0.2"]).ends(4).err;
    assert!(refused.contains("joint 3 is set absent"), "{refused}");
    let way = sim.json(&["jog", "5", "0.1", "--duration", "0.5"], 0);
    let moved = way["to_rad"][4].as_f64().unwrap() - way["from_rad"][4].as_f64().unwrap();
    assert!(moved > 0.02, "{moved} rad");

    // Joints can be declared absent or present only while the drives produce no torque.
    let refused = sim.jtc(&["bench", "present"]).ends(1).err;
    assert!(refused.contains("jtc disable"), "{refused}");
    sim.jtc(&["disable", "--yes"]).ends(0);
    sim.jtc(&["bench", "present"]).ends(0);
    assert_eq!(sim.json(&["bench", "show"], 0)["absent"].as_array().unwrap().len(), 0);
    for wrong in [
        &["bench", "absent"][..],
        &["bench", "absent", "3"],
        &["bench", "absent", "7=0"],
        &["bench", "absent", "3=x"],
        &["bench", "absent", "3=0", "3=1"],
    ] {
        sim.jtc(wrong).ends(2);
    }
    let far = sim.jtc(&["bench", "absent", "3=90"]).ends(1).err;
    assert!(far.contains("--deg"), "{far}");
}

#[test]
fn j53_a_drive_that_answers_at_an_absent_joint_is_named() {
    let sim = Sim::start(&["--no-throttle"]);
    std::thread::sleep(std::time::Duration::from_secs(1));
    sim.jtc(&["bench", "absent", "2=0"]).ends(0);
    std::thread::sleep(std::time::Duration::from_millis(200));
    let doctor = sim.jtc(&["doctor"]).ends(1).out;
    assert!(doctor.contains("joint 2 is marked as absent, but its drive answers"), "{doctor}");
    sim.jtc(&["bench", "present"]).ends(0);
    let sim = sim.held();
    let status = sim.json(&["status"], 0);
    assert_eq!(status["state"], "HoldPos");
    assert_ne!(status["joints"][1]["state"], "absent");
}
