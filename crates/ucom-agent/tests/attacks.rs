//! Attacks by clients without permission, as listed in docs/security.md. The tests of the arm agent (jtc-agent) try the
//! same attacks.
use crate::common;

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use common::Served;
use serde_json::json;
use test_kit::http;
use test_kit::patience::LONGEST;

#[test]
fn requests_of_other_sites_are_refused_whatever_they_ask() {
    let requests =
        ["GET /api/status", "POST /api/stop", "GET /api/boards", "GET /openapi.json", "GET /nothing"];
    http::other_sites_are_refused(&Served::start(1), &requests);
}

#[test]
fn pages_are_shown_by_the_agents_names_alone_and_their_sockets_have_tokens_of_their_own() {
    let served = Served::start(1);
    http::pages_are_the_agents_own(&served);
    http::sockets_take_a_token_beside_their_protocol(&served);
}

#[test]
fn a_socket_of_another_site_gets_no_stream() {
    http::a_socket_of_another_site_is_refused(&Served::start(1), "/api/stream");
}

#[test]
fn tokens_cannot_be_tried_without_end_and_a_stop_is_taken_meanwhile() {
    http::tokens_cannot_be_tried_without_end(&Served::start(1));
}

#[test]
fn a_wrong_token_keeps_no_stop_of_this_computer_away() {
    http::a_wrong_token_keeps_no_stop_away(&Served::start(1), &["POST /api/stop"]);
}

#[test]
fn requests_that_are_refused_fill_no_disk() {
    let mut served = Served::start(1);
    http::refused_requests_are_answered_shortly(&served, "POST /api/run");
    served.end();
    http::refusals_cost_few_short_lines(&std::fs::read_to_string(&served.log).expect("the log"));
}

#[test]
fn what_is_long_or_wrong_changes_nothing() {
    let requests = [
        ("POST /api/stop", "Content-Type: text/plain"),
        ("POST /api/lease", "X: y"),
        ("GET /api/boards/300", "X: y"),
        ("GET /api/events?after=-1", "X: y"),
        ("GET /api/stream?more=y", "Upgrade: websocket"),
    ];
    http::what_is_long_or_wrong_is_refused(&Served::start(1), &requests);
}

#[test]
fn connections_that_ask_for_nothing_are_closed_and_keep_nobody_out() {
    http::idle_connections_are_closed(&Served::start(1));
}

#[test]
fn the_address_of_a_stream_may_have_the_viewers_token_and_never_the_operators() {
    let served = Served::start(1);
    let with = |token: &str| format!("/api/stream?token={token}");
    served.stream(&with(&served.tokens.viewer), |message| message["role"] == "viewer");
    let (host, key) = (format!("Host: {}", served.address), "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==");
    let upgrade = [host.as_str(), "Upgrade: websocket", "Sec-WebSocket-Version: 13", key];
    assert_eq!(served.ask(&format!("GET {}", with(&served.tokens.operator)), &upgrade).0, 403);
}

#[test]
fn requests_that_wait_for_events_are_so_many_and_no_more() {
    let served = Served::start(1);
    let key = served.lease("anna", 60.0, "stop");
    http::waiting_requests_are_bounded(&served, || {
        served.begin("POST /api/scan", &key, None);
    });
}

#[test]
fn who_may_look_changes_nothing() {
    let served = Served::start(1);
    let key = served.lease("anna", 60.0, "stop");
    let commands = [
        ("POST /api/lease", Some(json!({ "name": "eve" }))),
        ("PUT /api/lease", None),
        ("DELETE /api/lease", None),
        ("POST /api/scan", None),
        ("POST /api/doctor", None),
        ("POST /api/init", Some(json!({}))),
        ("POST /api/run", Some(json!({}))),
        ("POST /api/updates", Some(json!({ "boards": [{ "board": 1 }], "image": "AAAA" }))),
        ("POST /api/boards/1/start", None),
        ("POST /api/boards/1/stop", None),
        ("POST /api/boards/1/reset", None),
        ("PUT /api/boards/1/outputs", Some(json!({ "active": true }))),
        ("PUT /api/boards/1/inputs/0", Some(json!({ "value": 0 }))),
        ("PUT /api/boards/1/parameters/0", Some(json!({ "value": 0 }))),
        ("DELETE /api/jobs/1", None),
    ];
    for (request, body) in commands {
        // The key of the lease holder does not change the result.
        for key in [None, Some(key.as_str())] {
            let (status, error) = served.api_as(Some(&served.tokens.viewer), request, key, body.clone());
            assert_eq!(status, 403, "{request}: {error}");
            assert_eq!(served.api_as(None, request, key, body.clone()).0, 403, "{request}");
        }
        if !request.ends_with("/lease") {
            assert_eq!(served.api(request, Some("x"), body).0, 403, "{request}: wrong keys are rejected");
        }
    }
    for request in ["GET /api/status", "GET /api/boards", "GET /api/jobs", "GET /api/events"] {
        assert_eq!(served.api_as(Some(&served.tokens.viewer), request, None, None).0, 200, "{request}");
    }
    assert_eq!(served.api("GET /api/jobs", None, None).1, json!([]), "nothing was begun");
    let log = std::fs::read_to_string(&served.log).expect("the log");
    assert!(!log.contains("\"command\""), "{log}");
}

/// The agent reads firmware images into memory only for the lease holder, and at most two images at the same time.
#[test]
fn images_are_read_of_who_commands_alone_and_two_at_once() {
    let served = Served::start(1);
    let key = served.lease("anna", 60.0, "stop");
    let tokens = served.tokens.clone();
    let begin = |lines: &[String]| {
        let mut stream = TcpStream::connect(served.address).expect("it listens");
        stream.set_read_timeout(Some(LONGEST)).expect("a time");
        let head: String = lines.iter().map(|line| format!("{line}\r\n")).collect();
        let (host, json) = (served.address, "Content-Type: application/json\r\nContent-Length: 6000000");
        let head = format!("POST /api/updates HTTP/1.1\r\nHost: {host}\r\n{json}\r\n{head}\r\n");
        stream.write_all(head.as_bytes()).expect("it reads");
        stream
    };
    let bearer = |token: &str| format!("Authorization: Bearer {token}");
    let lease = format!("Lease-Key: {key}");
    for lines in [
        vec![],
        vec![lease.clone()],
        vec![bearer(&tokens.viewer), lease.clone()],
        vec![bearer(&tokens.operator)],
    ] {
        let mut answer = [0; 12];
        begin(&lines).read_exact(&mut answer).expect("an answer before the images are there");
        assert_eq!(answer, *b"HTTP/1.1 403", "{lines:?}");
    }
    let slow: Vec<TcpStream> = (0..2).map(|_| begin(&[bearer(&tokens.operator), lease.clone()])).collect();
    std::thread::sleep(Duration::from_millis(300));
    let third = std::thread::spawn({
        let (http, key) = ((*served).clone(), key.clone());
        move || http.api("POST /api/updates", Some(&key), Some(json!({ "boards": [], "image": "" }))).0
    });
    std::thread::sleep(Duration::from_millis(700));
    assert!(!third.is_finished(), "a third one is read");
    assert_eq!(served.api("POST /api/stop", None, None).0, 200);
    drop(slow);
    assert_eq!(third.join().expect("it is answered"), 422);
}

/// A client can send any number of Stops. Even many Stops do not fill the bus or the event list.
#[test]
fn stops_without_end_are_counted_and_sent_together() {
    let served = Served::start(1);
    // Waits for the result of a first Stop, which shows that the agent has ended its first scan.
    let (status, _) = served.get("POST /api/stop");
    assert_eq!(status, 200);
    served.event(0, "stopped", |event| event["kind"] == "stopped");
    let (last, mut peer) = (served.last_event(), served.chain.peer());
    let begun = Instant::now();
    let stoppers: Vec<_> = (0..4)
        .map(|_| {
            let http = (*served).clone();
            std::thread::spawn(move || {
                let mut taken = 0;
                while begun.elapsed() < Duration::from_secs(1) {
                    assert_eq!(http.get("POST /api/stop").0, 200);
                    taken += 1;
                }
                taken
            })
        })
        .collect();
    let mut frames = 0;
    while begun.elapsed() < Duration::from_millis(1500) {
        let received = peer.receive(Duration::from_millis(50)).expect("the bus is there");
        frames += u64::from(received.is_some_and(|frame| frame.id().value() == 0x600));
    }
    let seconds = begun.elapsed().as_secs_f64();
    let taken: u64 = stoppers.into_iter().map(|stopper| stopper.join().expect("it is taken")).sum();
    assert!(taken > 100, "{taken}");
    assert!((3..).contains(&frames) && (frames as f64) < 80.0 * seconds, "{frames} in {seconds} s");
    let (_, all) = served.api(&format!("GET /api/events?after={last}"), None, None);
    let halts: Vec<&serde_json::Value> = all["events"]
        .as_array()
        .expect("events")
        .iter()
        .map(|e| &e["event"])
        .filter(|e| e["kind"] == "halt")
        .collect();
    let times: u64 = halts.iter().map(|halt| halt["times"].as_u64().unwrap_or(1)).sum();
    assert!(times == taken && (halts.len() as f64) < 12.0 * seconds, "{times} of {taken}: {halts:?}");
}
