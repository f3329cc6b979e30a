//! Tests of settings and other parameters of a controller by HTTP. The agent refuses changes by other clients, and
//! changes in the wrong state. The agent applies all changes of a request, or none of them.
use crate::common;

use common::Served;
use common::program::{Program, event, is_for_the_one_who_commands, logged};
use serde_json::{Value, json};

fn setting(served: &Served, name: &str, joint: Option<u8>) -> f64 {
    let (status, all) = served.api_as(Some(&served.tokens.viewer), "GET /api/settings", None, None);
    assert_eq!(status, 200, "{all}");
    let all = all.as_array().expect("settings");
    let is = |one: &&Value| one["name"] == name && one["joint"].as_u64() == joint.map(u64::from);
    let found = all.iter().find(is).unwrap_or_else(|| panic!("{name} {joint:?}"));
    let number = |key: &str| found[key].as_f64().expect("a number");
    assert!((number("low")..=number("high")).contains(&number("value")), "{found}");
    number("value")
}

#[test]
fn settings_are_read_and_changed_all_together_or_not_at_all() {
    let served = Served::start(921_600);
    let anna = Program::new(&served, "anna", 30.0, "continue");
    let change = |settings: Value| anna.ask("PUT /api/settings", Some(json!({ "settings": settings })));
    let good = json!([
        { "name": "host_timeout_ms", "value": 1500 },
        { "name": "velocity_max_rad_s", "joint": 2, "value": 0.75 },
    ]);
    is_for_the_one_who_commands(&served, "PUT /api/settings", &json!({ "settings": good }));
    assert_eq!(setting(&served, "host_timeout_ms", None), 0.0);
    let (status, error) = change(good.clone());
    assert_eq!(status, 204, "{error}");
    assert_eq!(setting(&served, "host_timeout_ms", None), 1500.0);
    assert_eq!(setting(&served, "velocity_max_rad_s", Some(2)), 0.75);
    assert_eq!(setting(&served, "velocity_max_rad_s", Some(3)), 1.5);
    let lines = logged(&served, "host_timeout_ms = 1500, velocity_max_rad_s of joint 2 = 0.75");
    assert!(lines.len() == 1 && lines[0]["why_not"].is_null(), "{lines:?}");

    // Each invalid setting is sent together with a valid setting. The agent refuses both settings.
    for (wrong, facts) in [
        (json!({ "name": "host_timeout", "value": 1 }), [Value::Null, json!(1.0), Value::Null]),
        (json!({ "name": "host_timeout_ms", "value": 60001 }), [Value::Null, json!(60001.0), json!(60000.0)]),
        (json!({ "name": "ramp_ms", "value": 100.5 }), [Value::Null, json!(100.5), Value::Null]),
        (json!({ "name": "kp_max", "joint": 1, "value": 5 }), [json!(1), json!(5.0), Value::Null]),
        (json!({ "name": "torque_max_nm", "value": 5 }), [Value::Null, json!(5.0), Value::Null]),
        (json!({ "name": "torque_max_nm", "joint": 7, "value": 5 }), [Value::Null, json!(5.0), Value::Null]),
        (json!({ "name": "torque_max_nm", "joint": 6, "value": -1 }), [json!(6), json!(-1.0), json!(0.01)]),
        (json!({ "name": "stop_ms", "value": 400 }), [Value::Null, json!(400.0), Value::Null]),
        (json!({ "name": "payload_mass_kg", "value": 1 }), [const { Value::Null }; 3]),
        // The value is within the range of the setting, but is not below the highest position of the joint. The agent
        // therefore refuses it.
        (json!({ "name": "position_min_rad", "joint": 4, "value": 3 }), [json!(4), json!(3.0), json!(2.97)]),
    ] {
        let (status, error) = change(json!([{ "name": "stop_ms", "value": 300 }, wrong]));
        assert_eq!((status, error["code"].as_str()), (422, Some("setting")), "{wrong}: {error}");
        if wrong["name"] != "host_timeout" {
            let found = ["joint", "value", "limit"].map(|key| error[key].clone());
            assert_eq!(found, facts, "{wrong}: {error}");
        }
        assert_eq!(setting(&served, "stop_ms", None), 500.0, "{wrong}");
    }
    let many = vec![json!({ "name": "stop_ms", "value": 300 }); 257];
    for none in [json!([]), json!(many), json!([{ "name": "stop_ms" }]), json!({})] {
        assert!(matches!(change(none).0, 400 | 422));
    }

    // While the torque is on, the controller refuses these settings and keeps its parameters, but accepts some other
    // settings.
    anna.recover();
    let (status, error) = change(json!([{ "name": "stop_ms", "value": 300 }]));
    assert!(status == 409 && error["next"].as_str().is_some_and(|n| n.contains("torque")), "{error}");
    assert_eq!(setting(&served, "stop_ms", None), 500.0);
    assert_eq!(change(json!([{ "name": "speed", "value": 0.5 }])).0, 204);
    assert_eq!(setting(&served, "speed", None), 0.5);
    let job = anna.begin("POST /api/moves", json!({ "to_rad": [0.4, 0.0, 0.0, 0.0, 0.0, 0.0] }));
    event(&served, 0, "executing");
    let (status, busy) = change(json!([{ "name": "stop_ms", "value": 300 }]));
    assert_eq!((status, busy["code"].as_str()), (409, Some("busy")), "{busy}");
    assert_eq!(anna.over(job)["stage"], "finished");
}

#[test]
fn joints_are_set_absent_and_present_without_torque_alone() {
    let served = Served::start(921_600);
    let anna = Program::new(&served, "anna", 30.0, "continue");
    let absent = || served.api_as(Some(&served.tokens.viewer), "GET /api/absent", None, None).1;
    let set = |absent: Value| anna.ask("PUT /api/absent", Some(json!({ "absent": absent })));
    let two = json!([{ "joint": 3, "position_rad": 0.5 }, { "joint": 6, "position_rad": -1.0 }]);
    is_for_the_one_who_commands(&served, "PUT /api/absent", &json!({ "absent": two }));
    assert_eq!(absent(), json!({ "absent": [] }));
    for (wrong, joint, limit) in [
        (json!({ "joint": 2, "position_rad": 6.3 }), json!(2), json!(6.2832)),
        (json!({ "joint": 3, "position_rad": 0 }), json!(3), Value::Null),
        (json!({ "joint": 7, "position_rad": 0 }), Value::Null, Value::Null),
        (json!({ "joint": 0, "position_rad": 0 }), Value::Null, Value::Null),
    ] {
        let (status, error) = set(json!([{ "joint": 3, "position_rad": 0.5 }, wrong]));
        assert_eq!((status, &error["joint"], &error["limit"]), (422, &joint, &limit), "{wrong}: {error}");
    }
    assert_eq!(absent(), json!({ "absent": [] }), "nothing by half");
    let (status, error) = set(two.clone());
    assert_eq!(status, 204, "{error}");
    let found = absent();
    let ones = found["absent"].as_array().expect("joints");
    let near = |one: &Value, at: f64| (one["position_rad"].as_f64().expect("rad") - at).abs() < 1e-6;
    assert!(
        ones.len() == 2 && ones[0]["joint"] == 3 && near(&ones[0], 0.5) && near(&ones[1], -1.0),
        "{found}"
    );
    assert_eq!(logged(&served, "absent: joint 3 at 0.5 rad, joint 6 at -1 rad").len(), 1);
    assert_eq!(set(json!([])).0, 204);
    assert_eq!(absent(), json!({ "absent": [] }));
    anna.recover();
    let (status, error) = set(two);
    assert!(status == 409 && error["next"].as_str().is_some_and(|n| n.contains("disable")), "{error}");
    assert_eq!(absent(), json!({ "absent": [] }));
}
