#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod agents;
mod tls;

use std::io;
use std::net::{TcpStream, ToSocketAddrs as _};
use std::path::PathBuf;
use std::time::{Duration, Instant};

use jtc_host::port::Halts;
use jtc_host::{Port, PortError};
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use tungstenite::client::IntoClientRequest as _;
use tungstenite::http::HeaderValue;
use tungstenite::http::header::AUTHORIZATION;
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Connector, Message, WebSocket, client_tls_with_config};

/// Maximum time for connecting and receiving the first message.
const CONNECTING: Duration = Duration::from_secs(5);
/// Maximum time for which the agent may leave a message of this client unread.
const STALL: Duration = Duration::from_secs(5);
/// Characters that must be escaped in a value in a URL. Only the unreserved characters (RFC 3986, 2.3) need no escape.
const RESERVED: &AsciiSet = &NON_ALPHANUMERIC.remove(b'-').remove(b'.').remove(b'_').remove(b'~');

/// Identity and options of a client.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// Name of the client that users see. If the name is empty, users see the address of the client.
    pub name: String,
    /// Token of the client. If the value is `None`, the client has only the access that needs no token.
    pub token: Option<String>,
    /// Policy for the motion of the client after it disconnects: `continue` (the default), `pause` or `stop`.
    pub policy: Option<&'static str>,
    /// File with trusted certificates (PEM) for agents at `https://`. If the value is `None`, the client trusts the
    /// certificates of the system.
    pub certificates: Option<PathBuf>,
}

/// First message of the agent.
#[derive(Clone, Debug, PartialEq, Eq, serde::Deserialize)]
pub struct Hello {
    /// Name of the port that the agent owns.
    pub port: String,
    /// Bit rate of the serial line, Bd; `None` if the connection has no bit rate.
    pub baud: Option<u32>,
    /// `true` if the arm is simulated.
    pub simulated: bool,
}

#[derive(serde::Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum Notice {
    Hello(Hello),
    Denied {
        why: String,
    },
    Halted {
        number: u64,
        /// Numbers of Stops and Pauses of other clients. An older agent does not send these numbers.
        of_others: Option<Halts>,
    },
    #[serde(other)]
    Other,
}

/// Connection to an agent that is used like a serial port.
pub struct AgentPort {
    socket: WebSocket<MaybeTlsStream<TcpStream>>,
    url: String,
    hello: Hello,
    start: Instant,
    /// Bytes that were received but not read yet.
    received: Vec<u8>,
    denied: Option<String>,
    /// Number of the last Stop or Pause that the agent has reported to this client, if there was one.
    halted: Option<u64>,
    /// Numbers of Stops and Pauses of other clients.
    halts: Halts,
}

impl AgentPort {
    /// Connects to an agent at `http://HOST:PORT`, or at `https://HOST:PORT` with TLS.
    ///
    /// # Errors
    ///
    /// Returns [`PortError::NoAgent`] if no agent answers at this address. Returns [`PortError::NotLetIn`] if the agent
    /// refuses this client.
    pub fn open(url: &str, options: &Options) -> Result<Self, PortError> {
        let no_agent = |what: String| PortError::NoAgent { url: url.to_owned(), what };
        let (secure, rest) = match (url.strip_prefix("https://"), url.strip_prefix("http://")) {
            (Some(rest), _) => (true, Some(rest)),
            (None, rest) => (false, rest),
        };
        let authority = rest
            .map(|rest| rest.trim_end_matches('/'))
            .filter(|rest| !rest.is_empty() && !rest.contains('/'))
            .ok_or_else(|| {
                no_agent("not the address of an agent, expected http://HOST:PORT or https://HOST:PORT".into())
            })?;
        let (scheme, port) = if secure { ("wss", 443) } else { ("ws", 80) };
        let with_port =
            if has_port(authority) { authority.to_owned() } else { format!("{authority}:{port}") };
        let stream = connect(&with_port).map_err(|error| no_agent(error.to_string()))?;
        let end = Instant::now() + CONNECTING;
        let prepare = || {
            stream.set_nodelay(true)?;
            stream.set_write_timeout(Some(STALL))?;
            stream.set_read_timeout(Some(CONNECTING))
        };
        prepare().map_err(|error: io::Error| no_agent(error.to_string()))?;
        let name = utf8_percent_encode(&options.name, RESERVED);
        let policy = options.policy.map_or(String::new(), |policy| format!("&policy={policy}"));
        let mut request = format!("{scheme}://{authority}/api/line?name={name}{policy}")
            .into_client_request()
            .map_err(|error| no_agent(error.to_string()))?;
        if let Some(token) = &options.token {
            let value = HeaderValue::from_str(&format!("Bearer {token}"))
                .map_err(|_| no_agent("the token has characters that are not valid in a token".into()))?;
            request.headers_mut().insert(AUTHORIZATION, value);
        }
        let connector = match secure {
            true => tls::connector(options.certificates.as_deref())
                .map_err(|error| no_agent(error.to_string()))?,
            false => Connector::Plain,
        };
        let connected = client_tls_with_config(request, stream, None, Some(connector));
        let (socket, _) = connected.map_err(|error| match error {
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
            halted: None,
            halts: Halts::default(),
        };
        while port.hello.port.is_empty() {
            if Instant::now() >= end {
                return Err(no_agent(
                    "the program at this address did not identify itself as an agent".into(),
                ));
            }
            port.receive(CONNECTING)?;
        }
        Ok(port)
    }

    /// Returns the first message of the agent, which describes the agent.
    pub fn hello(&self) -> &Hello {
        &self.hello
    }

    /// Receives a message. Returns `false` if no message arrives within the timeout.
    fn receive(&mut self, timeout: Duration) -> Result<bool, PortError> {
        let set = tls::socket(self.socket.get_mut()).and_then(|stream| {
            if timeout.is_zero() {
                return stream.set_nonblocking(true);
            }
            stream.set_nonblocking(false).and_then(|()| stream.set_read_timeout(Some(timeout)))
        });
        set.map_err(|error| self.gone(&error.into()))?;
        let message = self.socket.read();
        match message {
            Ok(Message::Binary(bytes)) => self.received.extend_from_slice(&bytes),
            Ok(Message::Text(text)) => match serde_json::from_str(&text) {
                Ok(Notice::Hello(hello)) => self.hello = hello,
                Ok(Notice::Denied { why }) => self.denied = Some(why),
                Ok(Notice::Halted { number, of_others }) => {
                    self.halted = Some(number);
                    // If an older agent sends no numbers of Stops and Pauses, the client increments its own count. Earlier requests then
                    // become invalid.
                    let one_more = Halts { all: self.halts.all + 1, stops: self.halts.stops + 1 };
                    self.halts = of_others.unwrap_or(one_more);
                }
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

    fn send(&mut self, message: Message) -> Result<(), PortError> {
        tls::socket(self.socket.get_mut())
            .and_then(|stream| stream.set_nonblocking(false))
            .map_err(|error| self.gone(&error.into()))?;
        self.socket.send(message).map_err(|error| self.gone(&error))
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

/// Connects to the first address of the host that accepts the connection.
fn connect(authority: &str) -> io::Result<TcpStream> {
    let mut last = io::Error::new(io::ErrorKind::NotFound, "this host name has no address");
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
        // The function also reads all other messages that have arrived, because a caller that requests new data must
        // not receive old data.
        while self.received.len() < buffer.len() {
            match self.receive(Duration::ZERO) {
                Ok(true) => {}
                // The end of the connection is reported after the caller has read all earlier messages.
                Ok(false) | Err(_) => break,
            }
        }
        let n = buffer.len().min(self.received.len());
        buffer[..n].copy_from_slice(&self.received[..n]);
        self.received.drain(..n);
        Ok(n)
    }

    fn write_all(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.send(Message::Binary(bytes.to_vec().into()))
    }

    fn ask_to_move(&mut self) -> Result<(), PortError> {
        match self.halted {
            Some(number) => self.send(Message::Text(format!("{{\"asked_after\":{number}}}").into())),
            None => Ok(()),
        }
    }

    fn halts(&self) -> Halts {
        self.halts
    }

    fn ask_to_move_after(&mut self, halts: u64) -> Result<(), PortError> {
        // If a Stop or Pause has occurred since the motion was requested, the client sends no request, and the agent
        // continues to refuse motions.
        if halts == self.halts.all { self.ask_to_move() } else { Ok(()) }
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
        // Errors during closing are ignored, because the agent also detects the end of the connection.
        let _ = self.socket.close(None);
        let _ = self.socket.flush();
    }
}
