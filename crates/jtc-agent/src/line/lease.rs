//! The lease: one client commands at a time, and all see who.
use std::time::Duration;

use super::{ClientId, Delivery, Introduction, LineEvent, Policy, PutOut, Role, SharedLine};

/// Who stops the arm of a client that has gone.
pub(super) const POLICY: &str = "the policy of a client that has gone";
/// No halt: what a client does was asked for before its policy ended it.
pub(super) const NOT_ASKED: u64 = u64::MAX;

/// Who commands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lease {
    /// The client that has it.
    pub holder: ClientId,
    /// Since when.
    pub since: Duration,
    /// Until when, if it is not renewed: a client without a connection of its own has to show that it is there.
    pub until: Option<Duration>,
    /// Who has asked for it.
    pub wanted_by: Option<ClientId>,
}

/// Why a client may not command.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error, serde::Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Denied {
    /// Another client commands.
    #[error("{holder} has commanded this arm for {age_s:.0} s: one client commands at a time", age_s = *age_ms as f64 / 1000.0)]
    Held {
        /// Its name.
        holder: String,
        /// For how long, ms.
        age_ms: u64,
    },
    /// Another client has asked for the lease before.
    #[error("{by} has asked for the lease of {holder} before, and waits for it: one waits at a time")]
    Awaited {
        /// Who commands.
        holder: String,
        /// Who waits.
        by: String,
    },
    /// This client may look and stop, and not command.
    #[error("this client was let in to look and to stop, not to command")]
    Viewer,
    /// Somebody stopped the arm just now, and this was sent before or at the same time.
    #[error(
        "{by} has stopped the arm: what was asked for before is not done, and nothing that moves it for three seconds"
    )]
    Stopped {
        /// Who it was.
        by: String,
    },
    /// The client was put out.
    #[error("this client is on the line no more: it was put out, or has gone")]
    Gone,
    /// Nothing is received from the client that commands while the controller supervises its host: questions of others would hide that (J-59).
    #[error(
        "nothing is received from {who}, and the controller pauses the motion when its host is silent: questions of others wait until the arm stands"
    )]
    Unattended {
        /// The client that commands, or has commanded.
        who: String,
    },
    /// The client has no lease that it could give.
    #[error("this client does not command the arm: it has no lease to give or to renew")]
    NotHolder,
}

impl SharedLine {
    /// Who commands.
    pub fn lease(&self) -> Option<&Lease> {
        self.lease.as_ref()
    }

    /// Takes, or renews, the lease. `lasts`: for how long without renewal, also where the client takes it later by a command or is given it;
    /// `None`: as long as the client is there.
    ///
    /// # Errors
    ///
    /// [`Denied`] when another client has it, which is then asked to let it go, or when this one may not command.
    pub fn take_lease(
        &mut self,
        client: ClientId,
        lasts: Option<Duration>,
        now: Duration,
    ) -> Result<(), Denied> {
        if let Some(client) = self.clients.get_mut(&client) {
            (client.lasts, client.lapsed, client.shown_at) = (lasts, false, now);
        }
        self.may_command(client, now)?;
        if let Some(lease) = &mut self.lease {
            lease.until = lasts.map(|lasts| now + lasts);
        }
        Ok(())
    }

    /// Lets the lease go: to the client that has asked for it, if one has.
    ///
    /// # Errors
    ///
    /// [`Denied::NotHolder`].
    pub fn release_lease(&mut self, client: ClientId, now: Duration) -> Result<(), Denied> {
        let lease = self.lease.take_if(|lease| lease.holder == client).ok_or(Denied::NotHolder)?;
        // Whoever lets it go in a motion leaves that to itself.
        self.bequeath(self.name(client), Policy::Continue);
        let next = lease.wanted_by.filter(|next| self.clients.contains_key(next));
        self.set_lease(next.map(|holder| self.lease_of(holder, now)));
        Ok(())
    }

    /// Asks the one who commands to let it go. The first who asks keeps its place as long as it waits: until it gets the lease, goes, or has not
    /// shown for as long as its own lease would last that it is there.
    ///
    /// # Errors
    ///
    /// [`Denied::Viewer`]; [`Denied::Awaited`]; [`Denied::NotHolder`] when nobody commands: it can be taken.
    pub fn want_lease(&mut self, client: ClientId, now: Duration) -> Result<(), Denied> {
        let Some(Introduction { name, role: Role::Operator, .. }) = self.introduction(client).cloned() else {
            return Err(Denied::Viewer);
        };
        let lease = self.lease.as_ref().ok_or(Denied::NotHolder)?;
        let first = lease.wanted_by.filter(|first| *first != client && self.waits(*first, now));
        if let Some(first) = first {
            return Err(Denied::Awaited { holder: self.name(lease.holder), by: self.name(first) });
        }
        self.show(client, now);
        let lease = self.lease.as_mut().ok_or(Denied::NotHolder)?;
        lease.wanted_by = Some(client);
        let holder = lease.holder;
        self.deliver(holder, Delivery::LeaseWanted(name));
        Ok(())
    }

    /// A client that has asked for the lease is there.
    fn waits(&self, id: ClientId, now: Duration) -> bool {
        self.clients.get(&id).is_some_and(|client| {
            client.lasts.is_none_or(|lasts| now.saturating_sub(client.shown_at) < lasts)
        })
    }

    /// The client shows that it is there.
    fn show(&mut self, id: ClientId, now: Duration) {
        if let Some(client) = self.clients.get_mut(&id) {
            client.shown_at = now;
        }
    }

    /// Nothing comes from a client any more: the one that commands is put out, and its motion follows its policy. If it wakes it has to come
    /// again, and to look at what others have done meanwhile.
    pub fn lapse(&mut self, client: ClientId, now: Duration) {
        if self.lease.as_ref().is_some_and(|lease| lease.holder == client) {
            self.put_out(client, PutOut::Silent, now);
        }
    }

    /// The client commands; it takes the lease where nobody has it.
    pub(super) fn may_command(&mut self, id: ClientId, now: Duration) -> Result<(), Denied> {
        self.could_command(id, now)?;
        if self.lease.is_none() {
            self.set_lease(Some(self.lease_of(id, now)));
        }
        Ok(())
    }

    /// The client commands, or could take the lease.
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
            // What it began goes on without it by its policy alone.
            None if self.is_over(id) => Err(Denied::NotHolder),
            None => Ok(()),
        }
    }

    /// The client shows that it is there: its lease, where it has it, lasts anew.
    pub fn renew(&mut self, id: ClientId, now: Duration) {
        self.end_lapsed(now);
        self.show(id, now);
        let lasts = self.clients.get(&id).and_then(|client| client.lasts);
        if let Some(lease) = self.lease.as_mut().filter(|lease| lease.holder == id) {
            lease.until = lasts.map(|lasts| now + lasts);
        }
    }

    /// The lease of this client has lapsed, and its policy has ended what it did.
    fn is_over(&self, id: ClientId) -> bool {
        let client = self.clients.get(&id);
        client.is_some_and(|client| client.lapsed && client.introduction.policy != Policy::Continue)
    }

    /// One that this client has from now on.
    fn lease_of(&self, holder: ClientId, now: Duration) -> Lease {
        let lasts = self.clients.get(&holder).and_then(|client| client.lasts);
        Lease { holder, since: now, until: lasts.map(|lasts| now + lasts), wanted_by: None }
    }

    pub(super) fn end_lapsed(&mut self, now: Duration) {
        if let Some(Lease { holder, .. }) =
            self.lease.clone().filter(|lease| lease.until.is_some_and(|until| now >= until))
        {
            if let Some(client) = self.clients.get_mut(&holder) {
                client.lapsed = true;
            }
            let policy = self.introduction(holder).map_or(Policy::default(), |client| client.policy);
            self.end_lease(holder, policy, now);
        }
    }

    /// The one who commanded does not any more.
    pub(super) fn end_lease(&mut self, holder: ClientId, policy: Policy, now: Duration) {
        let next = self.lease.as_ref().and_then(|lease| lease.wanted_by);
        let next = next.filter(|next| self.clients.contains_key(next));
        self.set_lease(next.map(|holder| self.lease_of(holder, now)));
        self.bequeath(self.name(holder), policy);
        let Some(command) = policy.command() else { return };
        if self.hold(POLICY, command, now) {
            self.events.push_back(LineEvent::PolicyApplied { client: holder, policy });
        } else if let Some(client) = self.clients.get_mut(&holder) {
            // Nobody else is held up, and what it was about to move stays.
            client.asked_after = NOT_ASKED;
        }
    }
}
