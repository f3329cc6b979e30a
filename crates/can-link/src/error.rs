//! Errors that occur while a bus is opened or used.

use std::io;
use std::net::IpAddr;

use crate::CanFrame;
use crate::url::UrlError;

/// Reasons why a bus could not be opened.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The URL is invalid.
    #[error(transparent)]
    Url(#[from] UrlError),
    /// The operating system cannot open buses of this kind.
    #[error("`{url}`: {kind} buses need a Linux kernel; this system supports {}", crate::url::OPENABLE)]
    Unsupported {
        /// URL that cannot be opened.
        url: String,
        /// Scheme of the URL.
        kind: &'static str,
    },
    /// The adapter's protocol does not support the requested bit rate.
    #[error("{url}: {what} {rate} bit/s is not supported, expected one of {possible}")]
    Rate {
        /// URL of the bus.
        url: String,
        /// Kind of bit rate.
        what: &'static str,
        /// Requested bit rate, bit/s.
        rate: u32,
        /// All bit rates that the protocol supports, bit/s.
        possible: String,
    },
    /// The bus cannot be reached.
    #[error(transparent)]
    Attach(#[from] AttachError),
    /// The bus was reached, but its set-up failed.
    #[error(transparent)]
    SetUp(#[from] CanError),
}

/// Reasons why the bus cannot be reached: its network, server, serial port or interface.
#[derive(Debug, thiserror::Error)]
pub enum AttachError {
    /// A multicast group could not be joined.
    #[error(
        "cannot join multicast group {group} port {port}: {step}: {source}; check that this host has a \
         network interface with multicast (`ip -br link`) and that the port can be shared"
    )]
    Join {
        /// Address of the multicast group.
        group: IpAddr,
        /// UDP port of the multicast group.
        port: u16,
        /// Operation that failed.
        step: &'static str,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The connection to a server failed.
    #[error("{url}: cannot connect: {source}; check that the server runs there and uses this port")]
    Connect {
        /// URL of the bus.
        url: String,
        /// Error of the operating system.
        source: io::Error,
    },
    /// A serial port could not be opened.
    #[error(
        "{url}: cannot open the port: {source}; check that the adapter is plugged in, the name, the rights \
         of this user, and that no other program uses the port"
    )]
    Port {
        /// URL of the bus.
        url: String,
        /// Error of the operating system.
        source: io::Error,
    },
    /// A network interface cannot be used.
    #[error(transparent)]
    Interface(#[from] InterfaceError),
}

/// Reasons why a network interface cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{url}: {source}: {hint}")]
pub struct InterfaceError {
    /// URL of the bus.
    pub url: String,
    /// Likely cause, and the command that the user should try next.
    pub hint: String,
    /// Error of the operating system.
    pub source: io::Error,
}

/// Reasons why an operation on an open bus failed.
#[derive(Debug, thiserror::Error)]
pub enum CanError {
    /// Sending or receiving failed.
    #[error("{url}: {step} failed: {source}")]
    Io {
        /// URL of the bus.
        url: String,
        /// Operation that failed.
        step: &'static str,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The connection has ended; the program must open the bus again.
    #[error(
        "{url}: the other side has closed the connection; open the bus again when the other side is available"
    )]
    Closed {
        /// URL of the bus.
        url: String,
    },
    /// The network interface has disappeared.
    #[error(transparent)]
    Interface(#[from] InterfaceError),
    /// A bus of this kind cannot transmit the frame.
    #[error("{url}: cannot carry {frame}: {why}")]
    NotCarried {
        /// URL of the bus.
        url: String,
        /// Frame that cannot be transmitted.
        frame: CanFrame,
        /// Capability that the bus lacks.
        why: &'static str,
    },
    /// The server or adapter did not carry out the request.
    #[error(transparent)]
    Answer(#[from] AnswerError),
}

/// Reasons why a server or an adapter did not carry out a request.
#[derive(Debug, thiserror::Error)]
pub enum AnswerError {
    /// The server or adapter refused the request.
    #[error("{url}: {step} was refused: {answer}")]
    Refused {
        /// URL of the bus.
        url: String,
        /// Operation that was refused.
        step: &'static str,
        /// Answer of the server or adapter.
        answer: String,
    },
    /// The server or adapter uses another protocol, or does not answer.
    #[error("{url}: no answer to {step} within {seconds} s; {hint}")]
    NoAnswer {
        /// URL of the bus.
        url: String,
        /// Operation that was not answered.
        step: &'static str,
        /// Time waited, s.
        seconds: u64,
        /// Likely causes of the missing answer.
        hint: &'static str,
    },
}

/// Reason why a server could not listen.
#[derive(Debug, thiserror::Error)]
#[error(
    "cannot listen at {address}: {source}; another server may use this address. Port 0 selects a free port"
)]
pub struct ListenError {
    /// Requested address.
    pub address: String,
    /// Error of the operating system.
    pub source: io::Error,
}
