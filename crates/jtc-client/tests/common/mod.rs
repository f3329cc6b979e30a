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
use jtc_agent::api::Agent;
use jtc_agent::jobs::{Jobs, Store};
use jtc_agent::log::{CommandLog, observer};
use jtc_agent::{Line, Owner, serve};
use jtc_client::{AgentPort, Options};
use jtc_host::port::sim::LivePort;
use jtc_host::{Arm, Session};
use jtc_sim::{SimConfig, World};
use serde_json::Value;

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
        Self::start_with(baud, None)
    }

    /// The same, with TLS where it is given.
    pub fn start_with(baud: u32, tls: Option<Arc<rustls::ServerConfig>>) -> Self {
        let dir = tempfile::tempdir().expect("a directory");
        let arm = Arm::avena();
        let config = SimConfig { baud: Some(baud), ..SimConfig::new(arm.config(), &arm.parameters()) };
        let log_path = dir.path().join("commands.jsonl");
        let log = Arc::new(Mutex::new(CommandLog::open(Some(&log_path), |_| {}).expect("a file")));
        let owner = Owner::new(LivePort::new(World::new(config)), observer(log.clone()));
        let (tokens, _) = Tokens::load_or_make(&dir.path().join("tokens.toml")).expect("a token file");
        let listener = TcpListener::bind("127.0.0.1:0").expect("an address");
        let address = listener.local_addr().expect("it listens");
        let access = Access::new(tokens.clone(), address, &[]);
        let line = owner.line();
        let jobs = Jobs::new(line.clone(), Store::in_memory(), arm);
        let agent = Agent::new(line.clone(), jobs, access, log, "simulated", true).expect("random numbers");
        let ended = Arc::new(AtomicBool::new(false));
        let end = ended.clone();
        let thread = std::thread::spawn(move || {
            serve::serve(agent.router(), listener, tls, move || end.load(Ordering::Relaxed))
                .expect("it serves");
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
        let options = Options { name: name.into(), token: token.cloned(), ..Options::default() };
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

    /// What an operator's program asks, with the key of its lease and a body, where there are any.
    pub fn api(&self, request: &str, key: Option<&str>, body: Option<Value>) -> (u16, Value) {
        self.api_as(Some(&self.tokens.operator), request, key, body)
    }

    /// The same with another token, or none.
    pub fn api_as(
        &self,
        token: Option<&String>,
        request: &str,
        key: Option<&str>,
        body: Option<Value>,
    ) -> (u16, Value) {
        let mut stream = TcpStream::connect(self.address).expect("it listens");
        stream.set_read_timeout(Some(Duration::from_secs(20))).expect("a time");
        let key = key.map_or(String::new(), |key| format!("Lease-Key: {key}\r\n"));
        let token = token.map_or(String::new(), |token| format!("Authorization: Bearer {token}\r\n"));
        let json = body.as_ref().map_or("", |_| "Content-Type: application/json\r\n");
        let body = body.map_or(String::new(), |body| body.to_string());
        let (host, length) = (self.address, body.len());
        let head =
            format!("Host: {host}\r\n{token}{key}{json}Connection: close\r\nContent-Length: {length}\r\n");
        write!(stream, "{request} HTTP/1.1\r\n{head}\r\n{body}").expect("it reads");
        let mut all = String::new();
        let _ = stream.read_to_string(&mut all);
        let status = all.split(' ').nth(1).and_then(|code| code.parse().ok()).unwrap_or(0);
        let body = all.split_once("\r\n\r\n").map_or("", |(_, body)| body);
        (status, serde_json::from_str(body).unwrap_or(Value::Null))
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
