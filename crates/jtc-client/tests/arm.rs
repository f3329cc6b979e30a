//! Tests of a complete arm by HTTP. A client reads, uploads and stores the arm. An invalid arm is refused completely.
use crate::common;

use common::Served;
use common::program::{Program, event, is_for_the_one_who_commands};
use jtc_host::Arm;
use jtc_host::arm::AVENA_TOML;
use serde_json::{Value, json};
use test_kit::patience::until;
use test_kit::written::text_with;

fn arm(served: &Served) -> (Arm, Value) {
    let (status, found) = served.api_as(Some(&served.tokens.viewer), "GET /api/arm", None, None);
    assert_eq!(status, 200, "{found}");
    (Arm::parse(found["text"].as_str().expect("a text")).expect("an arm file"), found)
}

/// Returns the text of the default arm file in which `from` is replaced by `to`.
fn other(from: &str, to: &str) -> String {
    assert!(AVENA_TOML.contains(from), "{from}");
    AVENA_TOML.replacen(from, to, 1)
}

#[test]
fn an_arm_is_read_given_and_stored_and_what_is_none_changes_nothing() {
    let served = Served::start(921_600);
    let anna = Program::new(&served, "anna", 60.0, "continue");
    let (before, found) = arm(&served);
    let same = |a: &Arm, b: &Arm| a.hash().expect("numbers") == b.hash().expect("numbers");
    assert!(same(&before, &Arm::avena()) && before.name == "avena", "{found}");
    let info = served.api("GET /api/info", None, None).1;
    assert_eq!(info["hash"], found["hash"]);

    let text = other("name = \"avena\"", "name = \"bench two\"") + "\n[settings]\nstop_ms = 400\n";
    let wanted = Arm::parse(&text).expect("an arm");
    let body = json!({ "text": text });
    is_for_the_one_who_commands(&served, "PUT /api/arm", &body);
    for wrong in [
        "no arm".to_owned(),
        String::new(),
        text.replace("stop_ms = 400", "stop_ms = 5"),
        text.replace("stop_ms", "stop_mss"),
        // The arm is complete, but contains a parameter that no controller accepts.
        text.replace("stop_ms = 400", "kp_max = 1"),
    ] {
        let (status, error) = anna.ask("PUT /api/arm", Some(json!({ "text": wrong })));
        assert_eq!(status, 422, "{error}");
        assert!(error["next"].as_str().is_some_and(|next| !next.is_empty()), "{error}");
    }
    assert_eq!(anna.ask("PUT /api/arm", Some(json!({ "text": 1 }))).0, 400);
    assert_eq!(arm(&served).1, found, "nothing by half");

    let job = anna.begin("PUT /api/arm", body.clone());
    let done = anna.over(job);
    assert_eq!(done["stage"], "finished", "{done}");
    let (now, found) = arm(&served);
    assert!(same(&now, &wanted) && now.name == "bench two" && !same(&now, &before), "{found}");
    assert_eq!(done["given"]["hash"], found["hash"]);
    assert_eq!(done["given"]["parts"].as_array().map(Vec::len), Some(3), "{done}");
    assert!(done["given"]["stored_number"].is_null());
    assert_eq!(event(&served, 0, "given").1["job"], job);

    // After the recovery, the controller holds the arm. While the torque is on, the controller rejects an arm with
    // other settings and applies none of its values.
    anna.recover();
    let job = anna.begin("PUT /api/arm", json!({ "text": AVENA_TOML }));
    let failed = anna.over(job);
    assert_eq!(
        (&failed["stage"], &failed["error"]["code"]),
        (&json!("failed"), &json!("refused")),
        "{failed}"
    );
    assert!(failed["error"]["next"].as_str().is_some_and(|next| next.contains("disable")), "{failed}");
    let job = anna.begin("PUT /api/arm", json!({ "text": AVENA_TOML, "store": true }));
    assert_eq!(anna.over(job)["error"]["code"], "powered");
    assert_eq!(arm(&served).1, found);

    assert_eq!(anna.ask("POST /api/disable", None).0, 204);
    until("Init", || served.api("GET /api/status", None, None).1["controller"]["state"] == "Init");
    let job = anna.begin("PUT /api/arm", json!({ "text": AVENA_TOML, "store": true }));
    let done = anna.over(job);
    assert_eq!((&done["stage"], &done["given"]["stored_number"]), (&json!("finished"), &json!(1)), "{done}");
    assert!(same(&arm(&served).0, &before));
    text_with(&served.log, &["\"arm bench two\"", "\"arm avena, stored\""]);
}
