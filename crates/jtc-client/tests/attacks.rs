//! Tests of attacks by clients without access rights, which docs/security.md lists.
use crate::common;

use common::Served;
use jtc_client::{AgentPort, Options};
use jtc_host::PortError;
use serde_json::json;
use test_kit::http;

#[test]
fn requests_of_other_sites_are_refused_whatever_they_ask() {
    let requests =
        ["GET /api/status", "POST /api/stop", "GET /api/line", "GET /openapi.json", "GET /nothing"];
    http::other_sites_are_refused(&Served::start(921_600), &requests);
}

#[test]
fn pages_of_an_allowed_origin_look_and_do_nothing_else_whatever_token_they_have() {
    let served = Served::start_with(921_600, None, &["https://app.example".into(), "file://".into()]);
    let host = format!("Host: {}", served.address);
    let bearer = format!("Authorization: Bearer {}", served.tokens.operator);
    for origin in ["Origin: https://app.example", "Origin: file://"] {
        for lines in [&[origin, &host, &bearer][..], &[origin, &host]] {
            let (status, body) = served.ask("GET /api/status", lines);
            assert!(status == 200 && body.contains("\"role\":\"viewer\""), "{status} {body}");
            assert_eq!(served.ask("GET /metrics", lines).0, 200);
            for request in [
                "POST /api/stop",
                "POST /api/pause",
                "POST /api/lease",
                "PUT /api/speed",
                "DELETE /api/lease",
                "POST /api/status",
                "POST /",
                "GET /api/line",
                "GET /api/jobs",
                "GET /api/events",
                "GET /api/info",
                "GET /openapi.json",
                "GET /api/foxglove/x",
                "OPTIONS /api/stop",
            ] {
                assert_eq!(served.ask(request, lines).0, 403, "{request} {origin}");
            }
        }
        let wrong = "Authorization: Bearer 0123456789abcdefghij";
        assert_eq!(served.ask("GET /api/status", &[origin, &host, wrong]).0, 401);
        let rebound = format!("Host: evil.example:{}", served.address.port());
        assert_eq!(served.ask("GET /api/status", &[origin, &rebound, &bearer]).0, 403);
    }
    for origin in ["Origin: https://evil.example", "Origin: null", "Origin: https://app.example.evil.example"]
    {
        for request in
            ["GET /api/status", "GET /metrics", "GET /api/foxglove", "GET /", "OPTIONS /api/status"]
        {
            assert_eq!(served.ask(request, &[origin, &host, &bearer]).0, 403, "{request} {origin}");
        }
    }
    assert_eq!(served.line.last_halt(), 0, "nothing was stopped");
}

#[test]
fn a_token_in_an_address_is_the_viewers_for_sockets_that_look_and_is_written_nowhere() {
    let mut served = Served::start(921_600);
    let host = format!("Host: {}", served.address);
    let key = "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==";
    let upgrade = [&host, "Upgrade: websocket", "Sec-WebSocket-Version: 13", key];
    let (operator, viewer) = (served.tokens.operator.clone(), served.tokens.viewer.clone());
    for path in ["/", "/api/foxglove", "/api/stream"] {
        assert_eq!(served.ask(&format!("GET {path}?token={operator}"), &upgrade).0, 403, "{path}");
        let (status, _) = served.ask(&format!("GET {path}?token=0123456789abcdefghij"), &upgrade);
        assert_eq!(status, 401, "{path}");
        // The viewer's token permits this request. The request fails for another reason: it lacks the headers of a
        // WebSocket.
        assert!(
            ![401, 403].contains(&served.ask(&format!("GET {path}?token={viewer}"), &upgrade).0),
            "{path}"
        );
    }
    served.end();
    let log = std::fs::read_to_string(&served.log).expect("it was written");
    assert!(log.contains("refused") && !log.contains(&operator) && !log.contains(&viewer), "{log}");
}

#[test]
fn pages_are_shown_by_the_agents_names_alone_and_their_sockets_have_tokens_of_their_own() {
    let served = Served::start(921_600);
    http::pages_are_the_agents_own(&served);
    http::sockets_take_a_token_beside_their_protocol(&served);
}

#[test]
fn a_socket_of_another_site_gets_no_end_of_the_line() {
    let served = Served::start(921_600);
    http::a_socket_of_another_site_is_refused(&served, "/api/line");
    let wrong =
        Options { name: "x".into(), token: Some("0123456789abcdefghij0123".into()), ..Options::default() };
    let error = AgentPort::open(&served.url(), &wrong).err().expect("it is not let in");
    assert!(matches!(error, PortError::NotLetIn { .. }), "{error}");
}

#[test]
fn tokens_cannot_be_tried_without_end_and_a_stop_is_taken_meanwhile() {
    let served = Served::start(921_600);
    http::tokens_cannot_be_tried_without_end(&served);
    served.operator("anna").fresh_status().expect("she is let in");
}

#[test]
fn a_wrong_token_keeps_no_stop_of_this_computer_away() {
    http::a_wrong_token_keeps_no_stop_away(&Served::start(921_600), &["POST /api/stop", "POST /api/pause"]);
}

#[test]
fn requests_that_are_refused_fill_no_disk() {
    let mut served = Served::start(921_600);
    http::refused_requests_are_answered_shortly(&served, "POST /api/gripper");
    served.end();
    http::refusals_cost_few_short_lines(&std::fs::read_to_string(&served.log).expect("the log"));
}

#[test]
fn what_is_long_or_wrong_changes_nothing() {
    let requests = [
        ("POST /api/stop", "Content-Type: text/plain"),
        ("POST /api/leases", "X: y"),
        ("GET /api/line?policy=none", "Upgrade: websocket"),
        ("GET /api/line?name=x&more=y", "Upgrade: websocket"),
    ];
    http::what_is_long_or_wrong_is_refused(&Served::start(921_600), &requests);
}

#[test]
fn connections_that_ask_for_nothing_are_closed_and_keep_nobody_out() {
    http::idle_connections_are_closed(&Served::start(921_600));
}

#[test]
fn requests_that_wait_for_events_are_so_many_and_no_more() {
    let served = Served::start(921_600);
    let (_, grant) = served.api("POST /api/lease", None, Some(json!({ "name": "anna" })));
    http::waiting_requests_are_bounded(&served, || {
        let body = Some(json!({ "defaults": true }));
        let (status, job) = served.api("POST /api/recover", grant["key"].as_str(), body);
        assert_eq!((status, job["number"].as_u64()), (202, Some(1)), "{job}");
    });
}
