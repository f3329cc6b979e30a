//! What somebody could try who is not to be let in, as docs/security.md lists it.
mod common;

use common::Served;
use jtc_client::{AgentPort, Options};
use jtc_host::PortError;

#[test]
fn requests_of_other_sites_are_refused_whatever_they_ask() {
    let served = Served::start(921_600);
    let own = format!("Host: {}", served.address);
    let bearer = format!("Authorization: Bearer {}", served.tokens.operator);
    for request in ["GET /api/status", "POST /api/stop", "GET /api/line", "GET /openapi.json", "GET /nothing"]
    {
        let evil = ["Origin: https://evil.example", own.as_str(), bearer.as_str()];
        assert_eq!(served.ask(request, &evil).0, 403, "{request}: a page of another site");
        let port = served.address.port();
        let rebound = format!("Host: evil.example:{port}");
        assert_eq!(served.ask(request, &[&rebound, &bearer]).0, 403, "{request}: a name that points here");
        let neighbour = format!("Origin: http://127.0.0.1:{}", port ^ 1);
        assert_eq!(served.ask(request, &[&own, &neighbour]).0, 403, "{request}: another program's page");
        assert_eq!(
            served.ask(request, &[&own, "Authorization: Bearer 0123456789abcdefghij"]).0,
            401,
            "{request}"
        );
        assert_eq!(served.ask(request, &[&own, "Authorization: Basic b3BlcmF0b3I6"]).0, 401, "{request}");
    }
    assert_eq!(served.get("GET /api/status").0, 200);
    // Reading a state changes nothing, and a page's image or link cannot stop an arm.
    assert_eq!(served.get("GET /api/stop").0, 405);
}

#[test]
fn a_socket_of_another_site_gets_no_end_of_the_line() {
    let served = Served::start(921_600);
    let key = "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==";
    let host = format!("Host: {}", served.address);
    let upgrade = [host.as_str(), "Upgrade: websocket", "Sec-WebSocket-Version: 13", key];
    let evil = [&upgrade[..], &["Origin: http://evil.example"]].concat();
    assert_eq!(served.ask("GET /api/line", &evil).0, 403);
    let wrong =
        Options { name: "x".into(), token: Some("0123456789abcdefghij0123".into()), ..Options::default() };
    let error = AgentPort::open(&served.url(), &wrong).err().expect("it is not let in");
    assert!(matches!(error, PortError::NotLetIn { .. }), "{error}");
}

#[test]
fn tokens_cannot_be_tried_without_end_and_a_stop_is_taken_meanwhile() {
    let served = Served::start(921_600);
    let host = format!("Host: {}", served.address);
    let mut answers = (0..40)
        .map(|n| served.ask("GET /api/status", &[&host, &format!("Authorization: Bearer {n:0>43}")]).0);
    assert!(answers.by_ref().take(20).all(|status| status == 401));
    assert!(answers.all(|status| status == 429));
    // Those who have a right one, and those on this computer who need none, are not kept out.
    assert_eq!(served.get("POST /api/stop").0, 200);
    served.operator("anna").fresh_status().expect("she is let in");
}

#[test]
fn what_is_long_or_wrong_changes_nothing() {
    let served = Served::start(921_600);
    let host = format!("Host: {}", served.address);
    for (request, line) in [
        ("POST /api/stop", "Content-Type: text/plain"),
        ("POST /api/leases", "X: y"),
        ("GET /api/line?policy=none", "Upgrade: websocket"),
        ("GET /api/line?name=x&more=y", "Upgrade: websocket"),
    ] {
        let (status, _) = served.ask(request, &[&host, line]);
        assert!([200, 400, 404, 426].contains(&status), "{request}: {status}");
    }
    let long = "a".repeat(100_000);
    let (status, _) = served.ask(&format!("GET /api/status?{long}"), &[&host]);
    assert!(status != 200 || served.get("GET /api/status").0 == 200);
    assert_eq!(served.get("GET /api/status").0, 200);
}

#[test]
fn connections_that_ask_for_nothing_are_closed_and_keep_nobody_out() {
    use std::io::{Read, Write};
    let served = Served::start(921_600);
    let mut idle: Vec<std::net::TcpStream> = (0..100)
        .map(|_| {
            let mut stream = std::net::TcpStream::connect(served.address).expect("it listens");
            stream.write_all(b"POST /api/stop HTTP/1.1\r\nHost:").expect("it reads");
            stream
        })
        .collect();
    assert_eq!(served.get("POST /api/stop").0, 200);
    let mut first = idle.swap_remove(0);
    first.set_read_timeout(Some(std::time::Duration::from_secs(60))).expect("a time");
    let mut rest = Vec::new();
    first.read_to_end(&mut rest).expect("it is closed");
    assert!(!String::from_utf8_lossy(&rest).contains("200"));
}
