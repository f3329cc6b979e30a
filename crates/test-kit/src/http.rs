//! HTTP requests that any client can send. The functions use plain HTTP, without code of this project.
use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};

use serde_json::Value;

use crate::patience::{LONGEST, Patience};

/// An agent, as a remote client reaches it.
#[derive(Clone, Debug)]
pub struct Http {
    /// Address at which the agent listens.
    pub address: SocketAddr,
    /// Token of the operator.
    pub operator: String,
}

impl Http {
    /// Sends a request with the given header lines, and returns the status and the body of the answer.
    pub fn ask(&self, request: &str, lines: &[&str]) -> (u16, String) {
        let head: String = lines.iter().map(|line| format!("{line}\r\n")).collect();
        self.exchange(&format!("{request} HTTP/1.1\r\n{head}Connection: close\r\nContent-Length: 0\r\n\r\n"))
    }

    /// Sends a request with the `Host` line of an ordinary client.
    pub fn get(&self, request: &str) -> (u16, String) {
        self.ask(request, &[&format!("Host: {}", self.address)])
    }

    /// Sends a request with the operator's token, and returns the status and the JSON body of the answer. A lease key
    /// and a body are optional.
    pub fn api(&self, request: &str, key: Option<&str>, body: Option<Value>) -> (u16, Value) {
        self.api_as(Some(&self.operator), request, key, body)
    }

    /// Like [`Self::api`], but uses another token or no token.
    pub fn api_as(
        &self,
        token: Option<&String>,
        request: &str,
        key: Option<&str>,
        body: Option<Value>,
    ) -> (u16, Value) {
        let key = key.map_or(String::new(), |key| format!("Lease-Key: {key}\r\n"));
        let token = token.map_or(String::new(), |token| format!("Authorization: Bearer {token}\r\n"));
        let json = body.as_ref().map_or("", |_| "Content-Type: application/json\r\n");
        let body = body.map_or(String::new(), |body| body.to_string());
        let (host, length) = (self.address, body.len());
        let head =
            format!("Host: {host}\r\n{token}{key}{json}Connection: close\r\nContent-Length: {length}\r\n");
        let (status, body) = self.exchange(&format!("{request} HTTP/1.1\r\n{head}\r\n{body}"));
        (status, serde_json::from_str(&body).unwrap_or(Value::Null))
    }

    /// Sends a request without a body, with the given token or without a token. Returns the status, the head and the body bytes of the
    /// answer.
    pub fn bytes_as(&self, token: Option<&String>, request: &str) -> (u16, String, Vec<u8>) {
        let token = token.map_or(String::new(), |token| format!("Authorization: Bearer {token}\r\n"));
        let host = self.address;
        let all = self.exchange_bytes(&format!(
            "{request} HTTP/1.1\r\nHost: {host}\r\n{token}Connection: close\r\n\r\n"
        ));
        let end = all.windows(4).position(|four| four == b"\r\n\r\n").unwrap_or(all.len());
        let head = String::from_utf8_lossy(&all[..end]).into_owned();
        (status(&head), head, all.get(end + 4..).unwrap_or_default().to_vec())
    }

    fn exchange(&self, request: &str) -> (u16, String) {
        let all = self.exchange_bytes(request);
        let all = String::from_utf8_lossy(&all);
        let body = all.split_once("\r\n\r\n").map_or("", |(_, body)| body);
        (status(&all), body.to_owned())
    }

    fn exchange_bytes(&self, request: &str) -> Vec<u8> {
        let mut stream = TcpStream::connect(self.address).expect("it listens");
        stream.set_read_timeout(Some(LONGEST)).expect("a time");
        // A write error is ignored: if the agent rejects a request, it may close the connection before the whole
        // request is written.
        let _ = stream.write_all(request.as_bytes());
        let mut all = Vec::new();
        let _ = stream.read_to_end(&mut all);
        all
    }

    /// Waits for the first event after number `after` for which `is` returns `true`. Returns the number of the event and the event.
    /// Checks that the event numbers have no gap.
    pub fn event(&self, after: u64, what: &str, is: impl Fn(&Value) -> bool) -> (u64, Value) {
        let (mut patience, mut last, mut seen) = (Patience::begin(), after, Vec::new());
        loop {
            let (_, found) = self.api(&format!("GET /api/events?after={last}&wait_s=2"), None, None);
            for event in found["events"].as_array().expect("events") {
                let number = event["number"].as_u64().expect("a number");
                assert_eq!(number, last + 1, "none is left out");
                last = number;
                if is(&event["event"]) {
                    return (number, event["event"].clone());
                }
                seen.push(event["event"].clone());
            }
            patience.pause(format_args!("{what} after {after}: {seen:?}"));
        }
    }

    /// Reads text messages from a WebSocket until `enough` returns `true`.
    pub fn stream(&self, path: &str, mut enough: impl FnMut(Value) -> bool) {
        let mut stream = TcpStream::connect(self.address).expect("it listens");
        stream.set_read_timeout(Some(LONGEST)).expect("a time");
        let upgrade = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
                       Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";
        write!(stream, "GET {path} HTTP/1.1\r\nHost: {}\r\n{upgrade}\r\n", self.address).expect("it reads");
        let mut head = Vec::new();
        while !head.ends_with(b"\r\n\r\n") {
            let mut byte = [0];
            stream.read_exact(&mut byte).expect("an answer");
            head.push(byte[0]);
        }
        assert!(head.starts_with(b"HTTP/1.1 101"), "{}", String::from_utf8_lossy(&head));
        loop {
            let mut head = [0; 2];
            stream.read_exact(&mut head).expect("a message");
            let mut length = [0; 8];
            let bytes = match head[1] & 0x7F {
                126 => &mut length[6..],
                127 => &mut length[..],
                short => {
                    length[7] = short;
                    &mut length[..0]
                }
            };
            stream.read_exact(bytes).expect("its length");
            let mut text = vec![0; u64::from_be_bytes(length) as usize];
            stream.read_exact(&mut text).expect("the message");
            if head[0] & 0x0F == 1 && enough(serde_json::from_slice(&text).expect("JSON")) {
                return;
            }
        }
    }
}

/// Returns the HTTP status in the first line of an answer, or 0 if this line has no status.
fn status(answer: &str) -> u16 {
    answer.split(' ').nth(1).and_then(|code| code.parse().ok()).unwrap_or(0)
}

/// Checks that the agent rejects all requests from other sites. The agent also rejects requests with unknown tokens,
/// except a Stop or a Pause.
pub fn other_sites_are_refused(http: &Http, requests: &[&str]) {
    let own = format!("Host: {}", http.address);
    let bearer = format!("Authorization: Bearer {}", http.operator);
    for request in requests {
        let evil = ["Origin: https://evil.example", own.as_str(), bearer.as_str()];
        assert_eq!(http.ask(request, &evil).0, 403, "{request}: a page of another site");
        let port = http.address.port();
        let rebound = format!("Host: evil.example:{port}");
        assert_eq!(http.ask(request, &[&rebound, &bearer]).0, 403, "{request}: a name that points here");
        let neighbour = format!("Origin: http://127.0.0.1:{}", port ^ 1);
        assert_eq!(http.ask(request, &[&own, &neighbour]).0, 403, "{request}: another program's page");
        // Browsers mark an image, a script or a link of a page of another site, or of another port of this computer.
        for site in ["cross-site", "same-site"] {
            let mark = format!("Sec-Fetch-Site: {site}");
            assert_eq!(http.ask(request, &[&own, &mark, &bearer]).0, 403, "{request}: {mark}");
        }
        // A Stop and a Pause from this computer need no token, so they succeed even with a wrong token.
        let refused = if ["POST /api/stop", "POST /api/pause"].contains(request) { 200 } else { 401 };
        for token in ["Bearer 0123456789abcdefghij", "Basic b3BlcmF0b3I6"] {
            assert_eq!(
                http.ask(request, &[&own, &format!("Authorization: {token}")]).0,
                refused,
                "{request}"
            );
        }
    }
    for site in ["same-origin", "none"] {
        let mark = format!("Sec-Fetch-Site: {site}");
        assert_eq!(http.ask("GET /api/status", &[&own, &mark, &bearer]).0, 200, "{mark}");
    }
    // A GET request must not cause a Stop. Otherwise, an image or a link on a page could stop the arm or the boards.
    assert_eq!(http.get("GET /api/stop").0, 405);
}

/// Checks that the agent serves the dashboard pages for requests with one of its host names, but not for pages of another site.
pub fn pages_are_the_agents_own(http: &Http) {
    let own = format!("Host: {}", http.address);
    // A page is also served with a wrong token, because the page itself asks the user for a token.
    for lines in [&[own.as_str()][..], &[&own, "Authorization: Bearer 0123456789abcdefghij"]] {
        let (status, page) = http.ask("GET /", lines);
        assert!(status == 200 && page.to_lowercase().starts_with("<!doctype html"), "{status} {page}");
        assert!(!page.contains(&http.operator), "nothing in it is secret");
    }
    let site = format!("Origin: http://{}", http.address);
    assert_eq!(http.ask("GET /", &[&own, &site]).0, 200);
    let rebound = format!("Host: evil.example:{}", http.address.port());
    assert_eq!(http.ask("GET /", &[&rebound]).0, 403, "a name that points here");
    assert_eq!(http.ask("GET /", &[&own, "Origin: https://evil.example"]).0, 403, "a page of another site");
    let (_, head, _) = http.bytes_as(None, "GET /");
    for part in ["default-src 'self'", "frame-ancestors 'none'", "same-origin", "nosniff"] {
        assert!(head.contains(part), "{part} is missing: {head}");
    }
    assert_ne!(http.get("POST /").0, 200);
}

/// Checks that a page can pass the token for its WebSocket in the protocol header, and that a page of another site cannot.
pub fn sockets_take_a_token_beside_their_protocol(http: &Http) {
    let host = format!("Host: {}", http.address);
    let key = "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==";
    let protocols = |token: &str| format!("Sec-WebSocket-Protocol: openjtc, bearer.{token}");
    let evil = "Origin: https://evil.example";
    let asked = |token: &str, more: &[&str]| {
        let protocols = protocols(token);
        let upgrade = [host.as_str(), "Upgrade: websocket", "Sec-WebSocket-Version: 13", key, &protocols];
        http.ask("GET /api/stream", &[&upgrade[..], more].concat()).0
    };
    // With a valid token, the request fails only later, because it is not a complete WebSocket handshake.
    assert!(![401, 403].contains(&asked(&http.operator, &[])));
    assert_eq!(asked("0123456789abcdefghij", &[]), 401);
    assert_eq!(asked(&http.operator, &[evil]), 403);
}

/// Checks that a page of another site cannot open a WebSocket.
pub fn a_socket_of_another_site_is_refused(http: &Http, path: &str) {
    let key = "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==";
    let host = format!("Host: {}", http.address);
    let upgrade = [host.as_str(), "Upgrade: websocket", "Sec-WebSocket-Version: 13", key];
    let evil = [&upgrade[..], &["Origin: http://evil.example"]].concat();
    assert_eq!(http.ask(&format!("GET {path}"), &evil).0, 403);
}

/// Checks that the number of attempts with wrong tokens is limited, and that a Stop is still accepted.
pub fn tokens_cannot_be_tried_without_end(http: &Http) {
    let host = format!("Host: {}", http.address);
    let mut answers =
        (0..40).map(|n| http.ask("GET /api/status", &[&host, &format!("Authorization: Bearer {n:0>43}")]).0);
    assert!(answers.by_ref().take(20).all(|status| status == 401));
    assert!(answers.all(|status| status == 429));
    // The limit does not block clients with a valid token. The limit also does not block requests that need no token,
    // such as a Stop from this computer.
    assert_eq!(http.get("POST /api/stop").0, 200);
}

/// Checks that wrong tokens of any form and number never block a Stop from this computer and never permit access.
pub fn a_wrong_token_keeps_no_stop_away(http: &Http, stops: &[&str]) {
    let host = format!("Host: {}", http.address);
    let evil = "Origin: https://evil.example";
    let (operator, cut) = (&http.operator, &http.operator[1..]);
    for line in [
        "Authorization: Bearer 0123456789abcdefghij".to_owned(),
        "Authorization: bearer 0123456789abcdefghij".to_owned(),
        "Authorization: Bearer".to_owned(),
        "Authorization: Bearer ".to_owned(),
        format!("Authorization: Bearer {cut}"),
        format!("Authorization: Bearer {operator}x"),
        format!("Authorization: Bearer\t{operator}"),
        format!("Authorization: {operator}"),
        format!("Authorization: Basic {operator}"),
        format!("Authorization: Bearer {}", "x".repeat(10_000)),
        "Authorization: Bearer \u{fc}".to_owned(),
        "Authorization:".to_owned(),
        format!("Sec-WebSocket-Protocol: openjtc, bearer.{cut}"),
    ] {
        for _ in 0..3 {
            for stop in stops {
                assert_eq!(http.ask(stop, &[&host, &line]).0, 200, "{stop} {line:?}");
                assert_eq!(http.ask(stop, &[&host, &line, evil]).0, 403, "{stop} {line:?}: another site");
            }
            let (status, _) = http.ask("GET /api/status", &[&host, &line]);
            assert!([401, 429].contains(&status), "{line:?}: {status}");
            let (status, _) = http.ask("POST /api/lease", &[&host, &line]);
            assert!([401, 429].contains(&status), "{line:?}: {status}");
        }
    }
    for scheme in ["Bearer", "bearer", "BEARER", "bEARER", "Bearer "] {
        let (status, body) =
            http.ask("GET /api/status", &[&host, &format!("Authorization: {scheme} {operator}")]);
        assert!(status == 200 && body.contains("\"role\":\"operator\""), "{scheme}: {status} {body}");
    }
}

/// Checks that the answers to a long series of rejected requests are short. [`refusals_cost_few_short_lines`] later checks the log.
pub fn refused_requests_are_answered_shortly(http: &Http, command: &str) {
    let (own, bearer) = (format!("Host: {}", http.address), "Authorization: Bearer 0123456789abcdefghij");
    for length in [100, 1_000, 12_000, 15_000, 65_000, 380_000] {
        let long = "B".repeat(length);
        let (host, origin) = (format!("Host: {long}"), format!("Origin: http://{long}"));
        let (path, asked) = (format!("GET /{long}"), format!("GET /api/status?{long}={long}"));
        let name = format!("GET /api/explain/{long}");
        let post = format!("POST /api/{long}");
        let method = format!("{long} /api/status");
        let cases: [(&str, &[&str]); 10] = [
            (&path, &["Host: evil"]),
            (&path, &[&own, bearer]),
            ("GET /api/status", &[&host]),
            ("GET /api/status", &[&own, &origin]),
            (&asked, &["Host: evil"]),
            (&name, &[&own]),
            (&post, &[&own, &origin]),
            (&method, &["Host: evil"]),
            (command, &[&own]),
            (&format!("GET /api/events?after={long}"), &[&own]),
        ];
        for (request, lines) in cases {
            for _ in 0..20 {
                let (status, answer) = http.ask(request, lines);
                assert!(status != 200 && answer.len() < 1_500, "{length}: {status}, {} bytes", answer.len());
            }
        }
    }
    assert_eq!(http.get("POST /api/stop").0, 200);
}

/// Checks the command log that [`refused_requests_are_answered_shortly`] has produced. Call this function after the agent has ended.
pub fn refusals_cost_few_short_lines(log: &str) {
    let lines: Vec<Value> =
        log.lines().map(|line| serde_json::from_str(line).expect("a whole line")).collect();
    let of = |what| lines.iter().filter(move |line| line["what"] == what);
    let times = |what| of(what).map(|line| line["times"].as_u64().unwrap_or(1)).sum::<u64>();
    assert!(times("refused") > 300 && times("denied") >= 100, "each is counted: {log}");
    assert!(of("refused").count() + of("denied").count() < 40, "{} lines", lines.len());
    assert!(log.lines().all(|line| line.len() < 1_000) && log.len() < 40_000, "{} bytes", log.len());
}

/// Checks that the agent answers long or invalid requests with an error status and changes nothing.
pub fn what_is_long_or_wrong_is_refused(http: &Http, requests: &[(&str, &str)]) {
    let host = format!("Host: {}", http.address);
    for (request, line) in requests {
        let (status, _) = http.ask(request, &[&host, line]);
        assert!([200, 400, 403, 404, 415, 426].contains(&status), "{request}: {status}");
    }
    let long = "a".repeat(100_000);
    let (status, _) = http.ask(&format!("GET /api/status?{long}"), &[&host]);
    assert!(status != 200 || http.get("GET /api/status").0 == 200);
    assert_eq!(http.get("GET /api/status").0, 200);
}

/// Checks that the agent closes idle connections, and that idle connections do not block other clients.
pub fn idle_connections_are_closed(http: &Http) {
    let mut idle: Vec<TcpStream> = (0..100)
        .map(|_| {
            let mut stream = TcpStream::connect(http.address).expect("it listens");
            stream.write_all(b"POST /api/stop HTTP/1.1\r\nHost:").expect("it reads");
            stream
        })
        .collect();
    assert_eq!(http.get("POST /api/stop").0, 200);
    let mut first = idle.swap_remove(0);
    first.set_read_timeout(Some(LONGEST)).expect("a time");
    let mut rest = Vec::new();
    first.read_to_end(&mut rest).expect("it is closed");
    assert!(!String::from_utf8_lossy(&rest).contains("200"));
}

/// Checks that at most 64 requests wait for an event at the same time. The agent must answer further requests at once, and the waiting
/// requests must receive their event. `begin` starts the first job of the agent.
pub fn waiting_requests_are_bounded(http: &Http, begin: impl FnOnce()) {
    const MOST: usize = 64;
    const MORE: usize = 16;
    let (answered, answers) = std::sync::mpsc::channel();
    for _ in 0..MOST + MORE {
        let (http, answered) = (http.clone(), answered.clone());
        std::thread::spawn(move || {
            let (status, found) = http.api("GET /api/events?job=1&wait_s=8", None, None);
            // If the test has failed in the meantime, the receiver no longer exists, so this error is ignored.
            let _ = answered.send((status, found["events"].as_array().map_or(0, Vec::len)));
        });
    }
    let next = || Patience::begin().receive(&answers).expect("an answer");
    for _ in 0..MORE {
        assert_eq!(next(), (200, 0), "one that finds no place is answered at once, and there is nothing yet");
    }
    begin();
    for n in 0..MOST {
        let (status, events) = next();
        assert!(status == 200 && events > 0, "{n}: {status}, {events} events: it did not wait for them");
    }
}
