//! CAN over a serial line with the ASCII protocol of LAWICEL's adapters (SLCAN) and the CAN FD lines of CANable 2. The
//! module contains the [host's side](SlcanBus) and the [adapter's side](SlcanAdapter) of the protocol.

mod adapter;
mod host;
pub(crate) mod line;
mod options;
mod port;

pub use adapter::{AdapterError, SlcanAdapter};
pub use host::SlcanBus;
pub use options::SlcanOptions;
