//! Starts an agent with a simulated chain in this process, and sends HTTP requests to the agent.

use std::net::TcpListener;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use agent_kit::access::{Access, Tokens};
use agent_kit::log::{CommandLog, LIMIT};
use can_link::{CanBus, CanFrame};
use serde_json::{Value, json};
use test_kit::http::Http;
use test_kit::patience::Patience;
use ucom::Profile;
use ucom_agent::api::Agent;
use ucom_agent::{Config, Owner};
use ucom_sim::{ChainConfig, ChainServer, ChainSim};

/// Simulated chain on a bus that other programs can join.
pub(crate) struct Chain {
    pub url: String,
    faults: Sender<(String, Sender<()>)>,
    ended: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Chain {
    pub(crate) fn start(boards: usize) -> Self {
        let (faults, lines) = channel::<(String, Sender<()>)>();
        let (ready, url) = channel();
        let ended: Arc<AtomicBool> = Arc::default();
        let end = ended.clone();
        let thread = std::thread::spawn(move || {
            let profile = Profile::default();
            let config = ChainConfig::head(&profile).with_boards(boards, &profile);
            let chain = ChainSim::new(&config, Vec::new(), 1, &profile);
            let mut server =
                ChainServer::bind("127.0.0.1:0", chain, profile.bitrate, 1, |text| println!("sim: {text}"))
                    .expect("an address");
            ready.send(server.url()).expect("the test waits");
            while !end.load(Ordering::Relaxed) {
                let given: Vec<_> = lines.try_iter().collect();
                given.iter().for_each(|(line, _)| server.fault(line));
                server.turn(Duration::from_millis(20));
                // `turn` has started the fault. Dropping the sender resumes the test that waits for the fault.
                drop(given);
            }
        });
        Self { url: url.recv().expect("it listens"), faults, ended, thread: Some(thread) }
    }

    /// Starts a fault of the simulated chain, and returns when the fault has started.
    pub(crate) fn fault(&self, line: &str) {
        let (begun, begins) = channel();
        self.faults.send((line.into(), begun)).expect("it goes on");
        // The channel transmits no messages. The wait ends when the thread of the chain drops the
        // sender.
        begins.recv().unwrap_or_default();
    }

    /// Joins the bus as a device that only sends and receives plain frames.
    pub(crate) fn peer(&self) -> Box<dyn CanBus + Send> {
        can_link::open(&self.url).expect("the bus opens")
    }

    pub(crate) fn end(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            thread.join().expect("it ends");
        }
    }
}

impl Drop for Chain {
    fn drop(&mut self) {
        self.end();
    }
}

/// Waits on a bus for a frame with this identifier and this data; returns the waiting time.
pub(crate) fn frame(peer: &mut dyn CanBus, id: u32, data: &[u8]) -> Duration {
    let begun = Instant::now();
    let what = format!("{id:03X}#{data:02X?}");
    frame_when(peer, &what, |frame| frame.id().value() == id && frame.data() == data);
    begun.elapsed()
}

/// Waits on a bus for a frame for which `is` returns `true`.
pub(crate) fn frame_when(peer: &mut dyn CanBus, what: &str, is: impl Fn(&CanFrame) -> bool) {
    let mut patience = Patience::begin();
    let mut next = || patience.wait(what, |time| peer.receive(time)).expect("the bus is there");
    while !next().is_some_and(|frame| is(&frame)) {}
}

/// Agent that ends when its test ends.
pub(crate) struct Served {
    pub chain: Chain,
    pub tokens: Tokens,
    pub log: PathBuf,
    http: Http,
    ended: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    _dir: tempfile::TempDir,
}

impl std::ops::Deref for Served {
    type Target = Http;

    fn deref(&self) -> &Http {
        &self.http
    }
}

impl Served {
    /// Starts an agent with a simulated chain of `boards` boards without numbers.
    pub(crate) fn start(boards: usize) -> Self {
        Self::start_as(boards, Config::default())
    }

    /// Like `start`, but with the agent configuration `config`.
    pub(crate) fn start_as(boards: usize, config: Config) -> Self {
        let chain = Chain::start(boards);
        let dir = tempfile::tempdir().expect("a directory");
        let log_path = dir.path().join("commands.jsonl");
        let log = Arc::new(Mutex::new(CommandLog::open(Some(&log_path), LIMIT, |_| {}).expect("a file")));
        let owner = Owner::open(&chain.url, config).expect("the bus opens");
        let (tokens, _) = Tokens::load_or_make(&dir.path().join("tokens.toml")).expect("a token file");
        let listener = TcpListener::bind("127.0.0.1:0").expect("an address");
        let address = listener.local_addr().expect("it listens");
        let access = Access::new(tokens.clone(), address, &[]);
        let agent = Agent::new(&owner, access, log, "simulated", true).expect("random numbers");
        let ended = Arc::new(AtomicBool::new(false));
        let end = ended.clone();
        let thread = std::thread::spawn(move || {
            agent_kit::serve::serve(agent.router(), listener, None, move || end.load(Ordering::Relaxed))
                .expect("it serves");
            owner.end();
        });
        let http = Http { address, operator: tokens.operator.clone() };
        Self { chain, tokens, log: log_path, http, ended, thread: Some(thread), _dir: dir }
    }

    /// Starts an agent with a chain of numbered boards, and takes the lease. Also returns the key of
    /// the lease.
    pub(crate) fn numbered(boards: usize) -> (Self, String) {
        Self::numbered_as(boards, Config::default())
    }

    /// Like `numbered`, but with the agent configuration `config`.
    pub(crate) fn numbered_as(boards: usize, config: Config) -> (Self, String) {
        let served = Self::start_as(boards, config);
        let key = served.lease("anna", 60.0, "continue");
        let job = served.job("POST /api/init", &key, Some(json!({})));
        assert_eq!(job["stage"], "finished", "{job}");
        (served, key)
    }

    /// Takes the lease and returns the key of the lease.
    pub(crate) fn lease(&self, name: &str, lasts_s: f64, policy: &str) -> String {
        let body = json!({ "name": name, "lasts_s": lasts_s, "policy": policy });
        let (status, grant) = self.api("POST /api/lease", None, Some(body));
        assert_eq!((status, grant["held"].as_bool()), (200, Some(true)), "{grant}");
        grant["key"].as_str().expect("a key").to_owned()
    }

    /// Starts a job and returns its number.
    pub(crate) fn begin(&self, request: &str, key: &str, body: Option<Value>) -> u64 {
        let (status, job) = self.api(request, Some(key), body);
        assert_eq!(status, 202, "{request}: {job}");
        job["number"].as_u64().expect("a number")
    }

    /// Waits for the end of a job and returns the job.
    pub(crate) fn over(&self, number: u64) -> Value {
        let mut patience = Patience::begin();
        loop {
            let (status, job) = self.api(&format!("GET /api/jobs/{number}"), None, None);
            assert_eq!(status, 200, "{job}");
            if job["stage"] != "running" {
                return job;
            }
            patience.pause(format_args!("the end of job {number}: {job}"));
        }
    }

    /// Starts a job, waits for its end, and returns the job.
    pub(crate) fn job(&self, request: &str, key: &str, body: Option<Value>) -> Value {
        self.over(self.begin(request, key, body))
    }

    /// Runs the control loops of these boards with enabled outputs.
    pub(crate) fn run(&self, key: &str, boards: &[u8]) {
        let body = json!({ "boards": boards, "active": true });
        let job = self.job("POST /api/run", key, Some(body));
        assert_eq!(job["stage"], "finished", "{job}");
    }

    pub(crate) fn board(&self, number: u8) -> Value {
        self.api(&format!("GET /api/boards/{number}"), None, None).1
    }

    /// Waits until `is` returns `true` for the board, then returns the board.
    pub(crate) fn board_when(&self, number: u8, what: &str, is: impl Fn(&Value) -> bool) -> Value {
        let mut patience = Patience::begin();
        loop {
            let board = self.board(number);
            if is(&board) {
                return board;
            }
            patience.pause(format_args!("board {number}, {what}: {board}"));
        }
    }

    pub(crate) fn last_event(&self) -> u64 {
        self.api("GET /api/status", None, None).1["last_event"].as_u64().expect("a number")
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
