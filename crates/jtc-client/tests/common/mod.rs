//! Agent for a simulated controller in this process, and functions that send requests of a client.

pub(crate) mod program;

use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

use jtc_agent::access::{Access, Tokens};
use jtc_agent::api::Agent;
use jtc_agent::jobs::{Jobs, Store};
use jtc_agent::log::{CommandLog, LIMIT, observer};
use jtc_agent::{Line, Owner, serve};
use jtc_client::{AgentPort, Options};
use jtc_host::port::sim::LivePort;
use jtc_host::{Arm, Port, Session};
use jtc_sim::{SimConfig, World};
use serde_json::json;
use test_kit::http::Http;
use tungstenite::client::IntoClientRequest as _;
use tungstenite::http::HeaderValue;
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket, connect};

/// Creates a simulated arm on a serial line with the bit rate `baud`.
pub(crate) fn simulated(baud: u32) -> LivePort {
    let arm = Arm::avena();
    let config = SimConfig { baud: Some(baud), ..SimConfig::new(arm.config(), &arm.parameters()) };
    LivePort::new(World::new(config))
}

/// Opens a WebSocket of a viewer at `stream`, `line` or `foxglove`. At `foxglove`, the function subscribes to all
/// channels.
#[allow(dead_code, reason = "the test of a load and the example of stops take it, the suite does not")]
pub(crate) fn socket(address: SocketAddr, path: &str) -> WebSocket<MaybeTlsStream<TcpStream>> {
    let mut request = format!("ws://{address}/api/{path}").into_client_request().expect("an address");
    if path != "foxglove" {
        return connect(request).expect("it is let in").0;
    }
    let spoken = HeaderValue::from_static("foxglove.websocket.v1");
    request.headers_mut().insert("Sec-WebSocket-Protocol", spoken);
    let (mut socket, _) = connect(request).expect("it is let in");
    let channels = [1, 2, 3, 4, 5, 6, 7].map(|n| json!({ "id": n, "channelId": n }));
    let subscribed = json!({ "op": "subscribe", "subscriptions": channels });
    socket.send(Message::text(subscribed.to_string())).expect("it reads");
    socket
}

/// Agent that is stopped at the end of the test.
pub(crate) struct Served {
    pub address: SocketAddr,
    pub tokens: Tokens,
    pub line: Line,
    pub log: PathBuf,
    ended: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    http: Http,
    _dir: tempfile::TempDir,
}

impl std::ops::Deref for Served {
    type Target = Http;

    fn deref(&self) -> &Http {
        &self.http
    }
}

impl Served {
    /// Starts an agent for a simulated arm on a serial line with the bit rate `baud`.
    pub(crate) fn start(baud: u32) -> Self {
        Self::start_with(baud, None, &[])
    }

    /// Like [`Self::start`], with TLS if `tls` is `Some`, and with read access for web pages from `origins`.
    pub(crate) fn start_with(baud: u32, tls: Option<Arc<rustls::ServerConfig>>, origins: &[String]) -> Self {
        Self::start_on(simulated(baud), tls, origins)
    }

    /// Like [`Self::start_with`], for any port.
    pub(crate) fn start_on(
        port: impl Port + Send + 'static,
        tls: Option<Arc<rustls::ServerConfig>>,
        origins: &[String],
    ) -> Self {
        Self::start_with_store(port, tls, origins, Store::in_memory(), Arm::avena())
    }

    /// Like [`Self::start_on`], with stored files and the specified arm.
    pub(crate) fn start_with_store(
        port: impl Port + Send + 'static,
        tls: Option<Arc<rustls::ServerConfig>>,
        origins: &[String],
        store: Store,
        arm: Arm,
    ) -> Self {
        let dir = tempfile::tempdir().expect("a directory");
        let log_path = dir.path().join("commands.jsonl");
        let log = Arc::new(Mutex::new(CommandLog::open(Some(&log_path), LIMIT, |_| {}).expect("a file")));
        let owner = Owner::new(port, observer(log.clone()));
        let (tokens, _) = Tokens::load_or_make(&dir.path().join("tokens.toml")).expect("a token file");
        let listener = TcpListener::bind("127.0.0.1:0").expect("an address");
        let address = listener.local_addr().expect("it listens");
        let access = Access::new(tokens.clone(), address, &[]).allowing(origins);
        let line = owner.line();
        let jobs = Jobs::new(line.clone(), store, arm);
        let agent = Agent::new(line.clone(), jobs, access, log, "simulated", true).expect("random numbers");
        let ended = Arc::new(AtomicBool::new(false));
        let end = ended.clone();
        let thread = std::thread::spawn(move || {
            serve::serve(agent.router(), listener, tls, move || end.load(Ordering::Relaxed))
                .expect("it serves");
            owner.end();
        });
        let http = Http { address, operator: tokens.operator.clone() };
        Self { http, address, tokens, line, log: log_path, ended, thread: Some(thread), _dir: dir }
    }

    pub(crate) fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    /// Opens a session of an operator.
    pub(crate) fn operator(&self, name: &str) -> Session<AgentPort> {
        self.session(name, Some(&self.tokens.operator))
    }

    pub(crate) fn session(&self, name: &str, token: Option<&String>) -> Session<AgentPort> {
        let options = Options { name: name.into(), token: token.cloned(), ..Options::default() };
        Session::new(AgentPort::open(&self.url(), &options).expect("it is let in"))
    }

    /// Ends the agent.
    pub(crate) fn end(&mut self) {
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
