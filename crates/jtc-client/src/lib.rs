#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod agents;

use std::io;
use std::net::{TcpStream, ToSocketAddrs as _};
use std::time::{Duration, Instant};

use jtc_host::{Port, PortError};
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use tungstenite::client::IntoClientRequest as _;
use tungstenite::http::HeaderValue;
use tungstenite::http::header::AUTHORIZATION;
use tungstenite::{Message, WebSocket};

/// Longest time for a connection and its first message.
const CONNECTING: Duration = Duration::from_secs(5);
/// Longest that an agent may leave a message untaken.
const STALL: Duration = Duration::from_secs(5);
/// What does not stand for itself in a value in an address: all but the unreserved characters (RFC 3986, 2.3).
const RESERVED: &AsciiSet = &NON_ALPHANUMERIC.remove(b'-').remove(b'.').remove(b'_').remove(b'~');

/// How a client presents itself.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// What people are to call it; empty: its address.
    pub name: String,
    /// Token; `None`: what can be had without one.
    pub token: Option<String>,
}

/// The first message of an agent.
#[derive(Clone, Debug, PartialEq, Eq, serde::Deserialize)]
pub struct Hello {
    /// Name of the port that the agent owns.
    pub port: String,
    /// Rate of its line, Bd, if it has one.
    pub baud: Option<u32>,
    /// No arm moves.
    pub simulated: bool,
}

#[derive(serde::Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum Notice {
    Hello(Hello),
    Denied {
        why: String,
    },
    #[serde(other)]
    Other,
}

/// A line that an agent owns, as a port.
pub struct AgentPort {
    socket: WebSocket<TcpStream>,
    url: String,
    hello: Hello,
    start: Instant,
    /// Bytes that were received and not read yet.
    received: Vec<u8>,
    denied: Option<String>,
}

impl AgentPort {
    /// Connects to an agent at `http://HOST:PORT`.
    ///
    /// # Errors
    ///
    /// [`PortError::NoAgent`] where none answers there, [`PortError::NotLetIn`] where it does not let this client in.
    pub fn open(url: &str, options: &Options) -> Result<Self, PortError> {
        let no_agent = |what: String| PortError::NoAgent { url: url.to_owned(), what };
        let authority = url
            .strip_prefix("http://")
            .map(|rest| rest.trim_end_matches('/'))
            .filter(|rest| !rest.is_empty() && !rest.contains('/'))
            .ok_or_else(|| no_agent("an agent's address is http://HOST:PORT".into()))?;
        let with_port = if has_port(authority) { authority.to_owned() } else { format!("{authority}:80") };
        let stream = connect(&with_port).map_err(|error| no_agent(error.to_string()))?;
        let end = Instant::now() + CONNECTING;
        let prepare = || {
            stream.set_nodelay(true)?;
            stream.set_write_timeout(Some(STALL))?;
            stream.set_read_timeout(Some(CONNECTING))
        };
        prepare().map_err(|error: io::Error| no_agent(error.to_string()))?;
        let mut request =
            format!("ws://{authority}/api/line?name={}", utf8_percent_encode(&options.name, RESERVED))
                .into_client_request()
                .map_err(|error| no_agent(error.to_string()))?;
        if let Some(token) = &options.token {
            let value = HeaderValue::from_str(&format!("Bearer {token}"))
                .map_err(|_| no_agent("the token is no token".into()))?;
            request.headers_mut().insert(AUTHORIZATION, value);
        }
        let (socket, _) = tungstenite::client(request, stream).map_err(|error| match error {
            tungstenite::HandshakeError::Failure(tungstenite::Error::Http(response)) => {
                let body = response.body().as_deref().unwrap_or_default();
                let message = serde_json::from_slice::<serde_json::Value>(body)
                    .ok()
                    .and_then(|body| Some(body.get("message")?.as_str()?.to_owned()));
                match response.status().as_u16() {
                    401 | 403 | 429 => PortError::NotLetIn {
                        url: url.to_owned(),
                        what: message.unwrap_or_else(|| response.status().to_string()),
                    },
                    _ => no_agent(message.unwrap_or_else(|| response.status().to_string())),
                }
            }
            other => no_agent(other.to_string()),
        })?;
        let hello = Hello { port: String::new(), baud: None, simulated: false };
        let mut port = Self {
            socket,
            url: url.to_owned(),
            hello,
            start: Instant::now(),
            received: Vec::new(),
            denied: None,
        };
        while port.hello.port.is_empty() {
            if Instant::now() >= end {
                return Err(no_agent("it does not introduce itself".into()));
            }
            port.receive(CONNECTING)?;
        }
        Ok(port)
    }

    /// What the agent has said of itself.
    pub fn hello(&self) -> &Hello {
        &self.hello
    }

    /// One message, if one comes in this time; false when none does.
    fn receive(&mut self, timeout: Duration) -> Result<bool, PortError> {
        let stream = self.socket.get_mut();
        let set = if timeout.is_zero() {
            stream.set_nonblocking(true)
        } else {
            stream.set_nonblocking(false).and_then(|()| stream.set_read_timeout(Some(timeout)))
        };
        set.map_err(|error| self.gone(&error.into()))?;
        let message = self.socket.read();
        match message {
            Ok(Message::Binary(bytes)) => self.received.extend_from_slice(&bytes),
            Ok(Message::Text(text)) => match serde_json::from_str(&text) {
                Ok(Notice::Hello(hello)) => self.hello = hello,
                Ok(Notice::Denied { why }) => self.denied = Some(why),
                Ok(Notice::Other) | Err(_) => {}
            },
            Ok(Message::Close(frame)) => {
                let reason = frame.map(|frame| frame.reason.to_string()).filter(|reason| !reason.is_empty());
                let what = reason.unwrap_or_else(|| "the agent has closed the connection".into());
                return Err(PortError::AgentGone { url: self.url.clone(), what });
            }
            Ok(_) => {}
            Err(tungstenite::Error::Io(error)) if nothing_yet(&error) => return Ok(false),
            Err(error) => return Err(self.gone(&error)),
        }
        Ok(true)
    }

    fn gone(&self, error: &tungstenite::Error) -> PortError {
        PortError::AgentGone { url: self.url.clone(), what: error.to_string() }
    }
}

fn nothing_yet(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted)
}

fn has_port(authority: &str) -> bool {
    authority.rsplit_once(':').is_some_and(|(_, port)| port.parse::<u16>().is_ok())
}

/// The first of the host's addresses that takes a connection.
fn connect(authority: &str) -> io::Result<TcpStream> {
    let mut last = io::Error::new(io::ErrorKind::NotFound, "this name has no address");
    for address in authority.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, CONNECTING) {
            Ok(stream) => return Ok(stream),
            Err(error) => last = error,
        }
    }
    Err(last)
}

impl Port for AgentPort {
    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, PortError> {
        let end = Instant::now() + timeout;
        while self.received.is_empty() {
            let left = end.saturating_duration_since(Instant::now());
            if !self.receive(left)? && left.is_zero() {
                return Ok(0);
            }
        }
        // What has come meanwhile, too: whoever asks for what is new is not to get what is old.
        while self.received.len() < buffer.len() {
            match self.receive(Duration::ZERO) {
                Ok(true) => {}
                // The end is reported when all that came before it is read.
                Ok(false) | Err(_) => break,
            }
        }
        let n = buffer.len().min(self.received.len());
        buffer[..n].copy_from_slice(&self.received[..n]);
        self.received.drain(..n);
        Ok(n)
    }

    fn write_all(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.socket.get_mut().set_nonblocking(false).map_err(|error| self.gone(&error.into()))?;
        self.socket.send(Message::Binary(bytes.to_vec().into())).map_err(|error| self.gone(&error))
    }

    fn now(&self) -> Duration {
        self.start.elapsed()
    }

    fn baud(&self) -> Option<u32> {
        self.hello.baud
    }

    fn name(&self) -> String {
        self.url.clone()
    }

    fn take_denial(&mut self) -> Option<String> {
        self.denied.take()
    }
}

impl Drop for AgentPort {
    fn drop(&mut self) {
        // It notices the end of the connection, too.
        let _ = self.socket.close(None);
        let _ = self.socket.flush();
    }
}
