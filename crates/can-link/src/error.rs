//! What can go wrong on a bus: while it is opened, and while it is used.

use std::io;
use std::net::IpAddr;

use crate::CanFrame;
use crate::url::UrlError;

/// Why a bus could not be opened.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The URL is none.
    #[error(transparent)]
    Url(#[from] UrlError),
    /// A URL of a kind that this system cannot open.
    #[error("`{url}`: {kind} buses are those of the Linux kernel; this system has {}", crate::url::OPENABLE)]
    Unsupported {
        /// The URL.
        url: String,
        /// Its scheme.
        kind: &'static str,
    },
    /// A rate that the adapter's protocol does not have.
    #[error("{url}: no {what} of {rate} bit/s; possible are {possible}")]
    Rate {
        /// The bus.
        url: String,
        /// Which rate.
        what: &'static str,
        /// What was asked for, bit/s.
        rate: u32,
        /// All that there are, bit/s.
        possible: String,
    },
    /// There is no way to the bus.
    #[error(transparent)]
    Attach(#[from] AttachError),
    /// The way is there, and the bus failed while it was set up.
    #[error(transparent)]
    SetUp(#[from] CanError),
}

/// Why the way to a bus is closed: its network, server, serial port or interface.
#[derive(Debug, thiserror::Error)]
pub enum AttachError {
    /// A multicast group could not be joined.
    #[error(
        "cannot join multicast group {group} port {port}: {step}: {source}; has this host a network \
         interface with multicast (`ip -br link`), and may others share the port?"
    )]
    Join {
        /// The group.
        group: IpAddr,
        /// The UDP port.
        port: u16,
        /// What was tried.
        step: &'static str,
        /// The system's error.
        source: io::Error,
    },
    /// No connection to a server.
    #[error("{url}: cannot connect: {source}; is the server running there, and is that its port?")]
    Connect {
        /// The bus.
        url: String,
        /// The system's error.
        source: io::Error,
    },
    /// A serial port could not be opened.
    #[error(
        "{url}: cannot open the port: {source}; is the adapter plugged in, is the name right, may this user open it, and is no \
             other program using it?"
    )]
    Port {
        /// The bus.
        url: String,
        /// The system's error.
        source: io::Error,
    },
    /// A network interface cannot be used.
    #[error(transparent)]
    Interface(#[from] InterfaceError),
}

/// Why a network interface cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{url}: {source}: {hint}")]
pub struct InterfaceError {
    /// The bus.
    pub url: String,
    /// The likely cause and the next command.
    pub hint: String,
    /// The system's error.
    pub source: io::Error,
}

/// Why an open bus failed.
#[derive(Debug, thiserror::Error)]
pub enum CanError {
    /// Sending or receiving failed.
    #[error("{url}: {step} failed: {source}")]
    Io {
        /// The bus.
        url: String,
        /// What was tried.
        step: &'static str,
        /// The system's error.
        source: io::Error,
    },
    /// The connection has ended; the bus must be opened again.
    #[error("{url}: the other side has ended the connection; open the bus again when it is back")]
    Closed {
        /// The bus.
        url: String,
    },
    /// The network interface has gone.
    #[error(transparent)]
    Interface(#[from] InterfaceError),
    /// A frame that this bus cannot carry.
    #[error("{url}: cannot carry {frame}: {why}")]
    NotCarried {
        /// The bus.
        url: String,
        /// The frame.
        frame: CanFrame,
        /// What is missing.
        why: &'static str,
    },
    /// The server or adapter did not do what was asked.
    #[error(transparent)]
    Answer(#[from] AnswerError),
}

/// Why a server or an adapter did not do what was asked.
#[derive(Debug, thiserror::Error)]
pub enum AnswerError {
    /// It refused.
    #[error("{url}: {step} was refused: {answer}")]
    Refused {
        /// The bus.
        url: String,
        /// What was asked for.
        step: &'static str,
        /// Its answer.
        answer: String,
    },
    /// It speaks something else, or nothing.
    #[error("{url}: no answer to {step} within {seconds} s; {hint}")]
    NoAnswer {
        /// The bus.
        url: String,
        /// What was asked for.
        step: &'static str,
        /// How long was waited.
        seconds: u64,
        /// What to look at.
        hint: &'static str,
    },
}

/// Why a server could not listen.
#[derive(Debug, thiserror::Error)]
#[error("cannot listen at {address}: {source}; is another server running there? Port 0 takes a free one")]
pub struct ListenError {
    /// The address asked for.
    pub address: String,
    /// The system's error.
    pub source: io::Error,
}
