//! Tests that the command log contains the executed commands and their results, even for clients that have disconnected.
use crate::common;

use std::io::Write as _;
use std::net::TcpStream;
use std::time::Duration;

use common::Served;
use serde_json::{Value, json};
use test_kit::patience::Patience;

/// Waits for the first log line for which `is` returns `true`, and returns this line.
fn line(served: &Served, what: &str, is: impl Fn(&Value) -> bool) -> Value {
    let mut patience = Patience::begin();
    loop {
        let log = std::fs::read_to_string(&served.log).expect("the log");
        let lines = log.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
        if let Some(line) = lines.into_iter().find(|line| is(line)) {
            return line;
        }
        patience.pause(format_args!("{what} in {log}"));
    }
}

#[test]
fn what_a_client_has_done_is_in_the_log_when_it_hangs_up() {
    let (served, key) = Served::numbered(1);
    assert_eq!(served.api("POST /api/boards/1/start", Some(&key), None).0, 200);
    let first = served.board(1)["offers"]["parameters"][0].as_str().expect("a name").to_owned();
    let (name, token) = (first.split(' ').next().unwrap_or_default(), served.tokens.operator.clone());
    // The client disconnects before it receives an answer. The test sends the command again until the agent has executed the
    // command of a disconnected client.
    let done = (100..140).find(|word| {
        let body = json!({ "value": word }).to_string();
        let request = format!(
            "PUT /api/boards/1/parameters/{name} HTTP/1.1\r\nHost: {}\r\nAuthorization: Bearer {token}\r\n\
             Lease-Key: {key}\r\nContent-Type: application/json\r\nContent-Length: {}\r\n\r\n{body}",
            served.address,
            body.len()
        );
        let mut stream = TcpStream::connect(served.address).expect("it listens");
        stream.write_all(request.as_bytes()).expect("it reads");
        std::thread::sleep(Duration::from_millis(4));
        drop(stream);
        std::thread::sleep(Duration::from_millis(200));
        let (_, values) = served.api("GET /api/boards/1/values", None, None);
        values["parameters"][0]["value"] == f64::from(*word)
    });
    let word = done.expect("one was done");
    let found = line(&served, "line of it", |line| line["asked"]["value"] == json!(f64::from(word)));
    assert_eq!(
        (&found["command"], &found["asked"]["name"], &found["why_not"]),
        (&json!("parameter"), &json!(name), &Value::Null)
    );
}

#[test]
fn a_lapse_its_stop_and_what_became_of_jobs_are_in_the_log() {
    let (served, key) = Served::numbered(1);
    let ended = |line: &Value| line["what"] == "ended" && line["event"]["outcome"] == "finished";
    assert_eq!(line(&served, "end of the job", ended)["event"]["job"], 1);
    assert_eq!(served.api("DELETE /api/lease", Some(&key), None).0, 204);
    let anna = served.lease("anna", 6.0, "stop");
    served.run(&anna, &[1]);
    let lapsed = |line: &Value| {
        line["what"] == "stop" && line["event"]["by"].as_str().is_some_and(|by| by.contains("anna"))
    };
    line(&served, "Stop by the policy", lapsed);
    let stopped = line(&served, "confirmation", |line| line["what"] == "stopped");
    assert_eq!(stopped["event"]["boards"], json!([1]));
    let lease =
        |holder: Value| move |line: &Value| line["what"] == "lease" && line["event"]["holder"] == holder;
    line(&served, "who commanded", lease(json!("anna")));
    line(&served, "lapse", lease(Value::Null));
}

/// The log contains executed and refused requests; a refused request has a reason. The log does not contain read-only requests.
#[test]
fn what_was_denied_is_in_the_log() {
    let (served, key) = Served::numbered(1);
    let (_, error) = served.api("POST /api/run", None, Some(json!({})));
    let denied = |asked: &'static str| move |line: &Value| line["what"] == "denied" && line["asked"] == asked;
    let found = line(&served, "denial without a lease", denied("POST /api/run"));
    assert_eq!((&found["why"], &found["code"]), (&error["message"], &json!("no-lease")), "{found}");
    assert!(found["from"].as_str().is_some_and(|from| from.starts_with("127.0.0.1:")), "{found}");
    assert_eq!(served.api("POST /api/boards/77/start", Some(&key), None).0, 422);
    line(&served, "denial of a board", denied("POST /api/boards/77/start"));
    assert_eq!(served.api("GET /api/boards/77", None, None).0, 404);
    assert_eq!(served.api("DELETE /api/lease", Some(&key), None).0, 204);
    line(&served, "end", |line| line["what"] == "left");
    let log = std::fs::read_to_string(&served.log).expect("the log");
    assert!(!log.contains("GET /api/boards/77"), "{log}");
}
