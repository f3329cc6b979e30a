//! Separate process with many viewers and with some clients that never read their messages.
use std::io::Read as _;
use std::net::SocketAddr;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use tungstenite::Message;

use crate::common::socket;

/// Number of viewers; each viewer receives 25 statuses per second. `DEAF` lists the URL paths of the clients that
/// never read their messages.
pub(crate) const VIEWERS: usize = 50;
const DEAF: [&str; 12] = [
    "stream", "line", "foxglove", "stream", "line", "foxglove", "stream", "line", "foxglove", "stream",
    "line", "foxglove",
];

/// Group of clients that run until `dismiss` is called.
pub(crate) struct Crowd(Child);

impl Crowd {
    /// Starts the clients. When this function returns, all clients are connected.
    pub(crate) fn gather(address: SocketAddr) -> Self {
        let program = std::env::current_exe().expect("this program");
        let mut child = Command::new(program)
            .args(["crowd", &address.to_string()])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("it starts");
        child.stdout.as_mut().expect("stdout").read_exact(&mut [0]).expect("they are let in");
        Self(child)
    }

    /// Ends the clients. Returns the status rate of the viewer that has received the fewest statuses, in statuses per second.
    pub(crate) fn dismiss(self) -> f64 {
        let ended = self.0.wait_with_output().expect("it ends");
        String::from_utf8_lossy(&ended.stdout).trim().parse().expect("a number")
    }
}

/// Runs the clients in the separate process until the stdin of this process ends.
pub(crate) fn look(address: &str) {
    let address: SocketAddr = address.parse().expect("an address");
    let ended = Arc::new(AtomicBool::new(false));
    let deaf: Vec<_> = DEAF.iter().map(|path| socket(address, path)).collect();
    let viewers: Vec<_> = (0..VIEWERS)
        .map(|_| {
            let (mut socket, ended) = (socket(address, "stream"), ended.clone());
            std::thread::spawn(move || {
                let (begun, mut statuses) = (Instant::now(), 0);
                while !ended.load(Ordering::Relaxed) {
                    if let Message::Text(text) = socket.read().expect("it is there to the end")
                        && text.contains("\"kind\":\"status\"")
                    {
                        statuses += 1;
                    }
                }
                f64::from(statuses) / begun.elapsed().as_secs_f64()
            })
        })
        .collect();
    println!(".");
    std::io::stdin().read_to_end(&mut Vec::new()).expect("stdin");
    ended.store(true, Ordering::Relaxed);
    let rates = viewers.into_iter().map(|viewer| viewer.join().expect("it looked to the end"));
    println!("{:.1}", rates.fold(f64::INFINITY, f64::min));
    drop(deaf);
}
