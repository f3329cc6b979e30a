//! Tests that a Stop cancels earlier requests, even if parts of the requests arrive late.
use crate::common;

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::time::Duration;

use common::Served;
use common::program::Program;
use jtc_host::arm::AVENA_TOML;
use serde_json::{Value, json};
use test_kit::patience::until;
use test_kit::written::text_with;

fn positions(served: &Served) -> Vec<f64> {
    let (_, status) = served.api("GET /api/status", None, None);
    let joints = status["controller"]["joints"].as_array().expect("joints");
    joints.iter().map(|joint| joint["position_rad"].as_f64().expect("it is measured")).collect()
}

/// Sends the header of a request without its body.
fn begin(served: &Served, request: &str, key: &str, body: &str) -> TcpStream {
    let mut stream = TcpStream::connect(served.address).expect("it listens");
    let head = format!(
        "{request} HTTP/1.1\r\nHost: {}\r\nAuthorization: Bearer {}\r\nLease-Key: {key}\r\nContent-Type: application/json\r\n\
         Connection: close\r\nContent-Length: {}\r\n\r\n",
        served.address,
        served.tokens.operator,
        body.len()
    );
    stream.write_all(head.as_bytes()).expect("it reads");
    stream
}

#[test]
fn a_request_that_began_before_a_stop_moves_nothing_however_late_its_body_comes() {
    let served = Served::start(921_600);
    let anna = Program::new(&served, "anna", 60.0, "continue");
    anna.recover();
    let before = positions(&served);
    let body = json!({ "to_rad": [0.2, 0.2, 0.2, 0.2, 0.2, 0.2] }).to_string();
    let mut late = begin(&served, "POST /api/moves", &anna.key, &body);
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(served.get("POST /api/stop").0, 200);
    // The test waits until the hold-off of three seconds has passed.
    std::thread::sleep(Duration::from_millis(3_300));
    late.write_all(body.as_bytes()).expect("it reads");
    let mut answer = String::new();
    late.read_to_string(&mut answer).expect("text");
    assert!(answer.starts_with("HTTP/1.1 409") && answer.contains("denied"), "{answer}");
    std::thread::sleep(Duration::from_millis(500));
    let after = positions(&served);
    assert!(before.iter().zip(&after).all(|(a, b)| (a - b).abs() < 1e-3), "{before:?} {after:?}");
    // A new request for the same motion succeeds.
    let job = anna.begin("POST /api/moves", serde_json::from_str(&body).expect("JSON"));
    assert_eq!(anna.over(job)["stage"], "finished");
}

#[test]
fn halts_that_no_agent_has_counted_are_refused_with_what_it_has() {
    let served = Served::start(921_600);
    let anna = Program::new(&served, "anna", 60.0, "continue");
    anna.recover();
    let (status, error) =
        anna.ask("POST /api/jog?asked_after=7", Some(json!({ "rates_rad_s": vec![0.1; 6] })));
    assert_eq!((status, &error["value"], &error["limit"]), (400, &json!(7.0), &json!(0.0)), "{error}");
}

#[test]
fn a_stop_ends_an_arm_that_is_being_given_and_what_is_in_use_of_it_is_named() {
    // At this bit rate, the upload takes long enough for a Stop during the upload.
    let served = Served::start(115_200);
    let text =
        AVENA_TOML.replacen("name = \"avena\"", "name = \"other\"", 1) + "\n[settings]\nstop_ms = 400\n";
    let anna = Program::new(&served, "anna", 60.0, "continue");
    let (status, job) = anna.ask("PUT /api/arm", Some(json!({ "text": text })));
    assert_eq!(status, 202, "{job}");
    text_with(&served.log, &["SetSettings"]);
    assert_eq!(served.get("POST /api/stop").0, 200);
    let done = anna.over(job["number"].as_u64().expect("a number"));
    assert_eq!((&done["stage"], &done["error"]["code"]), (&json!("stopped"), &json!("stopped")), "{done}");
    // The first frames were sent before the Stop. After the Stop, the controller keeps the parameters that it has
    // already accepted.
    let (message, given) = (done["error"]["message"].as_str().expect("words"), &done["given"]);
    assert!(message.contains("the controller already uses: one setting"), "{done}");
    assert_eq!(message.contains("its name"), given["named"] == true, "{done}");
    let (_, status) = served.api("GET /api/status", None, None);
    assert_eq!(status["controller"]["state"], "Init", "it has no torque: {done}");
}

#[test]
fn a_plan_that_nobody_waits_for_any_more_takes_no_number() {
    let served = Served::start(921_600);
    let two = "q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0\n0.4,0.2,-0.3,0,0.2,0\n";
    let keep = |name: &str, waypoints: &str| {
        let body = json!({ "waypoints": waypoints, "keep": { "number": 7, "name": name } });
        served.api("POST /api/plans", None, Some(body))
    };
    assert_eq!(keep("mine", two).0, 200);
    // The planning of a path with many corners takes seconds.
    let mut many = String::from("q1,q2,q3,q4,q5,q6\n");
    for i in 0..400 {
        many += &format!(
            "{},{},0,{},0,0\n",
            0.3 * f64::from(i % 2),
            0.2 * f64::from(i % 3),
            0.1 * f64::from(i % 5)
        );
    }
    let body = json!({ "waypoints": many, "blend_rad": 0.02, "keep": { "number": 7, "name": "abandoned" } })
        .to_string();
    let mut gone = begin(&served, "POST /api/plans", "none", &body);
    gone.write_all(body.as_bytes()).expect("it reads");
    std::thread::sleep(Duration::from_millis(200));
    let is_planned =
        || served.api("POST /api/plans", None, Some(json!({ "waypoints": two }))).1["code"] == "busy";
    assert!(is_planned(), "it is over before anybody could leave");
    drop(gone);
    until("the end of the plan", || !is_planned());
    let (_, list) = served.api("GET /api/trajectories", None, None);
    let names: Vec<&Value> = list.as_array().expect("a list").iter().map(|kept| &kept["name"]).collect();
    assert_eq!(names, ["mine"], "{list}");
}
