//! Lease of the serial line: only the client that holds the lease may send commands. All clients can see the holder's
//! name.
use std::time::Duration;

use agent_kit::lease::Presence;

use super::{ClientId, Delivery, Introduction, LineEvent, Policy, PutOut, Role, SharedLine};

/// Name that is reported as the source of a Stop that a disconnected client's policy requested.
pub(super) const POLICY: &str = "the policy of a disconnected client";
/// Special value instead of the number of a Stop: the policy of the client has cancelled the client's requests.
pub(super) const NOT_ASKED: u64 = u64::MAX;

/// Lease of a client on the serial line.
pub type Lease = agent_kit::lease::Lease<ClientId>;

/// Reason why a client may not command.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error, serde::Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Denied {
    /// Another client holds the lease.
    #[error("{holder} has held the lease of this arm for {age_s:.0} s: only one client can hold it at a time", age_s = *age_ms as f64 / 1000.0)]
    Held {
        /// Name of the holder.
        holder: String,
        /// Time since the holder took the lease, ms.
        age_ms: u64,
    },
    /// Another client already waits for the lease.
    #[error("{by} already waits for the lease of {holder}: only one client can wait for it")]
    Awaited {
        /// Name of the holder.
        holder: String,
        /// Name of the waiting client.
        by: String,
    },
    /// The client may only read and stop.
    #[error("this client can only read and stop: commands need the operator's token")]
    Viewer,
    /// The arm was stopped or paused after the request, or by another client shortly before the request (hold-off).
    #[error(
        "{by} has stopped the arm: earlier requests were discarded, and motion requests are refused for 3 s"
    )]
    Stopped {
        /// Name of the client that stopped or paused the arm.
        by: String,
    },
    /// The client was disconnected.
    #[error("this client has lost its connection: the agent or the client ended it")]
    Gone,
    /// The controller supervises its host, and the lease holder is silent. Queries of other clients would hide the
    /// silence from the controller (J-59).
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
    /// Present lease; `None` if no client holds the lease.
    pub fn lease(&self) -> Option<&Lease> {
        self.lease.as_ref()
    }

    /// Takes or renews the lease. `lasts` is the time without renewal after which the lease lapses. A lease that the
    /// client receives later, by a command or from another client, has the same duration. With `None`, the lease lasts
    /// while the client is connected.
    ///
    /// # Errors
    ///
    /// [`Denied`] if another client holds the lease, or if this client may not take it. If another client holds the
    /// lease, the holder receives a request to release it.
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

    /// Releases the lease, which passes to the client that has requested it, if any.
    ///
    /// # Errors
    ///
    /// [`Denied::NotHolder`].
    pub fn release_lease(&mut self, client: ClientId, now: Duration) -> Result<(), Denied> {
        let lease = self.lease.take_if(|lease| lease.holder == client).ok_or(Denied::NotHolder)?;
        // If a client releases the lease during a motion, the motion continues.
        self.bequeath(self.name(client), Policy::Continue);
        self.set_lease(lease.next(|next| self.lasts(*next), now));
        Ok(())
    }

    /// Requests the lease from the client that holds it. The first client that requests the lease stays first until it
    /// receives the lease, disconnects, or is silent for the duration of its own lease.
    ///
    /// # Errors
    ///
    /// [`Denied::Viewer`]; [`Denied::Awaited`]; [`Denied::NotHolder`] if no client holds the lease, so that it can be
    /// taken.
    pub fn want_lease(&mut self, client: ClientId, now: Duration) -> Result<(), Denied> {
        let Some(Introduction { name, role: Role::Operator, .. }) = self.introduction(client).cloned() else {
            return Err(Denied::Viewer);
        };
        let clients = &self.clients;
        let is_present =
            |id: &ClientId| clients.get(id).is_some_and(|client| client.presence.is_present(now));
        let lease = self.lease.as_mut().ok_or(Denied::NotHolder)?;
        let (holder, wanted) = (lease.holder, lease.want(client, is_present));
        wanted.map_err(|first| Denied::Awaited { holder: self.name(holder), by: self.name(first) })?;
        self.show(client, now);
        self.deliver(holder, Delivery::LeaseWanted(name));
        Ok(())
    }

    /// Returns the duration of a client's lease. The outer `None` means that the client has disconnected.
    fn lasts(&self, id: ClientId) -> Option<Option<Duration>> {
        self.clients.get(&id).map(|client| client.presence.lasts)
    }

    /// Records a sign of life of the client.
    fn show(&mut self, id: ClientId, now: Duration) {
        if let Some(client) = self.clients.get_mut(&id) {
            client.presence.seen = now;
        }
    }

    /// Disconnects a holder of the lease that no longer sends data, and applies the holder's policy to its motion. A
    /// client that sends data again later must first reconnect, so that it receives the changes that other clients made
    /// in the meantime.
    pub fn lapse(&mut self, client: ClientId, now: Duration) {
        if self.lease.as_ref().is_some_and(|lease| lease.holder == client) {
            self.put_out(client, PutOut::Silent, now);
        }
    }

    /// Checks that the client holds the lease. If no client holds the lease, the client takes it.
    pub(super) fn may_command(&mut self, id: ClientId, now: Duration) -> Result<(), Denied> {
        self.could_command(id, now)?;
        if self.lease.is_none() {
            self.set_lease(Some(Lease::begin(id, self.lasts(id).flatten(), now)));
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
            // Only the client's own policy applies to the motion that the client began.
            None if self.is_over(id) => Err(Denied::NotHolder),
            None => Ok(()),
        }
    }

    /// Records a sign of life of the client, and renews the lease if the client holds it.
    pub fn renew(&mut self, id: ClientId, now: Duration) {
        self.end_lapsed(now);
        self.show(id, now);
        let lasts = self.lasts(id).flatten();
        if let Some(lease) = self.lease.as_mut().filter(|lease| lease.holder == id) {
            lease.renew(lasts, now);
        }
    }

    /// Returns true if the lease of this client has lapsed, and the client's policy has ended its motion.
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
        let next = self.lease.as_ref().and_then(|lease| lease.next(|next| self.lasts(*next), now));
        self.set_lease(next);
        self.bequeath(self.name(holder), policy);
        let Some(command) = policy.command() else { return };
        if self.hold(POLICY, command, now) {
            self.events.push_back(LineEvent::PolicyApplied { client: holder, policy });
        } else if let Some(client) = self.clients.get_mut(&holder) {
            // Prevents a motion that this client was about to begin. Other clients are not affected.
            client.asked_after = NOT_ASKED;
        }
    }
}
