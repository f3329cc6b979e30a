//! The server for a host that runs the bus itself, such as a simulator in virtual time.

use std::net::{SocketAddr, ToSocketAddrs};
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::Duration;

use super::shared::{Channel, ClientAction, ClientId, Route};
use super::{ServerStats, SocketcandServer};
use crate::{CanFrame, ErrorState, ListenError, VirtualHub};

/// Most events that wait for the host; beyond that the connections wait.
const WAITING: usize = 1024;

/// Action of a client.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClientEvent {
    /// The client opened the bus.
    Joined,
    /// The client sends this frame.
    Frame(CanFrame),
    /// The client has disconnected.
    Left,
}

/// Event at a [`SocketcandGateway`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FromClient {
    /// Index of the channel among the names given.
    pub channel: usize,
    /// Client.
    pub client: ClientId,
    /// Action.
    pub event: ClientEvent,
}

/// A [`SocketcandServer`] whose clients' frames go to the host alone. The host decides when each is on the bus, and then
/// [delivers](Self::deliver) it: bus order, arbitration and faults are its own.
pub struct SocketcandGateway {
    // Dropped first: threads that wait for the host then end.
    events: Receiver<FromClient>,
    server: SocketcandServer,
}

impl SocketcandGateway {
    /// Listens at an address (port 0 takes a free one) and offers buses under the given names.
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

    /// The next thing a client did, in order; `None` when nothing happened within `timeout`.
    pub fn next(&mut self, timeout: Duration) -> Option<FromClient> {
        // The other end is held by the server, which lives as long as this: the only error is that time is up.
        self.events.recv_timeout(timeout).ok()
    }

    /// A frame was on the bus: all clients of the channel receive it, except one (that sent it). Never waits.
    pub fn deliver(&self, channel: usize, frame: &CanFrame, except: Option<ClientId>) {
        self.server.deliver(channel, frame, except);
    }

    /// Delivers a frame to this client only: for hosts in which each client is a separate member, for example of a
    /// [`TimedBus`](crate::TimedBus). Never waits.
    pub fn deliver_to(&self, client: ClientId, frame: &CanFrame) {
        self.server.deliver_to(client, frame);
    }

    /// Reports to a client that its own controller has left the bus ([`ErrorState::BusOff`]) or is back
    /// ([`ErrorState::Active`]), as an error frame between the frames before and after. The protocol's error frames carry no
    /// data: other states have no form there and are not reported. Never waits.
    pub fn report_state(&self, client: ClientId, state: ErrorState) {
        self.server.report_state(client, state);
    }

    /// Returns the address on which it listens, with the port that was taken.
    pub fn local_addr(&self) -> SocketAddr {
        self.server.local_addr()
    }

    /// The CAN URL of a channel for clients on this host.
    pub fn url(&self, channel: &str) -> String {
        self.server.url(channel)
    }

    /// Returns the counters.
    pub fn stats(&self) -> ServerStats {
        self.server.stats()
    }
}
