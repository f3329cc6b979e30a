//! CAN over TCP as the socketcand project defines it and python-can's `socketcand` interface and SavvyCAN speak it:
//! a [client](SocketcandBus) and a [server](SocketcandServer).
//!
//! The protocol carries classic data frames only: it has no form for remote frames, and no generally understood form for CAN FD.

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
