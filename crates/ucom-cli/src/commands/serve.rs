//! Command `ucom serve`: runs the agent that owns a bus.

use std::io::IsTerminal as _;
use std::net::TcpListener;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, mpsc};
use std::thread::JoinHandle;
use std::time::Duration;

use agent_kit::access::{Access, Announced, Tokens, token_file};
use agent_kit::log::CommandLog;
use agent_kit::{serve as service, tls};
use cli_kit::{ErrorKind, Failure, Output};
use serde_json::json;
use ucom::Profile;
use ucom_agent::api::Agent;
use ucom_agent::{Config, Owner};
use ucom_host::session::CleanupList;
use ucom_sim::{ChainConfig, ChainServer, ChainSim};

use crate::args::{LinkArgs, ServeArgs};
use crate::interrupt::listen;

/// Interval at which the agent's process checks for signals.
const LOOK: Duration = Duration::from_millis(50);

/// Runs the agent until SIGINT or SIGTERM. At its end, the agent stops the boards that it has
/// started.
pub(super) fn serve(args: &ServeArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    if args.sim && link.bus.is_some() {
        return Err(
            Failure::usage("--bus and --sim cannot be used together").next("omit --bus, and unset UCOM_BUS")
        );
    }
    if args.boards.is_some() && !args.sim {
        return Err(Failure::usage("--boards needs --sim").next("add --sim"));
    }
    let token_file = args.token_file.clone().or_else(|| token_file("ucom-tokens.toml")).ok_or_else(|| {
        Failure::usage("the token file has no folder: neither XDG_STATE_HOME nor HOME is set")
            .next("give the file with --token-file FILE")
    })?;
    let config = Config {
        profile: link.profile()?,
        signals: link.signal_table()?,
        cache: args.cache.cache(),
        cleanup: CleanupList::default(),
        // Simulated boards are new at each start. The inventory of real boards does not apply to
        // simulated boards.
        inventory: (!args.sim).then(|| args.inventory.clone()),
    };
    let stop = listen(&config.cleanup)?;
    let log = CommandLog::open(args.command_log.as_deref(), args.command_log_limit, log_failure(out));
    let log = log.map_err(|error| {
        let path = args.command_log.as_deref().unwrap_or("the command log".as_ref());
        Failure::usage(format!("{}: {error}", path.display()))
    })?;
    let tls = args.tls_cert.as_deref().zip(args.tls_key.as_deref());
    let tls = tls.map(|(certificate, key)| tls::load(certificate, key)).transpose()?;
    let listener = TcpListener::bind(args.listen).map_err(|error| {
        Failure::usage(format!("{}: {error}", args.listen))
            .next("another agent may use this address: give another address with --listen")
    })?;
    let address = listener.local_addr()?;
    let (tokens, are_new) = Tokens::load_or_make(&token_file)?;
    // The simulated chain is created before the owner of its bus, so that it is dropped after the owner.
    let simulated = args.sim.then(|| Simulated::start(args.boards, config.profile, out)).transpose()?;
    let bus = simulated.as_ref().map_or_else(|| link.url().map(str::to_owned), |sim| Ok(sim.url.clone()))?;
    let owner = Owner::open(&bus, config)?;
    if !address.ip().is_loopback() && tls.is_none() {
        out.note(
            "note: tokens and commands are sent without encryption: use --tls-cert and --tls-key, \
             unless you trust everyone on this network",
        );
    }
    let url = format!("{}://{address}", if tls.is_some() { "https" } else { "http" });
    let asked =
        Announced { are_new, link: args.link_with_token, on_terminal: std::io::stderr().is_terminal() };
    tokens.announce(&url, &token_file, asked).into_iter().for_each(|line| out.note(line));
    let access = Access::new(tokens, address, &args.names);
    let agent = Agent::new(&owner, access, Arc::new(Mutex::new(log)), &bus, args.sim)?;
    let value = json!({ "url": url, "token_file": token_file, "simulated": args.sim, "bus": bus });
    out.result(&value, || format!("ready: {url}{}", if args.sim { " (SIMULATED)" } else { "" }));
    let lost = owner.lost();
    let gone = owner.lost();
    service::serve(agent.router(), listener, tls, move || stop.asked() || lost().is_some())?;
    let gone = gone();
    owner.end();
    drop(simulated);
    gone.map_or(Ok(()), |why| {
        Err(Failure::new(ErrorKind::NoLink, "bus", why).next("check the bus with ucom doctor"))
    })
}

/// Returns a function that prints a note when the command log cannot be written.
fn log_failure(out: &Output) -> impl FnMut(&std::io::Error) + Send + 'static + use<> {
    let out = *out;
    move |error| {
        out.note(format!("the command log cannot be written: {error}; the agent still accepts commands"));
    }
}

/// Simulated chain that runs in a separate thread.
struct Simulated {
    url: String,
    ended: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Simulated {
    fn start(boards: Option<u8>, profile: Profile, out: &Output) -> Result<Self, Failure> {
        let (ready, url) = mpsc::channel();
        let ended: Arc<AtomicBool> = Arc::default();
        let (end, out) = (ended.clone(), *out);
        let thread = std::thread::spawn(move || {
            let head = ChainConfig::head(&profile);
            let boards = boards.map_or(head.boards.len(), usize::from);
            let chain = ChainSim::new(&head.with_boards(boards, &profile), Vec::new(), 1, &profile);
            let bound =
                ChainServer::bind("127.0.0.1:0", chain, profile.bitrate, 1, move |text| out.note(text));
            let mut server = match bound {
                Ok(server) => server,
                Err(error) => return drop(ready.send(Err(error.to_string()))),
            };
            // The receiver of this message still exists, so sending it cannot fail.
            let _ = ready.send(Ok(server.url()));
            while !end.load(Ordering::Relaxed) {
                server.turn(LOOK);
            }
        });
        let url = url
            .recv()
            .unwrap_or_else(|_| Err("the simulated chain ended because of a fault in the program".into()));
        Ok(Self { url: url.map_err(Failure::usage)?, ended, thread: Some(thread) })
    }
}

impl Drop for Simulated {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A panic of the simulation thread was already printed, so it is ignored here.
            drop(thread.join());
        }
    }
}
