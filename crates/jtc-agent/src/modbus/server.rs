//! Connections of PLCs, with limits for their addresses, their number and their request rate.
use std::collections::BTreeMap;
use std::io;
use std::net::TcpListener;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use jtc_host::session::Session;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;
use tokio::task::AbortHandle;
use tokio::time::timeout;

use super::allow::Allowed;
use super::pdu::{HEADER_LEN, Header};
use super::plc::{Connection, Plc};

/// Largest number of PLC connections.
pub const CONNECTIONS_MAX: usize = 8;
/// Duration of silence after which the server may close a connection to make room for a new connection. To make room,
/// the server never closes a connection that sends commands or whose coil holds the arm at rest.
const GIVES_WAY: Duration = Duration::from_secs(2);
/// Duration of silence after which the server closes any connection. The duration is longer than the longest watchdog
/// time.
const IDLE: Duration = Duration::from_secs(90);
/// Longest time for which a response may stay unread.
const SEND_TIME: Duration = Duration::from_secs(5);
/// Largest number of requests of a connection, per second and in one burst.
const REQUESTS_PER_S: f64 = 250.0;
const REQUESTS_AT_ONCE: f64 = 50.0;
/// Interval at which the server checks whether it must end.
const LOOK: Duration = Duration::from_millis(50);
/// Interval at which the agent reads the speed override from the controller while a PLC sends requests.
const SPEED: Duration = Duration::from_secs(2);

/// Modbus server on a separate thread. The server ends when this value is dropped.
pub struct Server {
    ended: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Serves `plc` at `listener` for connections from the allowed addresses.
    ///
    /// # Errors
    ///
    /// The operating system cannot start threads, or the listener fails.
    pub fn start(listener: TcpListener, allowed: Allowed, plc: Arc<Plc>) -> io::Result<Self> {
        listener.set_nonblocking(true)?;
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        let listener = {
            let _entered = runtime.enter();
            tokio::net::TcpListener::from_std(listener)?
        };
        let ended = Arc::new(AtomicBool::new(false));
        let end = ended.clone();
        let serve = move || {
            runtime.block_on(async move {
                tokio::select! {
                    () = accept(&listener, &allowed, &plc) => {}
                    () = ask_speed(&plc) => {}
                    () = until(&end) => {}
                }
            });
        };
        let thread = std::thread::Builder::new().name("modbus".into()).spawn(serve)?;
        Ok(Self { ended, thread: Some(thread) })
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // If the server thread has panicked, the panic was already printed.
            drop(thread.join());
        }
    }
}

async fn until(ended: &AtomicBool) {
    while !ended.load(Ordering::Relaxed) {
        tokio::time::sleep(LOOK).await;
    }
}

/// Reads the speed override from the controller repeatedly, so that PLCs can read it.
async fn ask_speed(plc: &Plc) {
    loop {
        if plc.is_asked(SPEED) && plc.line.lost().is_none() {
            let asked = plc.jobs.asker().call_in_turn(Session::speed).await;
            let percent = asked.ok().and_then(Result::ok).map(|speed| (speed * 100.0).round() as u16);
            plc.set_speed(percent);
        }
        tokio::time::sleep(SPEED).await;
    }
}

/// Open connection of a PLC.
struct Open {
    /// Time of the last request of the connection, ms.
    seen: Arc<AtomicU64>,
    abort: AbortHandle,
}

type Connections = Arc<Mutex<BTreeMap<u64, Open>>>;

/// Accepts connections in an endless loop.
async fn accept(listener: &tokio::net::TcpListener, allowed: &Allowed, plc: &Arc<Plc>) {
    let (connections, start, mut last) = (Connections::default(), Instant::now(), 0);
    loop {
        let Ok((stream, peer)) = listener.accept().await else {
            // The program has reached its limit of open files, so it waits before it accepts the next connection.
            tokio::time::sleep(LOOK).await;
            continue;
        };
        // When the stream is dropped, the connection closes immediately.
        if !allowed.contains(peer.ip()) {
            plc.refused(peer, "this address is not allowed: --modbus-allow lists the allowed addresses");
            continue;
        }
        if !make_room(&connections, plc, start) {
            plc.refused(peer, "too many PLC connections");
            continue;
        }
        last += 1;
        let connection = Connection { number: last, peer };
        let seen = Arc::new(AtomicU64::new(millis(start)));
        let gone = Gone { connection, plc: plc.clone(), connections: connections.clone() };
        let mut open = lock(&connections);
        let conversing = converse(stream, gone, seen.clone(), start);
        // The connection cannot end before it is added to the list, because the lock is held and the connection runs
        // on this thread.
        open.insert(last, Open { seen, abort: tokio::spawn(conversing).abort_handle() });
    }
}

/// Ensures that the server can accept another connection. If necessary, closes the connection that has been idle
/// longest. Never closes a connection that sends commands, whose coil holds the arm at rest, or that was idle for
/// less than `GIVES_WAY`. Returns `false` if no connection can be closed. If all connections hold the arm at rest, no
/// motion can begin.
fn make_room(connections: &Connections, plc: &Plc, start: Instant) -> bool {
    let mut open = lock(connections);
    if open.len() < CONNECTIONS_MAX {
        return true;
    }
    let silent = |seen: &AtomicU64| millis(start).saturating_sub(seen.load(Ordering::Relaxed));
    let idle = open
        .iter()
        .map(|(number, open)| (silent(&open.seen), *number))
        .filter(|(silent, number)| {
            u128::from(*silent) >= GIVES_WAY.as_millis() && !plc.needs_its_place(*number)
        })
        .max();
    let idle = idle.and_then(|(_, number)| open.remove(&number));
    idle.inspect(|open| open.abort.abort()).is_some()
}

fn lock(connections: &Connections) -> std::sync::MutexGuard<'_, BTreeMap<u64, Open>> {
    connections.lock().unwrap_or_else(PoisonError::into_inner)
}

fn millis(since: Instant) -> u64 {
    u64::try_from(since.elapsed().as_millis()).unwrap_or(u64::MAX)
}

/// Guard that removes its connection from the list when it is dropped.
struct Gone {
    connection: Connection,
    plc: Arc<Plc>,
    connections: Connections,
}

impl Drop for Gone {
    fn drop(&mut self) {
        self.plc.left(&self.connection);
        lock(&self.connections).remove(&self.connection.number);
    }
}

/// Answers the requests of a PLC until one side disconnects, or until the PLC sends invalid Modbus.
async fn converse(mut stream: TcpStream, gone: Gone, seen: Arc<AtomicU64>, start: Instant) {
    // Each response must be sent at once, without waiting for more data.
    let _ = stream.set_nodelay(true);
    let mut pace = Pace::new();
    let mut request = Vec::new();
    loop {
        let Ok(Some(header)) = timeout(IDLE, read(&mut stream, &mut request)).await else { return };
        // The request rate is limited per connection, so a fast PLC delays only itself.
        tokio::time::sleep(pace.wait(Instant::now())).await;
        seen.store(millis(start), Ordering::Relaxed);
        let response = header.respond(&gone.plc.respond(&gone.connection, &request));
        if !matches!(timeout(SEND_TIME, stream.write_all(&response)).await, Ok(Ok(()))) {
            return;
        }
    }
}

/// Reads a request of a PLC; returns `None` if the connection has ended.
async fn read(stream: &mut TcpStream, request: &mut Vec<u8>) -> Option<Header> {
    let mut head = [0; HEADER_LEN];
    stream.read_exact(&mut head).await.ok()?;
    let header = Header::parse(head)?;
    request.resize(header.len, 0);
    stream.read_exact(request).await.ok()?;
    Some(header)
}

/// Limit for the request rate of a connection.
struct Pace {
    allowance: f64,
    at: Instant,
}

impl Pace {
    fn new() -> Self {
        Self { allowance: REQUESTS_AT_ONCE, at: Instant::now() }
    }

    /// Returns the time for which the next request of the connection must wait.
    fn wait(&mut self, now: Instant) -> Duration {
        let passed = now.saturating_duration_since(self.at).as_secs_f64();
        self.allowance = (self.allowance + passed * REQUESTS_PER_S).min(REQUESTS_AT_ONCE) - 1.0;
        self.at = now;
        Duration::from_secs_f64((-self.allowance / REQUESTS_PER_S).max(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whoever_asks_faster_than_it_may_waits() {
        let (mut pace, begin) = (Pace::new(), Instant::now());
        pace.at = begin;
        // The simulated client sends each request as soon as its previous request was answered. The first requests need
        // not wait; the later requests are limited to the permitted rate.
        let mut now = begin;
        for _ in 0..1000 {
            now += pace.wait(now);
        }
        let took = now.duration_since(begin).as_secs_f64();
        let expected = (1000.0 - REQUESTS_AT_ONCE) / REQUESTS_PER_S;
        assert!((took - expected).abs() < 0.1, "{took} s instead of {expected} s");
        let mut slow = Pace::new();
        for n in 0..1000 {
            assert_eq!(slow.wait(begin + Duration::from_millis(10 * n)), Duration::ZERO, "{n}");
        }
    }
}
