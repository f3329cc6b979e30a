//! Lease of the serial line: only the client that holds the lease may send commands. All clients can see the name of
//! the lease holder.
use std::time::Duration;

use agent_kit::lease::Presence;

use super::{ClientId, Delivery, Introduction, LineEvent, Policy, PutOut, Role, SharedLine};

/// Name that is reported instead of a client's name if the policy of a disconnected client caused a Stop.
pub(super) const POLICY: &str = "the policy of a disconnected client";
/// Special value instead of the number of a Stop. The value means that the client's policy has cancelled the client's
/// requests.
pub(super) const NOT_ASKED: u64 = u64::MAX;

/// Lease of a client on the serial line.
pub type Lease = agent_kit::lease::Lease<ClientId>;

/// Reason why a client may not send commands.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error, serde::Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Denied {
    /// Another client holds the lease.
    #[error("{holder} has held the lease of this arm for {age_s:.0} s: only one client can hold it at a time", age_s = *age_ms as f64 / 1000.0)]
    Held {
        /// Name of the lease holder.
        holder: String,
        /// Time since the lease holder took the lease, ms.
        age_ms: u64,
    },
    /// Another client already waits for the lease.
    #[error("{by} already waits for the lease of {holder}: only one client can wait for it")]
    Awaited {
        /// Name of the lease holder.
        holder: String,
        /// Name of the client that already waits for the lease.
        by: String,
    },
    /// The client is a viewer: it may only read and stop.
    #[error("this client can only read and stop: commands need the operator's token")]
    Viewer,
    /// A client stopped or paused the arm after the request was made. The request is also refused during the hold-off
    /// after a Stop or Pause of another client.
    #[error(
        "{by} has stopped the arm: earlier requests were discarded, and motion requests are refused for 3 s"
    )]
    Stopped {
        /// Name of the client that stopped or paused the arm.
        by: String,
    },
    /// The agent disconnected the client.
    #[error("this client has lost its connection: the agent or the client ended it")]
    Gone,
    /// Host supervision of the controller is active, and the lease holder is silent. Queries of other clients would
    /// hide this silence from the controller (J-59).
    #[error(
        "{who} is silent: the agent sends no queries of other clients until the arm is at rest, so that the \
         controller can pause the motion"
    )]
    Unattended {
        /// Name of the present or the previous lease holder.
        who: String,
    },
    /// The client does not hold the lease.
    #[error("this client does not hold the lease of the arm: it cannot release or renew the lease")]
    NotHolder,
}

impl SharedLine {
    /// Returns the present lease; `None` if no client holds the lease.
    pub fn lease(&self) -> Option<&Lease> {
        self.lease.as_ref()
    }

    /// Takes or renews the lease for a client. `lasts` is the time without renewal after which the lease lapses. If the
    /// client receives the lease later, by a command or from another client, this lease has the same duration. If
    /// `lasts` is `None`, the lease lasts while the client is connected.
    ///
    /// # Errors
    ///
    /// [`Denied`] if another client holds the lease, or if this client may not take it. To request the lease from its
    /// holder, see [`want_lease`](Self::want_lease).
    pub fn take_lease(
        &mut self,
        client: ClientId,
        lasts: Option<Duration>,
        now: Duration,
    ) -> Result<(), Denied> {
        if let Some(client) = self.clients.get_mut(&client) {
            (client.presence, client.lapsed) = (Presence { lasts, seen: now }, false);
        }
        self.may_command(client, now)?;
        if let Some(lease) = &mut self.lease {
            lease.renew(lasts, now);
        }
        Ok(())
    }

    /// Releases the lease. A client that waits for the lease receives it.
    ///
    /// # Errors
    ///
    /// [`Denied::NotHolder`] if the client does not hold the lease.
    pub fn release_lease(&mut self, client: ClientId, now: Duration) -> Result<(), Denied> {
        let lease = self.lease.take_if(|lease| lease.holder == client).ok_or(Denied::NotHolder)?;
        // If a client releases the lease during a motion, the motion continues.
        self.bequeath(self.name(client), Policy::Continue);
        self.set_lease(lease.next(|next| self.presence(*next), now));
        Ok(())
    }

    /// Requests the lease from the client that holds it. The first client that requests the lease keeps its position
    /// until it receives the lease or disconnects. If the waiting client is silent for the duration of its own lease,
    /// another client can take its position.
    ///
    /// # Errors
    ///
    /// [`Denied::Viewer`], [`Denied::Awaited`], or [`Denied::NotHolder`] if no client holds the lease, so that the
    /// client can take it.
    pub fn want_lease(&mut self, client: ClientId, now: Duration) -> Result<(), Denied> {
        let Some(Introduction { name, role: Role::Operator, .. }) = self.introduction(client).cloned() else {
            return Err(Denied::Viewer);
        };
        let clients = &self.clients;
        let presence = |id: &ClientId| clients.get(id).map(|client| client.presence);
        let lease = self.lease.as_mut().ok_or(Denied::NotHolder)?;
        let (holder, wanted) = (lease.holder, lease.want(client, presence, now));
        wanted.map_err(|first| Denied::Awaited { holder: self.name(holder), by: self.name(first) })?;
        self.show(client, now);
        self.deliver(holder, Delivery::LeaseWanted(name));
        Ok(())
    }

    /// Returns the presence of a client; `None` if the client has disconnected.
    fn presence(&self, id: ClientId) -> Option<Presence> {
        self.clients.get(&id).map(|client| client.presence)
    }

    /// Records that the client is active at `now`.
    fn show(&mut self, id: ClientId, now: Duration) {
        if let Some(client) = self.clients.get_mut(&id) {
            client.presence.seen = now;
        }
    }

    /// Disconnects a lease holder that sends no more data, and applies the holder's policy to its motion. The client
    /// must reconnect before it can send data, and then receives the changes that other clients have made.
    pub fn lapse(&mut self, client: ClientId, now: Duration) {
        if self.lease.as_ref().is_some_and(|lease| lease.holder == client) {
            self.put_out(client, PutOut::Silent, now);
        }
    }

    /// Checks that the client holds the lease, or takes a free lease for it.
    pub(super) fn may_command(&mut self, id: ClientId, now: Duration) -> Result<(), Denied> {
        self.could_command(id, now)?;
        if self.lease.is_none() {
            self.set_lease(Some(Lease::begin(id, self.presence(id).and_then(|client| client.lasts), now)));
        }
        Ok(())
    }

    /// Checks that the client holds the lease or could take the lease.
    pub(super) fn could_command(&mut self, id: ClientId, now: Duration) -> Result<(), Denied> {
        if self.introduction(id).ok_or(Denied::Gone)?.role != Role::Operator {
            return Err(Denied::Viewer);
        }
        self.end_lapsed(now);
        match &self.lease {
            Some(lease) if lease.holder == id => Ok(()),
            Some(lease) => {
                let age_ms = now.saturating_sub(lease.since).as_millis() as u64;
                Err(Denied::Held { holder: self.name(lease.holder), age_ms })
            }
            // The policy of the client has ended its motion, so the client receives the lease again only if it
            // requests the lease.
            None if self.is_over(id) => Err(Denied::NotHolder),
            None => Ok(()),
        }
    }

    /// Records that the client is active at `now`, and renews the lease if the client holds it.
    pub fn renew(&mut self, id: ClientId, now: Duration) {
        self.show(id, now);
        self.end_lapsed(now);
        let lasts = self.presence(id).and_then(|client| client.lasts);
        if let Some(lease) = self.lease.as_mut().filter(|lease| lease.holder == id) {
            lease.renew(lasts, now);
        }
    }

    /// Returns true if the lease of this client has lapsed and the client's policy has ended its motion.
    fn is_over(&self, id: ClientId) -> bool {
        let client = self.clients.get(&id);
        client.is_some_and(|client| client.lapsed && client.introduction.policy != Policy::Continue)
    }

    pub(super) fn end_lapsed(&mut self, now: Duration) {
        if let Some(Lease { holder, .. }) = self.lease.clone().filter(|lease| lease.has_lapsed(now)) {
            if let Some(client) = self.clients.get_mut(&holder) {
                client.lapsed = true;
            }
            let policy = self.introduction(holder).map_or(Policy::default(), |client| client.policy);
            self.end_lease(holder, policy, now);
        }
    }

    /// Ends the lease of `holder`, and applies the policy of this client.
    pub(super) fn end_lease(&mut self, holder: ClientId, policy: Policy, now: Duration) {
        let next = self.lease.as_ref().and_then(|lease| lease.next(|next| self.presence(*next), now));
        self.set_lease(next);
        self.bequeath(self.name(holder), policy);
        let Some(command) = policy.command() else { return };
        if self.hold(POLICY, command, now) {
            self.events.push_back(LineEvent::PolicyApplied { client: holder, policy });
        } else if let Some(client) = self.clients.get_mut(&holder) {
            // The client may be about to begin a motion; the value `NOT_ASKED` prevents this. Other clients are not
            // affected.
            client.asked_after = NOT_ASKED;
        }
    }
}
