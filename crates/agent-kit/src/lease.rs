//! Who commands, where clients have no connection of their own: each shows by its requests, with the key that it was given, that it is there.
use std::collections::BTreeMap;
use std::time::Duration;

use axum::http::HeaderMap;
use host_kit::ErrorKind;
use utoipa::{IntoParams, ToSchema};

use crate::api::Problem;

/// The header with the key of a lease.
pub const KEY: &str = "lease-key";
/// How long a lease may last without a request, s.
const LASTS_S: std::ops::RangeInclusive<f64> = 1.0..=60.0;
/// The same where a client does not ask for it.
const LASTS_DEFAULT_S: f64 = 10.0;
/// Clients at once.
const CLIENTS_MAX: usize = 32;
/// A client that has asked for nothing for so long behind the end of its lease is forgotten.
const FORGOTTEN: Duration = Duration::from_secs(60);

/// How long a lease lasts without a request of a client that does not ask for it, s.
pub fn default_lasts_s() -> f64 {
    LASTS_DEFAULT_S
}

/// How long a lease is to last without a request.
///
/// # Errors
///
/// It is to last longer than is possible, or less.
pub fn lasts(lasts_s: f64) -> Result<Duration, Problem> {
    if LASTS_S.contains(&lasts_s) {
        return Ok(Duration::from_secs_f64(lasts_s));
    }
    let (least, most) = LASTS_S.into_inner();
    let message = format!("lasts_s is {lasts_s}: {least} to {most} s are possible");
    Err(Problem::new("lease", message, "choose how long it may last without a request")
        .kind(ErrorKind::Usage))
}

/// The key of a lease, in the description of a request.
#[derive(IntoParams)]
#[into_params(parameter_in = Header)]
pub struct LeaseKey {
    /// Key of the lease
    #[param(rename = "Lease-Key")]
    _key: String,
}

/// How a lease is.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct LeaseState {
    /// This client commands.
    pub held: bool,
    /// Who asks for the lease.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wanted_by: Option<String>,
}

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
    /// Another client has asked for the lease before.
    #[error("{by} has asked for the lease of {holder} before, and waits for it: one waits at a time")]
    Awaited {
        /// Who commands.
        holder: String,
        /// Who waits.
        by: String,
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
            Denied::Awaited { .. } => Self::new(
                "denied",
                text,
                "ask again when that one has had the lease: GET /api/status shows it",
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
    /// A client comes and takes the lease, or waits for it where it is to `ask` the one who has it. True: it commands. The first who waits keeps its
    /// place until it gets the lease, is forgotten, or has not shown for as long as its own lease would last that it is there.
    ///
    /// # Errors
    ///
    /// [`Denied`]: another one commands or waits, or too many have come; this one is not known then.
    pub fn admit(
        &mut self,
        key: &str,
        (name, lasts, policy): (&str, Duration, P),
        ask: bool,
        now: Duration,
    ) -> Result<(ClientId, bool), Denied> {
        let held = match self.held_by_another(key, now) {
            Some(denied) if !ask => return Err(denied),
            Some(_) if self.first(now).is_some() => {
                let lease = self.lease().zip(self.first(now));
                let (holder, by) =
                    lease.map_or_else(Default::default, |(lease, first)| (lease.holder, first.name.clone()));
                return Err(Denied::Awaited { holder, by });
            }
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
        if let Some(held) = self.held.take_if(|held| held.key == key) {
            self.pass_on(held.wanted_by, now);
        }
    }

    /// Ends the lease that has lapsed, which the client that has asked for it gets if one has, and forgets clients that do not come back.
    /// Whose lease it was.
    pub fn lapse(&mut self, now: Duration) -> Option<Client<P>> {
        // Whose lease it is, or was until now, is known for certain: its policy has to be followed.
        let holder = self.held.as_ref().map(|held| held.key.clone());
        self.clients.retain(|key, client| {
            Some(key) == holder.as_ref() || now.saturating_sub(client.seen) < client.lasts + FORGOTTEN
        });
        let held = self.held.take_if(|held| now >= held.until)?;
        self.pass_on(held.wanted_by, now);
        self.clients.get(&held.key).cloned()
    }

    /// Whether this client commands.
    pub fn holds(&self, client: ClientId, now: Duration) -> bool {
        let held = self.held.as_ref().filter(|held| now < held.until);
        held.and_then(|held| self.clients.get(&held.key)).is_some_and(|holder| holder.id == client)
    }

    /// Who waits for the lease, and is there.
    fn first(&self, now: Duration) -> Option<&Client<P>> {
        let first = self.clients.get(self.held.as_ref()?.wanted_by.as_ref()?)?;
        Some(first).filter(|first| now.saturating_sub(first.seen) < first.lasts)
    }

    fn pass_on(&mut self, wanted_by: Option<String>, now: Duration) {
        if let Some(next) = wanted_by.filter(|next| self.clients.contains_key(next)) {
            self.hold(&next, now);
            // It is not forgotten sooner than one who takes the lease now.
            if let Some(client) = self.clients.get_mut(&next) {
                client.seen = now;
            }
        }
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
        assert!(!leases.holds(ClientId(1), s(5)) && !leases.holds(ClientId(2), s(14)));
        assert!(leases.holds(ClientId(2), s(13)));
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
    fn a_lease_that_lapses_goes_to_the_one_who_has_asked_for_it() {
        let mut leases = Leases::default();
        leases.admit("a", ("anna", s(2), ()), false, s(0)).expect("nobody has it");
        assert_eq!(leases.admit("b", ("bob", s(5), ()), true, s(1)).map(|(_, held)| held), Ok(false));
        assert_eq!(leases.lapse(s(2)).map(|client| client.name), Some("anna".into()));
        assert_eq!(leases.lease().map(|lease| (lease.holder, lease.until)), Some(("bob".into(), s(7))));
        assert!(leases.admit("c", ("carl", s(5), ()), false, s(3)).is_err());
        assert!(leases.command(Some("b"), s(3)).is_ok() && leases.command(Some("a"), s(3)).is_err());
        // Nobody waits any more; and one who waited and is forgotten gets nothing.
        assert!(leases.lapse(s(8)).is_some() && leases.lease().is_none());
        leases.admit("d", ("dora", s(60), ()), false, s(8)).expect("nobody has it");
        leases.admit("e", ("emil", s(1), ()), true, s(8)).expect("he may wait");
        leases.clients.remove("e");
        assert!(leases.lapse(s(68)).is_some() && leases.lease().is_none());
    }

    /// However long before its end it was asked for, and however late that end is looked at: whose lease it was is known, once.
    #[test]
    fn who_was_given_the_lease_is_not_forgotten_while_it_has_it() {
        for let_go in 1..=70 {
            for looked in [let_go + 5, let_go + 200] {
                let mut leases = Leases::default();
                leases.admit("a", ("anna", s(60), ()), false, s(0)).expect("nobody has it");
                leases.admit("b", ("bob", s(5), ()), true, s(0)).expect("he may wait");
                leases.command(Some("a"), s(30)).expect("she commands");
                leases.lapse(s(let_go - 1));
                let had = leases.clients.contains_key("b");
                leases.release("a", s(let_go));
                assert_eq!(leases.lapse(s(let_go + 4)), None);
                assert_eq!(leases.lease().map(|lease| lease.holder), had.then(|| "bob".into()), "{let_go}");
                let lapsed = leases.lapse(s(looked)).map(|client| client.name);
                assert_eq!(lapsed, had.then(|| "bob".into()), "{let_go}");
                // He may come back as everyone else.
                assert!(looked > let_go + 5 || leases.command(Some("b"), s(looked)).is_ok() == had);
            }
        }
    }

    #[test]
    fn the_first_who_asks_keeps_its_place_as_long_as_it_waits() {
        let mut leases = Leases::default();
        let ask = |leases: &mut Leases<()>, key: &str, at| {
            leases.admit(key, (key, s(5), ()), true, s(at)).map(|(_, held)| held)
        };
        assert_eq!(ask(&mut leases, "anna", 0), Ok(true));
        assert_eq!(ask(&mut leases, "bob", 1), Ok(false));
        let awaited = Err(Denied::Awaited { holder: "anna".into(), by: "bob".into() });
        assert_eq!(ask(&mut leases, "carl", 2), awaited);
        // He shows that he waits, as anna that she commands.
        assert!(leases.command(Some("bob"), s(4)).is_err() && leases.command(Some("anna"), s(4)).is_ok());
        assert_eq!(ask(&mut leases, "carl", 8), awaited);
        assert!(leases.command(Some("anna"), s(8)).is_ok());
        assert_eq!(ask(&mut leases, "carl", 9), Ok(false), "bob is silent");
        leases.release("carl", s(9));
        assert_eq!(ask(&mut leases, "dora", 9), Ok(false), "carl has given up");
        leases.release("anna", s(10));
        assert_eq!(leases.lease().map(|lease| (lease.holder, lease.wanted_by)), Some(("dora".into(), None)));
        assert_eq!(ask(&mut leases, "emil", 10), Ok(false));
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
            // Each when the one before waits no more.
            let now = s(2 * n as u64);
            let lasts = s(if n == 0 { 60 } else { 1 });
            leases.admit(&n.to_string(), ("x", lasts, ()), true, now).expect("there is room");
            leases.command(Some("0"), now).expect("the first one commands");
            assert!(leases.clients.len() <= CLIENTS_MAX);
        }
        let last = (3 * CLIENTS_MAX - 1).to_string();
        assert!(leases.client(Some(&last), s(10)).is_ok() && leases.client(Some("1"), s(10)).is_err());
    }
}
