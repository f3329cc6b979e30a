//! Server for a host program that runs the bus itself, such as a simulator in virtual time.

use std::net::{SocketAddr, ToSocketAddrs};
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::Duration;

use super::shared::{Channel, ClientAction, ClientId, Route};
use super::{ServerStats, SocketcandServer};
use crate::{CanFrame, ErrorState, ListenError, VirtualHub};

/// Largest number of events in the queue for the host program. While this queue is full, the threads of the client
/// connections wait.
const WAITING: usize = 1024;

/// Action of a client.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClientEvent {
    /// The client opened the bus.
    Joined,
    /// The client sent this frame.
    Frame(CanFrame),
    /// The client has disconnected.
    Left,
}

/// Event of a client at a [`SocketcandGateway`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FromClient {
    /// Index of the channel in the list of names that was passed to `bind`.
    pub channel: usize,
    /// Client that caused the event.
    pub client: ClientId,
    /// Action of the client.
    pub event: ClientEvent,
}

/// A [`SocketcandServer`] that passes its clients' frames only to the host program. The host program determines when
/// each frame is on the bus, and then [delivers](Self::deliver) it. The host program itself simulates bus order,
/// arbitration and faults.
pub struct SocketcandGateway {
    // The field `events` is dropped first. Threads that wait for space in the event channel then end.
    events: Receiver<FromClient>,
    server: SocketcandServer,
}

impl SocketcandGateway {
    /// Listens at an address (with port 0, at a free port) and provides buses with the given names.
    pub fn bind(address: impl ToSocketAddrs, channels: &[&str]) -> Result<Self, ListenError> {
        let (sender, events) = sync_channel(WAITING);
        let channel = |(channel, name): (usize, &&str)| {
            let sender = sender.clone();
            let report = move |client, action| {
                let event = match action {
                    ClientAction::Joined => ClientEvent::Joined,
                    ClientAction::Sent(frame) => ClientEvent::Frame(frame),
                    ClientAction::Left => ClientEvent::Left,
                };
                sender.send(FromClient { channel, client, event }).is_ok()
            };
            Channel { name: (*name).to_owned(), hub: VirtualHub::new(), route: Route::Host(Box::new(report)) }
        };
        let channels = channels.iter().enumerate().map(channel).collect();
        Ok(Self { events, server: SocketcandServer::listen(address, channels)? })
    }

    /// Returns the next event of the clients, in the order of occurrence, or `None` if no event occurred within
    /// `timeout`.
    pub fn next(&mut self, timeout: Duration) -> Option<FromClient> {
        // The server owns the other end of the channel and exists as long as this gateway, so the only possible error
        // is a timeout.
        self.events.recv_timeout(timeout).ok()
    }

    /// Delivers a frame of the bus to all clients of the channel except its sender. Never waits.
    pub fn deliver(&self, channel: usize, frame: &CanFrame, except: Option<ClientId>) {
        self.server.deliver(channel, frame, except);
    }

    /// Delivers a frame to one client only. Host programs need this function if each client is a separate member, for
    /// example of a [`TimedBus`](crate::TimedBus). Never waits.
    pub fn deliver_to(&self, client: ClientId, frame: &CanFrame) {
        self.server.deliver_to(client, frame);
    }

    /// Reports to a client that its own controller is bus-off ([`ErrorState::BusOff`]) or has recovered
    /// ([`ErrorState::Active`]). The report is an error frame in order with the other frames. Other states are not
    /// reported, because the protocol's error frames have no data that could express them. Never waits.
    pub fn report_state(&self, client: ClientId, state: ErrorState) {
        self.server.report_state(client, state);
    }

    /// Returns the address and port on which the gateway listens.
    pub fn local_addr(&self) -> SocketAddr {
        self.server.local_addr()
    }

    /// Returns the CAN URL of a channel for clients on this computer.
    pub fn url(&self, channel: &str) -> String {
        self.server.url(channel)
    }

    /// Returns the counters of the gateway's server.
    pub fn stats(&self) -> ServerStats {
        self.server.stats()
    }
}
