//! Clients that use all connections of an agent. The agent must still answer a Stop.
use std::io::{ErrorKind, Read as _, Write as _};
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use crate::http::Http;
use crate::patience::until;

/// Number of connections that a flood keeps open; an agent accepts fewer.
const CONNECTIONS: usize = 400;
/// Number of Stops that are sent during each flood.
const STOPS: usize = 20;

/// Behaviour of the clients of a flood.
struct Flood {
    what: &'static str,
    /// Bytes that each client sends at once.
    bytes: Vec<u8>,
    /// Bytes that each client then sends repeatedly.
    drip: &'static [u8],
    /// `true` if the clients read the answers.
    reads: bool,
}

/// Checks that the agent answers Stops of every kind during every flood. `command` is a request that needs the
/// lease; `stops` are stop requests, which need no lease.
pub fn stops_are_answered_in_every_flood(http: &Http, command: &str, stops: &[&str]) {
    for flood in floods(http, command) {
        answered_in(http, &flood, stops);
    }
}

fn floods(http: &Http, command: &str) -> Vec<Flood> {
    let host = format!("Host: {}\r\n", http.address);
    let length = "Content-Type: application/json\r\nContent-Length: 9\r\n";
    let chunked = "Content-Type: application/json\r\nTransfer-Encoding: chunked\r\n";
    let request = |request: &str, lines: &str| format!("{request} HTTP/1.1\r\n{host}{lines}\r\n");
    let bearer = |token: &str| format!("Authorization: Bearer {token}\r\n");
    let upgrade = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
                   Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";
    let flood = |what, bytes: String| Flood { what, bytes: bytes.into(), drip: b"", reads: true };
    let own = bearer(&http.operator);
    let part = request(command, chunked) + "5\r\n{";
    let own_part = request(command, &format!("{own}{chunked}")) + "1\r\n{\r\n";
    vec![
        flood("the head of a command, and no body", request(command, length)),
        flood("a part of a body in chunks", part),
        flood(
            "a body that waits to be asked for",
            request(command, &format!("{length}Expect: 100-continue\r\n")),
        ),
        flood(
            "a body with the operator's token that does not come",
            request(command, &format!("{own}{length}")),
        ),
        Flood {
            drip: b"1\r\n \r\n",
            ..flood("a body with the operator's token that comes slowly", own_part)
        },
        flood(
            "the head of a command with a wrong token",
            request(command, &format!("{}{length}", bearer("x"))),
        ),
        flood("the head of a Stop, and no body", request("POST /api/stop", length)),
        flood("a body for what is not there", request("POST /api/nothing", length)),
        flood("nothing", String::new()),
        flood("half a head", format!("POST /api/stop HTTP/1.1\r\n{host}X: ")),
        Flood {
            drip: b"x",
            ..flood("a head that comes slowly", format!("POST /api/stop HTTP/1.1\r\n{host}X: "))
        },
        flood("half a TLS handshake", "\u{16}\u{3}\u{1}\u{2}".into()),
        flood("one question, and then nothing", request("GET /api/status", "")),
        flood("a question that waits", request("GET /api/events?after=999999&wait_s=8", "")),
        Flood {
            reads: false,
            ..flood("answers that are not read", request("GET /openapi.json", "").repeat(100))
        },
        Flood { reads: false, ..flood("a socket that is not read", request("GET /api/stream", upgrade)) },
        Flood {
            drip: b"GET / HTTP/1.1\r\nHost: evil\r\n\r\n",
            ..flood("requests of another site", request("GET /", ""))
        },
    ]
}

fn answered_in(http: &Http, flood: &Flood, stops: &[&str]) {
    let (over, opened) = (AtomicBool::new(false), AtomicUsize::new(0));
    std::thread::scope(|threads| {
        threads.spawn(|| keep_open(http, flood, &opened, &over));
        // The guard ends the flood even if a check panics.
        let _end = End(&over);
        until(format_args!("the flood of {}", flood.what), || opened.load(Ordering::Relaxed) >= CONNECTIONS);
        for n in 0..STOPS {
            for stop in stops {
                let (status, answer) = match n % 2 {
                    0 => http.get(stop),
                    _ => {
                        let (status, answer) = http.api(stop, None, None);
                        (status, answer.to_string())
                    }
                };
                assert_eq!(status, 200, "{}: {stop} number {n}: {answer:?}", flood.what);
            }
        }
    });
}

/// Guard that ends a flood when it is dropped.
struct End<'a>(&'a AtomicBool);

impl Drop for End<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Keeps `CONNECTIONS` connections open, and replaces each connection that the agent closes.
fn keep_open(http: &Http, flood: &Flood, opened: &AtomicUsize, over: &AtomicBool) {
    let mut streams: Vec<TcpStream> = Vec::new();
    while !over.load(Ordering::Relaxed) {
        streams.retain_mut(|stream| is_open(stream, flood));
        while streams.len() < CONNECTIONS && !over.load(Ordering::Relaxed) {
            let Ok(mut stream) = TcpStream::connect_timeout(&http.address, Duration::from_secs(1)) else {
                break;
            };
            // A write error is ignored, because the agent may have closed the connection at once.
            let _ = stream.set_nonblocking(true).and_then(|()| stream.write_all(&flood.bytes));
            streams.push(stream);
            opened.fetch_add(1, Ordering::Relaxed);
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn is_open(stream: &mut TcpStream, flood: &Flood) -> bool {
    let waits = |error: &std::io::Error| error.kind() == ErrorKind::WouldBlock;
    let drip = if flood.reads { flood.drip } else { b"\r\n" };
    if !drip.is_empty() && stream.write(drip).is_err_and(|error| !waits(&error)) {
        return false;
    }
    let mut answer = [0; 4096];
    loop {
        match if flood.reads { stream.read(&mut answer) } else { return true } {
            Ok(0) => return false,
            Ok(_) => {}
            Err(error) => return waits(&error),
        }
    }
}
