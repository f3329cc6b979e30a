//! Requests of PLCs: the values that PLCs read, the connection that may send commands, and the outcomes of commands.
use std::collections::BTreeMap;
use std::net::{IpAddr, SocketAddr};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use jtc_wire::ExecCommand;
use serde_json::json;

use super::codes::{Command, Outcome};
use super::handshake::{Handshake, Order};
use super::map::{self, COILS, DISCRETE_INPUTS, Holder, View, holding};
use super::pdu::{self, Device, Exception, Table};
use crate::jobs::{ArmEvent, HttpSession, Jobs};
use crate::line::{Introduction, Policy, Role};
use crate::log::CommandLog;
use crate::owner::Line;

/// Name of the PLC client on the serial line.
const NAME: &str = "the PLC (Modbus)";
/// Duration of silence after which the connection that sends commands is considered lost. If the watchdog time is
/// longer, the watchdog time applies instead. If the watchdog is off, `GONE_UNWATCHED` applies.
const GONE: Duration = Duration::from_secs(1);
const GONE_UNWATCHED: Duration = Duration::from_secs(60);

/// Connection of a PLC.
#[derive(Clone, Copy, Debug)]
pub struct Connection {
    /// Number of the connection. Connection numbers are not reused.
    pub number: u64,
    /// Network address of the PLC.
    pub peer: SocketAddr,
}

/// State of the PLC that writes the holding registers.
struct Operator {
    address: IpAddr,
    /// Number of the PLC's connection. `None` if the PLC has disconnected or released the lease.
    connection: Option<u64>,
    seen: Instant,
}

struct State {
    handshake: Handshake,
    operator: Option<Operator>,
    /// Coil values of each connection that has written a coil.
    coils: BTreeMap<u64, [bool; COILS.len()]>,
    http_session: Arc<HttpSession>,
    /// Last job that a PLC began. `looked` is the number of the last event that was read, and `runs` is the number of runs
    /// that the job has finished.
    job: Option<u64>,
    looked: u64,
    runs: u32,
    speed: Option<u16>,
    asked: Option<Instant>,
}

/// Modbus device that all PLC connections share.
pub struct Plc {
    pub(super) line: Line,
    pub(super) jobs: Arc<Jobs>,
    log: Arc<Mutex<CommandLog>>,
    simulated: bool,
    state: Mutex<State>,
}

impl Plc {
    /// Creates the Modbus device of a serial line. The first command must have the sequence number after `sequence`.
    pub fn new(
        line: Line,
        jobs: Arc<Jobs>,
        log: Arc<Mutex<CommandLog>>,
        simulated: bool,
        sequence: u16,
    ) -> Arc<Self> {
        let state = State {
            handshake: Handshake::new(sequence),
            operator: None,
            coils: BTreeMap::new(),
            // The PLC client is added to the line here, so that Stops of other clients apply to it even before its
            // first request.
            http_session: http_session(&line),
            job: None,
            looked: 0,
            runs: 0,
            speed: None,
            asked: None,
        };
        Arc::new(Self { line, jobs, log, simulated, state: Mutex::new(state) })
    }

    /// Returns the response to a request of a PLC.
    pub fn respond(self: &Arc<Self>, connection: &Connection, request: &[u8]) -> Vec<u8> {
        self.lock().asked = Some(Instant::now());
        let (response, done) = pdu::answer(request, &mut Asking { plc: self, connection });
        if done {
            self.renew(connection);
        }
        response
    }

    /// Processes the end of a connection. The lease lasts until the watchdog time has passed, so that the PLC can reconnect.
    pub fn left(&self, connection: &Connection) {
        let mut state = self.lock();
        state.coils.remove(&connection.number);
        if let Some(operator) = &mut state.operator {
            operator.connection = operator.connection.filter(|number| *number != connection.number);
        }
    }

    /// Returns `true` if the connection sends commands, or if one of its coils holds the arm at rest. The server must
    /// not close such a connection to make room for a new one.
    pub fn needs_its_place(&self, connection: u64) -> bool {
        let state = self.lock();
        let holds = state.coils.get(&connection).is_some_and(|coils| coils.contains(&true));
        holds
            || state.operator.as_ref().is_some_and(|operator| {
                operator.connection == Some(connection) && !operator.is_gone(&state.handshake)
            })
    }

    /// Returns `true` if a PLC sent a request within the last `within`.
    pub fn is_asked(&self, within: Duration) -> bool {
        self.lock().asked.is_some_and(|asked| asked.elapsed() < within)
    }

    /// Sets the speed override that PLCs can read, %.
    pub fn set_speed(&self, percent: Option<u16>) {
        self.lock().speed = percent;
    }

    pub(super) fn set_job(&self, job: u64) {
        let mut state = self.lock();
        (state.job, state.runs, state.looked) = (Some(job), 0, 0);
    }

    /// Returns the client of the serial line that sends the commands of PLCs.
    pub(super) fn http_session(&self) -> Arc<HttpSession> {
        let mut state = self.lock();
        if self.line.with(|line, _| line.introduction(state.http_session.client).is_none()) {
            // The serial line has disconnected the previous client, so a new client is added.
            state.http_session = http_session(&self.line);
        }
        state.http_session.clone()
    }

    /// Returns `true` if a coil of any connection is 1. A coil with the value 1 holds the arm at rest.
    pub(super) fn is_held_by_a_coil(&self) -> bool {
        self.lock().coils.values().any(|coils| coils.contains(&true))
    }

    /// Returns the policy for a motion if the PLC is silent or disconnected. Also returns the time after which the policy
    /// applies.
    pub(super) fn watchdog(&self) -> (Policy, Duration) {
        watchdog(&self.lock().handshake)
    }

    /// Ends the right of the present connection to write holding registers, so that another connection can send
    /// commands.
    pub(super) fn resign(&self) {
        if let Some(operator) = &mut self.lock().operator {
            operator.connection = None;
        }
    }

    pub(super) fn note(&self, what: &str, facts: serde_json::Value) {
        self.log.lock().unwrap_or_else(PoisonError::into_inner).write(what, facts);
    }

    /// Logs a refused connection.
    pub fn refused(&self, peer: SocketAddr, why: &str) {
        let facts = json!({ "from": peer.to_string(), "path": "modbus", "why": why });
        let mut log = self.log.lock().unwrap_or_else(PoisonError::into_inner);
        log.write_repeated("refused", &format!("modbus {}", peer.ip()), facts);
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn has_lease(&self, state: &State) -> bool {
        self.line.with(|line, _| line.lease().is_some_and(|lease| lease.holder == state.http_session.client))
    }

    /// Renews the lease after a request of the connection that sends commands.
    fn renew(&self, connection: &Connection) {
        let mut state = self.lock();
        let Some(operator) =
            state.operator.as_mut().filter(|operator| operator.connection == Some(connection.number))
        else {
            return;
        };
        operator.seen = Instant::now();
        let (policy, lasts) = watchdog(&state.handshake);
        let client = state.http_session.client;
        self.line.with(|line, now| {
            let lives = |until: Option<Duration>| until.is_none_or(|until| now < until);
            if line.lease().is_some_and(|lease| lease.holder == client && lives(lease.until)) {
                line.set_policy(client, policy);
                // The client holds the lease, so renewing it cannot fail.
                let _ = line.take_lease(client, Some(lasts), now);
            }
        });
    }

    /// Returns the values that a connection can read.
    fn view(&self, connection: &Connection) -> View {
        let lost = self.line.lost().is_some();
        let mut state = self.lock();
        let own = state.operator.as_ref().is_none_or(|operator| match operator.connection {
            Some(number) => number == connection.number,
            None => operator.address == connection.peer.ip(),
        });
        let client = state.http_session.client;
        let (now, status, holder, wanted) = self.line.with(|line, now| {
            let status = line.status().map(|(at, status)| (now.saturating_sub(*at), *status));
            let holder = line.lease().map_or(Holder::Nobody, |lease| {
                if lease.holder == client && own { Holder::Own } else { Holder::Other }
            });
            let wanted =
                line.lease().is_some_and(|lease| lease.holder == client && lease.wanted_by.is_some());
            (now, status, holder, wanted)
        });
        let job = state.job.and_then(|number| self.jobs.job(number)).map(|mut job| {
            job.done.runs = job.done.runs.max(self.runs(&mut state, job.number));
            job
        });
        let (acknowledged, outcome, error) = state.handshake.last();
        let (simulated, speed) = (self.simulated, state.speed);
        let stops = &self.jobs.stops;
        let stop = status.as_ref().and_then(|(_, status)| stops.cause(status, now));
        let jumped = status.as_ref().map_or(0, |(_, status)| stops.jumped(status));
        View {
            now,
            simulated,
            lost,
            status,
            stop,
            jumped,
            speed,
            holder,
            wanted,
            job,
            acknowledged,
            outcome,
            error,
        }
    }

    /// Returns the number of runs that a job has finished.
    fn runs(&self, state: &mut State, job: u64) -> u32 {
        if self.jobs.journal.last() != state.looked {
            let excerpt = self.jobs.journal.after(state.looked, Some(job), usize::from(u16::MAX));
            state.looked = excerpt.last;
            for event in excerpt.events {
                if let ArmEvent::Finished { runs, .. } = event.event {
                    state.runs = runs;
                }
            }
        }
        state.runs
    }

    /// Sends a Stop or a Pause of a connection before all other frames.
    fn halt(&self, connection: &Connection, command: ExecCommand) -> Result<(), Exception> {
        let (name, lost) = (format!("the PLC at {}", connection.peer.ip()), self.line.lost());
        let facts = json!({
            "command": command.name(), "from": connection.peer.to_string(), "by": name, "lost": lost,
        });
        self.note("halt", facts);
        if lost.is_some() {
            return Err(Exception::Failure);
        }
        // A connection may send commands again immediately after its own Stop or Pause.
        let state = self.lock();
        let is_own = |operator: &Operator| operator.connection == Some(connection.number);
        let own = state.operator.as_ref().is_some_and(is_own).then_some(state.http_session.client);
        drop(state);
        self.line.with(|line, now| line.halt_for(own, &name, command, now));
        Ok(())
    }

    /// Executes a command of a PLC and acknowledges it.
    fn obey(self: &Arc<Self>, connection: Connection, order: Order, busy: bool) {
        let halt = match order.command {
            Command::Stop => Some(ExecCommand::Stop),
            Command::Pause => Some(ExecCommand::Pause),
            _ => None,
        };
        if let Some(halt) = halt {
            let sent = self.halt(&connection, halt);
            let outcome = if sent.is_ok() { Outcome::Done } else { Outcome::NoController };
            return self.lock().handshake.acknowledge(order.sequence, outcome, 0);
        }
        if busy || order.command == Command::None {
            let outcome = if busy { Outcome::Busy } else { Outcome::Done };
            return self.lock().handshake.acknowledge(order.sequence, outcome, 0);
        }
        // If a client requests a Stop before the command starts, the command does not start.
        let (plc, halt) = (self.clone(), self.line.last_halt());
        tokio::spawn(async move {
            let refusal = plc.act(&order, halt).await.err();
            let facts = json!({
                "client": plc.http_session().client.0, "command": order.command.text(), "sequence": order.sequence,
                "from": connection.peer.to_string(),
                "why_not": refusal.as_ref().map(|refusal| refusal.why.clone()),
            });
            plc.note("command", facts);
            let (outcome, error) =
                refusal.map_or((Outcome::Done, 0), |refusal| (refusal.outcome, refusal.error));
            plc.lock().handshake.acknowledge(order.sequence, outcome, error);
        });
    }
}

impl Operator {
    /// Returns `true` if the connection that sends commands is closed, or has been silent for too long.
    fn is_gone(&self, handshake: &Handshake) -> bool {
        let after = match handshake.watchdog_ms() {
            0 => GONE_UNWATCHED,
            ms => Duration::from_millis(ms.into()).max(GONE),
        };
        self.connection.is_none() || self.seen.elapsed() > after
    }
}

impl State {
    /// Assigns the holding registers to this connection, unless another connection uses the registers. `leased` is `true` if
    /// a PLC holds the lease.
    fn operate(&mut self, connection: &Connection, leased: bool) -> Result<(), Exception> {
        let address = connection.peer.ip();
        let same = self.operator.as_ref().is_some_and(|operator| operator.address == address);
        if let Some(operator) = self.operator.as_ref().filter(|o| o.connection != Some(connection.number))
            && (!operator.is_gone(&self.handshake) || (leased && !same))
        {
            return Err(Exception::Busy);
        }
        if !same {
            self.handshake.forget();
        }
        self.operator = Some(Operator { address, connection: Some(connection.number), seen: Instant::now() });
        Ok(())
    }
}

fn http_session(line: &Line) -> Arc<HttpSession> {
    let introduction = Introduction { name: NAME.into(), role: Role::Operator, policy: Policy::Pause };
    HttpSession::new(line, introduction)
}

fn watchdog(handshake: &Handshake) -> (Policy, Duration) {
    let policy = match handshake.values()[holding::POLICY] {
        0 => Policy::Continue,
        2 => Policy::Stop,
        _ => Policy::Pause,
    };
    (policy, Duration::from_millis(handshake.watchdog_ms().into()))
}

/// Connection that sends the present request.
struct Asking<'a> {
    plc: &'a Arc<Plc>,
    connection: &'a Connection,
}

impl Device for Asking<'_> {
    fn bits(&mut self, table: Table, at: u16, count: u16) -> Result<Vec<bool>, Exception> {
        let all = match table {
            Table::Coils => {
                self.plc.lock().coils.get(&self.connection.number).copied().unwrap_or_default().to_vec()
            }
            _ => {
                let view = self.plc.view(self.connection);
                DISCRETE_INPUTS.iter().map(|row| (row.value)(&view)).collect()
            }
        };
        map::span(&all, at, count.into())
    }

    fn registers(&mut self, table: Table, at: u16, count: u16) -> Result<Vec<u16>, Exception> {
        match table {
            Table::HoldingRegisters => map::span(self.plc.lock().handshake.values(), at, count.into()),
            _ => map::span(&map::inputs(&self.plc.view(self.connection)), at, count.into()),
        }
    }

    fn write_coils(&mut self, at: u16, values: &[bool]) -> Result<(), Exception> {
        let number = self.connection.number;
        let mut coils = self.plc.lock().coils.get(&number).copied().unwrap_or_default();
        map::span(&coils, at, values.len())?;
        let before = coils;
        coils[usize::from(at)..][..values.len()].copy_from_slice(values);
        let rises = |coil: usize| coils[coil] && !before[coil];
        // The Stop coil has priority over the Pause coil.
        if rises(map::STOP) {
            self.plc.halt(self.connection, ExecCommand::Stop)?;
        } else if rises(map::PAUSE) {
            self.plc.halt(self.connection, ExecCommand::Pause)?;
        }
        self.plc.lock().coils.insert(number, coils);
        Ok(())
    }

    fn write_registers(&mut self, at: u16, values: &[u16]) -> Result<(), Exception> {
        let (order, busy) = {
            let mut state = self.plc.lock();
            let leased = self.plc.has_lease(&state);
            state.handshake.check(at, values, leased)?;
            state.operate(self.connection, leased)?;
            let busy = state.handshake.is_pending();
            (state.handshake.write(at, values), busy)
        };
        if let Some(order) = order {
            self.plc.obey(*self.connection, order, busy);
        }
        Ok(())
    }
}
