//! The lease: one client commands at a time, and all see who.
use std::time::Duration;

use jtc_wire::ExecCommand;

use super::{ClientId, Delivery, Introduction, LineEvent, Policy, PutOut, Role, SharedLine};

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
            client.lasts = lasts;
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
        let next = lease.wanted_by.filter(|next| self.clients.contains_key(next));
        self.set_lease(next.map(|holder| self.lease_of(holder, now)));
        Ok(())
    }

    /// Asks the one who commands to let it go.
    ///
    /// # Errors
    ///
    /// [`Denied::Viewer`]; [`Denied::NotHolder`] when nobody commands: it can be taken.
    pub fn want_lease(&mut self, client: ClientId) -> Result<(), Denied> {
        let Some(Introduction { name, role: Role::Operator, .. }) = self.introduction(client).cloned() else {
            return Err(Denied::Viewer);
        };
        let lease = self.lease.as_mut().ok_or(Denied::NotHolder)?;
        lease.wanted_by = Some(client);
        let holder = lease.holder;
        self.deliver(holder, Delivery::LeaseWanted(name));
        Ok(())
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
            None => {
                self.set_lease(Some(self.lease_of(id, now)));
                Ok(())
            }
        }
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
            let policy = self.introduction(holder).map_or(Policy::default(), |client| client.policy);
            self.end_lease(holder, policy, now);
        }
    }

    /// The one who commanded does not any more.
    pub(super) fn end_lease(&mut self, holder: ClientId, policy: Policy, now: Duration) {
        let next = self.lease.as_ref().and_then(|lease| lease.wanted_by);
        let next = next.filter(|next| self.clients.contains_key(next));
        self.set_lease(next.map(|holder| self.lease_of(holder, now)));
        let Some(command) = (match policy {
            Policy::Continue => None,
            Policy::Pause => Some(ExecCommand::Pause),
            Policy::Stop => Some(ExecCommand::Stop),
        }) else {
            return;
        };
        self.hold("the policy of a client that has gone", command, now);
        self.events.push_back(LineEvent::PolicyApplied { client: holder, policy });
    }
}
