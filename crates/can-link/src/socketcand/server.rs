//! Server of the socketcand protocol.

use std::io;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, Shutdown, SocketAddr, TcpListener, TcpStream, ToSocketAddrs};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use super::session;
use super::shared::{Channel, Client, ClientId, Inner, Route};
use crate::{CanFrame, CanUrl, ErrorState, ListenError, VirtualHub};

/// Largest number of clients at the same time.
const MOST_CLIENTS: usize = 64;
/// Longest time for which dropping the server waits for the clients' threads.
const END_TIMEOUT: Duration = Duration::from_secs(1);

/// Counters of a server.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ServerStats {
    /// Number of connected clients.
    pub clients: usize,
    /// Number of accepted connections.
    pub accepted: u64,
    /// Number of connections that the server closed at once because 64 clients were already connected.
    pub turned_away: u64,
    /// Number of frames received from clients.
    pub received: u64,
    /// Number of frames written to clients, counted for each client.
    pub sent: u64,
    /// Number of frames that clients missed because they did not read.
    pub missed: u64,
    /// Number of frames that the protocol cannot transmit (remote, CAN FD), counted for each client.
    pub not_carried: u64,
    /// Number of unknown commands.
    pub not_understood: u64,
}

/// A server of the socketcand protocol, compatible with python-can's `socketcand` interface and SavvyCAN.
///
/// The server forwards a client's frames to all other clients and members, but not back to the client. A client that
/// does not read misses frames after about 65,000 frames, and is disconnected after 30 s. A client never blocks the
/// bus. Dropping the server closes all connections.
///
/// ```
/// use std::time::Duration;
/// use can_link::{CanBus, CanFrame, Id, SocketcandServer, VirtualHub, open};
/// let hub = VirtualHub::new();
/// let server = SocketcandServer::bind("127.0.0.1:0", &[("can0", &hub)])?;
/// let mut node = hub.join();
/// let mut tool = open(&server.url("can0"))?;
/// tool.send(&CanFrame::classic(Id::standard(0x123)?, &[1, 2])?)?;
/// assert!(node.receive(Duration::from_secs(60))?.is_some());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct SocketcandServer {
    address: SocketAddr,
    inner: Arc<Inner>,
    acceptor: Option<JoinHandle<()>>,
}

impl SocketcandServer {
    /// Listens at an address (with port 0, at a free port) and provides buses of this process under the given names. A
    /// name must not contain blanks and has at most 16 characters.
    pub fn bind(address: impl ToSocketAddrs, buses: &[(&str, &VirtualHub)]) -> Result<Self, ListenError> {
        let channel = |(name, hub): &(&str, &VirtualHub)| Channel {
            name: (*name).to_owned(),
            hub: (*hub).clone(),
            route: Route::Hub,
        };
        Self::listen(address, buses.iter().map(channel).collect())
    }

    pub(super) fn listen(address: impl ToSocketAddrs, channels: Vec<Channel>) -> Result<Self, ListenError> {
        let asked = address.to_socket_addrs().map(|found| found.map(|a| a.to_string()).collect::<Vec<_>>());
        let asked = asked.map_or_else(|_| "this address".to_owned(), |found| found.join(", "));
        let failed = |source| ListenError { address: asked.clone(), source };
        let listener = TcpListener::bind(address).map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        let inner = Arc::new(Inner { channels, ..Inner::default() });
        let shared = Arc::clone(&inner);
        let thread = std::thread::Builder::new().name("socketcand".into());
        let acceptor = thread.spawn(move || accept(&listener, &shared)).map_err(failed)?;
        Ok(Self { address, inner, acceptor: Some(acceptor) })
    }

    /// Returns the address and port on which the server listens.
    pub fn local_addr(&self) -> SocketAddr {
        self.address
    }

    /// Returns the CAN URL of a channel for clients on this computer.
    pub fn url(&self, channel: &str) -> String {
        let (host, port) = (reachable(self.address).ip().to_string(), self.address.port());
        CanUrl::Socketcand { host, port, channel: channel.to_owned() }.to_string()
    }

    /// Returns the counters.
    pub fn stats(&self) -> ServerStats {
        let inner = &self.inner;
        let count = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        let clients = inner.clients();
        let missing = |client: &Client| client.opened.as_ref().map_or(0, |(_, member)| member.missed());
        let missing: u64 = clients.values().map(missing).sum();
        ServerStats {
            clients: clients.len(),
            accepted: count(&inner.accepted),
            turned_away: count(&inner.turned_away),
            received: count(&inner.received),
            sent: count(&inner.sent),
            missed: count(&inner.missed) + missing,
            not_carried: count(&inner.not_carried),
            not_understood: count(&inner.not_understood),
        }
    }

    pub(super) fn deliver_to(&self, client: ClientId, frame: &CanFrame) {
        let member = self.inner.member_number(client);
        if let Some((channel, number)) = member
            && let Some(channel) = self.inner.channels.get(channel)
        {
            channel.hub.deliver_to(frame, number);
        }
    }

    pub(super) fn report_state(&self, client: ClientId, state: ErrorState) {
        let member = self.inner.member_number(client);
        if let Some((channel, number)) = member
            && let Some(channel) = self.inner.channels.get(channel)
        {
            channel.hub.report_state(state, number);
        }
    }

    pub(super) fn deliver(&self, channel: usize, frame: &CanFrame, except: Option<ClientId>) {
        let except = except.and_then(|client| self.inner.member_number(client));
        let except = except.filter(|(its, _)| *its == channel).map(|(_, number)| number);
        if let Some(channel) = self.inner.channels.get(channel) {
            channel.hub.deliver(frame, except);
        }
    }
}

impl Drop for SocketcandServer {
    fn drop(&mut self) {
        self.inner.closing.store(true, Ordering::SeqCst);
        // The accepting thread waits in a system call; a new connection ends this wait.
        let woken = TcpStream::connect_timeout(&reachable(self.address), END_TIMEOUT).is_ok();
        if let Some(acceptor) = self.acceptor.take().filter(|_| woken) {
            let _ = acceptor.join();
        }
        let clients = self.inner.clients();
        for client in clients.values() {
            let _ = client.stream.shutdown(Shutdown::Both);
        }
        drop(self.inner.gone.wait_timeout_while(clients, END_TIMEOUT, |clients| !clients.is_empty()));
    }
}

/// Returns the address at which this computer can connect to a listener.
fn reachable(mut address: SocketAddr) -> SocketAddr {
    if address.ip().is_unspecified() {
        address.set_ip(match address.ip() {
            IpAddr::V4(_) => Ipv4Addr::LOCALHOST.into(),
            IpAddr::V6(_) => Ipv6Addr::LOCALHOST.into(),
        });
    }
    address
}

fn accept(listener: &TcpListener, inner: &Arc<Inner>) {
    for number in 0.. {
        let accepted = listener.accept();
        if inner.closing.load(Ordering::SeqCst) {
            return;
        }
        match accepted {
            Ok((stream, _)) => {
                inner.accepted.fetch_add(1, Ordering::Relaxed);
                if start(inner, ClientId(number), stream).is_err() {
                    inner.turned_away.fetch_add(1, Ordering::Relaxed);
                }
            }
            // The client has already disconnected, or the operating system has no resources for another connection.
            // Other clients are not affected.
            Err(_) => std::thread::sleep(Duration::from_millis(5)),
        }
    }
}

/// Starts a thread for a client.
fn start(inner: &Arc<Inner>, client: ClientId, stream: TcpStream) -> io::Result<()> {
    let kept = stream.try_clone()?;
    let mut clients = inner.clients();
    if clients.len() >= MOST_CLIENTS {
        return Err(io::ErrorKind::QuotaExceeded.into());
    }
    clients.insert(client, Client { stream: kept, opened: None });
    drop(clients);
    let shared = Arc::clone(inner);
    let session = move || {
        session::serve(&shared, client, stream);
        shared.forget(client);
    };
    let started = std::thread::Builder::new().name(format!("socketcand {client}")).spawn(session);
    started.map(|_| ()).inspect_err(|_| inner.forget(client))
}
