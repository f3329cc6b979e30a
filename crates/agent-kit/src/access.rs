//! Access control: tokens, and checks of the origin of a request.
//!
//! A web page of another site that is open in a browser can send requests to the address of this computer. The agent
//! recognises such a request by its `Origin` header. For images, scripts and links of a page, browsers send no `Origin`;
//! the agent recognises these requests by their `Sec-Fetch-Site` header. The page can also point its own host name to the address of this
//! computer (DNS rebinding). The agent recognises this by the `Host` header, which contains the page's host name. The
//! agent refuses a request of a page of another site, even with a valid token, unless the page's origin has read-only
//! access.
mod paths;
mod tokens;

use std::net::{IpAddr, SocketAddr};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use subtle::ConstantTimeEq as _;

use crate::cut::cut;

pub use paths::{halts, looks, stops};
pub use tokens::{Announced, TokenError, Tokens, default_token_file, random, token_file};

/// Permissions of a client.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Read-only access, Stop and Pause.
    Viewer,
    /// All requests; one operator holds the lease at a time.
    Operator,
}

/// Largest number of wrong tokens per minute from one address. `ALL_WRONG_MAX` is the limit for all addresses
/// together. Above a limit, a request with a wrong token is refused as [`Refusal::TooManyWrong`].
const WRONG_MAX: usize = 20;
const ALL_WRONG_MAX: usize = 2000;
const MINUTE: Duration = Duration::from_secs(60);

/// Reason why a request is refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// Request for a host name that does not belong to this agent.
    #[error("host {0} does not belong to this agent: expected its address, or a name set with --name")]
    Host(String),
    /// Request from a web page of another site.
    #[error("pages of {0} have no access to this agent")]
    Origin(String),
    /// Token that does not belong to this agent.
    #[error("the token is not valid for this agent")]
    WrongToken,
    /// Request without a token.
    #[error("token missing: expected the header `Authorization: Bearer …`")]
    NoToken,
    /// Operator's token in a URL. The agent refuses it because URLs are stored in histories and logs.
    #[error("the operator's token is not accepted in an address (URL)")]
    InAddress,
    /// Too many wrong tokens from the address of the client.
    #[error("too many invalid tokens were sent from this address")]
    TooManyWrong,
}

/// Parts of a request that the access check uses.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// Address that the request comes from.
    pub peer: IpAddr,
    /// `Host` header of the request.
    pub host: Option<&'a str>,
    /// `Origin` header, which browsers send.
    pub origin: Option<&'a str>,
    /// `Sec-Fetch-Site` header: relation of the page that sends the request to this agent. Browsers send this header
    /// with every request; other programs do not send it.
    pub site: Option<&'a str>,
    /// Token of the request, if it has one.
    pub token: Option<&'a str>,
    /// Token in the URL, for clients that cannot send a token in a header. The agent accepts only the viewer's token
    /// in a URL.
    pub address_token: Option<&'a str>,
    /// `true` if the request is read-only. Pages of allowed origins may read the answer to a read-only request.
    pub looks: bool,
    /// `true` for a Stop or a Pause ([`halts`]), which needs no token from a client on this computer.
    pub halts: bool,
}

/// Permissions of an accepted request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Role that belongs to the token.
    pub role: Role,
    /// `true` if a page of an allowed origin sent the request; such a page has read-only access.
    pub looks_only: bool,
}

/// Checks an origin in the form that browsers send: scheme, host and port, or `file://`.
///
/// # Errors
///
/// The text is not a valid origin, or it is a wildcard for several origins. The error is a message for the user.
pub fn origin(text: &str) -> Result<String, String> {
    let text = text.trim().to_lowercase();
    if text == "file://" {
        return Ok(text);
    }
    let host = text.split_once("://").map(|(scheme, host)| (scheme, host.strip_suffix('/').unwrap_or(host)));
    match host {
        Some((scheme, host)) if !scheme.is_empty() && !host.is_empty() && !host.contains(['/', '*', ' ']) => {
            Ok(format!("{scheme}://{host}"))
        }
        _ => Err("not a valid origin: expected SCHEME://HOST or file://".to_owned()),
    }
}

/// Access rules of an agent.
pub struct Access {
    tokens: Tokens,
    /// Names and addresses of this agent, each with the port.
    hosts: Vec<String>,
    /// Origins whose pages have read-only access.
    origins: Vec<String>,
    /// Client address and time of each request with a wrong token.
    wrong: Mutex<Vec<(IpAddr, Instant)>>,
}

impl Access {
    /// Returns the access rules of an agent that listens at `listen`. `names` are further host names of the agent.
    pub fn new(tokens: Tokens, listen: SocketAddr, names: &[String]) -> Self {
        let port = listen.port();
        let mut hosts: Vec<String> = names
            .iter()
            .flat_map(|name| [name.to_lowercase(), format!("{}:{port}", name.to_lowercase())])
            .collect();
        hosts.push(listen.to_string());
        if listen.ip().is_loopback() || listen.ip().is_unspecified() {
            hosts.extend(["localhost", "127.0.0.1", "[::1]"].map(|name| format!("{name}:{port}")));
        }
        Self { tokens, hosts, origins: Vec::new(), wrong: Mutex::new(Vec::new()) }
    }

    /// Allows read-only access for web pages of `origins`, in the form that [`origin`] returns.
    pub fn allowing(self, origins: &[String]) -> Self {
        Self { origins: origins.to_vec(), ..self }
    }

    /// Returns the permissions of this request.
    ///
    /// # Errors
    ///
    /// A [`Refusal`] if the request is not allowed.
    pub fn enter(&self, request: &Request<'_>) -> Result<Entry, Refusal> {
        let looks_only = self.is_foreign(request)?;
        let role = match self.role(request) {
            // A Stop from this computer needs no token. It is therefore accepted even if a program sends an outdated
            // token.
            Err(_) if request.halts && request.peer.to_canonical().is_loopback() => Role::Viewer,
            role => role?,
        };
        Ok(Entry { role: if looks_only { Role::Viewer } else { role }, looks_only })
    }

    /// Returns the role of the token, without checking the origin of the request.
    fn role(&self, request: &Request<'_>) -> Result<Role, Refusal> {
        match (request.token, request.address_token) {
            (Some(token), _) => self.bearer(token, request.peer),
            (None, Some(token)) => match self.bearer(token, request.peer)? {
                Role::Operator => Err(Refusal::InAddress),
                Role::Viewer => Ok(Role::Viewer),
            },
            (None, None) if request.peer.to_canonical().is_loopback() => Ok(Role::Viewer),
            (None, None) => Err(Refusal::NoToken),
        }
    }

    /// Returns `true` if a page of an allowed origin sent the request. Checks the headers only, not the token.
    ///
    /// # Errors
    ///
    /// [`Refusal::Host`] or [`Refusal::Origin`].
    pub fn is_foreign(&self, request: &Request<'_>) -> Result<bool, Refusal> {
        let origin = request.origin.map(str::to_lowercase);
        match self.is_own(request.host, request.origin) {
            Err(Refusal::Origin(_))
                if request.looks && origin.as_ref().is_some_and(|origin| self.origins.contains(origin)) =>
            {
                Ok(true)
            }
            // Another port of this computer is the same site, but it belongs to another program.
            Ok(()) if origin.is_none() && matches!(request.site, Some("cross-site" | "same-site")) => {
                Err(Refusal::Origin("another site".to_owned()))
            }
            own => own.map(|()| false),
        }
    }

    /// Checks that the request is addressed to this agent, and that no page of another site sent the request.
    ///
    /// # Errors
    ///
    /// [`Refusal::Host`] or [`Refusal::Origin`].
    pub fn is_own(&self, host: Option<&str>, origin: Option<&str>) -> Result<(), Refusal> {
        let host = host.unwrap_or_default().to_lowercase();
        if !self.hosts.contains(&host) {
            return Err(Refusal::Host(if host.is_empty() {
                "named".into()
            } else {
                cut(&host).into_owned()
            }));
        }
        let Some(origin) = origin else { return Ok(()) };
        let site = origin.to_lowercase();
        // The origin must name the same host and port as the `Host` header. A page of another agent on this computer
        // has another port.
        match site.strip_prefix("http://").or_else(|| site.strip_prefix("https://")) {
            Some(own) if own == host => Ok(()),
            _ => Err(Refusal::Origin(cut(origin).into_owned())),
        }
    }

    fn bearer(&self, token: &str, peer: IpAddr) -> Result<Role, Refusal> {
        let is = |other: &str| bool::from(token.as_bytes().ct_eq(other.as_bytes()));
        // Each token is compared with both valid tokens before wrong tokens are counted. Wrong tokens from other
        // clients therefore never prevent a Stop from a client with a valid token.
        match (is(&self.tokens.operator), is(&self.tokens.viewer)) {
            (true, _) => return Ok(Role::Operator),
            (_, true) => return Ok(Role::Viewer),
            _ => {}
        }
        let mut wrong = self.wrong.lock().unwrap_or_else(PoisonError::into_inner);
        wrong.retain(|(_, at)| at.elapsed() < MINUTE);
        if wrong.iter().filter(|(from, _)| *from == peer).count() >= WRONG_MAX || wrong.len() >= ALL_WRONG_MAX
        {
            return Err(Refusal::TooManyWrong);
        }
        wrong.push((peer, Instant::now()));
        Err(Refusal::WrongToken)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HERE: &str = "127.0.0.1:8780";

    fn access() -> Access {
        let tokens = Tokens { operator: "o".repeat(43), viewer: "v".repeat(43) };
        Access::new(tokens, HERE.parse().expect("an address"), &["arm.example".into()])
    }

    fn role(
        access: &Access,
        peer: &str,
        host: Option<&str>,
        origin: Option<&str>,
        token: Option<&str>,
    ) -> Result<Role, Refusal> {
        let peer = peer.parse().expect("an address");
        let request = Request {
            peer,
            host,
            origin,
            site: None,
            token,
            address_token: None,
            looks: false,
            halts: false,
        };
        access.enter(&request).map(|entry| entry.role)
    }

    #[test]
    fn pages_of_allowed_origins_look_and_do_nothing_else_with_any_token() {
        let origins = ["https://APP.example/", "file://"].map(|text| origin(text).expect("an origin"));
        let (access, peer) = (access().allowing(&origins), "127.0.0.1".parse().expect("an address"));
        let (operator, viewer) = ("o".repeat(43), "v".repeat(43));
        for from in ["https://app.example", "file://"] {
            for token in [None, Some(viewer.as_str()), Some(operator.as_str())] {
                let request = Request {
                    peer,
                    host: Some(HERE),
                    origin: Some(from),
                    site: None,
                    token,
                    address_token: None,
                    looks: true,
                    halts: false,
                };
                assert_eq!(access.enter(&request), Ok(Entry { role: Role::Viewer, looks_only: true }));
                let acts = Request { looks: false, ..request };
                assert_eq!(access.enter(&acts), Err(Refusal::Origin(from.into())));
                let rebound = Request { host: Some("evil.example"), ..request };
                assert!(matches!(access.enter(&rebound), Err(Refusal::Host(_))));
            }
        }
        for from in ["http://app.example", "https://app.example.evil.example", "null", "file:///", "*"] {
            let request = Request {
                peer,
                host: Some(HERE),
                origin: Some(from),
                site: None,
                token: None,
                address_token: None,
                looks: true,
                halts: false,
            };
            assert_eq!(access.enter(&request), Err(Refusal::Origin(from.into())), "{from}");
        }
        for text in ["*", "null", "", "https://", "https://*.example", "app.example", "https://a.example/b"] {
            assert!(origin(text).is_err(), "{text}");
        }
        for (method, path) in
            [("POST", "/"), ("GET", "/api/line"), ("GET", "/api/info"), ("POST", "/api/stop")]
        {
            assert!(!looks(method, path), "{method} {path}");
        }
    }

    #[test]
    fn an_address_may_have_the_viewers_token_and_never_the_operators() {
        let access = access();
        let from = |peer: &str, token: Option<&str>, address_token: Option<&str>| {
            let peer = peer.parse().expect("an address");
            access.enter(&Request {
                peer,
                host: Some(HERE),
                origin: None,
                site: None,
                token,
                address_token,
                looks: true,
                halts: false,
            })
        };
        let (operator, viewer) = ("o".repeat(43), "v".repeat(43));
        let role = |role| Ok(Entry { role, looks_only: false });
        for peer in ["127.0.0.1", "10.0.0.9"] {
            assert_eq!(from(peer, None, Some(&viewer)), role(Role::Viewer));
            assert_eq!(from(peer, None, Some(&operator)), Err(Refusal::InAddress));
            assert_eq!(from(peer, None, Some("")), Err(Refusal::WrongToken));
            assert_eq!(from(peer, Some(&operator), Some("x")), role(Role::Operator));
        }
    }

    #[test]
    fn pages_of_other_sites_and_names_that_are_not_ours_are_refused_with_any_token() {
        let (access, operator) = (access(), "o".repeat(43));
        for host in [HERE, "localhost:8780", "[::1]:8780", "ARM.example", "arm.example:8780"] {
            assert_eq!(role(&access, "127.0.0.1", Some(host), None, Some(&operator)), Ok(Role::Operator));
            let own = format!("http://{host}");
            assert_eq!(role(&access, "127.0.0.1", Some(host), Some(&own), None), Ok(Role::Viewer));
        }
        for host in [
            None,
            Some(""),
            Some("evil.example"),
            Some("evil.example:8780"),
            Some("127.0.0.1"),
            Some("127.0.0.1:80"),
        ] {
            let refused = role(&access, "127.0.0.1", host, None, Some(&operator));
            assert!(matches!(refused, Err(Refusal::Host(_))), "{host:?}");
        }
        for origin in [
            "http://evil.example",
            "null",
            "http://localhost:8781",
            "file://",
            "https://127.0.0.1:8780.evil.example",
        ] {
            let refused = role(&access, "127.0.0.1", Some(HERE), Some(origin), Some(&operator));
            assert!(matches!(refused, Err(Refusal::Origin(_))), "{origin}");
        }
    }

    #[test]
    fn requests_that_a_browser_marks_as_from_another_site_are_refused() {
        let access = access().allowing(&["https://app.example".to_owned()]);
        let operator = "o".repeat(43);
        let enter = |origin, site, looks, halts| {
            let peer = "127.0.0.1".parse().expect("an address");
            let (host, token) = (Some(HERE), Some(operator.as_str()));
            access.enter(&Request { peer, host, origin, site, token, address_token: None, looks, halts })
        };
        let own = "http://127.0.0.1:8780";
        for (looks, halts) in [(true, false), (false, false), (false, true)] {
            // An image, a script or a link of a page of another site, or of another port of this computer.
            for site in ["cross-site", "same-site"] {
                let refused = enter(None, Some(site), looks, halts);
                assert_eq!(refused, Err(Refusal::Origin("another site".into())), "{site}");
            }
            // A page of this agent, an address that the user has typed, and a program.
            for (origin, site) in [
                (Some(own), Some("same-origin")),
                (None, Some("same-origin")),
                (None, Some("none")),
                (None, None),
            ] {
                let entry = enter(origin, site, looks, halts).expect("it is let in");
                assert_eq!(entry, Entry { role: Role::Operator, looks_only: false }, "{site:?}");
            }
        }
        let allowed = enter(Some("https://app.example"), Some("cross-site"), true, false);
        assert_eq!(allowed, Ok(Entry { role: Role::Viewer, looks_only: true }));
    }

    #[test]
    fn from_elsewhere_nobody_gets_in_without_a_token_and_wrong_ones_are_counted() {
        let access = access();
        let from = |token: Option<&str>| role(&access, "10.0.0.9", Some(HERE), None, token);
        assert_eq!(from(None), Err(Refusal::NoToken));
        assert_eq!(from(Some(&"v".repeat(43))), Ok(Role::Viewer));
        for _ in 0..WRONG_MAX {
            assert_eq!(from(Some(&"o".repeat(42))), Err(Refusal::WrongToken));
        }
        assert_eq!(from(Some(&"o".repeat(42))), Err(Refusal::TooManyWrong));
        // After too many wrong tokens, the agent still accepts clients that send a valid token or need no token.
        assert_eq!(from(Some(&"o".repeat(43))), Ok(Role::Operator));
        assert_eq!(role(&access, "127.0.0.1", Some(HERE), None, None), Ok(Role::Viewer));
    }

    #[test]
    fn a_wrong_token_keeps_no_stop_of_this_computer_away_and_nothing_else_is_let_in_by_it() {
        let access = access();
        let enter = |peer: &str, origin, (token, address_token), halts| {
            let peer = peer.parse().expect("an address");
            let request = Request {
                peer,
                host: Some(HERE),
                origin,
                site: None,
                token,
                address_token,
                looks: false,
                halts,
            };
            access.enter(&request).map(|entry| entry.role)
        };
        let operator = "o".repeat(43);
        let wrong = [
            (Some(""), None),
            (Some("0123456789abcdefghij"), None),
            (None, Some("0123456789abcdefghij")),
            (None, Some(operator.as_str())),
        ];
        // Too many wrong tokens do not change the results: a Stop from this computer is accepted without a valid
        // token, and all other requests are refused.
        for token in wrong.iter().cycle().take(4 * WRONG_MAX).copied() {
            for here in ["127.0.0.1", "127.8.9.10", "::1", "::ffff:127.0.0.1"] {
                assert_eq!(enter(here, None, token, true), Ok(Role::Viewer), "{here} {token:?}");
                assert!(enter(here, None, token, false).is_err(), "{here} {token:?}");
                let evil = Some("http://evil.example");
                assert!(matches!(enter(here, evil, token, true), Err(Refusal::Origin(_))), "{here}");
            }
            assert!(enter("10.0.0.9", None, token, true).is_err(), "{token:?}");
        }
        assert_eq!(enter("127.0.0.1", None, (Some(&operator), None), true), Ok(Role::Operator));
    }

    #[test]
    fn foreign_names_in_refusals_are_cut() {
        let access = access();
        for length in [1, 199, 200, 201, 65_000] {
            let evil = "e".repeat(length);
            let host = role(&access, "127.0.0.1", Some(&evil), None, None).expect_err("it is another name");
            let origin = role(&access, "127.0.0.1", Some(HERE), Some(&evil), None).expect_err("another site");
            for refusal in [host, origin] {
                let text = refusal.to_string();
                assert!(text.len() < 320 && text.contains(&evil[..length.min(200)]), "{text}");
            }
        }
        // The complete text of an origin is compared with each allowed origin, not only the beginning of the text.
        let long = format!("https://{}.example", "a".repeat(300));
        let access = access.allowing(std::slice::from_ref(&long));
        let peer = "127.0.0.1".parse().expect("an address");
        let enter = |origin: &str| {
            access.enter(&Request {
                peer,
                host: Some(HERE),
                origin: Some(origin),
                site: None,
                token: None,
                address_token: None,
                looks: true,
                halts: false,
            })
        };
        assert_eq!(enter(&long), Ok(Entry { role: Role::Viewer, looks_only: true }));
        assert!(enter(&format!("{long}x")).is_err());
    }
}
