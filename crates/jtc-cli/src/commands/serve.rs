//! `jtc serve`: the agent that owns a port.

use std::io::IsTerminal as _;
use std::net::TcpListener;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use cli_kit::{ErrorKind, Failure, Output, Stop};
use jtc_agent::access::{Access, Announced, Tokens, default_token_file};
use jtc_agent::api::Agent;
use jtc_agent::jobs::{Jobs, Store};
use jtc_agent::log::{CommandLog, observer};
use jtc_agent::modbus::{self, Allowed, Plc};
use jtc_agent::record::{Notice, Prepared};
use jtc_agent::will::{self, Found, Keeper};
use jtc_agent::{Line, Owner, serve as service, tls};
use jtc_client::agents::{Registered, register};
use jtc_host::Arm;
use jtc_host::example::demo_motion;
use jtc_host::port::Port;
use jtc_host::port::sim::LivePort;
use jtc_sim::{SimConfig, World};
use jtc_wire::{ControllerState, Status};
use serde_json::json;

use super::named_arm;
use super::simulated::simulated;
use crate::args::ServeArgs;

/// Longest wait until a motion has stopped when the agent ends.
const STOPPING: Duration = Duration::from_secs(5);

/// Serves the port until SIGINT or SIGTERM. Before the agent ends, it stops a motion on its path.
pub(super) fn serve(args: &ServeArgs, out: &Output) -> Result<(), Failure> {
    let token_file = args.link.token_file.clone().or_else(default_token_file).ok_or_else(|| {
        Failure::usage("no folder for a token file: neither XDG_STATE_HOME nor HOME is set")
            .next("choose a file with --token-file FILE")
    })?;
    let stop = Stop::listen()?;
    let log = CommandLog::open(args.command_log.as_deref(), args.command_log_limit, log_failure(out));
    let log = log.map_err(|error| {
        let path = args.command_log.as_deref().unwrap_or("the log of commands".as_ref());
        Failure::usage(format!("{}: {error}", path.display()))
    })?;
    let store = args.trajectories.as_deref().map_or_else(|| Ok(Store::in_memory()), Store::open)?;
    if args.sim && args.arm.is_none() && args.trajectories.is_none() {
        // For a simulated arm, the agent stores an example motion, because a new user has no trajectory yet.
        store.put(1, "example motion", &demo_motion().to_exact_csv(), false, None)?;
    }
    let tls = args.tls_cert.as_deref().zip(args.tls_key.as_deref());
    let tls = tls.map(|(certificate, key)| tls::load(certificate, key)).transpose()?;
    let listener = TcpListener::bind(args.listen).map_err(|error| {
        Failure::usage(format!("{}: {error}", args.listen))
            .next("another agent may use this address: choose another one with --listen")
    })?;
    let listen = listener.local_addr()?;
    let modbus = listen_modbus(args)?;
    let modbus_at = modbus.as_ref().map(TcpListener::local_addr).transpose()?;
    let mut recordings =
        args.record.as_deref().map(|dir| open_recordings(dir, args.record_limit)).transpose()?;
    let (port, arm) = port(args, out)?;
    let (tokens, are_new) = Tokens::load_or_make(&token_file)?;
    let (url, name) = (format!("{}://{listen}", if tls.is_some() { "https" } else { "http" }), port.name());
    let log = Arc::new(Mutex::new(log));
    let left = if args.sim { None } else { keep_policies(&name, &log, out)? };
    // The absolute path is used, because a relative name would refer to a different port in another working
    // directory.
    let name = std::fs::canonicalize(&name).map_or(name, |path| path.display().to_string());

    let witness = recordings.as_mut().and_then(Prepared::witness);
    let will = left.as_ref().map(|(keeper, _)| keeper.witness());
    let mut logged = observer(log.clone());
    let observer = move |now, event: &_| {
        if let Some(will) = &will {
            will.see(event);
        }
        if let Some(witness) = &witness {
            witness.see(now, event);
        }
        logged(now, event);
    };
    let owner = Owner::new(port, Box::new(observer));
    let keeper = left.map(|(keeper, found)| act_on(&owner.line(), keeper, &found, &log, out));
    let notify = notices(&log, out, "warning");
    let recorder = recordings.map(|begin| begin.begin(owner.line(), &name, notify)).transpose()?;
    let registered = Registered {
        url: url.clone(),
        port: name.clone(),
        token_file: std::path::absolute(&token_file)?,
        certificate: args.tls_cert.as_deref().map(std::path::absolute).transpose()?,
    };
    // An error of the registration is ignored, because the user can still specify the address of the agent as an
    // option of each command.
    let registration = register(&registered).ok().flatten();
    if !listen.ip().is_loopback() && tls.is_none() {
        out.note(
            "note: tokens and commands are sent over the network without encryption: use --tls-cert and \
             --tls-key, or a network that you trust",
        );
    }
    if let Some(at) = modbus_at {
        out.note(format!(
            "note: Modbus has no tokens: every client that can connect to {at} can command the arm"
        ));
    }
    let asked =
        Announced { are_new, link: args.link_with_token, on_terminal: std::io::stderr().is_terminal() };
    tokens.announce(&url, &token_file, asked).into_iter().for_each(|line| out.note(line));
    let access = Access::new(tokens, listen, &args.names).allowing(&args.allow_origins);
    let jobs = Jobs::new(owner.line(), store, arm);
    let agent = Agent::new(owner.line(), jobs.clone(), access, log.clone(), &name, args.sim)?;
    let plcs = match modbus {
        Some(listener) => {
            let plc = Plc::new(owner.line(), jobs, log, args.sim, modbus::first_sequence()?);
            Some(modbus::Server::start(listener, Allowed::new(args.modbus_allow.clone()), plc)?)
        }
        None => None,
    };
    let value = json!({ "url": url, "token_file": token_file, "simulated": args.sim, "modbus": modbus_at });
    out.result(&value, || {
        let modbus = modbus_at.map_or(String::new(), |at| format!(", Modbus {at}"));
        format!("ready: {url}{modbus}{}", if args.sim { " (SIMULATED)" } else { "" })
    });
    let (line, ended) = (owner.line(), stop.clone());
    let lost = owner.line();
    service::serve(agent.router(), listener, tls, move || ended.asked() || lost.lost().is_some())?;
    drop((registration, plcs));
    let gone = line.lost();
    let rests = gone.is_none() && come_to_rest(&line, out);
    drop(recorder);
    // The agent reads the status again, because completing the recording may have taken several seconds.
    let rests = rests && line.with(|line, _| line.status().is_some_and(|(_, status)| !moves(status)));
    owner.end();
    if let Some(keeper) = keeper.filter(|_| rests) {
        keeper.forget();
    }
    match gone {
        Some(why) => {
            Err(Failure::new(ErrorKind::NoLink, "port", why)
                .next("connect the device again, then `jtc ports`"))
        }
        None => Ok(()),
    }
}

/// Opens the listener for PLCs, if requested.
fn listen_modbus(args: &ServeArgs) -> Result<Option<TcpListener>, Failure> {
    let Some(at) = args.modbus else { return Ok(None) };
    if !at.ip().is_loopback() && args.modbus_allow.is_empty() {
        return Err(Failure::usage(format!(
            "--modbus {at}: --modbus-allow is missing, so only this computer could connect"
        ))
        .next("give the allowed addresses or networks with --modbus-allow: Modbus has no tokens"));
    }
    let listener = TcpListener::bind(at).map_err(|error| {
        Failure::usage(format!("--modbus {at}: {error}"))
            .next("choose another port: on most systems only administrators can use 502, the port of Modbus")
    })?;
    Ok(Some(listener))
}

/// Returns `true` if the status shows that the arm moves, or that a user can guide the arm by hand.
fn moves(status: &Status) -> bool {
    status.is_executing() || status.state == ControllerState::Teaching
}

/// Stops a motion, because no client can stop the motion after the end of the agent. The function also ends Teaching, so that the
/// controller holds the arm. Returns `true` if the controller reports that the arm is at rest and held.
fn come_to_rest(line: &Line, out: &Output) -> bool {
    let began = line.now();
    line.with(|line, now| line.end(now));
    // Only statuses that arrive after this point are used.
    let rests = || {
        line.with(|line, _| {
            line.is_idle() && line.status().is_some_and(|(at, status)| *at > began && !moves(status))
        })
    };
    let end = Instant::now() + STOPPING;
    while !rests() && Instant::now() < end {
        std::thread::sleep(Duration::from_millis(20));
    }
    let rests = rests();
    if !rests {
        out.note("the arm may be moving: the controller has not reported the end of its motion");
    }
    rests
}

/// Opens the directory for recordings. The agent opens the directory before any other step.
fn open_recordings(dir: &Path, limit: u64) -> Result<Prepared, Failure> {
    Prepared::open(dir, limit).map_err(|error| {
        Failure::usage(format!("{}: {error}", dir.display()))
            .next("choose another directory with --record DIR")
    })
}

/// Starts to store which client's policy applies to a motion if this client disconnects. If this agent is killed, the
/// next agent applies the stored policy. The function also returns the policy that a killed agent has stored, for
/// `act_on`.
fn keep_policies(
    port: &str,
    log: &Arc<Mutex<CommandLog>>,
    out: &Output,
) -> Result<Option<(Keeper, Found)>, Failure> {
    let Some(state) = host_kit::user_folder("XDG_STATE_HOME", ".local/state") else {
        out.note(
            "warning: neither XDG_STATE_HOME nor HOME is set: if this agent is killed, no policy is applied \
             to a moving arm",
        );
        return Ok(None);
    };
    // The agent stores the port under the name that the user has specified, because a device may get another number after it is
    // reconnected.
    let port = std::path::absolute(port).map_or(port.to_owned(), |path| path.display().to_string());
    Ok(Some(Keeper::begin(&state.join("openjtc"), &port, notices(log, out, "warning"))?))
}

/// Applies the policy that a killed agent has stored, before this agent serves a client. Also starts to read the host
/// timeout of the controller, in a separate thread.
fn act_on(line: &Line, keeper: Keeper, found: &Found, log: &Arc<Mutex<CommandLog>>, out: &Output) -> Keeper {
    if let Some(notice) = will::apply(line, &keeper, found) {
        notices(log, out, "note")(notice);
    }
    let line = line.clone();
    std::thread::spawn(move || will::read_host_timeout(&line));
    keeper
}

/// Returns a function that writes notices about recordings and policies to the command log. The function also prints
/// the warnings for users.
fn notices(log: &Arc<Mutex<CommandLog>>, out: &Output, kind: &'static str) -> Box<dyn FnMut(Notice) + Send> {
    let (log, out) = (log.clone(), *out);
    Box::new(move |notice| {
        log.lock().unwrap_or_else(PoisonError::into_inner).write(notice.what, notice.facts);
        if let Some(warning) = notice.warning {
            out.note(format!("{kind}: {warning}"));
        }
    })
}

/// Returns a function that reports a write error of the command log.
fn log_failure(out: &Output) -> impl FnMut(&std::io::Error) + Send + 'static + use<> {
    let out = *out;
    move |error| {
        out.note(format!("the log of commands cannot be written: {error}; commands still work"));
    }
}

/// Returns the port, and the arm that the agent uses if the controller cannot report its arm.
fn port(args: &ServeArgs, out: &Output) -> Result<(Box<dyn Port + Send>, Arm), Failure> {
    if !args.sim {
        let arm = named_arm::load(args.arm.as_deref())?;
        if args.arm.is_some() {
            named_arm::note_warnings(&arm, out);
        }
        return Ok((Box::new(args.link.own()?), arm));
    }
    let (arm, config) = simulated(args.arm.as_deref(), None, out)?;
    let config = SimConfig { baud: Some(args.link.baud), ..config };
    Ok((Box::new(LivePort::new(World::new(config))), arm))
}
