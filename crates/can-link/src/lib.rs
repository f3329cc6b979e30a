//! One trait for a CAN bus, [`CanBus`], and its transports, opened by URL.
//!
//! | URL | what | CAN FD |
//! |---|---|---|
//! | `virtual:NAME` | a bus inside this process | yes |
//! | `multicast:ADDR:PORT` | python-can's `udp_multicast`; stays on this host | yes |
//! | `socketcand:HOST:PORT/can0` | a server of the socketcand protocol, such as [`SocketcandServer`] | no |
//! | `slcan:/dev/ttyACM0@1000000` | an adapter at a serial port | CANable 2 |
//! | `socketcan:can0` | an interface of the Linux kernel | yes |
//!
//! ```
//! use std::time::Duration;
//! use can_link::{CanBus, CanFrame, Id, open};
//!
//! let mut tool = open("virtual:readme")?;
//! let mut node = open("virtual:readme")?;
//! tool.send(&CanFrame::fd(Id::standard(0x123)?, &[1, 2, 3])?)?;
//! let heard = node.receive(Duration::ZERO)?.expect("members hear each other");
//! assert_eq!(heard.to_string(), "123 ## 01 02 03");
//! assert_eq!(tool.receive(Duration::ZERO)?, None, "and not themselves");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`TimedBus`] is a classic bus in virtual time for simulators: arbitration, bit timing, error counters, collisions.
//! [`SocketcandGateway`] lets clients of the socketcand protocol join such a bus.
//!
//! A bus that loses, corrupts, delays, doubles or reorders frames is any bus in a [`Faulty`] wrapper.
#![forbid(unsafe_code)]

mod bus;
mod datagram;
mod error;
mod faulty;
mod frame;
#[cfg(any(test, feature = "fuzzing"))]
#[doc(hidden)]
pub mod fuzzing;
mod multicast;
mod slcan;
#[cfg(target_os = "linux")]
mod socket_can;
mod socketcand;
mod state;
mod timed;
mod url;
mod virtual_bus;

pub use bus::{CanBus, open, open_url};
pub use error::CanError;
pub use faulty::{Counts, Faults, Faulty, Plan};
pub use frame::{CanFrame, Id, InvalidFrame};
pub use multicast::MulticastBus;
pub use slcan::{AdapterError, SlcanAdapter, SlcanBus, SlcanOptions};
#[cfg(target_os = "linux")]
pub use socket_can::SocketCanBus;
pub use socketcand::{
    ClientEvent, ClientId, FromClient, SOCKETCAND_PORT, ServerStats, SocketcandBus, SocketcandGateway,
    SocketcandServer,
};
pub use state::{ControllerState, ErrorState};
pub use timed::{
    BusError, BusStats, Happening, MemberId, QueueError, TimedBus, TimedEvent, classic_frame_bits,
};
pub use url::{CanUrl, UrlError};
pub use virtual_bus::{VirtualBus, VirtualHub};
