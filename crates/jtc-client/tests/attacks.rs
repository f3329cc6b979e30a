//! What somebody could try who is not to be let in, as docs/security.md lists it.
mod common;

use common::Served;
use jtc_client::{AgentPort, Options};
use jtc_host::PortError;
use test_kit::http;

#[test]
fn requests_of_other_sites_are_refused_whatever_they_ask() {
    let requests =
        ["GET /api/status", "POST /api/stop", "GET /api/line", "GET /openapi.json", "GET /nothing"];
    http::other_sites_are_refused(&Served::start(921_600), &requests);
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
