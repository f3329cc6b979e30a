//! Lease that a client holds, and the rules for renewing the lease and passing it to the next client. All agents use
//! the same rules for the lease.
use std::time::Duration;

/// Lease, which at most one client holds at a time. `Id` identifies a client. All times are measured by the agent's
/// clock.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lease<Id> {
    /// Client that holds the lease.
    pub holder: Id,
    /// Time when the holder took the lease.
    pub since: Duration,
    /// Time when the lease lapses if the client does not renew it. `None` if the client has a permanent connection;
    /// such a lease does not lapse.
    pub until: Option<Duration>,
    /// Client that waits for the lease.
    pub wanted_by: Option<Id>,
}

/// Time of a client's last message, and the duration of the client's lease.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Presence {
    /// Time until the client's lease lapses without a message from the client. `None` if the lease lasts while the
    /// client is connected.
    pub lasts: Option<Duration>,
    /// Time of the client's last message.
    pub seen: Duration,
}

impl Presence {
    /// Returns `true` if the client sent a message within the duration of its own lease.
    pub fn is_present(&self, now: Duration) -> bool {
        self.lasts.is_none_or(|lasts| now.saturating_sub(self.seen) < lasts)
    }
}

impl<Id: Clone + PartialEq> Lease<Id> {
    /// Begins the lease of a client. Without a message from the client, the lease lapses after `lasts`.
    pub fn begin(holder: Id, lasts: Option<Duration>, now: Duration) -> Self {
        Self { holder, since: now, until: lasts.map(|lasts| now + lasts), wanted_by: None }
    }

    /// Renews the lease after a message from its holder.
    pub fn renew(&mut self, lasts: Option<Duration>, now: Duration) {
        self.until = lasts.map(|lasts| now + lasts);
    }

    /// Returns `true` if the lease has lapsed.
    pub fn has_lapsed(&self, now: Duration) -> bool {
        self.until.is_some_and(|until| now >= until)
    }

    /// Returns the client that waits for the lease, if this client still sends messages. `presence` returns `None` for a
    /// client that has disconnected.
    pub fn first(&self, presence: impl Fn(&Id) -> Option<Presence>, now: Duration) -> Option<&Id> {
        self.wanted_by.as_ref().filter(|first| presence(first).is_some_and(|first| first.is_present(now)))
    }

    /// Registers a client that waits for the lease. Only one client can wait for the lease at a time. The first waiting
    /// client keeps its position while it sends messages.
    ///
    /// # Errors
    ///
    /// The client that already waits for the lease.
    pub fn want(
        &mut self,
        client: Id,
        presence: impl Fn(&Id) -> Option<Presence>,
        now: Duration,
    ) -> Result<(), Id> {
        match self.first(presence, now).filter(|first| **first != client) {
            Some(first) => Err(first.clone()),
            None => {
                self.wanted_by = Some(client);
                Ok(())
            }
        }
    }

    /// Returns the next lease, which the waiting client receives. A client that has become silent does not receive
    /// it.
    pub fn next(&self, presence: impl Fn(&Id) -> Option<Presence>, now: Duration) -> Option<Self> {
        let next = self.first(&presence, now)?;
        Some(Self::begin(next.clone(), presence(next)?.lasts, now))
    }
}
