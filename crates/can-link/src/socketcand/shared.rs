//! State shared by the threads of a server: its channels, its clients and its counters.

use std::collections::BTreeMap;
use std::fmt;
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use crate::{CanFrame, VirtualBus, VirtualHub};

/// Identifier of a client of a server. A number is never reused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ClientId(pub(super) u64);

impl fmt::Display for ClientId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "client {}", self.0)
    }
}

/// An action of a client, for a host program that runs the bus itself.
pub(super) enum ClientAction {
    Joined,
    Sent(CanFrame),
    Left,
}

/// Destination of the frames that the clients of a channel send to the server.
pub(super) enum Route {
    /// Hub: frames go directly to its other members.
    Hub,
    /// Host program, which puts the frames on its bus and delivers them.
    Host(Box<dyn Fn(ClientId, ClientAction) -> bool + Send + Sync>),
}

/// A bus of the server. The clients join its hub as guests: a sender never waits for a guest whose queue is full.
pub(super) struct Channel {
    pub(super) name: String,
    pub(super) hub: VirtualHub,
    pub(super) route: Route,
}

/// State that all threads of the server share.
#[derive(Default)]
pub(super) struct Inner {
    pub(super) channels: Vec<Channel>,
    pub(super) closing: AtomicBool,
    pub(super) clients: Mutex<BTreeMap<ClientId, Client>>,
    pub(super) gone: Condvar,
    pub(super) accepted: AtomicU64,
    pub(super) turned_away: AtomicU64,
    pub(super) received: AtomicU64,
    pub(super) sent: AtomicU64,
    pub(super) missed: AtomicU64,
    pub(super) not_carried: AtomicU64,
    pub(super) not_understood: AtomicU64,
}

/// A connection, for threads that close it or deliver frames to it.
pub(super) struct Client {
    pub(super) stream: TcpStream,
    /// Channel of the connection, and its membership of the hub.
    pub(super) opened: Option<(usize, VirtualBus)>,
}

impl Inner {
    pub(super) fn clients(&self) -> MutexGuard<'_, BTreeMap<ClientId, Client>> {
        // While the lock is held, no code runs that can panic.
        self.clients.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn set_opened(&self, client: ClientId, channel: usize, member: &VirtualBus) {
        if let Some(client) = self.clients().get_mut(&client) {
            client.opened = Some((channel, member.second_handle()));
        }
    }

    /// Returns the channel of a client, and its member number in the channel's hub.
    pub(super) fn member_number(&self, client: ClientId) -> Option<(usize, u64)> {
        let clients = self.clients();
        let (channel, member) = clients.get(&client)?.opened.as_ref()?;
        Some((*channel, member.number()))
    }

    pub(super) fn forget(&self, client: ClientId) {
        let mut clients = self.clients();
        if let Some(Client { opened: Some((_, member)), .. }) = clients.remove(&client) {
            self.missed.fetch_add(member.missed(), Ordering::Relaxed);
            member.leave();
        }
        drop(clients);
        self.gone.notify_all();
    }
}
