#![doc = include_str!("../README.md")]
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
mod open;
mod slcan;
#[cfg(target_os = "linux")]
mod socket_can;
mod socketcand;
mod state;
mod timed;
mod url;
mod virtual_bus;

pub use bus::CanBus;
pub use error::{AnswerError, AttachError, CanError, InterfaceError, ListenError, OpenError};
pub use faulty::{FaultConfig, FaultSchedule, FaultStats, Faulty};
pub use frame::{CanFrame, Id, InvalidFrame};
pub use multicast::MulticastBus;
pub use open::{open, open_url};
pub use slcan::{AdapterError, SlcanAdapter, SlcanBus, SlcanOptions};
#[cfg(target_os = "linux")]
pub use socket_can::SocketCanBus;
pub use socketcand::{
    ClientEvent, ClientId, FromClient, SOCKETCAND_PORT, ServerStats, SocketcandBus, SocketcandGateway,
    SocketcandServer,
};
pub use state::{ControllerState, ErrorState};
pub use timed::{
    BusError, BusEvent, BusStats, MemberId, QueueError, TimedBus, TimedEvent, classic_frame_bits,
};
pub use url::{CanUrl, UrlError};
pub use virtual_bus::{VirtualBus, VirtualHub};
