//! What somebody could try who is not to be let in, as docs/security.md lists it: the same as with an arm's agent.
mod common;

use common::Served;
use serde_json::json;
use test_kit::http;

#[test]
fn requests_of_other_sites_are_refused_whatever_they_ask() {
    let requests =
        ["GET /api/status", "POST /api/stop", "GET /api/boards", "GET /openapi.json", "GET /nothing"];
    http::other_sites_are_refused(&Served::start(1), &requests);
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
        // Also with the key of somebody who commands.
        for key in [None, Some(key.as_str())] {
            let (status, error) = served.api_as(Some(&served.tokens.viewer), request, key, body.clone());
            assert_eq!(status, 403, "{request}: {error}");
            assert_eq!(served.api_as(None, request, key, body.clone()).0, 403, "{request}");
        }
        if !request.ends_with("/lease") {
            assert_eq!(served.api(request, Some("x"), body).0, 403, "{request}: a wrong key is none");
        }
    }
    for request in ["GET /api/status", "GET /api/boards", "GET /api/jobs", "GET /api/events"] {
        assert_eq!(served.api_as(Some(&served.tokens.viewer), request, None, None).0, 200, "{request}");
    }
    assert_eq!(served.api("GET /api/jobs", None, None).1, json!([]), "nothing was begun");
    let log = std::fs::read_to_string(&served.log).expect("the log");
    assert!(!log.contains("\"command\""), "{log}");
}
