//! An agent of a simulated controller in this process, and requests to it as anybody could send them.
#![allow(dead_code)]

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use jtc_agent::access::{Access, Tokens};
use jtc_agent::api::{Agent, logged};
use jtc_agent::log::CommandLog;
use jtc_agent::{Line, Owner, serve};
use jtc_client::{AgentPort, Options};
use jtc_host::port::sim::LivePort;
use jtc_host::{Arm, Session};
use jtc_sim::{SimConfig, World};

/// An agent that ends with the test.
pub struct Served {
    pub address: SocketAddr,
    pub tokens: Tokens,
    pub line: Line,
    pub log: PathBuf,
    ended: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    _dir: tempfile::TempDir,
}

impl Served {
    /// Of a simulated arm on a line at this rate.
    pub fn start(baud: u32) -> Self {
        let dir = tempfile::tempdir().expect("a directory");
        let arm = Arm::avena();
        let config = SimConfig { baud: Some(baud), ..SimConfig::new(arm.config(), &arm.parameters()) };
        let log_path = dir.path().join("commands.jsonl");
        let log = Arc::new(Mutex::new(CommandLog::open(Some(&log_path), |_| {}).expect("a file")));
        let own_log = log.clone();
        let observer = Box::new(move |_, event: &_| {
            if let Some((what, facts)) = logged(event) {
                own_log.lock().expect("nobody panics").write(what, facts);
            }
        });
        let owner = Owner::new(LivePort::new(World::new(config)), observer);
        let (tokens, _) = Tokens::load_or_make(&dir.path().join("tokens.toml")).expect("a token file");
        let listener = TcpListener::bind("127.0.0.1:0").expect("an address");
        let address = listener.local_addr().expect("it listens");
        let access = Access::new(tokens.clone(), address, &[]);
        let line = owner.line();
        let agent = Agent::new(line.clone(), access, log, "simulated", true);
        let ended = Arc::new(AtomicBool::new(false));
        let end = ended.clone();
        let thread = std::thread::spawn(move || {
            serve::serve(agent.router(), listener, move || end.load(Ordering::Relaxed)).expect("it serves");
            owner.end();
        });
        Self { address, tokens, line, log: log_path, ended, thread: Some(thread), _dir: dir }
    }

    pub fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    /// A conversation of an operator.
    pub fn operator(&self, name: &str) -> Session<AgentPort> {
        self.session(name, Some(&self.tokens.operator))
    }

    pub fn session(&self, name: &str, token: Option<&String>) -> Session<AgentPort> {
        let options = Options { name: name.into(), token: token.cloned() };
        Session::new(AgentPort::open(&self.url(), &options).expect("it is let in"))
    }

    /// Status and body of what a request with these lines gets.
    pub fn ask(&self, request: &str, lines: &[&str]) -> (u16, String) {
        let mut stream = TcpStream::connect(self.address).expect("it listens");
        stream.set_read_timeout(Some(Duration::from_secs(20))).expect("a time");
        let head: String = lines.iter().map(|line| format!("{line}\r\n")).collect();
        write!(stream, "{request} HTTP/1.1\r\n{head}Connection: close\r\nContent-Length: 0\r\n\r\n")
            .expect("it reads");
        let mut all = String::new();
        let _ = stream.read_to_string(&mut all);
        let status = all.split(' ').nth(1).and_then(|code| code.parse().ok()).unwrap_or(0);
        let body = all.split_once("\r\n\r\n").map_or("", |(_, body)| body);
        (status, body.to_owned())
    }

    /// The same as an ordinary client asks.
    pub fn get(&self, request: &str) -> (u16, String) {
        self.ask(request, &[&format!("Host: {}", self.address)])
    }

    /// Lets the agent end.
    pub fn end(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            thread.join().expect("it ends");
        }
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.end();
    }
}
