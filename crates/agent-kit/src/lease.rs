//! Lease for clients without a permanent connection: each request with the client's key shows that the client still
//! runs.
mod held;

use std::collections::BTreeMap;
use std::time::Duration;

use axum::http::HeaderMap;
use host_kit::ErrorKind;
use utoipa::{IntoParams, ToSchema};

use crate::api::Problem;
pub use held::{Lease, Presence};

/// HTTP header that contains the key of a lease.
pub const KEY: &str = "lease-key";
/// Allowed range of the time until a lease without a request lapses, in seconds.
const LASTS_S: std::ops::RangeInclusive<f64> = 1.0..=60.0;
/// Default time until a lease without a request lapses, in seconds.
const LASTS_DEFAULT_S: f64 = 10.0;
/// Largest number of clients that the agent registers at the same time.
const CLIENTS_MAX: usize = 32;
/// Time after which the agent removes a silent client whose lease has ended.
const FORGOTTEN: Duration = Duration::from_secs(60);

/// Returns the default time until a lease without a request lapses, in seconds.
pub fn default_lasts_s() -> f64 {
    LASTS_DEFAULT_S
}

/// Returns the time until a lease without a request lapses.
///
/// # Errors
///
/// The duration is out of range (1–60 s).
pub fn lasts(lasts_s: f64) -> Result<Duration, Problem> {
    if LASTS_S.contains(&lasts_s) {
        return Ok(Duration::from_secs_f64(lasts_s));
    }
    let (least, most) = LASTS_S.into_inner();
    let message = format!("lasts_s is out of range: {lasts_s}, expected {least} to {most} s");
    Err(Problem::new(
        "lease",
        message,
        "set lasts_s to the time after which the lease lapses without a request",
    )
    .kind(ErrorKind::Usage))
}

/// Key of a lease, for the description of a request.
#[derive(IntoParams)]
#[into_params(parameter_in = Header)]
pub struct LeaseKey {
    /// Key of the lease
    #[param(rename = "Lease-Key")]
    _key: String,
}

/// State of a lease.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct LeaseState {
    /// `true` if this client holds the lease.
    pub held: bool,
    /// Name of the client that waits for the lease.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wanted_by: Option<String>,
}

/// Number of a client; the agent does not use the number again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize)]
pub struct ClientId(pub u64);

/// Client that is registered at an agent, and the rules of its lease. `P` is the type of the policy for the client's
/// work after the lease has lapsed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Client<P> {
    /// Number of the client.
    pub id: ClientId,
    /// Name of the client, which users see.
    pub name: String,
    /// Time until the client's lease lapses without a request.
    pub lasts: Duration,
    /// Policy for the client's work after its lease has lapsed.
    pub policy: P,
    seen: Duration,
}

/// Reason why a client is not permitted to send commands.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Denied {
    /// Another client holds the lease.
    #[error("{holder} has held the lease for {age_s} s: only one client can hold it at a time")]
    Held {
        /// Name of the lease holder.
        holder: String,
        /// Time since the lease holder took the lease, s.
        age_s: u64,
    },
    /// Another client already waits for the lease.
    #[error("{by} already waits for the lease of {holder}: only one client can wait for it")]
    Awaited {
        /// Name of the lease holder.
        holder: String,
        /// Name of the client that already waits for the lease.
        by: String,
    },
    /// The request of the client contains no lease key.
    #[error("this request needs a lease")]
    NoKey,
    /// The lease key of the request is not registered.
    #[error("the lease key is unknown, or its lease lapsed long ago")]
    Unknown,
    /// The maximum number of clients is registered.
    #[error("too many clients have requested a lease")]
    Full,
}

impl From<Denied> for Problem {
    fn from(denied: Denied) -> Self {
        let text = denied.to_string();
        match denied {
            Denied::Held { .. } => Self::new(
                "denied",
                text,
                "find the lease holder with GET /api/status, and request the lease with POST /api/lease and \
                 ask: true",
            ),
            Denied::Awaited { .. } => Self::new(
                "denied",
                text,
                "request the lease again after that client has had it: GET /api/status shows the lease \
                 holder",
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
                "release unused leases with DELETE /api/lease; the agent removes them after a minute",
            ),
        }
    }
}

/// Clients of an agent. At most one client holds the lease. All times are measured by the agent's clock.
pub struct Leases<P> {
    clients: BTreeMap<String, Client<P>>,
    /// Present lease. A client is identified by its key.
    held: Option<Lease<String>>,
    last: u64,
}

impl<P> Default for Leases<P> {
    fn default() -> Self {
        Self { clients: BTreeMap::new(), held: None, last: 0 }
    }
}

/// Returns the lease key of a request.
pub fn key_of(headers: &HeaderMap) -> Option<&str> {
    headers.get(KEY).and_then(|key| key.to_str().ok())
}

impl<P: Clone> Leases<P> {
    /// Registers a client, which takes the lease if it is free. If another client holds the lease and `ask` is
    /// `true`, the new client waits for the lease. Returns the client's number, and `true` if the client holds the
    /// lease. The first waiting client keeps its position until it receives the lease or is removed. If the waiting
    /// client is silent for the duration of its own lease, another client can take its position.
    ///
    /// # Errors
    ///
    /// [`Denied`]: another client holds the lease or waits for it, or the list of clients is full and no client can
    /// be removed. The new client is then not registered.
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
                let lease = self.lease().map(|lease| (lease.holder, lease.wanted_by.unwrap_or_default()));
                let (holder, by) = lease.unwrap_or_default();
                return Err(Denied::Awaited { holder, by });
            }
            other => other.is_none(),
        };
        if self.clients.len() >= CLIENTS_MAX {
            // If the list of clients is full, the agent removes the client that has been silent longest. A program
            // that restarts repeatedly therefore does not block other clients.
            let holder = self.held.as_ref().map(|held| held.holder.clone());
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

    /// Returns the client with this key, and stores the time of this request.
    ///
    /// # Errors
    ///
    /// [`Denied::NoKey`] or [`Denied::Unknown`].
    pub fn client(&mut self, key: Option<&str>, now: Duration) -> Result<Client<P>, Denied> {
        let client = self.clients.get_mut(key.ok_or(Denied::NoKey)?).ok_or(Denied::Unknown)?;
        client.seen = now;
        Ok(client.clone())
    }

    /// Returns the client with this key. Renews the client's lease. If no client holds the lease, this client takes
    /// the lease.
    ///
    /// # Errors
    ///
    /// [`Denied`] if the client cannot take the lease.
    pub fn command(&mut self, key: Option<&str>, now: Duration) -> Result<Client<P>, Denied> {
        let client = self.client(key, now)?;
        let key = key.unwrap_or_default();
        if let Some(denied) = self.held_by_another(key, now) {
            return Err(denied);
        }
        self.hold(key, now);
        Ok(client)
    }

    /// Releases the lease of a client and removes the client. A client that waits for the lease receives it.
    pub fn release(&mut self, key: &str, now: Duration) {
        self.clients.remove(key);
        if let Some(held) = self.held.take_if(|held| held.holder == key) {
            self.pass_on(&held, now);
        }
    }

    /// Ends a lease that has lapsed and returns its former holder. A client that waits for the lease receives it.
    /// Also removes clients that have stopped sending requests.
    pub fn lapse(&mut self, now: Duration) -> Option<Client<P>> {
        // The lease holder is never removed before its lease has lapsed, because the agent must apply the holder's
        // policy.
        let holder = self.held.as_ref().map(|held| held.holder.clone());
        self.clients.retain(|key, client| {
            Some(key) == holder.as_ref() || now.saturating_sub(client.seen) < client.lasts + FORGOTTEN
        });
        let held = self.held.take_if(|held| held.has_lapsed(now))?;
        self.pass_on(&held, now);
        self.clients.get(&held.holder).cloned()
    }

    /// Returns `true` if this client holds the lease.
    pub fn holds(&self, client: ClientId, now: Duration) -> bool {
        let held = self.held.as_ref().filter(|held| !held.has_lapsed(now));
        held.and_then(|held| self.clients.get(&held.holder)).is_some_and(|holder| holder.id == client)
    }

    /// Returns the key of the client that waits for the lease, if this client is registered and not silent.
    fn first(&self, now: Duration) -> Option<&String> {
        self.held.as_ref()?.first(|key| self.presence(key), now)
    }

    fn presence(&self, key: &str) -> Option<Presence> {
        let client = self.clients.get(key)?;
        Some(Presence { lasts: Some(client.lasts), seen: client.seen })
    }

    fn pass_on(&mut self, held: &Lease<String>, now: Duration) {
        self.held = held.next(|next| self.presence(next), now);
        // The new lease holder is treated as if it had just sent a request, so that the agent does not remove it too
        // early.
        let next = self.held.as_ref().and_then(|held| self.clients.get_mut(&held.holder));
        next.into_iter().for_each(|client| client.seen = now);
    }

    /// Returns the lease with the names of the lease holder and of the waiting client.
    pub fn lease(&self) -> Option<Lease<String>> {
        let Lease { holder, since, until, wanted_by } = self.held.as_ref()?;
        let name = |key: &String| self.clients.get(key).map(|client| client.name.clone());
        let wanted_by = wanted_by.as_ref().and_then(name);
        Some(Lease { holder: name(holder)?, since: *since, until: *until, wanted_by })
    }

    fn held_by_another(&self, key: &str, now: Duration) -> Option<Denied> {
        let held = self.held.as_ref().filter(|held| held.holder != key && !held.has_lapsed(now))?;
        let holder = self.clients.get(&held.holder)?.name.clone();
        Some(Denied::Held { holder, age_s: now.saturating_sub(held.since).as_secs() })
    }

    fn hold(&mut self, key: &str, now: Duration) {
        let Some(lasts) = self.clients.get(key).map(|client| Some(client.lasts)) else { return };
        match &mut self.held {
            Some(held) if held.holder == key => held.renew(lasts, now),
            held => *held = Some(Lease::begin(key.into(), lasts, now)),
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
        assert_eq!(
            leases.lease().map(|lease| (lease.holder, lease.until)),
            Some(("bob".into(), Some(s(14))))
        );
        assert!(!leases.holds(ClientId(1), s(5)) && !leases.holds(ClientId(2), s(14)));
        assert!(leases.holds(ClientId(2), s(13)));
        // A command renews the lease. If no further command arrives, `lapse` reports the end of the lease exactly
        // once.
        assert!(leases.command(Some("bob"), s(13)).is_ok());
        assert_eq!(leases.lapse(s(22)), None);
        assert_eq!(leases.lapse(s(23)).map(|client| client.name), Some("bob".into()));
        assert_eq!(leases.lapse(s(24)), None);
        // A client that sends a command before the agent removes it can take the lease again.
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
        assert_eq!(leases.lease().map(|lease| (lease.holder, lease.until)), Some(("bob".into(), Some(s(7)))));
        assert!(leases.admit("c", ("carl", s(5), ()), false, s(3)).is_err());
        assert!(leases.command(Some("b"), s(3)).is_ok() && leases.command(Some("a"), s(3)).is_err());
        // After Bob's lease has lapsed, no client waits for the lease. Emil was removed while he waited, so he does
        // not receive the lease.
        assert!(leases.lapse(s(8)).is_some() && leases.lease().is_none());
        leases.admit("d", ("dora", s(60), ()), false, s(8)).expect("nobody has it");
        leases.admit("e", ("emil", s(1), ()), true, s(8)).expect("he may wait");
        leases.clients.remove("e");
        assert!(leases.lapse(s(68)).is_some() && leases.lease().is_none());
    }

    /// If Bob receives the lease from Anna and then his lease lapses, `lapse` returns Bob exactly once. The result
    /// does not depend on when Anna releases the lease and when `lapse` is called.
    #[test]
    fn who_was_given_the_lease_is_not_forgotten_while_it_has_it() {
        for let_go in 1..=70 {
            for looked in [let_go + 5, let_go + 200] {
                let mut leases = Leases::default();
                leases.admit("a", ("anna", s(60), ()), false, s(0)).expect("nobody has it");
                leases.admit("b", ("bob", s(5), ()), true, s(0)).expect("he may wait");
                leases.command(Some("a"), s(30)).expect("she commands");
                leases.lapse(s(let_go - 1));
                // Bob's lease lasts 5 s, and his only message is at 0 s. He receives Anna's lease only if she
                // releases it within these 5 s.
                let had = let_go < 5;
                leases.release("a", s(let_go));
                assert_eq!(leases.lapse(s(let_go + 4)), None);
                assert_eq!(leases.lease().map(|lease| lease.holder), had.then(|| "bob".into()), "{let_go}");
                let lapsed = leases.lapse(s(looked)).map(|client| client.name);
                assert_eq!(lapsed, had.then(|| "bob".into()), "{let_go}");
                // As long as the former lease holder is registered, it can take the lease again like every other
                // client.
                let known = leases.clients.contains_key("b");
                assert!(looked > let_go + 5 || known || !had, "{let_go}");
                assert_eq!(leases.command(Some("b"), s(looked)).is_ok(), known, "{let_go}");
            }
        }
    }

    /// A command of a waiting client is refused, but shows that the client is still present. The client therefore
    /// receives the lease later.
    #[test]
    fn a_waiting_client_that_sends_requests_receives_the_lease() {
        let mut leases = Leases::default();
        leases.admit("a", ("anna", s(60), ()), false, s(0)).expect("nobody has it");
        leases.admit("b", ("bob", s(5), ()), true, s(0)).expect("he may wait");
        assert!(leases.command(Some("b"), s(28)).is_err());
        leases.release("a", s(30));
        assert_eq!(leases.lease().map(|lease| lease.holder), Some("bob".into()));
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
        // Bob's request shows that Bob still waits, and Anna's request renews her lease.
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
            // Each client requests the lease after the previous client was silent for too long.
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
