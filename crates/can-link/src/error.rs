//! What can go wrong on a bus.

use std::io;
use std::net::IpAddr;

use crate::url::UrlError;

/// Why a bus could not be opened or used.
#[derive(Debug, thiserror::Error)]
pub enum CanError {
    /// The URL is none.
    #[error(transparent)]
    Url(#[from] UrlError),
    /// A URL of a kind that this version cannot open.
    #[error("`{url}`: this version cannot open {kind} buses; it opens {}", crate::url::OPENABLE)]
    Unsupported {
        /// The URL.
        url: String,
        /// Its scheme.
        kind: &'static str,
    },
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
        /// What the system said.
        source: io::Error,
    },
    /// Sending or receiving failed.
    #[error("{url}: {step} failed: {source}")]
    Io {
        /// The bus.
        url: String,
        /// What was tried.
        step: &'static str,
        /// What the system said.
        source: io::Error,
    },
}
