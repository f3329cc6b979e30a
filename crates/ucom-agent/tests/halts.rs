//! Tests that a request from before a Stop moves no board after the Stop. The tests use different delays of the
//! request, and Stops of different clients.
use crate::common;

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::time::Duration;

use common::Served;
use serde_json::{Value, json};

/// Time that is longer than the hold-off of three seconds after a Stop of another client.
const CALM: Duration = Duration::from_millis(3_300);

fn last_halt(served: &Served) -> u64 {
    served.api("GET /api/status", None, None).1["last_halt"].as_u64().expect("a number")
}

/// Stops the boards, with or without a lease key, and returns the number of the Stop.
fn stop(served: &Served, key: Option<&str>) -> u64 {
    let (status, sent) = served.api("POST /api/stop", key, None);
    assert_eq!(status, 200, "{sent}");
    let number = sent["halt"].as_u64().expect("a number");
    assert_eq!(last_halt(served), number);
    number
}

/// Checks that the agent refused the request, and that the message contains the name of the client that requested the Stop.
fn is_stopped((status, error): (u16, Value), by: &str) {
    assert_eq!((status, error["code"].as_str()), (409, Some("stopped")), "{error}");
    assert!(error["message"].as_str().is_some_and(|text| text.starts_with(by)), "{error}");
}

/// Sends the head of a request, without the body.
fn begin(served: &Served, request: &str, key: &str, body: &str) -> TcpStream {
    let (address, token, length) = (served.address, &served.tokens.operator, body.len());
    let mut socket = TcpStream::connect(address).expect("it listens");
    write!(
        socket,
        "{request} HTTP/1.1\r\nHost: {address}\r\nAuthorization: Bearer {token}\r\nLease-Key: {key}\r\n\
         Content-Type: application/json\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n"
    )
    .expect("it reads");
    // After this wait, the agent has received the head of the request.
    std::thread::sleep(Duration::from_millis(300));
    socket
}

/// Sends the body of a request, and returns the answer.
fn finish(mut socket: TcpStream, body: &str) -> String {
    socket.write_all(body.as_bytes()).expect("it reads");
    let mut answer = String::new();
    socket.read_to_string(&mut answer).expect("text");
    answer
}

/// Checks that no application runs on any board, which proves that the agent has sent no start.
fn nothing_runs(served: &Served) {
    let (_, boards) = served.api("GET /api/boards", None, None);
    for board in boards.as_array().expect("boards") {
        assert_eq!(board["state"], "exloader", "{board}");
    }
}

#[test]
fn a_run_that_was_asked_for_before_a_stop_is_refused_and_one_behind_it_runs() {
    let (served, key) = Served::numbered(2);
    assert_eq!(last_halt(&served), 0);
    let halt = stop(&served, None);
    assert_eq!(halt, 1);
    std::thread::sleep(CALM);
    let run = |after: u64| {
        let body = json!({ "boards": [1, 2], "active": true });
        served.api(&format!("POST /api/run?asked_after={after}"), Some(&key), Some(body))
    };
    is_stopped(run(halt - 1), "127.0.0.1");
    nothing_runs(&served);
    let (status, job) = run(halt);
    assert_eq!(status, 202, "{job}");
    assert_eq!(served.over(job["number"].as_u64().expect("a number"))["stage"], "finished");
    assert_eq!(served.board(1)["active"], true);
}

#[test]
fn a_body_that_arrives_behind_a_stop_starts_nothing() {
    let (served, key) = Served::numbered(2);
    let run = json!({ "boards": [1, 2], "active": true }).to_string();
    let update =
        json!({ "boards": [{ "board": 1 }], "image": "AAAA", "format": "bin", "start": true }).to_string();
    let late = [("POST /api/run", &run), ("POST /api/updates", &update)]
        .map(|(request, body)| (begin(&served, request, &key, body), body));
    // The agent also refuses a request that is older than the client's own Stop, although this Stop causes no
    // hold-off.
    stop(&served, Some(&key));
    let last = served.last_event();
    for (socket, body) in late {
        let answer = finish(socket, body);
        assert!(answer.starts_with("HTTP/1.1 409") && answer.contains("\"stopped\""), "{answer}");
    }
    let (_, all) = served.api(&format!("GET /api/events?after={last}"), None, None);
    let begun = all["events"].as_array().expect("events").iter().any(|e| e["event"]["kind"] == "begun");
    assert!(!begun, "{all}");
    nothing_runs(&served);
    // A new request for the run succeeds.
    served.run(&key, &[1, 2]);
}

#[test]
fn stops_that_no_agent_has_counted_are_refused_with_what_it_has() {
    let (served, key) = Served::numbered(1);
    stop(&served, Some(&key));
    for (request, body) in [
        ("POST /api/run", Some(json!({ "boards": [1] }))),
        ("POST /api/init", Some(json!({}))),
        ("POST /api/updates", Some(json!({ "boards": [{ "board": 1 }], "image": "AAAA", "format": "bin" }))),
        ("PUT /api/boards/1/inputs/set_position", Some(json!({ "value": 7 }))),
        ("PUT /api/boards/1/parameters/gain", Some(json!({ "value": 7 }))),
        ("PUT /api/boards/1/outputs", Some(json!({ "active": true }))),
        ("POST /api/boards/1/start", None),
        ("POST /api/boards/1/reset", None),
    ] {
        let (status, error) = served.api(&format!("{request}?asked_after=7"), Some(&key), body.clone());
        let found = (status, &error["value"], &error["limit"]);
        assert_eq!(found, (400, &json!(7.0), &json!(1.0)), "{request}: {error}");
        // The agent refuses each of these requests if it is older than the Stop, whichever client requested the Stop.
        is_stopped(served.api(&format!("{request}?asked_after=0"), Some(&key), body), "anna");
    }
    nothing_runs(&served);
    let (status, error) = served.api("POST /api/run?asked_after=-1", Some(&key), Some(json!({})));
    assert_eq!(status, 400, "{error}");
}

#[test]
fn an_input_behind_ones_own_stop_is_refused_and_what_ends_something_is_not() {
    let (served, key) = Served::numbered(1);
    served.run(&key, &[1]);
    let set = |after: &str, value: i32| {
        let request = format!("PUT /api/boards/1/inputs/set_position{after}");
        served.api(&request, Some(&key), Some(json!({ "value": value })))
    };
    let before = last_halt(&served);
    assert_eq!(set(&format!("?asked_after={before}"), 500).0, 200);
    let last = served.last_event();
    let halt = stop(&served, Some(&key));
    is_stopped(set(&format!("?asked_after={before}"), 700), "anna");
    served.event(last, "stopped", |event| event["kind"] == "stopped");
    // A request to switch outputs off moves no board. The agent therefore executes the request even if it is older than the Stop.
    let off = json!({ "active": false });
    let (_, error) =
        served.api(&format!("PUT /api/boards/1/outputs?asked_after={before}"), Some(&key), Some(off));
    assert_ne!(error["code"], "stopped", "{error}");
    // A client's own Stop causes no hold-off for requests that contain the number of this Stop, or no number.
    let job =
        served.begin(&format!("POST /api/run?asked_after={halt}"), &key, Some(json!({ "boards": [1] })));
    assert_eq!(served.over(job)["stage"], "finished");
    assert_eq!(set("", 700).0, 200);
}

/// Every status contains its time. A client can therefore detect old messages even if messages arrive regularly.
#[test]
fn each_status_has_the_time_when_it_was_made() {
    let served = Served::start(1);
    let asked = || served.api("GET /api/status", None, None).1["at_ms"].as_u64().expect("a time");
    let (before, mut times) = (asked(), Vec::new());
    served.stream("/api/stream", |message| {
        if message["kind"] == "status" {
            times.push(message["at_ms"].as_u64().expect("a time"));
        }
        times.len() == 3
    });
    let after = asked();
    assert!(times.is_sorted() && times.first() >= Some(&before) && times.last() <= Some(&after), "{times:?}");
}
