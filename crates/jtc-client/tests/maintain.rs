//! Tests of the recovery of a controller by HTTP: clearing errors, resetting nodes, stored and uploaded arms, and the
//! results of the doctor.
use crate::common;

use std::time::Duration;

use common::Served;
use common::program::{Program, event, is_for_the_one_who_commands, logged};
use jtc_host::Arm;
use jtc_host::arm::AVENA_TOML;
use jtc_host::port::sim::LivePort;
use jtc_sim::{Fault, FaultKind, FaultPlan, SimConfig, Trigger, World};
use jtc_wire::Joint;
use serde_json::{Value, json};
use test_kit::patience::Patience;

fn look(served: &Served, request: &str) -> (u16, Value) {
    served.api_as(Some(&served.tokens.viewer), request, None, None)
}

fn until(served: &Served, is: impl Fn(&Value) -> bool) -> Value {
    let mut patience = Patience::begin();
    loop {
        let controller = look(served, "GET /api/status").1["controller"].clone();
        if is(&controller) {
            return controller;
        }
        patience.pause(format_args!("a change of the controller: {controller}"));
    }
}

fn findings(served: &Served) -> (bool, Vec<Value>) {
    let (status, found) = look(served, "GET /api/doctor");
    assert_eq!(status, 200, "{found}");
    assert!(found["statuses"].as_u64().is_some_and(|n| n > 30), "{found}");
    (found["healthy"] == true, found["findings"].as_array().expect("findings").clone())
}

#[test]
fn nodes_start_anew_and_an_arm_with_torque_falls_only_where_it_may() {
    let served = Served::start(921_600);
    let anna = Program::new(&served, "anna", 60.0, "continue");
    let (healthy, found) = findings(&served);
    assert!(!healthy && found[0]["what"].as_str().is_some_and(|w| w.contains("not given yet")), "{found:?}");
    anna.recover();
    let (healthy, found) = findings(&served);
    assert!(healthy && found.iter().all(|f| f["severity"] == "good"), "{found:?}");

    is_for_the_one_who_commands(&served, "POST /api/reset", &json!({ "all": true }));
    for (wrong, status) in [
        (json!({}), 422),
        (json!({ "joints": [7] }), 422),
        (json!({ "joints": [0] }), 422),
        (json!({ "joint": 1 }), 422),
        (json!({ "joints": [3] }), 409),
        (json!({ "all": true }), 409),
    ] {
        let (is, error) = anna.ask("POST /api/reset", Some(wrong.clone()));
        assert!(is == status || is == 400, "{wrong}: {is} {error}");
        assert!(error["next"].as_str().is_some_and(|next| !next.is_empty()), "{error}");
    }
    assert_eq!(look(&served, "GET /api/status").1["controller"]["state"], "HoldPos");
    assert_eq!(anna.ask("POST /api/reset", Some(json!({ "joints": [3], "arm_may_fall": true }))).0, 204);
    until(&served, |controller| controller["state"] != "HoldPos");
    assert_eq!(logged(&served, "reset joint 3").len(), 2, "what was refused is written down, too");
    anna.recover();
    // During teaching no joint can be reset, even with permission to let the arm fall. The gripper can be reset.
    assert_eq!(anna.ask("POST /api/teach", Some(json!({ "on": true }))).0, 204);
    let (status, error) = anna.ask("POST /api/reset", Some(json!({ "joints": [3], "arm_may_fall": true })));
    assert_eq!((status, error["code"].as_str()), (409, Some("powered")), "{error}");
    assert_eq!(look(&served, "GET /api/status").1["controller"]["state"], "Teaching");
    assert_eq!(anna.ask("POST /api/reset", Some(json!({ "gripper": true, "arm_may_fall": true }))).0, 204);
}

/// A drive fails while the arm is held. A request can clear this drive alone or together with all other drives.
#[test]
fn single_nodes_are_cleared_and_a_doctor_names_them() {
    let arm = Arm::avena();
    let kind = FaultKind::MotorFault { joint: Joint::ALL[1], bits: 0x40 };
    let held = Trigger::InState(jtc_wire::ControllerState::HoldPos, 300);
    let faults = vec![Fault { kind, trigger: held, duration_ms: Some(200) }];
    let faults = FaultPlan { faults, ..FaultPlan::default() };
    let config = SimConfig { baud: Some(921_600), faults, ..SimConfig::new(arm.config(), &arm.parameters()) };
    let served = Served::start_on(LivePort::new(World::new(config)), None, &[]);
    let anna = Program::new(&served, "anna", 60.0, "continue");
    anna.recover();
    let failed = until(&served, |controller| controller["state"] == "Error");
    assert_eq!(failed["causes"][0], "joint 2: motor-control fault", "{failed}");
    let (healthy, found) = findings(&served);
    assert!(!healthy && found.iter().any(|f| f["what"] == "joint 2: motor-control fault"), "{found:?}");

    // A request that clears only other drives is refused, because it has no effect on this fault (J-21).
    is_for_the_one_who_commands(&served, "POST /api/clear", &json!({ "joints": [2] }));
    let (status, error) = anna.ask("POST /api/clear", Some(json!({ "joints": [5], "gripper": true })));
    assert_eq!((status, error["code"].as_str()), (409, Some("refused")), "{error}");
    std::thread::sleep(Duration::from_millis(500));
    assert_eq!(look(&served, "GET /api/status").1["controller"]["state"], "Error");
    assert_eq!(anna.ask("POST /api/clear", Some(json!({ "joints": [9] }))).0, 422);
    assert_eq!(anna.ask("POST /api/clear", Some(json!({ "joints": [2] }))).0, 204);
    let cleared = until(&served, |controller| controller["state"] != "Error");
    assert_eq!(cleared["errors"], json!([]), "{cleared}");
    assert_ne!(cleared["errors_occurred"], json!([]), "those that have occurred stay");
    // A request without a body or with an empty body clears all occurred errors.
    for body in [None, Some(json!({}))] {
        assert_eq!(anna.ask("POST /api/clear", body).0, 204);
    }
    until(&served, |controller| controller["errors_occurred"] == json!([]));
    assert_eq!(logged(&served, "clear joint 2").len(), 1);
}

#[test]
fn a_controller_is_given_its_defaults_or_an_arm_and_tells_its_speed() {
    let served = Served::start(921_600);
    let anna = Program::new(&served, "anna", 60.0, "continue");
    assert_eq!(look(&served, "GET /api/speed"), (200, json!({ "percent": 100 })));
    assert_eq!(anna.ask("PUT /api/speed", Some(json!({ "percent": 35 }))).0, 204);
    assert_eq!(look(&served, "GET /api/speed"), (200, json!({ "percent": 35 })));

    // An uploaded arm must be complete. A recovery does not send the limits of the arm. If the arm and the controller have different
    // limits, the request must accept the difference.
    is_for_the_one_who_commands(&served, "POST /api/recover", &json!({ "arm": AVENA_TOML }));
    let heavy = AVENA_TOML.replacen("mass_kg = 4", "mass_kg = 5", 1);
    let other = heavy.replacen("position_max_rad = 2.97", "position_max_rad = 2.5", 1);
    assert!(heavy != AVENA_TOML && other != heavy);
    for wrong in [
        json!({ "arm": "no arm" }),
        json!({ "arm": AVENA_TOML, "defaults": true }),
        json!({ "arm": Arm::avena().to_urdf() }),
    ] {
        let (status, error) = anna.ask("POST /api/recover", Some(wrong));
        assert!(matches!(status, 409 | 422), "{status} {error}");
        assert!(error["next"].as_str().is_some_and(|next| !next.is_empty()), "{error}");
    }
    let refused = anna.over(anna.begin("POST /api/recover", json!({ "arm": other })));
    assert_eq!(
        (&refused["stage"], &refused["error"]["code"]),
        (&json!("failed"), &json!("device-limits")),
        "{refused}"
    );
    let mass = || look(&served, "GET /api/arm/model").1["links"][2]["mass_kg"].as_f64().expect("a mass");
    let before = mass();
    let body = json!({ "arm": other, "accept_device_limits": true });
    let job = anna.begin("POST /api/recover", body);
    assert_eq!(anna.over(job)["stage"], "finished");
    assert!(event(&served, 0, "note").1["text"].is_string());
    let masses: Vec<f64> =
        Arm::parse(&other).expect("an arm").model.links.iter().map(|link| link.mass).collect();
    let shown = look(&served, "GET /api/arm/model").1;
    for (n, mass) in masses.iter().enumerate() {
        assert!((shown["links"][n]["mass_kg"].as_f64().expect("a mass") - mass).abs() < 1e-5, "{shown}");
    }
    assert_eq!(look(&served, "GET /api/status").1["controller"]["state"], "HoldPos");

    // The arm of the controller is selected again while the torque is off. The controller then holds the arm.
    assert_eq!(anna.ask("POST /api/disable", None).0, 204);
    until(&served, |controller| controller["state"] == "Init");
    assert_eq!(served.api("POST /api/arm/defaults", None, None).0, 403);
    assert_eq!(anna.ask("POST /api/arm/defaults", None).0, 204);
    until(&served, |controller| controller["state"] == "HoldPos");
    assert_eq!(mass(), before);
    // A request that was sent before a Stop cannot enable the torque.
    assert_eq!(served.get("POST /api/stop").0, 200);
    assert_eq!(anna.ask("POST /api/arm/defaults?asked_after=0", None).0, 409);
}
