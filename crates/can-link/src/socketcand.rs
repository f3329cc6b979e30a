//! CAN over TCP as the socketcand project defines it; python-can's `socketcand` interface and SavvyCAN also support it.
//! Contains a [client](SocketcandBus) and a [server](SocketcandServer).
//!
//! The protocol transmits only classic data frames: it has no format for remote frames, and no CAN FD format that all
//! programs support.

mod client;
mod gateway;
mod server;
mod session;
mod shared;
pub(crate) mod splitter;
pub(crate) mod text;

pub use client::SocketcandBus;
pub use gateway::{ClientEvent, FromClient, SocketcandGateway};
pub use server::{ServerStats, SocketcandServer};
pub use shared::ClientId;

/// The protocol's usual TCP port.
pub const SOCKETCAND_PORT: u16 = 29536;
