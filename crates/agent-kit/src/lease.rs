//! Who commands, where clients have no connection of their own: each shows by its requests, with the key that it was given, that it is there.
use std::collections::BTreeMap;
use std::time::Duration;

use axum::http::HeaderMap;

use crate::api::Problem;

/// The header with the key of a lease.
pub const KEY: &str = "lease-key";
/// How long a lease may last without a request, s.
pub const LASTS_S: std::ops::RangeInclusive<f64> = 1.0..=60.0;
/// Clients at once.
const CLIENTS_MAX: usize = 32;
/// A client that has asked for nothing for so long behind the end of its lease is forgotten.
const FORGOTTEN: Duration = Duration::from_secs(60);

/// A client by number; numbers are not used again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize)]
pub struct ClientId(pub u64);

/// Who a client is, and how it holds a lease; `P` is what becomes of its work without it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Client<P> {
    /// Its number.
    pub id: ClientId,
    /// What people call it.
    pub name: String,
    /// How long a lease lasts without a request of it.
    pub lasts: Duration,
    /// What becomes of its work when it has lapsed.
    pub policy: P,
    seen: Duration,
}

/// Who commands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lease {
    /// Its name.
    pub holder: String,
    /// Since when.
    pub since: Duration,
    /// Until when, if it is not renewed.
    pub until: Duration,
    /// Who has asked for it.
    pub wanted_by: Option<String>,
}

/// Why a client may not command.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Denied {
    /// Another client does.
    #[error("{holder} has commanded for {age_s} s: one client commands at a time")]
    Held {
        /// Its name.
        holder: String,
        /// For how long, s.
        age_s: u64,
    },
    /// It sends no key.
    #[error("commands need a lease")]
    NoKey,
    /// Its key is of no lease.
    #[error("this key is of no lease, or of one that lapsed long ago")]
    Unknown,
    /// Too many clients have come.
    #[error("too many clients have come for the lease")]
    Full,
}

impl From<Denied> for Problem {
    fn from(denied: Denied) -> Self {
        let text = denied.to_string();
        match denied {
            Denied::Held { .. } => Self::new(
                "denied",
                text,
                "GET /api/status shows who commands; ask for the lease with POST /api/lease and ask: true",
            ),
            Denied::NoKey | Denied::Unknown => Self::new(
                "no-lease",
                text,
                "take the lease with POST /api/lease, and send its key in the header Lease-Key",
            )
            .forbidden(),
            Denied::Full => Self::new(
                "full",
                text,
                "let leases go that are not needed any more with DELETE /api/lease; they are forgotten after a minute",
            ),
        }
    }
}

struct Held {
    key: String,
    since: Duration,
    until: Duration,
    wanted_by: Option<String>,
}

/// The clients of an agent, one of which commands. Time is that of the agent.
pub struct Leases<P> {
    clients: BTreeMap<String, Client<P>>,
    held: Option<Held>,
    last: u64,
}

impl<P> Default for Leases<P> {
    fn default() -> Self {
        Self { clients: BTreeMap::new(), held: None, last: 0 }
    }
}

/// The key that a request carries.
pub fn key_of(headers: &HeaderMap) -> Option<&str> {
    headers.get(KEY).and_then(|key| key.to_str().ok())
}

impl<P: Clone> Leases<P> {
    /// A client comes and takes the lease, or waits for it where it is to `ask` the one who has it. True: it commands.
    ///
    /// # Errors
    ///
    /// [`Denied`]: another one commands, or too many have come; this one is not known then.
    pub fn admit(
        &mut self,
        key: &str,
        (name, lasts, policy): (&str, Duration, P),
        ask: bool,
        now: Duration,
    ) -> Result<(ClientId, bool), Denied> {
        let held = match self.held_by_another(key, now) {
            Some(denied) if !ask => return Err(denied),
            other => other.is_none(),
        };
        if self.clients.len() >= CLIENTS_MAX {
            // The one that has been silent longest makes room: a program that is begun again and again keeps nobody out.
            let holder = self.held.as_ref().map(|held| held.key.clone());
            let others = self.clients.iter().filter(|(key, _)| Some(*key) != holder.as_ref());
            let oldest = others.min_by_key(|(_, client)| client.seen).map(|(key, _)| key.clone());
            self.clients.remove(&oldest.ok_or(Denied::Full)?);
        }
        self.last += 1;
        let id = ClientId(self.last);
        let client = Client { id, name: name.to_owned(), lasts, policy, seen: now };
        self.clients.insert(key.to_owned(), client);
        if held {
            self.hold(key, now);
        } else if let Some(lease) = &mut self.held {
            lease.wanted_by = Some(key.to_owned());
        }
        Ok((id, held))
    }

    /// The client with this key; it shows by that that it is there.
    ///
    /// # Errors
    ///
    /// [`Denied::NoKey`], [`Denied::Unknown`].
    pub fn client(&mut self, key: Option<&str>, now: Duration) -> Result<Client<P>, Denied> {
        let client = self.clients.get_mut(key.ok_or(Denied::NoKey)?).ok_or(Denied::Unknown)?;
        client.seen = now;
        Ok(client.clone())
    }

    /// The client with this key commands; its lease is renewed, and taken where nobody has it.
    ///
    /// # Errors
    ///
    /// [`Denied`].
    pub fn command(&mut self, key: Option<&str>, now: Duration) -> Result<Client<P>, Denied> {
        let client = self.client(key, now)?;
        let key = key.unwrap_or_default();
        if let Some(denied) = self.held_by_another(key, now) {
            return Err(denied);
        }
        self.hold(key, now);
        Ok(client)
    }

    /// Lets the lease go, to the client that has asked for it if one has; the client is forgotten.
    pub fn release(&mut self, key: &str, now: Duration) {
        self.clients.remove(key);
        if let Some(held) = self.held.take_if(|held| held.key == key)
            && let Some(next) = held.wanted_by.filter(|next| self.clients.contains_key(next))
        {
            self.hold(&next, now);
        }
    }

    /// Ends the lease that has lapsed, and forgets clients that do not come back. Whose lease it was.
    pub fn lapse(&mut self, now: Duration) -> Option<Client<P>> {
        self.clients.retain(|_, client| now.saturating_sub(client.seen) < client.lasts + FORGOTTEN);
        let held = self.held.take_if(|held| now >= held.until)?;
        self.clients.get(&held.key).cloned()
    }

    /// Who commands.
    pub fn lease(&self) -> Option<Lease> {
        let held = self.held.as_ref()?;
        let name = |key: &String| self.clients.get(key).map(|client| client.name.clone());
        Some(Lease {
            holder: name(&held.key)?,
            since: held.since,
            until: held.until,
            wanted_by: held.wanted_by.as_ref().and_then(name),
        })
    }

    fn held_by_another(&self, key: &str, now: Duration) -> Option<Denied> {
        let held = self.held.as_ref().filter(|held| held.key != key && now < held.until)?;
        let holder = self.clients.get(&held.key)?.name.clone();
        Some(Denied::Held { holder, age_s: now.saturating_sub(held.since).as_secs() })
    }

    fn hold(&mut self, key: &str, now: Duration) {
        let Some(lasts) = self.clients.get(key).map(|client| client.lasts) else { return };
        match &mut self.held {
            Some(held) if held.key == key => held.until = now + lasts,
            held => *held = Some(Held { key: key.into(), since: now, until: now + lasts, wanted_by: None }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn s(s: u64) -> Duration {
        Duration::from_secs(s)
    }

    #[test]
    fn one_commands_at_a_time_and_a_lease_lapses_is_given_and_forgotten() {
        let mut leases = Leases::default();
        let admit = |leases: &mut Leases<u8>, key: &str, ask, at| {
            leases.admit(key, (key, s(10), 0), ask, s(at)).map(|(_, held)| held)
        };
        assert_eq!(leases.command(Some("anna"), s(0)).err(), Some(Denied::Unknown));
        assert_eq!(leases.command(None, s(0)).err(), Some(Denied::NoKey));
        assert_eq!(admit(&mut leases, "anna", false, 0), Ok(true));
        let held = Denied::Held { holder: "anna".into(), age_s: 3 };
        assert_eq!(admit(&mut leases, "bob", false, 3), Err(held.clone()));
        assert_eq!(leases.client(Some("bob"), s(3)).err(), Some(Denied::Unknown), "he did not get in");
        assert_eq!(admit(&mut leases, "bob", true, 3), Ok(false));
        assert_eq!(leases.command(Some("bob"), s(3)).err(), Some(held));
        assert_eq!(leases.lease().and_then(|lease| lease.wanted_by), Some("bob".into()));
        leases.release("anna", s(4));
        assert_eq!(leases.lease().map(|lease| (lease.holder, lease.until)), Some(("bob".into(), s(14))));
        // A command renews it; then it lapses, once.
        assert!(leases.command(Some("bob"), s(13)).is_ok());
        assert_eq!(leases.lapse(s(22)), None);
        assert_eq!(leases.lapse(s(23)).map(|client| client.name), Some("bob".into()));
        assert_eq!(leases.lapse(s(24)), None);
        // Who comes back before long has it again.
        assert!(leases.command(Some("bob"), s(30)).is_ok());
        assert!(leases.lapse(s(40)).is_some() && leases.lapse(s(200)).is_none());
        assert_eq!(leases.command(Some("bob"), s(200)).err(), Some(Denied::Unknown));
    }

    #[test]
    fn a_lease_that_has_lapsed_and_was_not_looked_at_keeps_nobody_out() {
        let mut leases = Leases::default();
        leases.admit("a", ("anna", s(1), ()), false, s(0)).expect("nobody has it");
        assert_eq!(leases.admit("b", ("bob", s(5), ()), false, s(2)).map(|(_, held)| held), Ok(true));
        assert_eq!(
            leases.command(Some("a"), s(2)).err().map(|d| matches!(d, Denied::Held { .. })),
            Some(true)
        );
    }

    #[test]
    fn the_one_that_was_silent_longest_makes_room_and_never_the_one_who_commands() {
        let mut leases = Leases::default();
        for n in 0..3 * CLIENTS_MAX {
            let now = s(n as u64 / 10);
            leases.admit(&n.to_string(), ("x", s(60), ()), true, now).expect("there is room");
            leases.command(Some("0"), now).expect("the first one commands");
            assert!(leases.clients.len() <= CLIENTS_MAX);
        }
        let last = (3 * CLIENTS_MAX - 1).to_string();
        assert!(leases.client(Some(&last), s(10)).is_ok() && leases.client(Some("1"), s(10)).is_err());
    }
}
