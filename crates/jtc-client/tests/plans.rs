//! Tests of trajectories through waypoints that the agent plans. The agent stores and executes these trajectories, or
//! refuses them with an error.
use crate::common;

use std::time::Duration;

use common::Served;
use common::program::Program;
use jtc_host::trajectory::Loaded;
use serde_json::{Value, json};
use test_kit::written::text_with;

const THREE: &str = "q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0\n0.4,0.2,-0.3,0,0.2,0\n0,0,0,0,0,0\n";
const SWING: &str = "q1,q2,q3,q4,q5,q6\n1.2,0.4,-0.9,0.8,0.6,1\n-1.2,-0.5,0.9,-0.8,-0.6,-1\n";
const CORNER: &str = "q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0\n0.4,0,0,0,0,0\n0.4,0,0,0.4,0,0\n";

#[test]
fn waypoints_become_a_trajectory_that_is_kept_and_run() {
    let served = Served::start(921_600);
    let plan = |body: Value| served.api("POST /api/plans", None, Some(body));
    let (status, planned) = plan(json!({ "waypoints": THREE }));
    assert_eq!(status, 200, "{planned}");
    assert!(planned["kept"].is_null() && planned["waypoints"] == 3, "{planned}");
    let trajectory =
        Loaded::parse(planned["text"].as_str().expect("a text"), None).expect("a file").trajectory;
    assert_eq!(planned["points"].as_u64(), Some(trajectory.points.len() as u64));
    let seconds = |planned: &Value| planned["duration_s"].as_f64().expect("a number");
    assert!((seconds(&planned) - trajectory.duration_s()).abs() < 1e-9);
    // The motion passes the second waypoint at the time in the response.
    let times = planned["waypoint_times_s"].as_array().expect("times");
    let at = times[1].as_f64().expect("a number") * 1000.0 / f64::from(trajectory.step_ms);
    assert!((trajectory.points[at.round() as usize].position[0] - 0.4).abs() < 1e-3);
    let binding = planned["binding"].as_array().expect("what binds");
    let words = ["velocity", "acceleration", "jerk", "torque", "stop", "friction", "given time"];
    assert!(
        !binding.is_empty() && binding.iter().all(|b| words.iter().any(|w| b["limit"] == *w)),
        "{binding:?}"
    );
    assert!(planned["joints"][1]["torque_peak_nm"].as_f64().is_some_and(|torque| torque > 1.0), "{planned}");

    // The plan keeps the default torque margin. If the request specifies a margin of 0, the remaining torque is
    // smaller, and the response contains a warning.
    let left = |planned: &Value| planned["margin"]["percent"].as_f64().expect("a margin");
    assert!(left(&planned) >= 15.0 && planned["warnings"] == json!([]), "{}", planned["margin"]);
    let tight = plan(json!({ "waypoints": SWING, "margin_percent": 0 })).1;
    assert!(left(&tight) < 10.0, "{}", tight["margin"]);
    assert!(tight["warnings"].to_string().contains("torque margin"), "{}", tight["warnings"]);
    let wide = plan(json!({ "waypoints": THREE, "margin_percent": 50 })).1;
    assert!(seconds(&wide) > seconds(&planned), "{}", seconds(&wide));

    // The request plans a slower motion with rounded corners, and stores it under a number.
    let slower = plan(json!({ "waypoints": THREE, "speed_percent": 50 })).1;
    assert!(seconds(&slower) > 1.5 * seconds(&planned), "{}", seconds(&slower));
    let keep = json!({ "number": 4, "name": "bow" });
    let sharp = plan(json!({ "waypoints": CORNER })).1;
    let (status, kept) = plan(json!({ "waypoints": CORNER, "blend_rad": 0.1, "keep": keep }));
    assert_eq!(
        (status, &kept["kept"]["number"], &kept["kept"]["name"]),
        (200, &json!(4), &json!("bow")),
        "{kept}"
    );
    assert!(seconds(&kept) < seconds(&sharp), "no stop at the second one");
    assert_eq!(served.api("GET /api/trajectories/4/check", None, None).1["passed"], true);
    let log = text_with(&served.log, &["\"planned\":true", "\"number\":4"]);
    assert!(
        log.lines().any(|line| line.contains("\"planned\":true") && line.contains("\"number\":4")),
        "{log}"
    );
    let anna = Program::new(&served, "anna", 30.0, "continue");
    anna.recover();
    let job = anna.begin("POST /api/runs", json!({ "trajectory": 4 }));
    // The agent can plan a motion while another motion is executed.
    assert_eq!(plan(json!({ "waypoints": THREE })).0, 200);
    assert_eq!(anna.over(job)["stage"], "finished");

    // The plan uses the limits of the controller: with a lower velocity limit, the motion takes longer.
    assert_eq!(anna.ask("POST /api/disable", None).0, 204);
    std::thread::sleep(Duration::from_millis(500));
    let slow = json!([{ "name": "velocity_max_rad_s", "joint": 1, "value": 0.1 }]);
    let (status, error) = anna.ask("PUT /api/settings", Some(json!({ "settings": slow })));
    assert_eq!(status, 204, "{error}");
    let planned = plan(json!({ "waypoints": THREE })).1;
    assert!(seconds(&planned) > 8.0, "{}", seconds(&planned));
    // A plan with a payload of 2 kg needs more torque.
    let heavy = json!({ "mass_kg": 2.0, "com_m": [0.0, 0.0, 0.1] });
    let loaded = plan(json!({ "waypoints": THREE, "payload": heavy })).1;
    let torque = |planned: &Value| planned["joints"][1]["torque_peak_nm"].as_f64().expect("a torque");
    assert!(torque(&loaded) > torque(&planned) + 5.0, "{} {}", torque(&loaded), torque(&planned));
}

#[test]
fn what_cannot_be_planned_is_refused_with_place_value_and_limit_and_is_not_kept() {
    let served = Served::start(921_600);
    let keep = json!({ "number": 4, "name": "bow" });
    let body = |waypoints: &str| json!({ "waypoints": waypoints, "keep": keep });
    let viewer = served.api_as(Some(&served.tokens.viewer), "POST /api/plans", None, Some(body(THREE)));
    assert_eq!(viewer.0, 403, "{}", viewer.1);
    assert_eq!(served.api_as(None, "POST /api/plans", None, Some(body(THREE))).0, 403);
    let far = THREE.replace("0.4,", "4,");
    let (status, error) = served.api("POST /api/plans", None, Some(body(&far)));
    assert_eq!(
        (status, &error["joint"], &error["value"], &error["limit"]),
        (409, &json!(1), &json!(4.0), &json!(2.97))
    );
    assert!(error["message"].as_str().is_some_and(|m| m.contains("line 3")), "{error}");
    let change = |key: &str, value: Value| {
        let mut body = body(THREE);
        body[key] = value;
        body
    };
    let many = format!("{THREE}{}", "0.1,0,0,0,0,0\n0,0,0,0,0,0\n".repeat(250));
    for (wrong, value, limit) in [
        (body("q1\n1"), Value::Null, Value::Null),
        (body(""), Value::Null, Value::Null),
        (body(&many), json!(503.0), json!(500.0)),
        (change("speed_percent", json!(101)), json!(101.0), json!(100.0)),
        (change("temperature_c", json!(-41)), json!(-41.0), json!(-40.0)),
        (change("margin_percent", json!(-1)), json!(-1.0), json!(0.0)),
        (change("margin_percent", json!(50.5)), json!(50.5), json!(50.0)),
        (change("margin_percent", json!(100)), json!(100.0), json!(50.0)),
        (change("blend_rad", json!(-1)), Value::Null, Value::Null),
        (change("blend_rad", json!(5)), json!(5.0), json!(0.5)),
        (change("blend_m", json!(20)), json!(20.0), json!(0.5)),
        (change("payload", json!({ "mass_kg": -1, "com_m": [0, 0, 0] })), Value::Null, Value::Null),
        (change("keep", json!({ "number": 100, "name": "" })), Value::Null, Value::Null),
        (change("waypoints", json!("pose\nnowhere\n")), Value::Null, Value::Null),
    ] {
        let (status, error) = served.api("POST /api/plans", None, Some(wrong.clone()));
        assert!(matches!(status, 409 | 422), "{wrong}: {status} {error}");
        assert_eq!((&error["value"], &error["limit"]), (&value, &limit), "{wrong}: {error}");
        assert!(error["next"].as_str().is_some_and(|next| !next.is_empty()), "{error}");
    }
    assert_eq!(served.api("POST /api/plans", None, Some(json!({ "waypoint": THREE }))).0, 400);
    assert_eq!(served.api("GET /api/trajectories", None, None).1, json!([]), "nothing is kept");
}
